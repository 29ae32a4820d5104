"""What the error of a contender would cost the baseline, and when the contender pays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hipuq.comparison.statistics import Cells

Array = NDArray[np.float64]


def costs(
    cells: Cells, rmse: Array, resampled: Array, baseline: int, same_model: list[bool], level: float
) -> dict[str, Array]:
    """Return what the error of each contender would cost the baseline, and when the contender pays.

    Parameters
    ----------
    cells : Cells
    rmse : (m, b) array
    resampled : (RESAMPLES, m, b) array
        As from `errors`.
    baseline : int
        Number of the contender that others are held against; its error is taken to fall as n**-1/2.
    same_model : list of bool
        Which contenders evaluate the model of the baseline.
    level : float
        Of the limits.

    Returns
    -------
    dict of (m, b) array
        ``run_time`` and ``model_time``, medians over the replicates [s], ``baseline_evaluations`` with
        limits, ``cost_ratio`` with limits, ``break_even`` [s].
    """
    whole, model, ratio, least, most, even = np.full((6, *rmse.shape), np.nan)
    for i, j, count in cells.each():
        whole[i, j] = np.median(cells.seconds[i, j, :count])
        model[i, j] = np.median(cells.model_seconds[i, j, :count])
    needed = _needed(cells, rmse[None], baseline)[0]
    needed = np.where(needed > 0, needed, np.nan)
    drawn = _needed(cells, resampled, baseline)
    # A resample in which nobody errs tells nothing: it widens both limits.
    ends = [
        np.quantile(np.where(np.isnan(drawn) & ~np.isnan(needed), away, drawn), q, 0, method="inverted_cdf")
        for q, away in ((0.5 - level / 2, 0.0), (0.5 + level / 2, np.inf))
    ]
    ran = cells.evaluations[baseline] > 0
    n = cells.evaluations[baseline, ran].astype(np.float64)
    total, beside = _line(n, whole[baseline, ran]), _line(n, (whole - model)[baseline, ran])
    for i, j, _ in cells.each():
        if np.isnan(needed[i, j]):
            continue
        # More evaluations of the baseline cost it more: the limits change places.
        for found, count in ((ratio, needed[i, j]), (least, ends[1][i, j]), (most, ends[0][i, j])):
            spent = total(count) if np.isfinite(count) else np.inf
            found[i, j] = 1.0 if i == baseline else whole[i, j] / spent if spent > 0 else np.inf
        if same_model[i] and i != baseline:
            saved = needed[i, j] - cells.evaluations[i, j]
            more = whole[i, j] - model[i, j] - beside(needed[i, j]) if np.isfinite(saved) else 0.0
            even[i, j] = np.inf if saved <= 0 else max(more / saved, 0.0)
    return {
        "run_time": whole,
        "model_time": model,
        "baseline_evaluations": needed,
        "baseline_evaluations_low": ends[0],
        "baseline_evaluations_high": ends[1],
        "cost_ratio": ratio,
        "cost_ratio_low": least,
        "cost_ratio_high": most,
        "break_even": even,
    }


def _needed(cells: Cells, rmse: Array, baseline: int) -> Array:
    """Return the evaluations of the baseline for errors (k, m, b); its own for those of its own."""
    own = np.isfinite(rmse[0, baseline]) & (cells.evaluations[baseline] > 0)
    if not own.any():
        return np.full_like(rmse, np.nan)
    n = cells.evaluations[baseline].astype(np.float64)
    scale = np.average(
        (n * rmse[:, baseline] ** 2)[:, own],
        axis=1,
        weights=cells.replicates[baseline, own].astype(np.float64),
    )
    scale = scale[:, None, None]
    needed = np.divide(scale, rmse**2, out=np.full_like(rmse, np.inf), where=rmse > 0)
    needed = np.where(np.isnan(rmse) | ((scale == 0) & (rmse == 0)), np.nan, needed)
    # The line through its errors is not what it was run with.
    needed[:, baseline] = np.where(np.isnan(rmse[:, baseline]), np.nan, n)
    return needed


def _line(n: Array, seconds: Array) -> Callable[[float], float]:
    """Return the time of so many evaluations: between those measured, outside on the line through them."""
    each = float(seconds[-1] / n[-1])
    slope = float(np.clip(np.polyfit(n, seconds, 1)[0], 0.0, each)) if len(set(n)) > 1 else each
    slope = slope or each

    def time(evaluations: float) -> float:
        if evaluations < n[0]:
            proportional = seconds[0] * evaluations / n[0]
            return float(max(seconds[0] - slope * (n[0] - evaluations), proportional))
        return float(np.interp(evaluations, n, seconds)) + slope * max(evaluations - float(n[-1]), 0.0)

    return time
