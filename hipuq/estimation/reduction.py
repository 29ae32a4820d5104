"""Reductions over samples, block by block, so that outcomes may be lazy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Moments:
    """Counts and moments of a variable by group; arrays (groups, ...).

    Attributes
    ----------
    size : (groups,) array
        Samples.
    known : array
        Samples that are not missing.
    mean : array
        Mean of the known ones, NaN without any.
    squares : array
        Their sum of squared deviations.
    """

    size: Array
    known: Array
    mean: Array
    squares: Array

    @property
    def total(self) -> Array:
        """Sum of the known values."""
        return self.known * np.nan_to_num(self.mean)

    @property
    def variance(self) -> Array:
        """Sample variance, NaN for fewer than two known values."""
        return np.divide(
            self.squares, self.known - 1, out=np.full_like(self.mean, np.nan), where=self.known > 1
        )

    def reshaped(self, *groups: int) -> Moments:
        """Return the same moments with the groups laid out in several axes."""
        size, *rest = (
            np.reshape(part, (*groups, *part.shape[1:]))
            for part in (self.size, self.known, self.mean, self.squares)
        )
        return Moments(size, *rest)

    def first(self, count: int) -> Moments:
        """Return the moments of the first groups."""
        return Moments(*(part[:count] for part in (self.size, self.known, self.mean, self.squares)))

    def pooled(self) -> Moments:
        """Return the moments over the second axis of groups together."""
        known = self.known.sum(axis=1)
        mean = np.divide(self.total.sum(axis=1), known, out=np.full_like(known, np.nan), where=known > 0)
        # An empty cell has known 0, so its missing mean must not spread.
        spread = self.known * np.square(np.nan_to_num(self.mean) - mean[:, None])
        squares = (self.squares + np.nan_to_num(spread)).sum(axis=1)
        return Moments(self.size.sum(axis=1), known, mean, squares)

    def with_unknown(self, value: float) -> Moments:
        """Return the moments with every missing value replaced by `value`."""
        size = self.size.reshape(self.size.shape + (1,) * (self.known.ndim - self.size.ndim))
        size = np.broadcast_to(size, self.known.shape)
        missing = size - self.known
        # An empty group stays empty: its mean is missing, not 0 / 0.
        draws = np.where(size > 0, size, np.nan)
        filled = (self.total + missing * value) / draws
        delta = np.where(self.known > 0, value - np.nan_to_num(self.mean), 0.0)
        squares = self.squares + np.nan_to_num(np.square(delta) * self.known * missing / draws)
        return Moments(self.size, size, filled, squares)


def moments(values: xr.DataArray, groups: NDArray[np.intp], count: int, block: int = 65_536) -> Moments:
    """Reduce a variable over ``sample`` by group, block by block, so that it may be lazy.

    Parameters
    ----------
    values : DataArray
        ``sample`` first.
    groups : (samples,) array of int
        Group of each sample, from 0.
    count : int
        Number of groups.
    block : int
        Samples held in memory at a time; blocks are merged by the update of Chan, Golub and
        LeVeque (1983).

    Returns
    -------
    Moments

    Raises
    ------
    InputError
        If a value is infinite.
    """
    shape = values.shape[1:]
    width = int(np.prod(shape, dtype=int))
    known, mean, squares = np.zeros((3, count, width))
    infinite = 0
    for start in range(0, values.sizes["sample"], block):
        rows = slice(start, start + block)
        x = np.asarray(values[rows].values, dtype=np.float64).reshape(-1, width)
        infinite += int(np.isinf(x).any(axis=1).sum())
        if infinite:
            continue
        for column in range(width):
            present = ~np.isnan(x[:, column])
            group, part = groups[rows][present], x[present, column]
            n = np.bincount(group, minlength=count).astype(np.float64)
            m = _divide(np.bincount(group, part, count).astype(np.float64), n)
            s = np.bincount(group, np.square(part - m[group]), count)
            both = known[:, column] + n
            delta = m - mean[:, column]
            squares[:, column] += s + _divide(np.square(delta) * known[:, column] * n, both)
            mean[:, column] += _divide(delta * n, both)
            known[:, column] = both
    if infinite:
        raise not_finite(str(values.name), infinite, values.sizes["sample"], "it has no mean")
    mean[known == 0] = np.nan
    size = np.bincount(groups, minlength=count).astype(np.float64)
    return Moments(size, *(part.reshape(count, *shape) for part in (known, mean, squares)))


def check_finite(name: str, values: Array, outputs: int, samples: int, why: str) -> None:
    """Raise an InputError if an outcome is infinite anywhere.

    Parameters
    ----------
    name : str
        The outcome.
    values : array
        Its values; NaN is allowed.
    outputs : int
        Axis of `values` that is not one of samples.
    samples : int
        Number of all samples.
    why : str
        What cannot be done with it.
    """
    count = int(np.any(np.isinf(values), axis=outputs).sum())
    if count:
        raise not_finite(name, count, samples, why)


def not_finite(name: str, infinite: int, samples: int, why: str) -> InputError:
    """Return the error for an outcome with infinite values, which names their share."""
    return InputError(
        f"{name} is infinite in {infinite} samples ({infinite / samples:.2%}): {why}; analyse another outcome"
    )


def _divide(a: Array, b: Array) -> Array:
    """Return a / b, 0 where b is 0."""
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0)
