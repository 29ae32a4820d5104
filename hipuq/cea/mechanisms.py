"""Mechanisms taken out of damped pencils, for every friction at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import EPS, norms
from hipuq.cea.pencils import Array
from hipuq.errors import InputError


def without_mechanisms(
    rows: NDArray[np.intp], constant: Array, slope: Array, damping: Array, m: int
) -> tuple[Array, Array, Array]:
    """Return A0, A1 and D on the complement of the mechanisms.

    As for a single friction: with V a basis of the common null space of A0 and A1 and Q of its complement
    the eigenvalues other than 0 of A are those of ``Q^T A Q``, and the same holds for D if it maps the
    null space into itself; the mechanisms then rest or decay.

    Parameters
    ----------
    rows : (s,) array of int
        Numbers of the samples, to name one.
    constant, slope : (s, n, n) array
        A0 and A1 [1/s^2].
    damping : (s, n, n) array
        D [1/s].
    m : int
        Dimension of the null space.

    Returns
    -------
    constant, slope, damping : (s, n - m, n - m) array

    Raises
    ------
    InputError
        If a sample has no such mechanisms, or damping couples them to the rest or makes them grow.
    """
    if m == 0:
        return constant, slope, damping
    n = constant.shape[1]
    _, singular, right = np.linalg.svd(np.concatenate([constant, slope], axis=1))
    null, rest = right[:, n - m :], right[:, : n - m]
    dragged = damping @ null.transpose(0, 2, 1)
    own = null @ dragged
    rounding = 10 * n * EPS
    largest = norms(damping)
    taken = singular[:, n - m] <= rounding * singular[:, 0]
    taken &= norms(dragged - null.transpose(0, 2, 1) @ own) <= 1e3 * rounding * largest
    taken &= np.linalg.eigvalsh(own)[:, 0] >= -1e3 * rounding * largest
    if not taken.all():
        bad = int(rows[np.argmin(taken)])
        raise InputError(f"sample {bad} does not have the {m} mechanisms that were declared")
    across = rest.transpose(0, 2, 1)
    return rest @ constant @ across, rest @ slope @ across, rest @ damping @ across
