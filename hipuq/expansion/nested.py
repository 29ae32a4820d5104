"""Least squares on growing sets of columns, with the leave-one-out error of each.

One QR factorisation of the design matrix ``psi = Q R`` serves all leading sets of its columns. With P
columns the fit is the projection on the first P columns of Q, the leverage of a sample the sum of
squares of their entries, and the inverse of the leading block of R the leading block of its inverse, so
that residuals, leverages and ``tr((psi^T psi)^-1)`` are all sums that grow column by column.

The leave-one-out error is the mean of ``(r / (1 - h))**2`` over residuals r and leverages h. It is
corrected by ``s / (s - P) (1 + tr((psi^T psi)^-1))`` for s samples (Blatman and Sudret, J. Comput. Phys.
230 (2011) 2345). That factor is what turns the mean of squared residuals into an estimate of the error of
prediction (Chapelle, Vapnik and Bengio, Mach. Learn. 48 (2002) 9): of the variance of the noise residuals
hold ``1 - P / s`` and errors of prediction ``1 + tr((psi^T psi)^-1)``. The leave-one-out error alone is
nearly free of bias, so corrected it leans to the safe side, which keeps large bases from winning by
chance. Errors are relative to the sample variance of the outcome.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from hipuq.errors import InputError

Array = NDArray[np.float64]

CONDITION_MAXIMUM = 1e8
"""Largest condition number (in the Frobenius norm) of a design matrix that is trusted."""

_EPS = float(np.finfo(np.float64).eps)

# A sample whose leverage is this close to 1 alone decides a coefficient.
_LEVERAGE_GAP = 1e-9


@dataclass(frozen=True)
class Outputs:
    """Outputs without their mean.

    Attributes
    ----------
    centred : (s, outputs) array
    mean, variance : (outputs,) array
        The variance is 0 for outputs that are constant but for rounding.
    floor : (outputs,) array
        Relative errors below this are rounding.
    """

    centred: Array
    mean: Array
    variance: Array
    floor: Array

    @classmethod
    def of(cls, y: Array, weights: Array) -> Outputs:
        """Return outputs, with weights (s,) of mean 1.

        Raises
        ------
        InputError
            If a value is not a finite number, or there are no samples.
        """
        if not len(y):
            raise InputError("there are no samples to fit")
        if not np.isfinite(y).all():
            bad = int(np.argmin(np.isfinite(y).all(axis=1)))
            raise InputError(f"the outcome of sample {bad} to fit is not a finite number: leave it out")
        mean = weights @ y / len(y)
        largest = np.abs(y).max(axis=0)
        constant = np.ptp(y, axis=0) <= 8 * _EPS * largest
        mean[constant] = y[0, constant]
        centred = np.where(constant, 0.0, y - mean)
        variance = weights @ np.square(centred) / max(len(y) - 1, 1)
        scale = np.where(constant, 1.0, variance)
        return cls(centred, mean, variance, np.square(1e3 * _EPS * largest) / scale + 1e-25)

    def one(self, column: int) -> Outputs:
        """Return one of the outputs."""
        only = slice(column, column + 1)
        return Outputs(self.centred[:, only], self.mean[only], self.variance[only], self.floor[only])


class Nested:
    """Least squares on every leading set of columns of one design matrix.

    Parameters
    ----------
    psi : (s, terms) array
        Design matrix.
    weights : (s,) array
        Weights of mean 1.

    Attributes
    ----------
    size : int
        Number of leading columns that can be fitted: fewer than samples, and not rank deficient.
    """

    def __init__(self, psi: Array, weights: Array) -> None:
        self._root = np.sqrt(weights)[:, None]
        usable = min(psi.shape[1], len(psi) - 1)
        self._q, r = np.linalg.qr(psi[:, :usable] * self._root)
        # Up to the first column that depends on those before it the triangle can be inverted.
        own, whole = np.abs(np.diag(r)), np.sqrt(np.square(r).sum(axis=0))
        bad = ~(own > whole / CONDITION_MAXIMUM)
        first = int(np.argmax(bad)) if bad.any() else usable
        self._r = r[:first, :first]
        inverse = solve_triangular(self._r, np.eye(first)) if first else np.empty((0, 0))
        self._trace = np.cumsum(np.square(inverse).sum(axis=0))
        condition = np.sqrt(np.cumsum(np.square(whole[:first])) * self._trace)
        # It never falls from one column to the next.
        self.size = int(np.searchsorted(condition, CONDITION_MAXIMUM, side="right"))

    def errors(self, outputs: Outputs, sizes: Sequence[int]) -> Array:
        """Return the relative corrected leave-one-out error of each number of leading columns.

        Parameters
        ----------
        outputs : Outputs
        sizes : sequence of int
            Numbers of leading columns, rising.

        Returns
        -------
        (sizes, outputs) array
            inf where there is none: too many columns, or a sample that alone decides a coefficient.
        """
        s = len(self._q)
        found = np.full((len(sizes), outputs.centred.shape[1]), np.inf)
        residual = outputs.centred * self._root
        left = np.ones(s)
        before = 0
        for i, size in enumerate(sizes):
            if size > self.size:
                break
            added = self._q[:, before:size]
            residual = residual - added @ (added.T @ residual)
            left = left - np.square(added).sum(axis=1)
            before = size
            if left.min() <= _LEVERAGE_GAP:
                break
            error = np.square(residual / left[:, None]).mean(axis=0)
            factor = s / (s - size) * (1 + self._trace[size - 1])
            found[i] = factor * error / np.where(outputs.variance > 0, outputs.variance, np.nan)
        return found

    def coefficients(self, outputs: Outputs, size: int) -> Array:
        """Return the coefficients (size, outputs) on a number of leading columns, the mean not added."""
        target = self._q[:, :size].T @ (outputs.centred * self._root)
        return np.asarray(solve_triangular(self._r[:size, :size], target))

    def condition(self, size: int) -> float:
        """Return the condition number of a number of leading columns."""
        return float(np.linalg.cond(self._r[:size, :size]))
