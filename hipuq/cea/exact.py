"""The characteristic polynomial of a pencil A0 + mu A1 in both its variables, in exact integers.

``det(w - A0 - mu A1)`` has degree n in w and the rank of A1 in mu. It is interpolated from the
characteristic polynomials at whole numbers mu = 0, 1, ..., whose entries stay short; after that it can
be evaluated at any double mu in microseconds and without any error.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from hipuq.cea.pencils import Array


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
        zero, one = fmpz_mat(n, n, whole[: n * n]), fmpz_mat(n, n, whole[n * n :])
        self.bits = max(abs(a) for a in whole).bit_length()
        self.degree = one.rank()
        values = [(zero + t * one).charpoly().coeffs() for t in range(self.degree + 1)]
        samples = fmpz_mat(self.degree + 1, n + 1, [c for p in values for c in p])
        # Row k: coefficients of w**k as a polynomial in mu, times a common denominator.
        self._rows = (_vandermonde_inverse(self.degree) * samples).transpose()

    def at(self, mu: float) -> Any:
        """Return an integer multiple of the characteristic polynomial in w / 2**exponent, fmpz_poly."""
        from flint import fmpz, fmpz_mat, fmpz_poly

        top, bottom = mu.as_integer_ratio()
        down = bottom.bit_length() - 1
        powers = [fmpz(top) ** j << down * (self.degree - j) for j in range(self.degree + 1)]
        made = self._rows * fmpz_mat(self.degree + 1, 1, powers)
        return fmpz_poly([made[k, 0] for k in range(self.n + 1)])


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
