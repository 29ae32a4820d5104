"""Confidence intervals of shares and means."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit

from hipuq.errors import InputError

Array = NDArray[np.float64]


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
    centre = (share + z**2 / (2 * draws)) / (1 + z**2 / draws)
    half = z * np.sqrt(share * (1 - share) / draws + z**2 / (4 * draws**2)) / (1 + z**2 / draws)
    # Rounding must not leave the estimate outside at 0 and 1.
    low = np.where(hits <= 0, 0.0, np.clip(centre - half, 0.0, share))
    high = np.where(hits >= n, 1.0, np.clip(centre + half, share, 1.0))
    return np.where(n > 0, low, 0.0), np.where(n > 0, high, 1.0)


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


def combined(
    table: xr.Dataset, weight: str, dim: str, spread: float | xr.DataArray = 0.0
) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
    """Return a weighted mean of independent estimates over `dim`, with its interval.

    Distances to the limits are added in squares, which keeps the good behaviour of the single
    intervals near 0 and 1 (Zou and Donner, Stat. Med. 27 (2008) 1693). Only what is left to chance
    goes so: what is unknown may be all on one side, so limits are measured from the estimates with
    every unknown counted as 0 (``floor``) and as 1 (``ceiling``).

    Parameters
    ----------
    table : Dataset
        ``estimate``, ``low``, ``high``, ``floor``, ``ceiling`` and the weights.
    weight : str
        Name of the weights over `dim`; they need not add up to 1.
    dim : str
    spread : float or DataArray, default 0
        Half-width of one more independent error of the whole, such as that of the weights.

    Returns
    -------
    estimate, low, high : DataArray
        NaN if one of the estimates that has a weight is.
    """
    share = table[weight] / table[weight].sum(dim)
    used = share > 0

    def total(part: xr.DataArray) -> xr.DataArray:
        return part.where(used, 0.0).sum(dim, skipna=False)

    below = (total((share * (table["floor"] - table["low"])) ** 2) + spread**2) ** 0.5
    above = (total((share * (table["high"] - table["ceiling"])) ** 2) + spread**2) ** 0.5
    return (
        total(share * table["estimate"]),
        total(share * table["floor"]) - below,
        total(share * table["ceiling"]) + above,
    )
