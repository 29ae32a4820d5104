"""Frequencies, growth rates and verdicts of a batch of pencils, in double precision.

A verdict in double precision is wrong where rounding turns a close pair of real eigenvalues into a
complex one or the reverse. So each verdict carries the question how far the eigenvalue may be from
its computed place: a uniform radius first, which costs nothing, then first-order condition numbers
for the samples that it does not clear. What remains open is unknown (NaN), never stable and never
unstable; a structured solver or a certificate may decide it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import ALWAYS, AUTO, NEVER
from hipuq.cea.damped import damped_modes
from hipuq.cea.pencils import Array, Pencils
from hipuq.cea.undamped import undamped_modes
from hipuq.errors import InputError, check_name


@dataclass(frozen=True)
class Spectra:
    """Spectra of a batch of s samples with n modes by ascending frequency.

    Inside a coalesced pair the decaying eigenvalue comes first and the growing one second.
    Mechanisms come first of all, with frequency, growth rate and verdict 0.

    Attributes
    ----------
    frequency : (s, n) array
        Im l / (2 pi) [Hz].
    growth_rate : (s, n) array
        Re l [1/s].
    unstable : (s, n) array of float32
        1 if the growth rate is above the threshold, 0 if not, NaN if that is not known.
    margin : (s,) array
        Stability margin [1], negative exactly where unstable, NaN where that is unknown. Undamped
        and without a threshold it is the smallest of: the squared gap of neighbouring real
        eigenvalues w = -l**2, minus the squared gap of each complex pair (both over the squared
        mean of w), and the smallest real w over that mean. Otherwise it is
        (threshold - largest growth rate) / root mean w.
    mechanisms : (s,) array of int
        Number of rigid mechanisms: those that the model declares, or more if more were found.
    decided_by : (s,) array of int8
        `DOUBLE`, `STRUCTURED` or `CERTIFICATE` of `hipuq.cea.bounds`; -1 where nothing decided.
    """

    frequency: Array
    growth_rate: Array
    unstable: NDArray[np.float32]
    margin: Array
    mechanisms: NDArray[np.intp]
    decided_by: NDArray[np.int8]

    @property
    def any_unstable(self) -> NDArray[np.float32]:
        """1 if a mode is known to be unstable, 0 if all are known to be stable, else NaN; (s,)."""
        unknown = np.isnan(self.unstable).any(axis=1)
        verdict = np.where(unknown, np.nan, 0.0)
        verdict[(self.unstable == 1).any(axis=1)] = 1.0
        return verdict.astype(np.float32)

    @property
    def unstable_count(self) -> NDArray[np.float32]:
        """Number of unstable modes, NaN if any mode is unknown; (s,)."""
        count: NDArray[np.float32] = self.unstable.sum(axis=1, dtype=np.float32)
        return count


def solve(pencils: Pencils, *, growth_threshold: float = 0.0, certify: str = AUTO) -> Spectra:
    """Solve a batch of eigenvalue problems and judge their stability.

    Each sample is solved by itself, so results do not depend on the batch that it is in.

    Parameters
    ----------
    pencils : Pencils
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

    Raises
    ------
    InputError
        If the threshold is negative or not finite, there is no such way to certify, or a mass
        matrix is not positive definite.
    """
    if not (np.isfinite(growth_threshold) and growth_threshold >= 0):
        raise InputError(
            f"growth_threshold is {growth_threshold}: it must be a finite number of 1/s, 0 or above"
        )
    check_name("way to certify", certify, (AUTO, ALWAYS, NEVER))
    stiffness, damping = pencils.reduced()
    mechanisms = pencils.mechanisms
    s, n = stiffness.shape[:2]
    frequency, growth, known = np.empty((s, n)), np.empty((s, n)), np.empty((s, n), bool)
    margin, decided_by = np.empty(s), np.empty(s, np.int8)
    damped = np.zeros(s, bool) if damping is None else damping.any(axis=(1, 2))
    free = ~damped
    if free.any():
        frequency[free], growth[free], known[free], margin[free], decided_by[free] = undamped_modes(
            stiffness[free], mechanisms[free], growth_threshold, certify, pencils.filter_radius
        )
    if damping is not None and damped.any():
        frequency[damped], growth[damped], known[damped], margin[damped], decided_by[damped] = damped_modes(
            stiffness[damped],
            damping[damped],
            mechanisms[damped],
            growth_threshold,
            certify,
            pencils.filter_radius,
        )
    unstable = np.where(known, growth > growth_threshold, np.nan).astype(np.float32)
    # The certificate may find more zero roots than were declared: they are mechanisms too.
    found = (known & (frequency == 0) & (growth == 0)).sum(axis=1)
    spectra = Spectra(frequency, growth, unstable, margin, np.maximum(mechanisms, found), decided_by)
    undecided = np.isnan(spectra.any_unstable)
    margin[undecided] = np.nan
    decided_by[undecided] = -1
    return spectra


def damping_ratio(frequency: Array, growth_rate: Array) -> Array:
    """Return the damping ratio ``-Re l / abs(l)`` [1], NaN for ``l = 0``.

    Parameters
    ----------
    frequency : array
        [Hz]
    growth_rate : array of the same shape
        [1/s]

    Returns
    -------
    array of the same shape
        Negative for a growing mode.
    """
    modulus = np.hypot(2 * np.pi * frequency, growth_rate)
    return np.divide(-growth_rate, modulus, out=np.full_like(modulus, np.nan), where=modulus > 0)
