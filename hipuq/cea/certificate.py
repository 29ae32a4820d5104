"""Verdicts that are proved: exact integer arithmetic on the matrix as it is given in doubles.

Every double is an integer times a power of two, so the characteristic polynomial of a matrix of
doubles is exact in integers. Approximate eigenvalues, however they were found, then get rigorous
discs: with p monic of degree n, all its roots lie in the discs about the z_i of radius
``n |p(z_i)| / prod |z_i - z_j|``, and a group of k discs that touches no other holds exactly k of
them (B. T. Smith, J. ACM 17 (1970) 661). Where those discs do not settle it, the roots are isolated
from the polynomial itself, multiple ones included.

What is proved is the verdict on the matrix A = M^(-1/2) K M^(-1/2) as rounded to doubles, mechanisms
apart; in damped problems that on the pencil of A and D, which the mechanisms have been projected out
of in double precision. Of a model's declared mechanisms it is proved
that exactly so many roots lie within the rounding of the entries about zero. It is not proved that
those entries are the right physics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import EPS, SAFETY, ZERO, Complex
from hipuq.cea.exact import integers, scaled, whole
from hipuq.cea.pencils import Array

Mask = NDArray[np.bool_]

# Discs are computed in doubles from exact values of p; this covers the rounding of that many times.
_OUTWARDS = 1.0 + 1e-9


@dataclass(frozen=True)
class Certified:
    """Roots of one matrix with what is proved of them.

    Attributes
    ----------
    values : (n,) complex array
        Centres of the enclosures; exactly real for roots proved real.
    known : (n,) array of bool
        Whether the verdict on the root is proved.
    """

    values: Complex
    known: Mask


def certify_undamped(stiffness: Array, start: Complex, mechanisms: int) -> Certified:
    """Prove which eigenvalues w of a matrix are real, and the signs of the real ones.

    Parameters
    ----------
    stiffness : (n, n) array
        A [1/s^2].
    start : (n,) complex array
        Approximations; good ones make it quick, bad ones do no harm.
    mechanisms : int
        Number of zero eigenvalues by construction.

    Returns
    -------
    Certified
        Roots inside the bound of the entries' rounding about zero are exactly 0: the declared
        mechanisms, and any more of them. If there are fewer than declared nothing is known.
    """
    polynomial, exponent = _characteristic_polynomial(stiffness)
    values = certify_polynomial(polynomial, exponent, start, mechanisms, _norm(stiffness))
    if values is None:
        return Certified(np.asarray(start, np.complex128), np.zeros(len(start), bool))
    return Certified(values, np.ones(len(start), bool))


def certify_polynomial(
    polynomial: Any, exponent: int, start: Complex, mechanisms: int, norm: float
) -> Complex | None:
    """Prove which roots of a polynomial are real, and the signs of the real ones.

    Parameters
    ----------
    polynomial : fmpz_poly
        An integer multiple of the characteristic polynomial in w / 2**exponent.
    exponent : int
    start : (n,) complex array
        Approximations of the w.
    mechanisms : int
        Number of zero roots by construction.
    norm : float
        Of the matrix: roots within SAFETY * EPS times it are zero, declared ones within ZERO times it.

    Returns
    -------
    (n,) complex array or None
        The roots, real and zero ones exactly so; None if that cannot be proved.
    """
    centres, radius = _discs(polynomial, exponent, _distinct(start, mechanisms, SAFETY * EPS * norm))
    values = _proved(centres, radius, norm, mechanisms)
    if values is None:
        centres, radius, multiplicity = _isolated(polynomial, exponent)
        values = _proved(centres, radius, norm, mechanisms, multiplicity)
    return values


def _proved(
    centres: Complex,
    radius: Array,
    norm: float,
    mechanisms: int,
    multiplicity: NDArray[np.intp] | None = None,
) -> Complex | None:
    """Return the roots, real and zero ones exactly so, if the discs prove what each is.

    Parameters
    ----------
    centres, radius : (k,) array
        Discs: each holds one root if it touches no other, or `multiplicity` equal ones.
    norm : float
        Of the matrix.
    mechanisms : int
    multiplicity : (k,) array of int, optional
        1 by default.
    """
    count = np.ones(len(centres), np.intp) if multiplicity is None else multiplicity
    zero = SAFETY * EPS * norm
    inside = np.abs(centres) + radius <= zero
    if count[inside].sum() < mechanisms:
        # The declaration is believed as far as ZERO, but then no more than it says.
        zero = ZERO * norm
        inside = np.abs(centres) + radius <= zero
        if count[inside].sum() != mechanisms:
            return None
    gaps = np.abs(centres[:, None] - centres[None, :])
    touching = gaps <= radius[:, None] + radius[None, :]
    np.fill_diagonal(touching, False)
    # Inside the bound about zero it does not matter which disc holds which root.
    touching &= ~(inside[:, None] & inside[None, :])
    if multiplicity is not None:
        # Isolated roots are apart by proof, though doubles may not tell.
        touching[...] = False
    real = centres.imag == 0
    off_axis = (np.abs(centres.imag) > radius) if multiplicity is None else ~real
    clear = inside | np.where(real, np.abs(centres) - radius > zero, off_axis)
    if touching.any() or not clear.all():
        return None
    return np.repeat(np.where(inside, 0.0, centres), count)


def certify_damped(stiffness: Array, damping: Array, threshold: float, values: Complex) -> Mask:
    """Prove on which side of the threshold eigenvalues l lie.

    The companion matrix of ``(l + g)**2 + (l + g) D + A`` has the roots l - g: those right of the
    imaginary axis grow faster than g.

    Parameters
    ----------
    stiffness : (n, n) array
        A [1/s^2], mechanisms taken out.
    damping : (n, n) array
        D [1/s].
    threshold : float
        g [1/s].
    values : (2n,) complex array
        Approximations of all eigenvalues l.

    Returns
    -------
    (2n,) array of bool
        Whether the side of each is proved to be the one that its approximation is on.
    """
    n = len(stiffness)
    size = math.sqrt(_norm(stiffness)) or _norm(damping) or 1.0
    scale = 2.0 ** math.frexp(size)[1]
    companion = np.zeros((2 * n, 2 * n))
    companion[:n, n:] = np.eye(n)
    companion[n:, :n] = -stiffness / scale**2
    companion[n:, n:] = -damping / scale
    polynomial, exponent = _characteristic_polynomial(companion, shift=-threshold / scale)
    start = _distinct(values / scale - threshold / scale, 0, 0.0)
    centres, radius = _discs(polynomial, exponent, start)
    clear = np.abs(centres.real) > radius
    if clear.all():
        same: Mask = np.sign(centres.real) == np.sign(values.real - threshold)
        return same
    roots = polynomial.complex_roots()
    right = sum(count for root, count in roots if root.real > 0)
    left = sum(count for root, count in roots if root.real < 0)
    # Sides are counts; they belong to the approximations if those have the same counts.
    claimed = int((values.real > threshold).sum())
    proved = right == claimed and left == 2 * n - claimed
    return np.full(2 * n, proved)


def _characteristic_polynomial(matrix: Array, shift: float = 0.0) -> tuple[Any, int]:
    """Return the exact characteristic polynomial of (matrix + shift) / 2**exponent, and the exponent."""
    from flint import fmpz_mat

    n = len(matrix)
    entries, lowest = integers(np.append(matrix.ravel(), shift))
    for i in range(n):
        entries[i * (n + 1)] += entries[-1]
    return fmpz_mat(n, n, entries[:-1]).charpoly(), lowest


def _norm(matrix: Array) -> float:
    """Return the Frobenius norm, also where squares of the entries are out of range."""
    largest = float(np.abs(matrix).max())
    return largest * float(np.linalg.norm(matrix / largest)) if largest > 0 else 0.0


def _distinct(values: Complex, mechanisms: int, zero: float) -> Complex:
    """Return approximations that all differ: mechanisms spread about zero, equal ones moved apart."""
    spread = values.copy()
    small = np.argsort(np.abs(spread), kind="stable")[:mechanisms]
    # Radii of their discs are about n times this.
    apart = zero / (2 * len(values) + 2)
    spread[small] = apart * np.exp(2j * np.pi * np.arange(mechanisms) / max(mechanisms, 1))
    scale = np.abs(spread).max(initial=1e-300)
    order = np.lexsort((spread.imag, spread.real))
    for a, b in pairwise(order):
        if spread[a] == spread[b]:
            spread[b] += 1e-12 * scale
    return spread


def _discs(polynomial: Any, exponent: int, values: Complex) -> tuple[Complex, Array]:
    """Return centres, integers times 2**exponent, and Smith's radii; infinite where centres coincide.

    The products are added up as logarithms: tight clusters would leave the range of doubles.
    """
    n = len(values)
    real = [whole(x, exponent) for x in values.real.tolist()]
    imag = [whole(x, exponent) for x in values.imag.tolist()]
    coefficients = list(reversed(polynomial.coeffs()))
    lead = math.log2(abs(int(coefficients[0])))
    size = np.array(
        [
            _log_modulus(coefficients, x, y) if y else _log2(int(polynomial(x)))
            for x, y in zip(real, imag, strict=True)
        ]
    )
    parts = [np.array([scaled(x, exponent) for x in part]) for part in (real, imag)]
    centres = parts[0] + 1j * parts[1]
    gaps = np.abs(centres[:, None] - centres[None, :])
    np.fill_diagonal(gaps, 1.0)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        radius = n * np.exp2(size - lead + n * exponent - np.log2(gaps).sum(axis=1))
    return centres, np.where(np.isnan(radius), np.inf, radius) * _OUTWARDS


def _log_modulus(coefficients: list[Any], x: int, y: int) -> float:
    """Return log2 |p(x + iy)| from exact integers, coefficients from the highest down."""
    a, b = coefficients[0] * 0, coefficients[0] * 0
    for c in coefficients:
        a, b = a * x - b * y + c, a * y + b * x
    a, b = int(a), int(b)
    drop = max(0, max(a.bit_length(), b.bit_length()) - 500)
    modulus = math.hypot(float(a >> drop), float(b >> drop))
    return math.log2(modulus) + drop if modulus > 0 else -math.inf


def _log2(number: int) -> float:
    """Return log2 |number|."""
    drop = max(0, number.bit_length() - 500)
    return math.log2(abs(number) >> drop) + drop if number else -math.inf


def _isolated(polynomial: Any, exponent: int) -> tuple[Complex, Array, NDArray[np.intp]]:
    """Return enclosures of the distinct roots and their multiplicities; real ones are exactly real."""
    from flint import arb

    unit = arb(2) ** exponent
    roots = [(root * unit, count) for root, count in polynomial.complex_roots()]
    centres = np.array([complex(float(z.real.mid()), float(z.imag.mid())) for z, _ in roots])
    inner = np.array([float(z.real.rad()) + float(z.imag.rad()) for z, _ in roots])
    radius = (inner + 2.0**-51 * np.abs(centres)) * _OUTWARDS
    return centres, radius, np.array([count for _, count in roots], np.intp)
