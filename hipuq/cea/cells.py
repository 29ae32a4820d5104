"""A range of friction cut into cells in which the same modes are unstable throughout.

The cells end where the number of unstable modes changes. Within them the verdict of one place is that
of all, and each cell is looked at: where what is found does not fit the boundaries, it is unknown.
Modes are numbered by frequency at each friction, so a cell also ends where an unstable mode overtakes
a stable one.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.boundary import Boundary, inside
from hipuq.cea.damped_onset import damped_boundaries
from hipuq.cea.onset import check_range, search
from hipuq.cea.pencils import Array, Pencils
from hipuq.cea.spectrum import solve
from hipuq.errors import InputError

Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]

BLOCK = 1024
"""Frictions looked at together."""

LOOKS = 9
"""Places at which each cell is looked at."""

LOOKS_BY_MODE = 33
"""The same where modes are told apart: one that overtakes another twice between two of them is not seen."""

FINEST = 1e-10
"""Width to which an overtaking is located, as part of the range."""


@dataclass(frozen=True)
class Cells:
    """The cells of one sample over a range of friction.

    Attributes
    ----------
    edges : (k + 1,) array
        Ends of the cells, ascending, those of the range included [1].
    count : (k,) array
        Number of unstable modes in each cell, NaN where that is not known.
    unstable : (k, n) array
        1 where a mode is unstable in a cell, 0 where not, NaN where that is not known.
    boundaries : tuple of Boundary
        Where the number of unstable modes changes, ascending.
    """

    edges: Array
    count: Array
    unstable: Array
    boundaries: tuple[Boundary, ...]

    @property
    def any_unstable(self) -> Array:
        """1, 0 or NaN for each cell, (k,)."""
        return np.minimum(self.count, 1.0)

    def intervals(self, verdict: Array) -> Array:
        """Return the intervals in which a verdict is 1, neighbouring cells joined, (m, 2).

        Parameters
        ----------
        verdict : (k,) array
            Such as `any_unstable`, or a column of `unstable`.
        """
        inside = np.concatenate([[False], verdict == 1, [False]])
        change = np.flatnonzero(inside[1:] != inside[:-1])
        found: Array = self.edges[change].reshape(-1, 2)
        return found


def stability_cells(
    pencils: Pencils, lower: float, upper: float, *, growth_threshold: float = 0.0, by_mode: bool = True
) -> list[Cells]:
    """Cut a range of friction into cells in which the same modes are unstable.

    Parameters
    ----------
    pencils : Pencils
        s samples; their own friction is not used.
    lower, upper : float
        Range of friction, lower < upper [1].
    growth_threshold : float
        Growth rate above which a mode is unstable [1/s].
    by_mode : bool
        Whether cells end where an unstable mode overtakes a stable one. Without that only the number of
        unstable modes is that of the whole cell.

    Returns
    -------
    list of Cells

    Raises
    ------
    InputError
        If the range is not one, or a threshold is negative.
    """
    check_range(lower, upper)
    found, unresolved = _all_boundaries(pencils, lower, upper, growth_threshold)
    edges = [np.array([lower, *(one.friction for one in own or ()), upper]) for own in found]
    row = np.repeat(np.arange(len(edges)), [len(own) - 1 for own in edges])
    start, end = (np.concatenate([own[part] for own in edges]) for part in (slice(-1), slice(1, None)))
    looks = _looks(LOOKS_BY_MODE if by_mode else LOOKS)
    friction = start[:, None] + (end - start)[:, None] * looks
    unstable = _unstable(pencils, np.repeat(row, len(looks)), friction.ravel(), growth_threshold)
    unstable = unstable.reshape(*friction.shape, -1)
    fits = np.zeros(friction.shape, bool)
    for i, own in enumerate(found):
        if own is not None:
            fits[row == i] = _fitting(unstable[row == i].sum(axis=2), own)
    pieces = [
        _pieces(*cell, by_mode) for cell in zip(row.tolist(), start, friction, unstable, fits, strict=True)
    ]
    _locate(pencils, pieces, growth_threshold, FINEST * (upper - lower))
    cells = []
    for i, own in enumerate(found):
        parts = [part for j in np.flatnonzero(row == i) for part in pieces[j]]
        at = np.array([part.start for part in parts] + [upper])
        count = np.array([part.count for part in parts])
        whole = Cells(at, count, np.stack([part.unstable for part in parts]), tuple(own or ()))
        cells.append(_without(whole, unresolved[i]))
    return cells


def _without(cells: Cells, unresolved: Array) -> Cells:
    """Return cells of which nothing is known in some intervals of friction, (k, 2)."""
    if not len(unresolved):
        return cells
    edges = np.union1d(cells.edges, unresolved.clip(cells.edges[0], cells.edges[-1]))
    middle = (edges[:-1] + edges[1:]) / 2
    here = np.searchsorted(cells.edges, middle) - 1
    lost = ((unresolved[:, :1] < middle) & (middle < unresolved[:, 1:])).any(axis=0)
    count = np.where(lost, np.nan, cells.count[here])
    return Cells(edges, count, np.where(lost[:, None], np.nan, cells.unstable[here]), cells.boundaries)


@dataclass(frozen=True)
class _Piece:
    """A part of a cell from `start` on, with the modes unstable there, looked at up to `last`."""

    row: int
    start: float
    first: float
    last: float
    count: float
    unstable: Array


def _all_boundaries(
    pencils: Pencils, lower: float, upper: float, growth_threshold: float
) -> tuple[list[tuple[Boundary, ...] | None], list[Array]]:
    """Return the boundaries of each sample, None where they cannot be told apart, and what is unresolved."""
    samples = len(pencils.stiffness)
    damped = np.full(samples, growth_threshold > 0)
    if pencils.damping is not None:
        damped |= pencils.damping.any(axis=(1, 2))
    found: list[tuple[Boundary, ...] | None] = [None] * samples
    unresolved = [np.empty((0, 2))] * samples

    def look(rows: Rows) -> None:
        own = pencils.rows(rows)
        if damped[rows].any():
            parts = damped_boundaries(own, lower, upper, growth_threshold)
            parts = [inside(part, lower, upper) for part in parts]
        else:
            both = search(replace(own, damping=None), lower, upper)
            parts = both.boundaries
            for i, left in zip(rows, both.unresolved, strict=True):
                unresolved[i] = left
        for i, part in zip(rows, parts, strict=True):
            found[i] = tuple(part)

    for rows in (np.flatnonzero(~damped), np.flatnonzero(damped)):
        try:
            if rows.size:
                look(rows)
        except InputError:
            # One sample that cannot be searched takes no other with it.
            for i in rows:
                with suppress(InputError):
                    look(np.array([i]))
    return found, unresolved


def _looks(count: int) -> Array:
    """Return places in a cell of length 1, denser towards its ends."""
    places: Array = (1 - np.cos(np.pi * (np.arange(count) + 0.5) / count)) / 2
    return places


def _unstable(pencils: Pencils, row: Rows, friction: Array, growth_threshold: float) -> Array:
    """Return which modes of samples are unstable at frictions, (N, n); NaN where not known."""
    made = np.empty((len(row), pencils.stiffness.shape[1]))
    for start in range(0, len(row), BLOCK):
        part = slice(start, start + BLOCK)
        own = replace(pencils.rows(row[part]), friction=friction[part])
        made[part] = solve(own, growth_threshold=growth_threshold).unstable
    return made


def _fitting(count: Array, found: tuple[Boundary, ...]) -> Mask:
    """Say at which looks (cells, looks) the number of unstable modes is what the boundaries say."""
    change = np.cumsum([0, *(one.direction for one in found)])[:, None]
    at_start = count - change
    known = at_start[~np.isnan(at_start)]
    if not known.size:
        return np.zeros(count.shape, bool)
    values, times = np.unique(known, return_counts=True)
    return np.asarray(at_start == values[times.argmax()])


def _pieces(
    row: int, start: float, friction: Array, unstable: Array, fits: Mask, by_mode: bool
) -> list[_Piece]:
    """Return the parts of a cell in which its looks show the same modes unstable."""
    pieces: list[_Piece] = []
    for x, own in zip(friction[fits], unstable[fits], strict=True):
        if pieces and (not by_mode or np.array_equal(pieces[-1].unstable, own)):
            pieces[-1] = replace(pieces[-1], last=x)
        else:
            pieces.append(_Piece(row, start if not pieces else x, x, x, float(own.sum()), own))
    # A verdict that contradicts the boundaries shows that one was missed: then nothing is known.
    if not pieces or not (fits | np.isnan(unstable).any(axis=1)).all():
        return [_Piece(row, start, start, start, np.nan, np.full(unstable.shape[1], np.nan))]
    return pieces


@dataclass
class _Change:
    """Two frictions in a cell with different modes unstable; where they change is halved down to."""

    cell: int
    low: float
    high: float
    below: Array
    above: Array
    known: bool = True


def _locate(pencils: Pencils, pieces: list[list[_Piece]], growth_threshold: float, finest: float) -> None:
    """Move the starts of pieces to where unstable modes overtake others, in place.

    What lies between two looks that cannot be told becomes a piece of which the number of unstable modes
    is known, but not which.
    """
    changes = [
        _Change(k, a.last, b.first, a.unstable, b.unstable)
        for k, own in enumerate(pieces)
        for a, b in pairwise(own)
    ]
    while True:
        open_ = [one for one in changes if one.known and one.high - one.low > finest]
        if not open_:
            break
        row = np.array([pieces[one.cell][0].row for one in open_])
        middles = np.array([(one.low + one.high) / 2 for one in open_])
        found = _unstable(pencils, row, middles, growth_threshold)
        for one, x, seen in zip(open_, middles.tolist(), found, strict=True):
            if np.array_equal(seen, one.below):
                one.low = x
            elif np.array_equal(seen, one.above):
                one.high = x
            elif seen.sum() == one.below.sum():
                changes.append(_Change(one.cell, x, one.high, seen, one.above))
                one.high, one.above = x, seen
            else:
                one.known = False
    for k in {one.cell for one in changes}:
        first = pieces[k][0]
        pieces[k] = [first]
        for one in sorted((one for one in changes if one.cell == k), key=lambda one: one.low):
            if one.known:
                middle = (one.low + one.high) / 2
                pieces[k].append(replace(first, start=middle, unstable=one.above))
            else:
                pieces[k].append(replace(first, start=one.low, unstable=np.full_like(one.above, np.nan)))
                pieces[k].append(replace(first, start=one.high, unstable=one.above))
