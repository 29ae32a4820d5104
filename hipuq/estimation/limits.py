"""Estimates of shares and means with their limits, from moments by stratum and replicate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hipuq.estimation.reduction import Moments
from hipuq.estimation.results import Kind
from hipuq.intervals import graded, replicated, student, wilson

Array = NDArray[np.float64]

ROUNDING = 1e-12
"""Relative scatter of replicates up to which they agree."""


def columns(cells: Moments, bounds: list[Moments], kind: Kind, confidence: float) -> dict[str, Array]:
    """Return estimates and limits by stratum.

    Parameters
    ----------
    cells : Moments
        Of groups laid out as (strata, replicates), values (strata, replicates, ...).
    bounds : list of Moments
        Of the lower and the upper bound of every sample; empty where there are none, and a value that is
        missing may be 0 or 1.
    kind : Kind
    confidence : float
        1 where nothing is left to chance: the limits are what is unknown alone.

    Returns
    -------
    dict of str to array
        ``estimate``, ``low``, ``high``, ``floor`` and ``ceiling`` (the estimates with every unknown at its
        lower and its upper bound), ``known``, ``draws`` and ``variance``, each (strata, ...).
    """
    pooled = cells.pooled()
    floor, ceiling = bounds or (cells, cells)
    if kind.bounded and not bounds:
        floor, ceiling = cells.with_unknown(0.0), cells.with_unknown(1.0)
    if confidence == 1:
        low, high = floor.pooled().mean, ceiling.pooled().mean
    else:
        low, high = _limit(floor, kind, confidence)[0], _limit(ceiling, kind, confidence)[1]
    if kind.bounded:
        low, high = np.clip(low, 0.0, 1.0), np.clip(high, 0.0, 1.0)
    return {
        "estimate": pooled.mean,
        "low": low,
        "high": high,
        "floor": floor.pooled().mean,
        "ceiling": ceiling.pooled().mean,
        "known": pooled.known,
        "draws": floor.pooled().known,
        "variance": pooled.variance,
    }


def _limit(cells: Moments, kind: Kind, confidence: float) -> tuple[Array, Array]:
    """Return the limits between replicates, or those of the pooled draws where replicates agree."""
    pooled = cells.pooled()
    shares = kind.quantity == "probability" and not kind.graded
    over_draws = graded if kind.graded else student
    if shares:
        single = wilson(pooled.total, pooled.known, confidence)
    else:
        single = over_draws(pooled.mean, pooled.squares, pooled.known, confidence)
    replicates = cells.known.shape[1]
    if replicates == 1:
        return single
    mean = cells.mean.mean(axis=1)
    # The mean of equal numbers may differ from them by rounding, which is no scatter.
    agree = np.ptp(cells.mean, axis=1) <= ROUNDING * np.abs(cells.mean).max(axis=1)
    squares = np.where(agree, 0.0, np.square(cells.mean - mean[:, None]).sum(axis=1))
    if shares:
        between = replicated(mean, squares, replicates, pooled.known, confidence)
    else:
        between = student(mean, squares, np.full_like(mean, replicates), confidence)
    low, high = (np.where(agree, a, b) for a, b in zip(single, between, strict=True))
    return low, high
