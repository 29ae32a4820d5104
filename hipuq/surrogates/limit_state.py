"""The event behind an outcome, and its probability from a surrogate mended by true evaluations.

A surrogate alone gives a probability of unknown error. Here it only says how the inputs are divided into
strata; what is counted in each are true verdicts, so the interval holds whatever the surrogate is worth,
and is narrow where it is good (stratified sampling with strata of equal predictions; Cochran, Sampling
Techniques, 1977, chapter 5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.special import ndtri

from hipuq import schema
from hipuq.errors import InputError
from hipuq.estimation.results import kind_of
from hipuq.intervals import combined, student, wilson
from hipuq.surrogates.options import check_limit

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ROUNDING = 1e-9
"""Weights that add up to 1 but for this leave nothing out."""

LIMIT = "limit_state"
"""Attribute of an outcome: the event is that it lies below this value."""


@dataclass(frozen=True)
class LimitState:
    """When an outcome means the event.

    Attributes
    ----------
    limit : float
        The value between event and none.
    below : bool
        Whether the event lies below it.
    """

    limit: float
    below: bool = True

    def distance(self, y: Array) -> Array:
        """Return how far a value is from the limit, negative in the event."""
        return y - self.limit if self.below else self.limit - y

    def event(self, y: Array) -> Array:
        """Return 1 in the event, 0 outside, NaN where the value is unknown."""
        return np.where(np.isnan(y), np.nan, (self.distance(y) < 0).astype(np.float64))


def limit_state_of(values: xr.DataArray, limit: float | None) -> LimitState | None:
    """Return the limit state of an outcome, None if it has none.

    Parameters
    ----------
    values : DataArray
        The outcome; its attribute ``limit_state`` names the limit.
    limit : float or None
        In place of the outcome's own: the event is that the outcome lies below it.

    Raises
    ------
    InputError
        If the limit is not a finite number, or the outcome is a verdict.
    """
    kind = kind_of(values)
    if limit is None:
        if kind.bounded:
            return None if kind.graded else LimitState(0.5, below=False)
        own = values.attrs.get(LIMIT)
        return None if own is None else LimitState(float(own))
    if values.attrs.get("role") == schema.VERDICT or values.dtype.kind == "b":
        raise InputError(
            f"limit is {limit!r}, but {values.name} is a verdict: its event is 1, leave limit out"
        )
    check_limit(limit)
    return LimitState(float(limit))


@dataclass(frozen=True)
class Strata:
    """True evaluations by stratum.

    Attributes
    ----------
    number : (s,) array of int
        Stratum of each evaluation, from 0.
    weight : (strata,) array
        Probability that each stratum holds.
    draws : float
        Points from which the weights were found: what they are uncertain by; infinite if they are exact.
    """

    number: NDArray[np.intp]
    weight: Array
    draws: float = np.inf

    def share(self, event: Array, confidence: float) -> tuple[Array, Array, Array]:
        """Return the probability of an event (s, outputs), 1, 0 or NaN, with its limits."""
        estimate, _, _ = self._moments(event)
        ends = []
        for end, value in enumerate((0.0, 1.0)):
            filled, _, draws = self._moments(np.where(np.isnan(event), value, event))
            # A stratum without draws has the bound itself.
            limit = wilson(np.nan_to_num(filled) * draws, draws, confidence)[end]
            ends.append((limit, np.where(draws > 0, filled, value)))
        (low, floor), (high, ceiling) = ends
        # The largest variance that the unknown leaves.
        whole = (self.weight[:, None] * np.clip(0.5, floor, ceiling)).sum(axis=0)
        spread = ndtri(0.5 + confidence / 2) * np.sqrt(whole * (1 - whole) / self.draws)
        columns = {"estimate": estimate, "low": low, "high": high, "floor": floor, "ceiling": ceiling}
        middle, below, above = self._combined(columns | {"draws": draws}, spread, confidence)
        return middle, np.clip(below, 0.0, 1.0), np.clip(above, 0.0, 1.0)

    def mean(self, values: list[Array], confidence: float) -> tuple[Array, Array, Array]:
        """Return a mean with its t limits from the values, and the lower and upper bounds of each."""
        known, low, high = values
        columns = {"estimate": self._moments(known)[0]}
        for end, (limit, start, part) in enumerate((("low", "floor", low), ("high", "ceiling", high))):
            moments = self._moments(part)
            columns |= {limit: student(*moments, confidence)[end], start: moments[0]}
        return self._combined(columns)

    def _moments(self, values: Array) -> tuple[Array, Array, Array]:
        """Return mean, sum of squared deviations and number of the known values by stratum."""
        strata = len(self.weight)
        mean, squares, known = np.zeros((3, strata, values.shape[1]))
        for k in range(strata):
            part = values[self.number == k]
            known[k] = (~np.isnan(part)).sum(axis=0)
            some = known[k] > 0
            mean[k] = np.divide(np.nansum(part, axis=0), known[k], out=np.full(len(some), np.nan), where=some)
            squares[k] = np.nansum(np.square(part - mean[k]), axis=0)
        return mean, squares, known

    def _combined(
        self, columns: dict[str, Array], spread: Array | float = 0.0, confidence: float | None = None
    ) -> tuple[Array, Array, Array]:
        table = xr.Dataset({name: (("stratum", "output"), part) for name, part in columns.items()})
        extra = xr.DataArray(np.broadcast_to(spread, columns["estimate"].shape[1:]), dims="output")
        found = combined(
            table.assign(weight=("stratum", self.weight)), "weight", "stratum", extra, confidence
        )
        middle, low, high = (part.values for part in found)
        return middle, low, high


def sample_strata(outcomes: xr.Dataset, rows: Mask, draws: float = np.inf) -> Strata:
    """Return the strata that samples carry in their coordinates ``stratum`` and ``stratum_weight``.

    What they leave of the whole is one more stratum, in which nothing is known.
    """
    names, place = np.unique(outcomes["stratum"].values[rows], return_inverse=True)
    weight = outcomes["stratum_weight"].values[rows]
    first = [float(weight[place == i][0]) for i in range(len(names))]
    rest = 1.0 - sum(first)
    if rest > ROUNDING:
        first.append(rest)
    return Strata(place.astype(np.intp), np.array(first) / sum(first), draws)
