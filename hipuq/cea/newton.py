"""The friction and frequency at which an eigenvalue lies on a line, to the last digit of a double.

Newton's method for ``P(g + i omega, mu) x = 0``, ``c^H x = 1`` in x, omega and mu. The steps are solved for
in doubles, the residuals formed in whole numbers of 240 bits: iterative refinement, which wins some
digits with every step however ill-conditioned the crossing is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import Complex
from hipuq.cea.pencils import Array

BITS = 240
"""Bits behind the point of numbers near 1: doubles down to 1e-56 have all of theirs."""

STEPS = 60
"""Steps before it is given up."""

Whole = NDArray[Any]


@dataclass(frozen=True)
class Crossing:
    """An eigenvalue on the line.

    Attributes
    ----------
    friction : float
        mu [1].
    omega : float
        Its imaginary part, 0 for a real one [rad/s].
    """

    friction: float
    omega: float


def solve_crossing(
    constant: Array,
    slope: Array,
    damping: Array,
    threshold: float,
    omega: float,
    shape: Complex,
    friction: float,
) -> Crossing | None:
    """Solve for the crossing near an approximation.

    Parameters
    ----------
    constant, slope, damping : (n, n) array
        A0, A1 [1/s^2] and D [1/s].
    threshold : float
        g [1/s].
    omega : float
        Approximation, exactly 0 for a real eigenvalue [rad/s].
    shape : (n,) complex array
        Approximation of the eigenvector.
    friction : float
        Approximation [1].

    Returns
    -------
    Crossing or None
        None if the steps do not become small.
    """
    n = len(constant)
    rate = 2.0 ** round(np.log2(max(np.abs(constant).max(), np.finfo(np.float64).tiny)) / 2)
    matrices = [constant / rate**2, slope / rate**2, damping / rate]
    exact = [_whole(matrix) for matrix in matrices]
    shape = shape / np.linalg.norm(shape)
    g, (w, mu) = int(_whole(threshold / rate)), _whole(np.array([omega / rate, friction]))
    x, y = _whole(shape.real), _whole(shape.imag)
    for _ in range(STEPS):
        at, vector = complex(_double(g), _double(w)), _double(x) + 1j * _double(y)
        pencil = at**2 * np.eye(n) + at * matrices[2] + matrices[0] + _double(mu) * matrices[1]
        columns = np.stack([1j * (2 * at * vector + matrices[2] @ vector), matrices[1] @ vector])
        p, q = _residual(exact, g, w, mu, x, y)
        system = np.zeros((2 * n + 2, 2 * n + 2))
        system[:n, :n], system[:n, n : 2 * n] = pencil.real, -pencil.imag
        system[n : 2 * n, :n], system[n : 2 * n, n : 2 * n] = pencil.imag, pencil.real
        system[:n, 2 * n :], system[n : 2 * n, 2 * n :] = columns.real.T, columns.imag.T
        system[2 * n, : 2 * n] = np.concatenate([shape.real, shape.imag])
        system[2 * n + 1, : 2 * n] = np.concatenate([-shape.imag, shape.real])
        short = 1 - np.vdot(shape, vector)
        given = np.concatenate([_double(-p), _double(-q), [short.real, short.imag]])
        try:
            step = np.linalg.solve(system, given)
        except np.linalg.LinAlgError:
            return None
        if not (np.abs(step) < 1e3).all():
            return None
        change = _whole(step)
        x, y, w, mu = x + change[:n], y + change[n : 2 * n], w + change[2 * n], mu + change[2 * n + 1]
        if abs(step[-1]) <= 1e-18 * abs(_double(mu)) and abs(step[-2]) <= 1e-18 * max(abs(_double(w)), 1e-3):
            if omega == 0 and abs(_double(w)) > 1e-12:
                return None
            return Crossing(float(_double(mu)), abs(float(_double(w))) * rate if omega > 0 else 0.0)
    return None


def _residual(exact: list[Whole], g: int, w: int, mu: int, x: Whole, y: Whole) -> tuple[Whole, Whole]:
    """Return the real and imaginary parts of ``(l**2 + l D + A0 + mu A1)(x + i y)``."""
    constant, slope, damping = exact

    def times(p: Whole, q: Whole) -> tuple[Whole, Whole]:
        return (g * p - w * q) >> BITS, (g * q + w * p) >> BITS

    lx, ly = times(x, y)
    # l (l x + D x) + A0 x + mu A1 x
    p, q = times(lx + (damping @ x >> BITS), ly + (damping @ y >> BITS))
    p = p + (constant @ x >> BITS) + (mu * (slope @ x >> BITS) >> BITS)
    q = q + (constant @ y >> BITS) + (mu * (slope @ y >> BITS) >> BITS)
    return p, q


def _whole(numbers: Any) -> Any:
    """Return numbers as integers times 2**-BITS, rounded towards zero."""
    scaled = np.ldexp(numbers, BITS)
    if np.ndim(scaled) == 0:
        return int(scaled)
    return np.array([int(value) for value in scaled.ravel()], dtype=object).reshape(scaled.shape)


def _double(whole: Any) -> Any:
    """Return integers times 2**-BITS as doubles."""
    if isinstance(whole, int):
        return float(np.ldexp(float(whole), -BITS))
    return np.ldexp(np.array(whole, dtype=np.float64), -BITS)
