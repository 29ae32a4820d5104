"""Coefficients of an expansion from samples: least squares, sparse regression, projection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hipuq.errors import InputError
from hipuq.expansion.angles import Angles, Path
from hipuq.expansion.nested import Nested, Outputs

Array = NDArray[np.float64]
Sizes = Sequence[tuple[int, int]]

# Terms of a sparse fit that are tried first.
_FIRST_TERMS = 32


@dataclass(frozen=True)
class Fit:
    """Coefficients of several outputs on the same terms.

    Attributes
    ----------
    coefficients : (terms, outputs) array
        0 for terms that are not used.
    loo : (outputs,) array
        Relative corrected leave-one-out error; NaN for a constant output and for projections.
    degree : (outputs,) array of int
        Degree of the candidate that was taken, 0 for a constant.
    terms : (outputs,) array of int
        Number of terms used.
    condition : float
        Condition number of the largest design matrix used.
    """

    coefficients: Array
    loo: Array
    degree: NDArray[np.int64]
    terms: NDArray[np.int64]
    condition: float


def least_squares(psi: Array, y: Array, sizes: Sizes, weights: Array | None = None) -> Fit:
    """Return the least-squares fit whose degree has the least corrected leave-one-out error.

    Parameters
    ----------
    psi : (s, terms) array
        Terms at the samples, by rising degree, the first of them 1.
    y : (s, outputs) array
        Outcomes; each takes its own degree.
    sizes : sequence of (int, int)
        Candidates: number of leading terms, and the degree that they are.
    weights : (s,) array, optional
        Weights of the samples, such as those of quadrature nodes.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        If an outcome is missing, there are too few samples for every candidate, or the design matrix
        of every candidate is rank deficient.
    """
    share = _weights(psi, y, weights)
    outputs = Outputs.of(y, share)
    candidates = _candidates(sizes, psi.shape[1])
    if len(psi) <= candidates[0][0]:
        raise _no_candidate(len(psi), candidates[0][0], 0)
    nested = Nested(psi[:, : candidates[-1][0]], share)
    errors = nested.errors(outputs, [size for size, _ in candidates])
    best = np.argmin(np.maximum(errors, outputs.floor), axis=0)
    varies = outputs.variance > 0
    if varies.any() and not np.isfinite(errors[best, np.arange(y.shape[1])][varies]).all():
        raise _no_candidate(len(psi), candidates[0][0], nested.size)
    fit = _constant(psi, outputs)
    largest = 1
    for i in np.unique(best[varies]):
        columns = np.flatnonzero(varies & (best == i))
        size, degree = candidates[i]
        largest = max(largest, size)
        own = nested.coefficients(outputs, size)[:, columns]
        fit.coefficients[:size, columns] += own
        fit.loo[columns], fit.degree[columns], fit.terms[columns] = errors[i, columns], degree, size
    return replace(fit, condition=nested.condition(largest) if varies.any() else 1.0)


def sparse(psi: Array, y: Array, sizes: Sizes) -> Fit:
    """Return the fit on few terms, found by hybrid least-angle regression.

    The regression gives the order in which terms enter; of the least-squares fits on the first of them
    that with the least corrected leave-one-out error is taken (Blatman and Sudret, J. Comput. Phys. 230
    (2011) 2345). Candidates are tried from the lowest degree until the error has lain above the least one
    twice in a row. As terms are chosen from the same samples, a few too many may be taken and the error is
    on the low side: judge by samples held out.

    Parameters
    ----------
    psi, y, sizes
        As of `least_squares`; there may be more terms than samples.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        If an outcome is missing, or there are fewer than two samples.
    """
    outputs = Outputs.of(y, np.ones(len(psi)))
    candidates = _candidates(sizes, psi.shape[1])
    if len(psi) < 2:
        raise _no_candidate(len(psi), 1, 0)
    fit = _constant(psi, outputs)
    angles = Angles(psi[:, : candidates[-1][0]])
    condition = 1.0
    for column in np.flatnonzero(outputs.variance > 0):
        own = outputs.one(int(column))
        best, rises = np.inf, 0
        for size, degree in candidates:
            path = angles.path(own.centred[:, 0], size)
            order, nested, error = _best_on(path, psi, own, size)
            compared = max(error, float(own.floor[0]))
            if compared < best * (1 - 1e-9):
                best, rises = compared, 0
                kept = order, nested, error, degree if len(order) > 1 else 0
            elif compared > best * (1 + 1e-9):
                rises += 1
            if rises == 2:
                break
        order, nested, error, degree = kept
        fit.coefficients[order, column] += nested.coefficients(own, len(order))[:, 0]
        fit.loo[column], fit.degree[column], fit.terms[column] = error, degree, len(order)
        condition = max(condition, nested.condition(len(order)))
    return replace(fit, condition=condition)


def _best_on(path: Path, psi: Array, own: Outputs, size: int) -> tuple[NDArray[np.intp], Nested, float]:
    """Return the terms of the best fit to one output along a path, all its fits, and its error.

    The path is followed to twice as many terms until its best fit lies in the first half.
    """
    most = min(size, len(psi) - 1)
    count = min(_FIRST_TERMS, most)
    while True:
        order = path.first(count)
        nested = Nested(psi[:, order], np.ones(len(psi)))
        errors = nested.errors(own, range(1, len(order) + 1))[:, 0]
        best = int(np.argmin(np.maximum(errors, own.floor[0]))) + 1
        if 2 * best < len(order) or len(order) < count or count == most:
            return order[:best], nested, float(errors[best - 1])
        count = min(2 * count, most)


def project(psi: Array, y: Array, weights: Array, *, degree: int = -1) -> Fit:
    """Return the projection on every term by quadrature: ``psi^T (w y)``.

    Where nodes are missing, terms are no longer orthonormal for the nodes that are left: the fit is
    then by least squares with their weights, which is the same on a full grid.

    Parameters
    ----------
    psi : (s, terms) array
        Terms at the nodes, of a degree that the quadrature integrates the squares of.
    y : (s, outputs) array
    weights : (s,) array
        Weights of the nodes.
    degree : int
        Degree of the terms, to be told in the fit; -1 if it is not known.

    Returns
    -------
    Fit
        Its errors are NaN: nodes are no random samples.

    Raises
    ------
    InputError
        If an outcome is missing, or too many nodes are.
    """
    terms = psi.shape[1]
    if np.abs(weights @ np.square(psi) - 1).max() > 1e-8:
        fit = least_squares(psi, y, [(terms, degree)], weights)
        return replace(fit, loo=np.full_like(fit.loo, np.nan))
    outputs = Outputs.of(y, _weights(psi, y, weights))
    fit = _constant(psi, outputs)
    varies = outputs.variance > 0
    added = psi.T @ (weights[:, None] * outputs.centred[:, varies])
    fit.coefficients[:, varies] += added
    fit.degree[varies], fit.terms[varies] = degree, terms
    return fit


def _weights(psi: Array, y: Array, weights: Array | None) -> Array:
    """Return weights of mean 1; check shapes."""
    if y.ndim != 2 or len(y) != len(psi):
        raise InputError(f"outcomes have the shape {y.shape}: {len(psi)} samples of outputs are needed")
    if weights is None:
        return np.ones(len(psi))
    if weights.shape != (len(psi),) or not (weights >= 0).all() or not 0 < weights.sum() < np.inf:
        raise InputError("weights must be one number for each sample, not negative and not all 0")
    return np.asarray(weights / weights.mean())


def _candidates(sizes: Sizes, terms: int) -> list[tuple[int, int]]:
    """Return the candidates by rising size; of the same size the lowest degree."""
    lowest = {size: degree for size, degree in sorted(sizes, reverse=True) if 1 <= size <= terms}
    if not lowest:
        raise InputError(f"sizes are {list(sizes)}: they need a number of terms from 1 to {terms}")
    return sorted(lowest.items())


def _constant(psi: Array, outputs: Outputs) -> Fit:
    """Return the fit by the mean alone."""
    terms, count = psi.shape[1], len(outputs.mean)
    coefficients = np.zeros((terms, count))
    coefficients[0] = outputs.mean
    return Fit(coefficients, np.full(count, np.nan), np.zeros(count, np.int64), np.ones(count, np.int64), 1.0)


def _no_candidate(samples: int, terms: int, usable: int) -> InputError:
    if samples <= terms:
        return InputError(
            f"{samples} samples are too few for {terms} terms: at least {terms + 1} are needed and "
            f"{2 * terms} are better; or take a lower degree, q below 1, interaction=2 or a sparse fit"
        )
    if usable < terms:
        return InputError(
            f"{samples} samples cannot tell {terms} terms apart, only {usable}: do all inputs vary in them, "
            "each by itself? Take more samples or a lower degree"
        )
    return InputError(
        f"of {samples} samples some decide a term of {terms} alone: take more samples or a lower degree"
    )
