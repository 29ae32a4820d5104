"""Damped modes: the state space of ``l**2 + l D + A``, time scaled so that its entries are near 1."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import (
    ALWAYS,
    AUTO,
    CERTIFICATE,
    DOUBLE,
    EPS,
    NEVER,
    conditioned_eigenvalues,
    norms,
    scales,
)
from hipuq.cea.certificate import certify_damped
from hipuq.cea.eigenvalues import eigenvalues
from hipuq.cea.numbering import TIE, mode_order
from hipuq.cea.pencils import Array

Mask = NDArray[np.bool_]


def damped_modes(
    stiffness: Array,
    damping: Array,
    mechanisms: NDArray[np.intp],
    threshold: float,
    certify: str = AUTO,
    filter_radius: float = 0.0,
) -> tuple[Array, Array, Mask, Array, NDArray[np.int8]]:
    """Return the modes of a batch by ascending frequency.

    A state space of n degrees of freedom has 2n eigenvalues: each complex pair is one mode, and so
    are two real ones, with frequency 0 and the larger real part: the larger half of the real
    eigenvalues. So there are always n modes.

    Parameters
    ----------
    stiffness : (s, n, n) array
        A [1/s^2].
    damping : (s, n, n) array
        D [1/s].
    mechanisms : (s,) array of int
        Dimension of the null space of A by construction. It is taken out before the eigenvalues
        are computed, because its double eigenvalue 0 is defective in the state space.
    threshold : float
        Growth rate above which a mode is unstable [1/s].
    certify : str
        ``"auto"``, ``"always"`` or ``"never"``.
    filter_radius : float
        As in `Pencils`.

    Returns
    -------
    frequency, growth_rate : (s, n) array
        [Hz], [1/s].
    known : (s, n) array of bool
        Whether the side of the threshold on which a mode lies is beyond rounding.
    margin : (s,) array
        (threshold - largest growth rate) / root mean w [1].
    decided_by : (s,) array of int8
        The path that gave the verdicts.
    """
    s, n = stiffness.shape[:2]
    frequency = np.zeros((s, n))
    growth = np.zeros((s, n))
    known = np.ones((s, n), bool)
    decided_by = np.full(s, DOUBLE, np.int8)
    largest = np.empty(s)
    for m in np.unique(mechanisms):
        rows = np.flatnonzero(mechanisms == m)
        part, drag, taken = _without_mechanisms(stiffness[rows], damping[rows], int(m))
        frequency[rows, m:], growth[rows, m:], certain, decided_by[rows] = _state_space_modes(
            part, drag, threshold, certify, filter_radius
        )
        known[rows, m:] = certain & taken[:, None]
        known[rows, :m] = taken[:, None]
        largest[rows] = growth[rows, m:].max(axis=1)
    margin = (threshold - largest) / np.sqrt(scales(stiffness, mechanisms))
    return frequency, growth, known, margin, decided_by


def _state_space_modes(
    stiffness: Array, damping: Array, threshold: float, certify: str, filter_radius: float
) -> tuple[Array, Array, Mask, NDArray[np.int8]]:
    """Return frequency, growth rate and whether the verdict is known, of n modes, and the path."""
    s, n = stiffness.shape[:2]
    # Frobenius norms of A are sums of squared frequencies; the root puts l / rate near 1.
    rate = np.sqrt(np.maximum(norms(stiffness), np.finfo(np.float64).tiny))
    states = np.zeros((s, 2 * n, 2 * n))
    states[:, :n, n:] = np.eye(n)
    states[:, n:, :n] = -stiffness / np.square(rate)[:, None, None]
    states[:, n:, n:] = -damping / rate[:, None, None]
    values = eigenvalues(states)
    uniform = filter_radius * norms(states)[:, None] if filter_radius else np.inf
    radius = np.broadcast_to(uniform, values.shape)
    limit = (threshold / rate)[:, None]
    known = np.abs(values.real - limit) > radius
    flagged = np.flatnonzero(~known.all(axis=1))
    if flagged.size:
        values[flagged], radius = conditioned_eigenvalues(states[flagged])
        known[flagged] = np.abs(values[flagged].real - limit[flagged]) > radius
    decided_by = np.full(s, DOUBLE, np.int8)
    open_ = np.arange(s) if certify == ALWAYS else np.flatnonzero(~known.all(axis=1))
    for row in open_ if certify != NEVER else ():
        known[row] = certify_damped(stiffness[row], damping[row], threshold, values[row] * rate[row])
        decided_by[row] = CERTIFICATE
    # Upper complex ones first, then real ones from the largest down: the first n are the modes.
    kind = np.sign(values.imag)
    order = np.lexsort((-values.real, -kind), axis=1)[:, :n]
    values, known = np.take_along_axis(values, order, 1), np.take_along_axis(known, order, 1)
    values *= rate[:, None]
    order = mode_order(values.imag, values.real, TIE)
    values, known = np.take_along_axis(values, order, 1), np.take_along_axis(known, order, 1)
    return values.imag / (2 * np.pi), values.real, known, decided_by


def _without_mechanisms(stiffness: Array, damping: Array, m: int) -> tuple[Array, Array, Mask]:
    """Return A and D on the complement of the mechanisms, and whether they could be taken out.

    With V a basis of the null space of A and Q of its complement, A V = 0, so the eigenvalues
    other than 0 of A are those of ``Q^T A Q``. The same reduction holds for D if it maps the null
    space into itself, and then the mechanisms obey ``l (l + V^T D V)``: they rest or decay.
    """
    if m == 0:
        return stiffness, damping, np.ones(len(stiffness), bool)
    n = stiffness.shape[1]
    _, singular, right = np.linalg.svd(stiffness)
    null, rest = right[:, n - m :], right[:, : n - m]
    dragged = damping @ null.transpose(0, 2, 1)
    own = null @ dragged
    stray = norms(dragged - null.transpose(0, 2, 1) @ own)
    rounding = 10 * n * EPS
    taken = singular[:, n - m] <= rounding * singular[:, 0]
    taken &= stray <= 1e3 * rounding * norms(damping)
    taken &= np.linalg.eigvalsh(own)[:, 0] >= -1e3 * rounding * norms(damping)
    across = rest.transpose(0, 2, 1)
    return rest @ stiffness @ across, rest @ damping @ across, taken
