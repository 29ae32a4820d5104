"""Derivatives of a friction at which stability changes with respect to anything that the matrices depend on.

At a boundary a matrix A(s, mu) that is a polynomial in an eigenvalue s is singular, with left and right
null vectors y and x. Where two real eigenvalues merge they are those of the coalescence, and y^T M x = 0
(A. P. Seyranian and A. A. Mailybaev, Multiparameter Stability Theory with Mechanical Applications, World
Scientific 2003).

Beside such a point the null vectors of a ring have hardly a degree of freedom in common: y^T x is 1e-8
of |y| |x| and less, so singular vectors, right to rounding in norm only, leave the derivatives right to
7 digits. A matrix bordered by one row and column is regular there, and its inverse gives the null
vectors, entry by entry, and a function g that is zero where A is singular (W. Govaerts, Numerical Methods
for Bifurcations of Dynamical Equilibria, SIAM 2000, chapter 3). Newton's method on g finds the boundary
that the matrices really have, next to the one that was given.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hipuq.cea.bounds import Complex
from hipuq.cea.pencils import Array, Pencils
from hipuq.errors import InputError

FAR = 1e-3
"""A boundary farther than this from the one that was given, relative, is another one."""

STEPS = 20
"""Newton steps; from a good start it takes two or three."""


@dataclass(frozen=True)
class Derivatives:
    """Derivatives of the matrices of one sample with respect to p parameters.

    Attributes
    ----------
    mass : (p, n) or (p, n, n) array
        dM / dp [kg per unit of the parameter], in the form that M has.
    stiffness, friction_stiffness : (p, n, n) array
        dK0 / dp and dK1 / dp [N/m per unit].
    damping : (p, n, n) array or None
        dC / dp [N s/m per unit]; None if it is zero.
    """

    mass: Array
    stiffness: Array
    friction_stiffness: Array
    damping: Array | None


@dataclass(frozen=True)
class _Boundary:
    """The singular point itself: y^T A x = 0 with A = K + s C + s^2 M, or K + s M without damping."""

    friction: float
    s: complex
    left: Complex
    right: Complex


def onset_sensitivity(
    pencils: Pencils,
    friction: float,
    frequency: float,
    derivatives: Derivatives,
    *,
    growth_threshold: float = 0.0,
) -> Array:
    """Compute d mu / d p of a friction mu at which a mode becomes unstable or stable again.

    Undamped, two real eigenvalues w merge: ``-(y^T (K_p - w M_p) x) / (y^T K1 x)``. Damped, or above a
    growth threshold, one eigenvalue l crosses the line Re l = threshold: ``-Re(a_p / a_l) / Re(a_mu / a_l)``
    with ``a_q = y^T A_q x``, A = l^2 M + l C + K. For divergence (frequency 0) l is the threshold itself
    and ``-a_p / a_mu``.

    Parameters
    ----------
    pencils : Pencils
        One sample with n degrees of freedom; its own friction is not used.
    friction : float
        mu at the boundary, to about 4 digits at least: it is refined [1].
    frequency : float
        Frequency of the mode there, to about 6 digits at least; 0 for divergence [Hz].
    derivatives : Derivatives
        With respect to p parameters.
    growth_threshold : float, default 0
        Growth rate of the boundary [1/s].

    Returns
    -------
    (p,) array
        d mu / d p [1 per unit]. NaN for a parameter of damping at flutter without damping: there the
        smallest damping moves the onset by a jump, not in proportion.

    Raises
    ------
    InputError
        If there is not exactly one sample, a number cannot be used, divergence is asked of a sample
        with mechanisms, or there is no boundary where it was said to be.
    """
    if len(pencils.stiffness) != 1:
        raise InputError(f"sensitivities need exactly one sample, not {len(pencils.stiffness)}")
    for name, value in (("frequency", frequency), ("growth_threshold", growth_threshold)):
        if not (np.isfinite(value) and value >= 0):
            raise InputError(f"{name} is {value}: it must be a finite number, 0 or above")
    if not (np.isfinite(friction) and friction != 0):
        raise InputError(f"friction is {friction}: a boundary lies at a finite friction other than 0")
    if frequency == 0 and growth_threshold == 0 and pencils.mechanisms[0]:
        raise InputError("mechanisms hide the eigenvalue of divergence at frequency 0: take them out first")
    undamped = (pencils.damping is None or not pencils.damping.any()) and growth_threshold == 0
    coalescing = undamped and frequency > 0
    found = _refined(pencils, friction, 2 * np.pi * frequency, growth_threshold, coalescing)
    left, right, s = found.left, found.right, found.s
    slope = left @ pencils.friction_stiffness[0] @ right
    forms = _forms(derivatives.stiffness + found.friction * derivatives.friction_stiffness, left, right)
    forms = forms + (s if coalescing else s**2) * _forms(derivatives.mass, left, right)
    if derivatives.damping is not None and not coalescing:
        forms = forms + s * _forms(derivatives.damping, left, right)
    if frequency > 0 and not coalescing:
        # All relative to the derivative in l, so that real parts are those of l itself.
        own = left @ _in_s(pencils, s, coalescing)[1] @ right
        slope, forms = slope / own, forms / own
    result: Array = -forms.real / slope.real
    if derivatives.damping is not None and coalescing:
        result[derivatives.damping.any(axis=(1, 2))] = np.nan
    return result


def _forms(matrices: Array, left: Complex, right: Complex) -> Complex:
    """Return y^T A x of each matrix, given whole or as its diagonal, (p,)."""
    if matrices.ndim == 2:
        diagonal: Complex = matrices @ (left * right)
        return diagonal
    full: Complex = np.einsum("i,pij,j->p", left, matrices, right)
    return full


def _in_s(pencils: Pencils, s: complex, coalescing: bool) -> tuple[Complex, Complex]:
    """Return A - K and dA / ds."""
    mass = pencils.mass[0]
    mass = np.diag(mass) if mass.ndim == 1 else mass
    if coalescing:
        return s * mass, mass.astype(np.complex128)
    damping = np.zeros_like(mass) if pencils.damping is None else pencils.damping[0]
    return s * (damping + s * mass), damping + 2 * s * mass


def _refined(
    pencils: Pencils, friction: float, omega: float, threshold: float, coalescing: bool
) -> _Boundary:
    """Solve for the boundary by Newton's method, from the friction and the angular frequency given."""
    s = complex(-(omega**2)) if coalescing else complex(threshold, omega)
    mu, start = friction, s
    border = None
    size = np.inf
    for _ in range(STEPS):
        rest, first = _in_s(pencils, s, coalescing)
        matrix = pencils.stiffness[0] + mu * pencils.friction_stiffness[0] + rest
        border = _border(matrix) if border is None else border
        border[:-1, :-1] = matrix
        try:
            inverse = np.linalg.inv(border).astype(np.complex128)
            if size < 1e-9:
                # The step before this point was so small that the error after it is rounding.
                if abs(mu - friction) > FAR * abs(friction) or abs(s - start) > FAR * abs(start):
                    break
                return _Boundary(mu, s, inverse[-1, :-1], inverse[:-1, -1])
            step = _step(inverse, pencils.friction_stiffness[0], first, coalescing, omega > 0)
        except np.linalg.LinAlgError:
            break
        mu += step[0]
        s += step[1]
        size = max(abs(step[0] / friction), abs(step[1] / start) if omega > 0 else 0.0)
        if not size < 1.0:
            break
    raise InputError(
        f"there is no boundary of instability within {FAR:g}, relative, of friction {friction:g} and"
        f" frequency {omega / (2 * np.pi):g} Hz"
    )


