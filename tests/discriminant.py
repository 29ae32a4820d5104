"""Every friction at which eigenvalues of A0 + mu A1 meet: real roots of the exact discriminant in mu.

The discriminant of det(w - A0 - mu A1) in w is a polynomial in mu with whole coefficients, once the
doubles are written as whole numbers over a power of two. It changes sign where the number of complex
pairs changes, and nowhere else. It is interpolated from exact discriminants at whole numbers, and its
roots are isolated rigorously: complete, slow (seconds for 18 degrees of freedom), and independent of
everything in the package.
"""

from itertools import pairwise

import flint
import numpy as np


def meetings(constant: np.ndarray, slope: np.ndarray, lower: float, upper: float) -> list[float]:
    """Return the frictions in a range at which the exact discriminant changes sign, ascending."""
    n = len(constant)
    zero, one = (flint.fmpz_mat(n, n, part) for part in _whole(np.stack([constant, slope])))
    # The coefficient of w**k has at most the degree of rank, and the discriminant is homogeneous of
    # degree 2n - 2 in the coefficients.
    degree = min(n * (n - 1), one.rank() * (2 * n - 2))
    values = [_discriminant((zero + t * one).charpoly().coeffs()) for t in range(degree + 1)]
    return _sign_changes(values, lower, upper)


def _discriminant(coefficients: list[flint.fmpz]) -> flint.fmpz:
    """Return the discriminant of a monic polynomial: the determinant of the power sums of its roots."""
    n = len(coefficients) - 1
    e = coefficients[::-1]  # 1, then the coefficients from the second highest down
    sums = [flint.fmpz(n)]
    for k in range(1, 2 * n - 1):
        # Newton's identities.
        total = k * e[k] if k <= n else flint.fmpz(0)
        total += sum((e[i] * sums[k - i] for i in range(1, min(k - 1, n) + 1)), start=flint.fmpz(0))
        sums.append(-total)
    return flint.fmpz_mat(n, n, [sums[i + j] for i in range(n) for j in range(n)]).det()


def zeros(
    constant: np.ndarray, slope: np.ndarray, lower: float, upper: float, mechanisms: int = 0
) -> list[float]:
    """Return the frictions in a range at which the product of the roots changes sign, ascending.

    With mechanisms, roots that are zero but for rounding, that of all others.
    """
    n = len(constant)
    zero, one = (flint.fmpz_mat(n, n, part) for part in _whole(np.stack([constant, slope])))
    values = [(zero + t * one).charpoly()[mechanisms] for t in range(one.rank() + 1)]
    return _sign_changes(values, lower, upper)


def _sign_changes(values: list[flint.fmpz], lower: float, upper: float) -> list[float]:
    """Return where the polynomial with these values at 0, 1, ... changes sign in a range, ascending."""
    degree = len(values) - 1
    differences = []
    while values:
        differences.append(values[0])
        values = [b - a for a, b in pairwise(values)]
    # Newton's form, sum of differences over falling factorials, times degree!, by Horner's rule.
    polynomial, weight = flint.fmpz_poly([0]), flint.fmpz(1)
    for k in range(degree, -1, -1):
        polynomial = flint.fmpz_poly([-k, 1]) * polynomial + flint.fmpz_poly([differences[k] * weight])
        weight *= max(k, 1)
    if polynomial == 0:
        raise ValueError("the polynomial is zero at every friction")
    found = []
    for factor, times in polynomial.factor_squarefree()[1]:
        if times % 2:
            roots = [root for root, _ in factor.complex_roots() if root.imag == 0]
            found += [float(root.real.mid()) for root in roots]
    return sorted(x for x in found if lower < x < upper)


def _whole(values: np.ndarray) -> np.ndarray:
    """Return doubles times the smallest power of two that makes them whole, as Python integers."""
    ratios = [float(x).as_integer_ratio() for x in values.ravel()]
    common = max(bottom for _, bottom in ratios)
    return np.array([top * (common // bottom) for top, bottom in ratios], object).reshape(len(values), -1)
