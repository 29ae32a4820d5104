"""Damping by one number: modal damping on the frictionless modes, and Rayleigh damping."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
        root = np.sqrt(mass[modal])
        weight = root[:, :, None] * root[:, None, :]
        reduced = stiffness[modal] / weight
    else:
        damping += alpha[:, None, None] * mass
        lower = np.linalg.cholesky(mass[modal])
        inverse = np.linalg.inv(lower)
        reduced = inverse @ stiffness[modal] @ inverse.transpose(0, 2, 1)
    squares, modes = np.linalg.eigh(reduced)
    # A mechanism's square is zero up to rounding; it stays undamped.
    squares[squares < 1e-12 * squares[:, -1:]] = 0.0
    factor = modes * np.sqrt(np.sqrt(squares))[:, None, :]
    if lower is not None:
        factor = lower @ factor
    damping[modal] += 2 * ratio[modal, None, None] * (factor @ factor.transpose(0, 2, 1)) * weight
    return damping
