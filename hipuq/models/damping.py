"""Damping by one number: modal damping on the frictionless modes, and Rayleigh damping."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq.errors import InputError

Array = NDArray[np.float64]

SOFTEST = 1e-12
"""Square of a frequency, relative to the largest, below which it is that of a mechanism, up to rounding."""

DAMPING = ("damping_ratio", "mass_damping", "stiffness_damping")
"""Parameters that make a sample damped where they are not zero."""


def damping_matrices(mass: Array, stiffness: Array, values: Mapping[str, Array]) -> Array | None:
    """Return the damping matrices, None if no sample has any; (s, n, n).

    Modal damping on the frictionless modes, ``C = 2 z L S L^T`` with ``M = L L^T`` and S the root of
    ``L^-1 K0 L^-T``, and Rayleigh damping ``a M + b K0``.

    Parameters
    ----------
    mass : (s, n) or (s, n, n) array
        Masses of a diagonal M, or M [kg].
    stiffness : (s, n, n) array
        K0, symmetric where there is modal damping [N/m].
    values : mapping
        z [1], a [1/s] and b [s] by their names in `DAMPING`, each (s,); one that is missing is zero.

    Raises
    ------
    InputError
        If a mass is not positive definite where there is modal damping.
    """
    none = np.zeros(len(stiffness))
    ratio, alpha, beta = (values.get(name, none) for name in DAMPING)
    if not (ratio.any() or alpha.any() or beta.any()):
        return None
    damping: Array = beta[:, None, None] * stiffness
    modal = np.flatnonzero(ratio)
    lower: Any = None
    weight: Array | float = 1.0
    if mass.ndim == 2:
        diagonal = np.arange(mass.shape[1])
        damping[:, diagonal, diagonal] += alpha[:, None] * mass
        wrong = (mass[modal] <= 0).any(axis=1)
        if wrong.any():
            bad = int(modal[np.argmax(wrong)])
            raise InputError(f"mass must be positive, it is {mass[bad].min()} in sample {bad}")
        root = np.sqrt(mass[modal])
        weight = root[:, :, None] * root[:, None, :]
        reduced = stiffness[modal] / weight
    else:
        damping += alpha[:, None, None] * mass
        try:
            lower = np.linalg.cholesky(mass[modal])
        except np.linalg.LinAlgError as error:
            raise InputError("mass matrix is not positive definite") from error
        inverse = np.linalg.inv(lower)
        reduced = inverse @ stiffness[modal] @ inverse.transpose(0, 2, 1)
    squares, modes = np.linalg.eigh(reduced)
    # A mechanism stays undamped.
    squares[squares < SOFTEST * squares[:, -1:]] = 0.0
    factor = modes * np.sqrt(np.sqrt(squares))[:, None, :]
    if lower is not None:
        factor = lower @ factor
    damping[modal] += 2 * ratio[modal, None, None] * (factor @ factor.transpose(0, 2, 1)) * weight
    return damping


def damping_derivative(
    mass: Array, stiffness: Array, of_mass: Array, of_stiffness: Array, values: Mapping[str, Array]
) -> Array:
    """Return the derivative of the damping matrix of one sample where mass and stiffness change, (n, n).

    ``C = 2 z M X + a M + b K0`` with X the root of ``M^-1 K0``. In the frictionless modes, of squared
    frequencies w_i, the derivative of X is that of ``M^-1 K0``, times 1 / (root of w_i + root of w_j) (N. J.
    Higham, Functions of Matrices, SIAM 2008, chapter 3).

    Parameters
    ----------
    mass : (n,) or (n, n) array
        Masses of a diagonal M, or M [kg].
    stiffness : (n, n) array
        K0, symmetric where there is modal damping [N/m].
    of_mass : (n,) or (n, n) array
        Derivative of M, in its form [kg per unit].
    of_stiffness : (n, n) array
        Derivative of K0, symmetric where there is modal damping [N/m per unit].
    values : mapping
        As for `damping_matrices`, each (1,).
    """
    ratio, alpha, beta = (float(values[name][0]) if name in values else 0.0 for name in DAMPING)
    mass, of_mass = (np.diag(one) if one.ndim == 1 else one for one in (mass, of_mass))
    changed: Array = alpha * of_mass + beta * of_stiffness
    if ratio == 0:
        return changed
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    squares, modes = np.linalg.eigh(inverse @ stiffness @ inverse.T)
    modes = inverse.T @ modes
    resisted = squares >= SOFTEST * squares[-1]
    roots = np.sqrt(np.where(resisted, squares, 0.0))
    sums = roots[:, None] + roots
    # Beside a mode that stays undamped it is the root of the other, over the difference of the squares.
    apart = np.where(resisted[:, None] & resisted, sums**2, np.abs(squares[:, None] - squares))
    slopes = np.divide(sums, apart, out=np.zeros_like(sums), where=sums > 0)
    turned = modes.T @ of_stiffness @ modes - modes.T @ of_mass @ modes * squares
    weighted = mass @ modes
    root = modes * roots @ weighted.T
    changed += 2 * ratio * (of_mass @ root + weighted @ (slopes * turned) @ weighted.T)
    return changed
