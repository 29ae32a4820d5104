"""Confidence intervals of shares and means."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit

from hipuq.errors import InputError

Array = NDArray[np.float64]

CARRYING = 30
"""Draws that carry a mean, (sum of y)^2 / (sum of y^2), from which on its t interval is good."""


def check_confidence(confidence: float) -> float:
    """Return a confidence level.

    Raises
    ------
    InputError
        If it does not lie between 0 and 1.
    """
    if isinstance(confidence, (int, float)) and 0 < confidence < 1:
        return float(confidence)
    raise InputError(f"confidence is {confidence!r}: it must lie between 0 and 1, such as 0.95")


def wilson(hits: Array, n: Array, confidence: float) -> tuple[Array, Array]:
    """Return the score interval of a share (Wilson, J. Am. Stat. Assoc. 22 (1927) 209).

    Parameters
    ----------
    hits, n : array
        Events and draws; without draws the interval is 0 to 1.
    confidence : float

    Returns
    -------
    low, high : array
    """
    z = ndtri(0.5 + confidence / 2)
    draws = np.maximum(n, 1.0)
    share = np.where(n > 0, hits / draws, 0.5)
    centre, half = _score(share, draws, z)
    # Rounding must not leave the estimate outside at 0 and 1.
    low = np.where(hits <= 0, 0.0, np.clip(centre - half, 0.0, share))
    high = np.where(hits >= n, 1.0, np.clip(centre + half, share, 1.0))
    return np.where(n > 0, low, 0.0), np.where(n > 0, high, 1.0)


def replicated(
    share: Array, squares: Array, replicates: int, n: Array, confidence: float
) -> tuple[Array, Array]:
    """Return the interval of a share from those of independent designs.

    The score interval of as many draws as have the variance between replicates, with the t quantile, and half
    a point more to either side, for a share of n points is a multiple of 1/n. A plain t interval forgets that
    the variance depends on the share, and that even points leave replicates few different shares: of 8
    replicates its 95 % limits hold in as little as 89 % (four random events in all) and 92 % (even points in
    one dimension), these in 95 % and 93 %.

    Parameters
    ----------
    share : array
        Mean over the replicates.
    squares : array
        Sum of squared deviations of the replicates from it; where it is 0 there is no such interval.
    replicates : int
    n : array
        Points of all replicates together.
    confidence : float

    Returns
    -------
    low, high : array
        NaN where the replicates do not differ.
    """
    freedom = replicates - 1
    differ = squares > 0
    draws = np.where(differ, share * (1 - share) * freedom * replicates, 1.0) / np.where(differ, squares, 1.0)
    centre, half = _score(share, draws, float(stdtrit(freedom, 0.5 + confidence / 2)))
    reach = np.where(differ, half + 0.5 / np.maximum(n, 1.0), np.nan)
    return np.minimum(centre - reach, share), np.maximum(centre + reach, share)


def _score(share: Array, draws: Array, z: float) -> tuple[Array, Array]:
    """Return centre and half width of the score interval."""
    centre = (share + z**2 / (2 * draws)) / (1 + z**2 / draws)
    half = z * np.sqrt(share * (1 - share) / draws + z**2 / (4 * draws**2)) / (1 + z**2 / draws)
    return centre, half


def student(mean: Array, squares: Array, n: Array, confidence: float) -> tuple[Array, Array]:
    """Return the t interval of a mean over independent draws, NaN for fewer than two.

    Parameters
    ----------
    mean, squares, n : array
        Mean, sum of squared deviations and number of draws.
    confidence : float

    Returns
    -------
    low, high : array
    """
    enough = n > 1
    freedom = np.where(enough, n - 1, 1)
    error = np.sqrt(squares / (freedom * np.maximum(n, 1)))
    half = np.where(enough, stdtrit(freedom, 0.5 + confidence / 2) * error, np.nan)
    return mean - half, mean + half


def graded(mean: Array, squares: Array, n: Array, confidence: float) -> tuple[Array, Array]:
    """Return the interval of a mean of values between 0 and 1, such as probabilities, over independent draws.

    The t interval, where enough draws carry the mean. Where they are few it is far too narrow: of values
    that are 0 in 91 % and uniform to 0.2 else its 95 % limits hold in 30 % (4 draws), 69 % (16), 83 % (32),
    90 % (64). There it is widened to the score interval of as many draws of 0 and 1 as have the variance
    of the mean, and to Wilson's where all values are 0, or all 1: what was not drawn may be like nothing that
    was. So it holds in 99 % and more there.

    Parameters
    ----------
    mean, squares, n : array
        Mean, sum of squared deviations and number of draws.
    confidence : float

    Returns
    -------
    low, high : array
        Between 0 and 1; NaN for fewer than two draws.
    """
    low, high = student(mean, squares, n, confidence)
    enough, draws = n > 1, np.maximum(n, 1.0)
    squares = np.maximum(squares, 0.0)
    carrying = [
        np.divide(draws * part**2, squares / draws + part**2, out=np.zeros_like(mean), where=part > 0)
        for part in (mean, 1 - mean)
    ]
    few = enough & (np.minimum(*carrying) < CARRYING)
    differ = few & (squares > 0)
    freedom = np.maximum(draws - 1, 1.0)
    like = np.where(differ, mean * (1 - mean) * freedom * draws, 1.0) / np.where(differ, squares, 1.0)
    centre, half = _score(mean, like, stdtrit(freedom, 0.5 + confidence / 2))
    low, high = (
        np.where(differ, np.minimum(low, centre - half), low),
        np.where(differ, np.maximum(high, centre + half), high),
    )
    # What never came, or always did, may be rare: that is all that so many draws tell.
    single = wilson(mean * draws, draws, confidence)
    certain = few & ((mean <= 0) | (mean >= 1))
    low, high = np.where(certain, single[0], low), np.where(certain, single[1], high)
    # Nor do values near 0 tell more than those that are 0.
    rare = wilson(np.zeros_like(draws), draws, confidence)[1]
    low = np.where(few, np.minimum(low, 1 - rare), low)
    high = np.where(few, np.maximum(high, rare), high)
    return np.clip(low, 0.0, 1.0), np.clip(high, 0.0, 1.0)


def combined(
    table: xr.Dataset,
    weight: str,
    dim: str,
    spread: float | xr.DataArray = 0.0,
    confidence: float | None = None,
) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
    """Return a weighted mean of independent estimates over `dim`, with its interval.

    Distances to the limits are added in squares, which keeps the good behaviour of the single
    intervals near 0 and 1 (Zou and Donner, Stat. Med. 27 (2008) 1693). Only what is left to chance
    goes so: what is unknown may be all on one side, so limits are measured from the estimates with
    every unknown counted as 0 (``floor``) and as 1 (``ceiling``).

    Shares of few draws in many strata make that interval too narrow on the side of rare events (in 8 strata
    of 16 draws at a share of 0.01, 95 % limits hold in 87 %). So for shares it is widened to the
    Wilson interval of as many draws as have the variance of the whole.

    Parameters
    ----------
    table : Dataset
        ``estimate``, ``low``, ``high``, ``floor``, ``ceiling`` and the weights; ``draws`` of shares.
    weight : str
        Name of the weights over `dim`; they need not add up to 1.
    dim : str
    spread : float or DataArray, default 0
        Half-width of one more independent error of the whole, such as that of the weights.
    confidence : float, optional
        Of the limits, where the estimates are shares of ``draws``.

    Returns
    -------
    estimate, low, high : DataArray
        NaN if one of the estimates that has a weight is.
    """
    share = table[weight] / table[weight].sum(dim)
    used = share > 0

    def total(part: xr.DataArray) -> xr.DataArray:
        return part.where(used, 0.0).sum(dim, skipna=False)

    ends = []
    for side, (limit, start) in enumerate((("low", "floor"), ("high", "ceiling"))):
        middle = total(share * table[start])
        reach = total((share * (table[limit] - table[start])) ** 2) ** 0.5
        if confidence is not None:
            pooled = _pooled_reach(table, total, share, start, side, confidence)
            reach = reach.where(~(pooled > reach), pooled)
        reach = (reach**2 + spread**2) ** 0.5
        ends.append(middle + (reach if side else -reach))
    return total(share * table["estimate"]), ends[0], ends[1]


def _pooled_reach(
    table: xr.Dataset,
    total: Callable[[xr.DataArray], xr.DataArray],
    share: xr.DataArray,
    start: str,
    side: int,
    confidence: float,
) -> xr.DataArray:
    """Return the distance to the Wilson limit of as many draws as have the variance of the whole.

    NaN where there is none: no stratum of more than one draw varies.
    """
    p, draws = table[start], table["draws"]
    spread = (p * (1 - p) / (draws - 1)).where(draws > 1, 0.0)
    whole, variance = total(share * p), total(share**2 * spread)
    n = (whole * (1 - whole) / variance.where(variance > 0)).where(whole * (1 - whole) > 0)
    limit = wilson((whole * n).fillna(0.0).values, n.fillna(0.0).values, confidence)[side]
    return abs(whole.copy(data=limit) - whole).where(n.notnull())
