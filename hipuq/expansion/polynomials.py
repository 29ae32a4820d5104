"""Orthonormal polynomials of one variable from their three-term recurrence.

Coefficients a and b are those of the monic polynomials, ``p[k+1](x) = (x - a[k]) p[k](x) - b[k] p[k-1](x)``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HIGHEST_DEGREE = 50
"""Highest degree of any polynomial."""


def orthonormal(x: Array, recurrences: Array) -> Array:
    """Return orthonormal polynomials by their three-term recurrence.

    Parameters
    ----------
    x : (d, s) array
        Points of d variables.
    recurrences : (d, 2, degree + 1) array
        Coefficients a and b of each; b is NaN for degrees that there are none of.

    Returns
    -------
    (d, degree + 1, s) array
        NaN for degrees that there are none of.
    """
    a, b = recurrences[:, 0], np.sqrt(recurrences[:, 1])
    d, terms = a.shape
    found = np.ones((d, terms, x.shape[1]))
    for k in range(terms - 1):
        found[:, k + 1] = (x - a[:, k, None]) * found[:, k]
        if k:
            found[:, k + 1] -= b[:, k, None] * found[:, k - 1]
        found[:, k + 1] /= b[:, k + 1, None]
    return found


def gauss(recurrence: Array) -> tuple[Array, Array]:
    """Return nodes and weights of a Gauss quadrature (Golub and Welsch, Math. Comput. 23 (1969) 221).

    Parameters
    ----------
    recurrence : (2, n + 1) array
        Coefficients a and b.

    Returns
    -------
    nodes, weights : (n,) array
        Exact for polynomials of degree 2 n - 1.
    """
    a, b = recurrence[:, :-1]
    beside = np.sqrt(b[1:])
    nodes = np.linalg.eigvalsh(np.diag(a) + np.diag(beside, 1) + np.diag(beside, -1))
    # The Christoffel numbers keep the digits that components of eigenvectors lose.
    values = orthonormal(nodes[None], recurrence[None, :, :-1])[0]
    return nodes, 1.0 / np.square(values).sum(axis=0)


def lanczos(atoms: Array, weight: Array) -> tuple[Array, int]:
    """Return the recurrence of a discrete measure, and the highest degree that it is good to.

    Parameters
    ----------
    atoms, weight : (n,) array
        Points between -1 and 1 and their probabilities.

    Returns
    -------
    recurrence : (2, largest + 1) array
        Coefficients a and b.
    largest : int
        n - 1, or less where there are so many that the recurrence loses orthogonality.
    """
    most = min(len(atoms) - 1, HIGHEST_DEGREE)
    found = np.zeros((2, most + 1))
    vectors = np.zeros((most + 1, len(atoms)))
    vectors[0] = np.sqrt(weight)
    found[1, 0] = 1.0
    for k in range(most + 1):
        found[0, k] = np.square(vectors[k]) @ atoms
        if k == most:
            break
        ahead = atoms * vectors[k]
        for _ in range(2):
            ahead -= vectors[: k + 1].T @ (vectors[: k + 1] @ ahead)
        length = np.linalg.norm(ahead)
        found[1, k + 1] = length**2
        if length == 0:
            break
        vectors[k + 1] = ahead / length
    with np.errstate(all="ignore"):
        values = orthonormal(atoms[None], found[None])[0]
        gram = np.abs((values * weight) @ values.T - np.eye(most + 1))
    good = [not gram[: k + 1, : k + 1].max() <= 1e-10 for k in range(most + 1)]
    largest = (good.index(True) if True in good else most + 1) - 1
    return found[:, : largest + 1], largest