def _border(matrix: Complex) -> Complex:
    """Return a matrix with one row and column more, which make it regular, and room for it."""
    n = len(matrix)
    u, values, vh = np.linalg.svd(matrix)
    border = np.zeros((n + 1, n + 1), np.complex128)
    # As large as the rest of the matrix, whatever the units.
    border[:n, n], border[n, :n] = values[0] * u[:, -1], values[0] * vh[-1]
    return border


def _step(
    inverse: Complex, slope: Array, first: Complex, coalescing: bool, moving: bool
) -> tuple[float, complex]:
    """Return the Newton step in mu and s, from the inverse of the bordered matrix and its derivatives.

    Where two eigenvalues merge s = -w is real, and g = 0 and g_s = 0; where one crosses the line
    Re s = threshold, Im s is unknown, and Re g = 0 and Im g = 0; for divergence s stays, and g = 0.
    """
    inner, right, left, g = inverse[:-1, :-1], inverse[:-1, -1], inverse[-1, :-1], inverse[-1, -1]
    g_mu, g_s = -left @ slope @ right, -left @ first @ right
    if coalescing:
        back = inner @ (first @ right)
        g_ss = 2 * (left @ first @ back)
        g_smu = left @ slope @ back + left @ first @ (inner @ (slope @ right))
        jacobian, residual = np.array([[g_mu, g_s], [g_smu, g_ss]]).real, np.array([g, g_s]).real
        step = -np.linalg.solve(jacobian, residual)
        return float(step[0]), complex(step[1])
    if moving:
        jacobian = np.array([[g_mu.real, -g_s.imag], [g_mu.imag, g_s.real]])
        step = -np.linalg.solve(jacobian, np.array([g.real, g.imag]))
        return float(step[0]), 1j * float(step[1])
    return -float(g.real) / float(g_mu.real) if g_mu.real else np.inf, 0j
