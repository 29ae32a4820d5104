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
from hipuq.cea.eigenvalues import eigenvalues
from hipuq.cea.exact import integers, log2, scaled, stripped, whole
from hipuq.cea.pencils import Array

FINER = 60
"""Bits behind the unit in which the entries are whole, for the roots."""

STEPS = 10
"""Most steps of Newton's method for a root."""

ENOUGH = 40
"""Bits to which the last step agrees with the one before: it squares errors."""


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
    start = _approximations(constant + friction * slope, damping) - threshold
    centres, told = _discs(polynomial, exponent, start)
    if told:
        return Sides(centres + threshold, int((centres.real > 0).sum()))
    values, right, left = [], 0, 0
    for root, times in polynomial.complex_roots():
        values += [complex(float(root.real.mid()), float(root.imag.mid()))] * times
        right += times * bool(root.real > 0)
        left += times * bool(root.real < 0)
    rounded = np.ldexp(1.0, exponent) * np.array(values, np.complex128) + threshold
    return Sides(rounded, right if right + left == len(values) else None)


def _approximations(stiffness: Array, damping: Array) -> Complex:
    """Return approximate eigenvalues l of one pencil, (2n,) [1/s]."""
    n = len(stiffness)
    size = np.sqrt(max(float(np.linalg.norm(stiffness)), np.finfo(np.float64).tiny))
    rate = 2.0 ** np.round(np.log2(size))
    states = np.zeros((2 * n, 2 * n))
    states[:n, n:] = np.eye(n)
    states[n:, :n], states[n:, n:] = -stiffness / rate**2, -damping / rate
    return np.asarray(eigenvalues(states[None])[0] * rate, np.complex128)


def _discs(polynomial: Any, exponent: int, start: Complex) -> tuple[Complex, bool]:
    """Return roots near approximations, and whether discs about them prove their sides and which are real.

    Smith's discs, as in `hipuq.cea.certificate`.

    Parameters
    ----------
    polynomial : fmpz_poly
    exponent : int
        Its roots are those of the pencil over 2**exponent.
    start : (2n,) complex array
        Approximations; pairs are exact conjugates.

    Returns
    -------
    values : (2n,) complex array
    told : bool
    """
    from flint import fmpz_poly

    size = len(start)
    p = fmpz_poly([c << FINER * (size - k) for k, c in enumerate(polynomial.coeffs())])
    unit = exponent - FINER
    slope = p.derivative()
    upper = start[start.imag >= 0]
    found, moduli = [], []
    for z in upper.tolist():
        x, y = whole(z.real, unit), whole(z.imag, unit)
        for _ in range(STEPS):
            (a, b), (c, d) = _at(p, x, y), _at(slope, x, y)
            square = c * c + d * d
            if not square:
                break
            right, up = (a * c + b * d) // square, (b * c - a * d) // square
            x, y = x - right, y - up
            if max(abs(right), abs(up)) <= max(abs(x), abs(y)) >> ENOUGH:
                break
        z = complex(scaled(x, unit), scaled(y, unit))
        found.append(z)
        # Doubles, so that distances between them are as good as doubles too.
        a, b = _at(p, whole(z.real, unit), whole(z.imag, unit))
        moduli.append(log2(a * a + b * b) / 2)
    above = np.array(found)
    pair = above.imag > 0
    values = np.concatenate([above, above[pair].conj()])
    if len(values) != size:
        return start, False
    gaps = np.abs(values[:, None] - values)
    np.fill_diagonal(gaps, 1.0)
    height = np.concatenate([np.array(moduli), np.array(moduli)[pair]])
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        lead = log2(int(p[size])) - size * unit
        radius = (1 + 1e-9) * size * np.exp2(height - lead - np.log2(gaps).sum(axis=1))
    np.fill_diagonal(gaps, np.inf)
    alone = (gaps > radius[:, None] + radius).all(axis=1)
    told = (np.abs(values.real) > radius) & np.where(values.imag == 0, alone, np.abs(values.imag) > radius)
    return values, bool(told.all())


def _at(p: Any, x: int, y: int) -> tuple[int, int]:
    """Return p(x + i y), from the remainder by the factor of x + i y and its conjugate, in two parts."""
    from flint import fmpz_poly

    if y == 0:
        return int(p(x)), 0
    rest = p % fmpz_poly([x * x + y * y, -2 * x, 1])
    return int(rest[1]) * x + int(rest[0]), int(rest[1]) * y


def _polynomial(
    constant: Array, slope: Array, damping: Array, threshold: float, friction: float
) -> tuple[Any, int]:
    """Return the polynomial whose roots are ``(l - g) / 2**exponent``, and the exponent."""
    from flint import fmpz_mat, fmpz_poly

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
    beyond = limit << max(0, limit_power - exponent)
    if not any(drag):
        # That of A in w = -l**2, of half the size.
        square = [a << (power - 2 * exponent) for a in stiffness]
        return fmpz_mat(n, n, square).charpoly()(-(fmpz_poly([beyond, 1]) ** 2)), exponent
    size = 2 * n
    entries = [0] * size**2
    for i in range(n):
        entries[i * size + n + i] = 1
        for j in range(n):
            row = (n + i) * size
            entries[row + j] = -stiffness[i * n + j] << (power - 2 * exponent)
            entries[row + n + j] = -drag[i * n + j] << max(0, drag_power - exponent)
    for i in range(size):
        entries[i * (size + 1)] -= beyond
    return fmpz_mat(size, size, entries).charpoly(), exponent


def _stripped(values: Array) -> tuple[list[int], int]:
    """Return doubles as whole numbers over a common power of two that is as coarse as they allow."""
    whole, power = integers(values)
    short, spare = stripped(whole)
    return short, power + spare
