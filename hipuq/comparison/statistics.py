"""Error, coverage and convergence of contenders, over their replicates, with limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq.intervals import replicated, wilson

Array = NDArray[np.float64]

RESAMPLES = 1000
"""Resamples of the replicates for the limits of a root mean square error."""

ROUNDING = 1e-10
"""Relative distance by which a limit may miss an exact reference: what exact methods are good for."""


@dataclass(frozen=True)
class Cells:
    """All that was run, and the answer.

    Attributes
    ----------
    estimate, low, high : (m, b, r, ...) array
        Of m contenders, b budgets and r replicates, over the dims of what is compared; NaN where there is
        none.
    seconds, model_seconds : (m, b, r) array
        Of a run, and of the model in it [s].
    evaluations : (m, b) array of int
        Model runs of one run; 0 where a contender does not take part.
    replicates : (m, b) array of int
        Runs.
    reference : (...) array
    exact : bool
        Whether the reference is exact.
    """

    estimate: Array
    low: Array
    high: Array
    seconds: Array
    model_seconds: Array
    evaluations: NDArray[np.int64]
    replicates: NDArray[np.int64]
    reference: Array
    exact: bool

    def each(self) -> list[tuple[int, int, int]]:
        """Return contender, budget and number of replicates of every cell that was run."""
        return [(i, j, int(r)) for (i, j), r in np.ndenumerate(self.replicates) if r > 0]


def errors(
    cells: Cells, rng: Callable[[int, int], np.random.Generator], level: float
) -> tuple[dict[str, NDArray[Any]], Array]:
    """Return bias, root mean square error and coverage of each cell.

    Parameters
    ----------
    cells : Cells
    rng : callable
        Contender and budget by number -> generator of its resamples.
    level : float
        Of the limits.

    Returns
    -------
    numbers : dict of (m, b, ...) or (m, b) array
        By name; NaN in cells that were not run, or in which a replicate has no estimate. What ends in
        ``_overall`` is over the extra dims too. ``intervals`` counts the runs that gave any.
    resampled : (RESAMPLES, m, b) array
        Root mean square errors, over the extra dims too, of resampled replicates.
    """
    shape = cells.replicates.shape
    extra = cells.reference.shape
    names = ("bias", "bias_error", *(f"{n}{e}" for n in ("rmse", "coverage") for e in ("", "_low", "_high")))
    found: dict[str, NDArray[Any]] = {name: np.full(shape + extra, np.nan) for name in names}
    overall = {f"{n}_overall{e}": np.full(shape, np.nan) for n in ("rmse", "coverage") for e in _ENDS}
    found["intervals"] = np.zeros(shape, np.int64)
    resampled = np.full((RESAMPLES, *shape), np.nan)
    ends = [0.5 - level / 2, 0.5 + level / 2]
    for i, j, count in cells.each():
        error = cells.estimate[i, j, :count] - cells.reference
        squares = np.square(error).reshape(count, -1)
        drawn = rng(i, j).multinomial(count, np.full(count, 1 / count), size=RESAMPLES)
        by_resample = drawn @ squares / count
        found["bias"][i, j] = error.mean(axis=0)
        found["bias_error"][i, j] = error.std(axis=0, ddof=1) / np.sqrt(count)
        found["rmse"][i, j] = np.sqrt(squares.mean(axis=0)).reshape(extra)
        low, high = np.quantile(np.sqrt(by_resample), ends, axis=0)
        found["rmse_low"][i, j], found["rmse_high"][i, j] = low.reshape(extra), high.reshape(extra)
        resampled[:, i, j] = np.sqrt(by_resample.mean(axis=1))
        overall["rmse_overall"][i, j] = np.sqrt(squares.mean())
        overall["rmse_overall_low"][i, j], overall["rmse_overall_high"][i, j] = np.quantile(
            resampled[:, i, j], ends
        )
        hits, told = _held(cells, i, j, count)
        found["coverage"][i, j], *limits = _share(hits.sum(axis=0), told.sum(axis=0), level)
        found["coverage_low"][i, j], found["coverage_high"][i, j] = limits
        found["intervals"][i, j] = told.reshape(count, -1).sum(axis=0).min()
        middle, *limits = _share_over_runs(hits.reshape(count, -1), told.reshape(count, -1), level)
        overall["coverage_overall"][i, j] = middle
        overall["coverage_overall_low"][i, j], overall["coverage_overall_high"][i, j] = limits
    return found | (overall if extra else {}), resampled


_ENDS = ("", "_low", "_high")


def _held(cells: Cells, i: int, j: int, count: int) -> tuple[Array, Array]:
    """Return which intervals hold the reference, and which there are, (count, ...)."""
    low, high = cells.low[i, j, :count], cells.high[i, j, :count]
    reach = ROUNDING * np.abs(cells.reference) if cells.exact else 0.0
    told = np.isfinite(low) & np.isfinite(high)
    held = (low - reach <= cells.reference) & (cells.reference <= high + reach) & told
    return held.astype(np.float64), told.astype(np.float64)


def _share(hits: Array, n: Array, level: float) -> tuple[Array, Array, Array]:
    """Return a share with its limits; NaN without trials."""
    hits, n = np.asarray(hits, np.float64), np.asarray(n, np.float64)
    middle = np.divide(hits, n, out=np.full_like(hits, np.nan), where=n > 0)
    low, high = wilson(hits, n, level)
    return middle, np.where(n > 0, low, np.nan), np.where(n > 0, high, np.nan)


def _share_over_runs(hits: Array, n: Array, level: float) -> tuple[Array, Array, Array]:
    """Return the share of hits (runs, results) with limits from the scatter of the runs.

    Results of one run hang together, so that runs that agree count as one trial each.
    """
    hits, n = hits[n.sum(axis=1) > 0], n[n.sum(axis=1) > 0]
    runs = len(n)
    each = hits.sum(axis=1) / n.sum(axis=1)
    middle = each.mean() if runs else np.array(np.nan)
    squares = np.square(each - middle).sum()
    if runs < 2 or squares <= ROUNDING:
        return _share(middle * runs if runs else np.array(0.0), np.array(float(runs)), level)
    low, high = replicated(middle, squares, runs, n.sum(), level)
    return middle, np.clip(low, 0.0, 1.0), np.clip(high, 0.0, 1.0)


def ranks(rmse: Array, resampled: Array, level: float) -> dict[str, Array]:
    """Return the error of each contender over the lowest one at its budget.

    Parameters
    ----------
    rmse : (m, b) array
    resampled : (RESAMPLES, m, b) array
        As from `errors`.
    level : float

    Returns
    -------
    dict of (m, b) array
        ``rmse_ratio`` with limits; 1 for the lowest, infinite for others where the lowest is 0. NaN
        where there is no error to compare.
    """
    ratio, low, high = np.full((3, *rmse.shape), np.nan)
    ends = [0.5 - level / 2, 0.5 + level / 2]
    for j in range(rmse.shape[1]):
        known = np.flatnonzero(np.isfinite(rmse[:, j]))
        if not known.size:
            continue
        best = known[rmse[known, j].argmin()]
        for i in known:
            if i == best:
                ratio[i, j] = low[i, j] = high[i, j] = 1.0
            elif rmse[best, j] > 0:
                ratio[i, j] = rmse[i, j] / rmse[best, j]
                # Some resamples may hold nothing but hits.
                parts = resampled[:, best, j]
                drawn = np.divide(resampled[:, i, j], parts, out=np.full_like(parts, np.inf), where=parts > 0)
                low[i, j], high[i, j] = np.quantile(drawn, ends, method="inverted_cdf")
            else:
                ratio[i, j] = low[i, j] = high[i, j] = np.inf if rmse[i, j] > 0 else 1.0
    return {"rmse_ratio": ratio, "rmse_ratio_low": low, "rmse_ratio_high": high}


def rates(rmse: Array, resampled: Array, evaluations: NDArray[np.int64], level: float) -> dict[str, Array]:
    """Return how errors fall: the slope of log error over log evaluations.

    Parameters
    ----------
    rmse : (m, b) array
        Root mean square errors.
    resampled : (RESAMPLES, m, b) array
        As from `errors`.
    evaluations : (m, b) array of int
        Model runs of one run.
    level : float
        Of the limits.

    Returns
    -------
    dict of (m) array
        ``rate`` with limits; NaN with fewer than three budgets or an error of 0.
    """
    rate, low, high = np.full((3, len(rmse)), np.nan)
    for i in range(len(rmse)):
        cells = np.isfinite(rmse[i]) & (evaluations[i] > 0)
        if (
            len(set(evaluations[i, cells])) < 3
            or not (resampled[:, i, cells] > 0).all()
            or not (rmse[i, cells] > 0).all()
        ):
            continue
        x = np.log(evaluations[i, cells])
        x = x - x.mean()
        rate[i] = x @ np.log(rmse[i, cells]) / (x @ x)
        slopes = np.log(resampled[:, i, cells]) @ x / (x @ x)
        low[i], high[i] = np.quantile(slopes, [0.5 - level / 2, 0.5 + level / 2])
    return {"rate": rate, "rate_low": low, "rate_high": high}
