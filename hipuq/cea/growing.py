"""Exact eigenvalues about the threshold: those of ``l**2 + l D + A0 + mu A1`` as given in doubles.

The matrix A0 + mu A1 formed in doubles is already rounded, and near a boundary of an ill-conditioned
pencil that moves the boundary by more than the distance at which both its sides are proved. So the sum
is formed in integers, every double being an integer times a power of two, and the characteristic
polynomial of the state space is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hipuq.cea.bounds import Complex
from hipuq.cea.exact import integers
from hipuq.cea.pencils import Array


@dataclass(frozen=True)
class Sides:
    """Eigenvalues l of one pencil at one friction and on which side of the threshold they lie.

    Attributes
    ----------
    values : (2n,) complex array
        Enclosed eigenvalues, rounded [1/s]; exactly real for those proved real.
    right : int or None
        Number of eigenvalues proved to be right of the threshold; None if one could not be told.
    """

    values: Complex
    right: int | None


def exact_sides(constant: Array, slope: Array, damping: Array, threshold: float, friction: float) -> Sides:
    """Enclose all eigenvalues of a pencil by exact arithmetic, and prove their sides.

    Parameters
    ----------
    constant, slope : (n, n) array
        A0 and A1 [1/s^2], mechanisms taken out.
    damping : (n, n) array
        D [1/s].
    threshold : float
        g [1/s].
    friction : float
        mu [1].

    Returns
    -------
    Sides
    """
    polynomial, exponent = _polynomial(constant, slope, damping, threshold, friction)
    values, right, left = [], 0, 0
    for root, times in polynomial.complex_roots():
        values += [complex(float(root.real.mid()), float(root.imag.mid()))] * times
        right += times * bool(root.real > 0)
        left += times * bool(root.real < 0)
    rounded = np.ldexp(1.0, exponent) * np.array(values, np.complex128) + threshold
    return Sides(rounded, right if right + left == len(values) else None)


def _polynomial(
    constant: Array, slope: Array, damping: Array, threshold: float, friction: float
) -> tuple[Any, int]:
    """Return the polynomial whose roots are ``(l - g) / 2**exponent``, and the exponent."""
    from flint import fmpz_mat

    n = len(constant)
    parts, power = _stripped(np.stack([constant, slope]))
    (at,), shift = _stripped(np.array([friction]))
    up = max(0, -shift)
    stiffness = [
        (a << up) + (b * at << max(0, shift)) for a, b in zip(parts[: n * n], parts[n * n :], strict=True)
    ]
    power -= up
    drag, drag_power = _stripped(damping)
    (limit,), limit_power = _stripped(np.array([threshold]))
    # A unit of l in which D and g are whole, and A in its square.
    finest = [power // 2]
    if any(drag):
        finest.append(drag_power)
    if limit:
        finest.append(limit_power)
    exponent = min(finest)
    size = 2 * n
    entries = [0] * size**2
    for i in range(n):
        entries[i * size + n + i] = 1
        for j in range(n):
            row = (n + i) * size
            entries[row + j] = -stiffness[i * n + j] << (power - 2 * exponent)
            entries[row + n + j] = -drag[i * n + j] << max(0, drag_power - exponent)
    for i in range(size):
        entries[i * (size + 1)] -= limit << max(0, limit_power - exponent)
    return fmpz_mat(size, size, entries).charpoly(), exponent


def _stripped(values: Array) -> tuple[list[int], int]:
    """Return doubles as whole numbers over a common power of two that is as coarse as they allow."""
    whole, power = integers(values)
    spare = min(((abs(a) & -abs(a)).bit_length() - 1 for a in whole if a), default=0)
    return [a >> spare for a in whole], power + spare
