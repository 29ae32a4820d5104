"""Exact stability verdicts: characteristic polynomial over the rationals, isolated complex roots.

Every double is a rational number, so the characteristic polynomial of a matrix of doubles can be
computed without any rounding, and its roots enclosed in balls that are proved to hold one each. Real
roots come out with an imaginary part that is exactly zero. Slow (about 15 ms for 18 degrees of
freedom), and independent of everything in the package.
"""

import flint
import numpy as np

RIGID = 1e-7
"""Roots below this times the largest one are mechanisms: rounding of the entries moves them off 0."""


def exact_roots(matrix: np.ndarray) -> list:
    """Return (ball, multiplicity) of each root of the characteristic polynomial of a real matrix."""
    entries = [flint.fmpq(*float(value).as_integer_ratio()) for value in np.ravel(matrix)]
    polynomial = flint.fmpq_mat(*matrix.shape, entries).charpoly()
    return polynomial.numer().complex_roots()


def exact_counts(matrix: np.ndarray) -> tuple[int, int]:
    """Return how many roots w are complex and how many negative real, mechanisms left out."""
    roots = [(complex(ball), ball, times) for ball, times in exact_roots(matrix)]
    largest = max(abs(middle) for middle, _, _ in roots)
    flutter = divergence = 0
    for middle, ball, times in roots:
        if abs(middle) < RIGID * largest:
            continue
        if ball.imag != 0:
            flutter += times
        elif middle.real < 0:
            divergence += times
    return flutter, divergence


def exact_unstable(matrix: np.ndarray) -> bool:
    """Return whether the undamped modes of a unit-mass stiffness are unstable, exactly."""
    return sum(exact_counts(matrix)) > 0


def lapack_unstable(matrix: np.ndarray) -> bool:
    """Return what plain LAPACK eigenvalues say, mechanisms left out by the same rule."""
    roots = np.linalg.eigvals(matrix)
    roots = roots[np.abs(roots) >= RIGID * np.abs(roots).max()]
    return bool(((roots.imag != 0) | (roots.real < 0)).any())
