"""Polynomial chaos as a user of NumPy, or of chaospy, writes it: what the benchmarks compare with."""

from __future__ import annotations

import chaospy as cp
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POINTS = 2**16
"""Points at which the surrogate is evaluated for its quantiles and its probability."""

BLOCK = 512
"""Points at a time: of 512 to 4,096 about the fastest."""


def legendre(x: Array) -> Array:
    """Return the orthonormal Legendre polynomials up to degree 2 of inputs in (-1, 1), (s, terms)."""
    d, size = x.shape[1], len(x)
    x = np.ascontiguousarray(x.T)
    terms = np.empty(((d + 1) * (d + 2) // 2, size))
    terms[0] = 1.0
    np.multiply(x, np.sqrt(3.0), out=terms[1 : d + 1])
    terms[d + 1 : 2 * d + 1] = np.sqrt(5.0) * (1.5 * x * x - 0.5)
    at = 2 * d + 1
    for i in range(d - 1):
        np.multiply(3.0 * x[i], x[i + 1 :], out=terms[at : at + d - 1 - i])
        at += d - 1 - i
    return terms.T


def chaos(x: Array, y: Array, held_out: tuple[Array, Array], members: list[list[int]]) -> dict[str, Array]:
    """Fit by least squares and tell the same as an analysis of hipuq.

    Parameters
    ----------
    x : (s, d) array
        Inputs, uniform in (-1, 1).
    y : (s,) array
        The outcome.
    held_out : (h, d) and (h,) array
        Samples to check the fit.
    members : list of list of int
        Columns that belong to each parameter.

    Returns
    -------
    dict of array
        ``mean``, ``variance``, ``S1``, ``ST``, ``loo``, ``q2``, ``quantiles``, ``probability``.
    """
    basis = legendre(x)
    q, r = np.linalg.qr(basis)
    coefficients = np.linalg.solve(r, q.T @ y)
    left_out = (y - basis @ coefficients) / (1.0 - np.square(q).sum(axis=1))
    power = np.square(coefficients[1:])
    variance = power.sum()
    d = x.shape[1]
    i, j = np.triu_indices(d, 1)
    owner = np.empty(d, int)
    for number, columns in enumerate(members):
        owner[columns] = number
    first, second = owner[np.r_[:d, :d, i]], owner[np.r_[:d, :d, j]]
    takes = [(first == k) | (second == k) for k in range(len(members))]
    alone = [(first == k) & (second == k) for k in range(len(members))]
    rng = np.random.default_rng(0)
    surrogate = np.concatenate(
        [legendre(rng.uniform(-1, 1, (BLOCK, d))) @ coefficients for _ in range(POINTS // BLOCK)]
    )
    points, truth = held_out
    return {
        "mean": coefficients[0],
        "variance": variance,
        "S1": np.array([power[mask].sum() for mask in alone]) / variance,
        "ST": np.array([power[mask].sum() for mask in takes]) / variance,
        "loo": np.square(left_out).mean() / y.var(),
        "q2": 1.0 - np.square(truth - legendre(points) @ coefficients).mean() / truth.var(),
        "quantiles": np.quantile(surrogate, [0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99]),
        "probability": (surrogate < 0).mean(),
    }


def chaospy_fit(x: Array, y: Array) -> dict[str, Array]:
    """Expand and fit with chaospy; mean and variance from the coefficients of the orthonormal terms."""
    joint = cp.Iid(cp.Uniform(-1, 1), x.shape[1])
    expansion = cp.generate_expansion(2, joint, normed=True)
    _, coefficients = cp.fit_regression(expansion, x.T, y, retall=1)
    return {"mean": coefficients[0], "variance": np.square(coefficients[1:]).sum()}
