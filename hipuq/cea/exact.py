"""The characteristic polynomial of a pencil A0 + mu A1 in both its variables, in exact integers.

``det(w - A0 - mu A1)`` has degree n in w and the rank of A1 in mu. It is interpolated from the
characteristic polynomials at whole numbers mu = 0, 1, ..., whose entries stay short; after that it can
be evaluated at any double mu in microseconds and without any error.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from hipuq.cea.pencils import Array

MOST_STEPS = 30
"""Steps after which the iteration for a pair of roots is given up."""

HALF = 40
"""Bits of a root to which the last step of Newton's method agrees with the one before: it squares errors."""

FINE = 40
"""Bits of a squared gap, in units of the root, from which whole numbers resolve it well."""


class ExactPencil:
    """Exact characteristic polynomial of A0 + mu A1, both given in doubles.

    Parameters
    ----------
    constant, slope : (n, n) array
        A0 and A1 [1/s^2].

    Attributes
    ----------
    n : int
        Degree in w.
    exponent : int
        Roots of the polynomials are w / 2**exponent.
    bits : int
        They have about so many bits.
    """

    def __init__(self, constant: Array, slope: Array) -> None:
        from flint import fmpz_mat

        self.n = n = len(constant)
        whole, self.exponent = integers(np.stack([constant, slope]))
        self.bits = max(abs(a) for a in whole).bit_length()
        # Short entries make the polynomials quick; the unit of the roots is put in afterwards.
        short, spare = stripped(whole)
        zero, one = fmpz_mat(n, n, short[: n * n]), fmpz_mat(n, n, short[n * n :])
        self.degree = one.rank()
        values = [(zero + t * one).charpoly().coeffs() for t in range(self.degree + 1)]
        scaled = [c << spare * (n - k) for p in values for k, c in enumerate(p)]
        samples = fmpz_mat(self.degree + 1, n + 1, scaled)
        # Row k: coefficients of w**k as a polynomial in mu, times a common denominator.
        self._rows = (_vandermonde_inverse(self.degree) * samples).transpose()

    def at(self, mu: float) -> Any:
        """Return an integer multiple of the characteristic polynomial in w / 2**exponent, fmpz_poly."""
        return self._combined(self._powers(mu))

    def at_with_slope(self, mu: float) -> tuple[Any, Any]:
        """Return the polynomial as `at` does and its derivative by mu, times the same number."""
        powers = self._powers(mu)
        rising = [0, *(j * powers[j - 1] for j in range(1, self.degree + 1))]
        return self._combined(powers), self._combined(rising)

    def _powers(self, mu: float) -> list[Any]:
        """Return the powers of mu, times a common power of two."""
        from flint import fmpz

        top, bottom = mu.as_integer_ratio()
        down = bottom.bit_length() - 1
        return [fmpz(top) ** j << down * (self.degree - j) for j in range(self.degree + 1)]

    def _combined(self, weights: list[Any]) -> Any:
        """Return the polynomial in w whose coefficients are sums over those in mu, fmpz_poly."""
        from flint import fmpz_mat, fmpz_poly

        made = self._rows * fmpz_mat(self.degree + 1, 1, weights)
        return fmpz_poly(made.entries())


def stripped(whole: list[int]) -> tuple[list[int], int]:
    """Return whole numbers without the power of two that is common to all, and its exponent."""
    together = 0
    for a in whole:
        together |= a
    spare = max(0, (together & -together).bit_length() - 1)
    return [a >> spare for a in whole], spare


def coalescence(exact: ExactPencil, friction: float, centre: float) -> tuple[float, int] | None:
    """Return the friction at which two roots coalesce, and the double root, by Newton's method.

    Between the two roots p has an extremum w in w, and its value there vanishes with their gap. By mu that
    value changes as dp / dmu at w does, so each step needs p at one friction.

    Parameters
    ----------
    exact : ExactPencil
    friction : float
        Approximation [1].
    centre : float
        Approximate double root [1/s^2].

    Returns
    -------
    friction : float
        To the last digits of a double [1].
    root : int
        Over 2**exponent, the extremum at that friction.

    None if the steps do not become small.
    """
    w = whole(centre, exact.exponent)
    first_step = math.inf
    for _ in range(MOST_STEPS):
        p, by_mu = exact.at_with_slope(friction)
        found = _extremum(p, w)
        if found is None:
            return None
        w = found
        slope = int(by_mu(w))
        if slope == 0:
            return None
        step = -_ratio(int(p(w)), slope, 0)
        friction += step
        if abs(step) <= 1e-15 * abs(friction):
            return friction, w
        if abs(step) > 2 * first_step:
            return None
        first_step = min(first_step, abs(step))
    return None


