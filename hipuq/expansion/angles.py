"""Least-angle regression: the order in which terms enter a fit.

Starting from 0, the fit moves so that the correlations of the residual with all entered columns fall
together, until another column has the same correlation and enters (Efron, Hastie, Johnstone and
Tibshirani, Ann. Stat. 32 (2004) 407). With ``X_A = Q R`` for the entered columns and g the signs of their
correlations the direction that lowers these at unit rate is ``Q z`` with ``R^T z = g``; entered columns
keep their signs, so Q, R and z only grow, and one more column costs one more row of ``Q^T X``. That is a
Cholesky factorisation of ``X^T X`` whose pivots are chosen by angle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRAM_MAXIMUM = 4_000
"""Most terms whose products with each other are all kept in memory."""

# Columns whose sine of the angle to the entered ones is below the root of this do not enter.
_DEPENDENT = 1e-12

# Correlations below this part of the first one are rounding.
_NOTHING_LEFT = 1e-13


class Angles:
    """Least-angle regression on the leading columns of one design matrix, for many outputs.

    Parameters
    ----------
    psi : (s, terms) array
        Design matrix, its first column constant: the rest is centred and scaled.
    """

    def __init__(self, psi: Array) -> None:
        centred = psi[:, 1:] - psi[:, 1:].mean(axis=0)
        length = np.sqrt(np.square(centred).sum(axis=0))
        # A term that is constant at the samples never enters.
        still = length <= 1e-12 * np.sqrt(len(psi)) * np.abs(psi[:, 1:]).max(axis=0, initial=0.0)
        self._columns = np.divide(centred, length, out=np.zeros_like(centred), where=~still)
        self._gram = self._columns.T @ self._columns if centred.shape[1] <= GRAM_MAXIMUM else None

    def path(self, y: Array, size: int) -> Path:
        """Return the path of one centred output (s,) on the first `size` terms."""
        columns = self._columns[:, : size - 1]
        gram = self._gram

        def products(j: int) -> Array:
            return np.asarray(columns.T @ columns[:, j] if gram is None else gram[j, : size - 1])

        return Path(_entries(columns.T @ y, np.square(columns).sum(axis=0), products))


class Path:
    """Terms in the order of their entry, found as far as they are asked for."""

    def __init__(self, entries: Iterator[int]) -> None:
        self._entries = entries
        # The constant term is in every fit.
        self._order = [0]

    def first(self, count: int) -> NDArray[np.intp]:
        """Return the first `count` terms, fewer if the path ends before."""
        self._order.extend(1 + j for j in islice(self._entries, max(count - len(self._order), 0)))
        return np.array(self._order[:count], np.intp)


def _entries(correlation: Array, squares: Array, products: Callable[[int], Array]) -> Iterator[int]:
    """Yield the numbers of columns in the order of their entry.

    Parameters
    ----------
    correlation : (n,) array
        ``X^T y``.
    squares : (n,) array
        Squared lengths of the columns, 1 or 0.
    products : callable
        Number of a column -> its products with all columns, (n,).
    """
    c, left = correlation.copy(), squares.copy()
    free = left > _DEPENDENT
    height = np.abs(c[free]).max(initial=0.0)
    end = _NOTHING_LEFT * height
    rows = np.empty((16, len(c)))
    z, falls = np.empty(0), np.zeros_like(c)
    while free.any() and height > end:
        # How far the common correlation falls until that of another column, or its negative, is as high.
        with np.errstate(divide="ignore", invalid="ignore"):
            up = np.where(falls < 1, (height - c).clip(0) / (1 - falls), np.inf)
            down = np.where(falls > -1, (height + c).clip(0) / (1 + falls), np.inf)
        step = np.where(free, np.minimum(up, down), np.inf)
        j = int(np.argmin(step))
        if not step[j] < height - end:
            return
        c -= step[j] * falls
        height -= step[j]
        k = len(z)
        if k == len(rows):
            rows = np.concatenate([rows, np.empty_like(rows)])
        before = rows[:k, j].copy()
        rows[k] = (products(j) - before @ rows[:k]) / np.sqrt(left[j])
        z = np.append(z, (np.sign(c[j]) - before @ z) / rows[k, j])
        falls += z[k] * rows[k]
        left -= np.square(rows[k])
        free &= left > _DEPENDENT
        free[j] = False
        yield j
