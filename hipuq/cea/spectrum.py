"""Frequencies, growth rates and verdicts of a batch of pencils, in double precision.

A verdict in double precision is wrong where rounding turns a close pair of real eigenvalues into a
complex one or the reverse. So each verdict carries the question how far the eigenvalue may be from
its computed place: a uniform radius first, which costs nothing, then first-order condition numbers
for the samples that it does not clear. What remains open is unknown (NaN), never stable and never
unstable; a structured solver or a certificate may decide it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import ALWAYS, AUTO, CERTIFICATE, NEVER
from hipuq.cea.compact import CompactPencils
from hipuq.cea.damped import damped_modes
from hipuq.cea.eigenvalues import kernel_for
from hipuq.cea.lanes import lane_modes
from hipuq.cea.pencils import Array, Pencils
from hipuq.cea.spectra import Spectra
from hipuq.cea.undamped import undamped_modes
from hipuq.errors import InputError, check_name


def solve(
    pencils: Pencils | CompactPencils, *, growth_threshold: float = 0.0, certify: str = AUTO
) -> Spectra:
    """Solve a batch of eigenvalue problems and judge their stability.

    The problem is ``(l**2 M + l C + K0 + mu K1) y = 0`` (Oberst et al., INTER-NOISE 2016, eq. 1). Each sample
    is solved by itself, so results do not depend on the batch that it is in.

    Parameters
    ----------
    pencils : Pencils or CompactPencils
        The matrices of s samples.
    growth_threshold : float, default 0
        Growth rate above which a mode counts as unstable [1/s], not negative.
    certify : str
        ``"auto"``: what double precision leaves open goes to the structured solver and then to the
        certificate. ``"always"``: the certificate judges every sample. ``"never"``: what is open
        stays unknown.

    Returns
    -------
    Spectra
        Frequencies [Hz], growth rates [1/s], verdicts and margins [1] of the s samples.

    Raises
    ------
    InputError
        If the threshold is negative or not finite, or a mass matrix is not positive definite.
    UnknownNameError
        If there is no such way to certify.

    Examples
    --------
    Two modes of the squared circular frequencies 1 and 2, coupled by friction, flutter above mu = 0.5:

    >>> import numpy as np
    >>> from hipuq import cea
    >>> pencils = cea.Pencils(
    ...     mass=np.ones((2, 2)),
    ...     stiffness=np.array(2 * [[[1.0, 0.0], [0.0, 2.0]]]),
    ...     friction_stiffness=np.array(2 * [[[0.0, 1.0], [-1.0, 0.0]]]),
    ...     friction=np.array([0.4, 0.6]),
    ...     damping=None,
    ...     mechanisms=np.array([0, 0]),
    ... )
    >>> spectra = cea.solve(pencils)
    >>> spectra.growth_rate.round(4)
    array([[ 0.    ,  0.    ],
           [-0.1346,  0.1346]])
    >>> spectra.any_unstable
    array([0., 1.], dtype=float32)
    """
    if not (np.isfinite(growth_threshold) and growth_threshold >= 0):
        raise InputError(
            f"growth_threshold is {growth_threshold}: it must be a finite number of 1/s, 0 or above"
        )
    check_name("way to certify", certify, (AUTO, ALWAYS, NEVER))
    judged = None if certify == ALWAYS else _by_lanes(pencils, growth_threshold)
    if judged is None:
        whole = pencils if isinstance(pencils, Pencils) else pencils.rows()
        return _by_bounds(whole, growth_threshold, certify, whole.filter_radius)
    spectra, rest = judged
    if rest.size:
        spectra.put(rest, _by_bounds(pencils.rows(rest), growth_threshold, certify, 0.0))
    return spectra


def _by_lanes(pencils: Pencils | CompactPencils, threshold: float) -> tuple[Spectra, NDArray[np.intp]] | None:
    """Let the compiled kernel judge what it can; return that and the samples that it leaves open."""
    compiled = kernel_for(pencils.size)
    if compiled is None:
        return None
    if isinstance(pencils, CompactPencils):
        spectra, open_ = lane_modes(compiled, pencils, threshold)
        return spectra, np.flatnonzero(open_)
    damped = pencils.damped
    free = np.flatnonzero(~damped)
    part, open_ = lane_modes(compiled, CompactPencils.of(pencils.rows(free)), threshold)
    spectra = Spectra.empty(*pencils.stiffness.shape[:2])
    spectra.put(free, part)
    return spectra, np.concatenate([np.flatnonzero(damped), free[open_]])


def _by_bounds(pencils: Pencils, threshold: float, certify: str, filter_radius: float) -> Spectra:
    """Judge every sample by eigenvalues and bounds of their errors, and by what lies behind them.

    `filter_radius` is that of the undamped samples, 0 where it did not clear them.
    """
    stiffness, damping = pencils.reduced()
    mechanisms = pencils.mechanisms
    s, n = stiffness.shape[:2]
    frequency, growth, known = np.empty((s, n)), np.empty((s, n)), np.empty((s, n), bool)
    margin, decided_by = np.empty(s), np.empty(s, np.int8)
    damped = pencils.damped
    free = ~damped
    if free.any():
        frequency[free], growth[free], known[free], margin[free], decided_by[free] = undamped_modes(
            stiffness[free], mechanisms[free], threshold, certify, filter_radius
        )
    if damping is not None and damped.any():
        frequency[damped], growth[damped], known[damped], margin[damped], decided_by[damped] = damped_modes(
            stiffness[damped],
            damping[damped],
            mechanisms[damped],
            threshold,
            certify,
            pencils.filter_radius,
        )
    unstable = np.where(known, growth > threshold, np.nan).astype(np.float32)
    # The certificate may find more zero roots than were declared: they are mechanisms too. That a root
    # comes out as exactly zero in double precision is chance.
    zero = known & (frequency == 0) & (growth == 0)
    found = np.where(decided_by == CERTIFICATE, zero.sum(axis=1), 0)
    spectra = Spectra(frequency, growth, unstable, margin, np.maximum(mechanisms, found), decided_by)
    undecided = np.isnan(spectra.any_unstable)
    margin[undecided] = np.nan
    decided_by[undecided] = -1
    return spectra


def damping_ratio(frequency: Array, growth_rate: Array) -> Array:
    """Return the damping ratio ``-Re l / abs(l)`` [1], NaN for ``l = 0``.

    Parameters
    ----------
    frequency : (...,) array
        Im l / (2 pi) [Hz].
    growth_rate : (...,) array
        Re l [1/s], of the same shape.

    Returns
    -------
    (...,) array
        Damping ratio [1] of the same shape, negative for a growing mode.
    """
    modulus = np.hypot(2 * np.pi * frequency, growth_rate)
    return np.divide(-growth_rate, modulus, out=np.full_like(modulus, np.nan), where=modulus > 0)