def _extremum(p: Any, w: int) -> int | None:
    """Return the extremum of a polynomial near w by Newton's method in whole numbers, or None."""
    first = p.derivative()
    second = first.derivative()
    for _ in range(MOST_STEPS):
        curvature = int(second(w))
        if curvature == 0:
            return None
        step = int(first(w)) // curvature
        w -= step
        # From there on the next step would be below the last bit of a double.
        if abs(step) <= max(1, abs(w) >> HALF):
            return w
    return None


def exact_gap(exact: ExactPencil, friction: float, centre: float, gap: float) -> tuple[float, float]:
    """Return the squared gap of a pair of roots and their middle, from exact values.

    The pair is a quadratic factor of the characteristic polynomial, well determined also where its two
    roots are one; found by the iteration of Bairstow in whole numbers.

    Parameters
    ----------
    exact : ExactPencil
    friction : float
        mu [1].
    centre, gap : float
        Approximate middle [1/s^2] and squared gap [1/s^4] of the pair.

    Returns
    -------
    gap : float
        (w1 - w2)**2, negative for a complex pair [1/s^4]; NaN where the iteration does not converge.
    centre : float
        [1/s^2]
    """
    from flint import fmpz_poly

    p = exact.at(friction)
    s = whole(centre, exact.exponent - 1)
    q = (s * s - whole(gap, 2 * exact.exponent)) // 4
    for _ in range(MOST_STEPS):
        # p = b (w^2 - s w + q) + r, and the correction of s and q is that which makes r vanish.
        quadratic = fmpz_poly([q, -s, 1])
        b, r = divmod(p, quadratic)
        t = b % quadratic
        r0, r1, t0, t1 = int(r[0]), int(r[1]), int(t[0]), int(t[1])
        det = -(t1 * s + t0) * t0 - t1 * t1 * q
        if det == 0:
            break
        ds, dq = (r1 * t0 - t1 * r0) // det, (-(t1 * s + t0) * r0 - t1 * q * r1) // det
        s, q = s + ds, q + dq
        if abs(ds) <= 2:
            found = s * s - 4 * q
            if abs(found).bit_length() < s.bit_length() + FINE:
                return gap_about(p, s // 2, exact.exponent)
            return scaled(found, 2 * exact.exponent), scaled(s, exact.exponent - 1)
    return math.nan, centre


def gap_about(p: Any, w: int, exponent: int) -> tuple[float, float]:
    """Return squared gap and middle of a pair of roots so close that whole numbers do not resolve it.

    About the extremum of p between the roots p is p'' / 2 ((w - m)^2 - gap^2 / 4) up to third order.
    """
    first = p.derivative()
    curvature = int(first.derivative()(w))
    if curvature == 0:
        return math.nan, scaled(w, exponent)
    slope = int(first(w))
    squared = _ratio(4 * (slope * slope - 2 * int(p(w)) * curvature), curvature * curvature, 2 * exponent)
    return squared, _ratio(w * curvature - slope, curvature, exponent)


def _ratio(top: int, bottom: int, exponent: int) -> float:
    """Return top / bottom * 2**exponent, rounded."""
    shift = max(0, 70 + bottom.bit_length() - top.bit_length())
    return scaled((top << shift) // bottom, exponent - shift)


def whole(number: float, exponent: int) -> int:
    """Return number / 2**exponent, rounded down to an integer."""
    mantissa, power = math.frexp(number)
    shift = power - 53 - exponent
    digits = int(mantissa * 2.0**53)
    return digits << shift if shift >= 0 else digits >> -shift


def scaled(number: int, exponent: int) -> float:
    """Return number * 2**exponent, rounded, also where the number is beyond the range of doubles."""
    drop = max(0, number.bit_length() - 64)
    return math.ldexp(float(number >> drop), drop + exponent)


def log2(number: int) -> float:
    """Return log2 |number|, also where the number is beyond the range of doubles."""
    drop = max(0, number.bit_length() - 500)
    return math.log2(abs(number) >> drop) + drop if number else -math.inf


def integers(values: Array) -> tuple[list[int], int]:
    """Return doubles as whole numbers over a common power of two.

    Parameters
    ----------
    values : array

    Returns
    -------
    whole : list of int
        The values, flat, over 2**exponent. It is finer than they need, by 80 bits below the largest, so
        that approximate roots can be given as whole numbers too.
    exponent : int
    """
    mantissa, exponent = np.frexp(values.ravel())
    whole = (mantissa * 2.0**53).astype(np.int64)
    power = exponent.astype(int) - 53
    used = whole != 0
    lowest = min(int(power[used].min()), int(exponent[used].max()) - 80) if used.any() else 0
    return [int(a) << int(b - lowest) if a else 0 for a, b in zip(whole, power, strict=True)], lowest


@lru_cache
def _vandermonde_inverse(degree: int) -> Any:
    """Return the inverse of the Vandermonde matrix of 0 to degree, times a number that makes it whole."""
    from flint import fmpq_mat

    size = degree + 1
    nodes = fmpq_mat(size, size, [t**j for t in range(size) for j in range(size)])
    return nodes.inv().numer_denom()[0]
