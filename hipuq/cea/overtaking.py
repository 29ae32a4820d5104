"""Where unstable modes overtake stable ones: their numbers by frequency change, not how many they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hipuq.cea.pencils import Array

PATIENCE = 3
"""Looks in a row that may move the same end before the interval is halved."""

Look = Callable[[list[int], Array], tuple[Array, Array]]
"""Cells and frictions, (k,) -> which modes are unstable there, NaN if unknown, and frequencies, (k, n)."""


@dataclass
class Change:
    """Two frictions in a cell between which the unstable modes change their numbers.

    Attributes
    ----------
    cell : int
    ends : list of float
        The two frictions [1].
    shown : list of (n,) array
        Which modes are unstable at them.
    known : bool
        False where it cannot be told what lies between.
    lead : list of float
        At both ends the lead in frequency of a mode over one that it overtakes; NaN if not known.
    """

    cell: int
    ends: list[float]
    shown: list[Array]
    known: bool = True
    lead: list[float] = field(default_factory=lambda: [np.nan, np.nan])
    _moved: int = -1
    _stayed: int = 0

    def place(self, finest: float) -> float:
        """Return where to look next: where the line through the leads is zero, halfway if there is none."""
        (low, high), (a, b) = self.ends, self.lead
        if not (a * b <= 0 and a != b) or self._stayed >= PATIENCE:
            return (low + high) / 2
        # Not at an end itself, or the other one would never come in.
        reach = min(finest, high - low) / 2
        return min(max(low + (high - low) * a / (a - b), low + reach), high - reach)

    def see(self, x: float, unstable: Array, frequency: Array) -> Change | None:
        """Put in what is seen between the ends; return the rest if there is one more change."""
        same = [np.array_equal(unstable, one) for one in self.shown]
        if not any(same):
            if unstable.sum() != self.shown[0].sum():
                self.known = False
                return None
            rest = Change(self.cell, [x, self.ends[1]], [unstable, self.shown[1]])
            self.ends[1], self.shown[1], self.lead = x, unstable, [np.nan, np.nan]
            return rest
        end = same.index(True)
        self._stayed = self._stayed + 1 if end == self._moved and self._stayed < PATIENCE else 0
        self._moved = end
        # Illinois: an end that stays is weighed down, so that both come in.
        self.lead[1 - end] /= 2.0 if self._stayed else 1.0
        self.ends[end], self.lead[end] = x, _lead(self.shown, end, frequency)
        return None


def _lead(shown: list[Array], end: int, frequency: Array) -> float:
    """Return by how much a mode leads the one that it overtakes; NaN if these are not one and its neighbour.

    Of a pair, which has the same frequency twice, the second is the unstable one.
    """
    changed = np.flatnonzero(shown[0] != shown[1])
    if len(changed) != 2 or changed[1] != changed[0] + 1:
        return np.nan
    j = int(changed[0])
    if shown[end][j] == 1:
        return float(frequency[j] - frequency[j + 1])
    ahead = float(frequency[j + 1] - frequency[j])
    return float(frequency[j + 1] - frequency[j - 1]) if ahead == 0 and j > 0 else ahead


def located(changes: list[Change], look: Look, finest: float) -> list[Change]:
    """Close in on changes until their ends are as near to each other as wanted.

    Parameters
    ----------
    changes : list of Change
        They are changed in place.
    look : callable
    finest : float
        Distance of the ends [1].

    Returns
    -------
    list of Change
        With those that were found in between, by cell and friction.
    """
    changes = list(changes)
    while True:
        open_ = [one for one in changes if one.known and one.ends[1] - one.ends[0] > finest]
        if not open_:
            return sorted(changes, key=lambda one: (one.cell, one.ends[0]))
        places = np.array([one.place(finest) for one in open_])
        unstable, frequency = look([one.cell for one in open_], places)
        seen = zip(open_, places.tolist(), unstable, frequency, strict=True)
        found = [one.see(x, shown, heights) for one, x, shown, heights in seen]
        changes += [rest for rest in found if rest is not None]
