"""Reductions over samples, block by block, so that outcomes may be lazy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.errors import InputError

Array = NDArray[np.float64]
Groups = Callable[[slice], NDArray[np.intp]]
"""Rows -> group of each sample, from 0."""

BLOCK = 65_536
"""Samples held in memory at a time. Sums are made block by block: another size gives other last digits."""


def slices(samples: int, block: int | None = None) -> Iterator[slice]:
    """Yield the rows of each block of samples, `BLOCK` of them if nothing else is asked for."""
    step = BLOCK if block is None else block
    for start in range(0, samples, step):
        yield slice(start, min(start + step, samples))


def read(values: xr.DataArray, rows: slice) -> NDArray[Any]:
    """Return the values of some samples, which is all that is read of a lazy array."""
    return np.asarray(values.variable.isel(sample=rows).values)


def one_group(rows: slice) -> NDArray[np.intp]:
    """Return the group of samples that are not divided."""
    return np.zeros(rows.stop - rows.start, np.intp)


def by_block(values: xr.DataArray) -> Iterator[NDArray[Any]]:
    """Yield the values over ``sample``, block by block."""
    for rows in slices(values.sizes["sample"]):
        yield read(values, rows)


def flag_counts(values: xr.DataArray, flags: Mapping[str, int]) -> dict[str, int]:
    """Return how many samples have each value of a flag variable.

    Parameters
    ----------
    values : DataArray
        Over ``sample``.
    flags : mapping of str to int
        Meaning -> value.

    Returns
    -------
    dict of str to int
    """
    counts = dict.fromkeys(flags, 0)
    for part in by_block(values):
        for name, value in flags.items():
            counts[name] += int((part == value).sum())
    return counts


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


def moments(
    values: xr.DataArray, groups: NDArray[np.intp] | Groups, count: int, block: int | None = None
) -> Moments:
    """Reduce a variable over ``sample`` by group, block by block, so that it may be lazy.

    Parameters
    ----------
    values : DataArray
        ``sample`` first.
    groups : (samples,) array of int, or callable
        Group of each sample, from 0; or rows -> groups of those samples.
    count : int
        Number of groups.
    block : int, optional
        Samples held in memory at a time, `BLOCK` by default.

    Returns
    -------
    Moments

    Raises
    ------
    InputError
        If a value is infinite.
    """
    of = groups if callable(groups) else groups.__getitem__
    return reduced([values], [(of, count)], block)[0][0]


def reduced(
    variables: Sequence[xr.DataArray], groupings: Sequence[tuple[Groups, int]], block: int | None = None
) -> list[list[Moments]]:
    """Reduce several variables over ``sample`` by several groupings, reading every block once.

    Parameters
    ----------
    variables : sequence of DataArray
        ``sample`` first.
    groupings : sequence of (callable, int)
        Rows -> group of each sample, and the number of groups.
    block : int, optional
        Samples held in memory at a time, `BLOCK` by default.

    Returns
    -------
    list of list of Moments
        For each grouping those of each variable.

    Raises
    ------
    InputError
        If a value is infinite.
    """
    samples = variables[0].sizes["sample"]
    sums = [[_Sums(count, values.shape[1:]) for values in variables] for _, count in groupings]
    infinite = [0] * len(variables)
    for rows in slices(samples, block):
        groups = [of(rows) for of, _ in groupings]
        for i, values in enumerate(variables):
            width = int(np.prod(values.shape[1:], dtype=int))
            x = np.asarray(read(values, rows), dtype=np.float64).reshape(-1, width)
            infinite[i] += int(np.isinf(x).any(axis=1).sum())
            if not any(infinite):
                for own, group in zip(sums, groups, strict=True):
                    own[i].add(x, group)
    for values, found in zip(variables, infinite, strict=True):
        if found:
            raise not_finite(str(values.name), found, samples, "it has no mean")
    return [[one.moments() for one in own] for own in sums]


class _Sums:
    """Moments in the making; blocks are merged by the update of Chan, Golub and LeVeque (1983)."""

    def __init__(self, count: int, shape: tuple[int, ...]) -> None:
        self.count, self.shape = count, shape
        self.size = np.zeros(count)
        self.known, self.mean, self.squares = np.zeros((3, count, int(np.prod(shape, dtype=int))))

    def add(self, x: Array, groups: NDArray[np.intp]) -> None:
        """Take in a block of values (samples, elements) and the group of each sample."""
        self.size += np.bincount(groups, minlength=self.count)
        for column in range(x.shape[1]):
            present = ~np.isnan(x[:, column])
            group, part = groups[present], x[present, column]
            n = np.bincount(group, minlength=self.count).astype(np.float64)
            m = _divide(np.bincount(group, part, self.count).astype(np.float64), n)
            s = np.bincount(group, np.square(part - m[group]), self.count)
            known = self.known[:, column]
            both = known + n
            delta = m - self.mean[:, column]
            self.squares[:, column] += s + _divide(np.square(delta) * known * n, both)
            self.mean[:, column] += _divide(delta * n, both)
            self.known[:, column] = both

    def moments(self) -> Moments:
        """Return the moments of all blocks so far."""
        mean = np.where(self.known > 0, self.mean, np.nan)
        parts = (part.reshape(self.count, *self.shape) for part in (self.known, mean, self.squares))
        return Moments(self.size, *parts)


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
