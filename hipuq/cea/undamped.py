"""Undamped modes: eigenvalues w = -l**2 of A, the stiffness for unit mass.

All w real and positive: stable. A complex pair: flutter by mode coupling, one growing and one
decaying mode of the same frequency. A negative real w: divergence. Without a growth threshold the
question is whether eigenvalues are real, so a verdict is known when no eigenvalue can meet another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import (
    ALWAYS,
    AUTO,
    CERTIFICATE,
    DOUBLE,
    EPS,
    NEVER,
    SAFETY,
    STRUCTURED,
    ZERO,
    Complex,
    conditioned_eigenvalues,
    norms,
    scales,
)
from hipuq.cea.certificate import certify_damped, certify_undamped
from hipuq.cea.eigenvalues import eigenvalues
from hipuq.cea.numbering import mode_order
from hipuq.cea.pencils import Array
from hipuq.cea.structured import block_sizes, conjugate_pairs, structured_eigenvalues

Mask = NDArray[np.bool_]


def undamped_modes(
    stiffness: Array,
    mechanisms: NDArray[np.intp],
    threshold: float,
    certify: str = AUTO,
    filter_radius: float = 0.0,
) -> tuple[Array, Array, Mask, Array, NDArray[np.int8]]:
    """Return the modes of a batch by ascending frequency.

    Parameters
    ----------
    stiffness : (s, n, n) array
        A [1/s^2].
    mechanisms : (s,) array of int
        Number of zero eigenvalues by construction.
    threshold : float
        Growth rate above which a mode is unstable [1/s].
    certify : str
        ``"auto"``, ``"always"`` or ``"never"``.
    filter_radius : float
        As in `Pencils`; 0 for samples that it is known not to clear.

    Returns
    -------
    frequency : (s, n) array
        [Hz], mechanisms first.
    growth_rate : (s, n) array
        [1/s]; inside a coalesced pair the growing mode is the second.
    known : (s, n) array of bool
        Whether the side of the threshold on which a mode lies is beyond rounding.
    margin : (s,) array
        Stability margin [1], meaningful where the verdict is known.
    decided_by : (s,) array of int8
        The path that gave the verdicts.
    """
    roots = judged_roots(stiffness, mechanisms, threshold, certify, filter_radius)
    values, rigid, known = roots.values, roots.rigid, roots.known
    root = np.sqrt(values)
    real = values.imag == 0
    frequency = np.where(rigid, 0.0, root.real / (2 * np.pi))
    growth = np.where(rigid, 0.0, np.where(real, root.imag, -root.imag))
    # LAPACK puts the members of a pair side by side, the decaying one first, and their frequencies
    # are equal to the last bit: a stable sort keeps them so, also where two pairs coincide.
    order = mode_order(np.where(rigid, -1.0, frequency), growth)
    frequency, growth, known = (
        np.take_along_axis(part, order, axis=1) for part in (frequency, growth, known)
    )
    scale = scales(stiffness, mechanisms)
    if threshold == 0:
        margin = _gap_margin(values, rigid, scale)
    else:
        margin = (threshold - growth.max(axis=1)) / np.sqrt(scale)
    return frequency, growth, known, margin, roots.decided_by


@dataclass
class Roots:
    """Roots w of a batch while they are judged: (s, n) but for `decided_by`, (s,)."""

    values: Complex
    rigid: Mask
    known: Mask
    decided_by: NDArray[np.int8]

    def open(self) -> NDArray[np.intp]:
        """Return the samples in which a verdict is unknown."""
        return np.flatnonzero(~self.known.all(axis=1))

    def take(self, rows: NDArray[np.intp], values: Complex, judged: tuple[Mask, Mask], path: int) -> None:
        """Put in what a path says of some samples, where it says more than was known before."""
        rigid, known = judged
        better = known.all(axis=1) | (known.sum(axis=1) > self.known[rows].sum(axis=1))
        rows = rows[better]
        self.values[rows], self.rigid[rows], self.known[rows] = values[better], rigid[better], known[better]
        self.decided_by[rows] = path


def judged_roots(
    stiffness: Array, mechanisms: NDArray[np.intp], threshold: float, certify: str, filter_radius: float
) -> Roots:
    """Return the roots w, which of them are mechanisms, of which the verdict is known, and by which path."""
    s, n = stiffness.shape[:2]
    norm = norms(stiffness)[:, None]
    no = np.zeros((s, n), np.bool_)
    roots = Roots(np.empty((s, n), np.complex128), no, no.copy(), np.full(s, DOUBLE, np.int8))
    if certify == ALWAYS:
        roots.values[:] = eigenvalues(stiffness)
        _certify(roots, np.arange(s), stiffness, mechanisms, threshold)
        return roots
    if filter_radius:
        roots.values[:] = eigenvalues(stiffness)
        uniform = np.broadcast_to(filter_radius * norm, (s, n))
        roots.rigid[:], roots.known[:] = judge(roots.values, uniform, ZERO * norm, mechanisms, threshold)
    rows = roots.open()
    if rows.size:
        part = stiffness[rows]
        values, radius = conditioned_eigenvalues(part)
        # Eigenvalues of a symmetric matrix are real, however close: nothing couples them.
        symmetric = (part == part.transpose(0, 2, 1)).all(axis=(1, 2))
        if symmetric.any():
            values[symmetric] = np.linalg.eigvalsh(part[symmetric])
            radius[symmetric] = SAFETY * EPS * norm[rows[symmetric]]
        zero = np.maximum(ZERO * norm[rows], radius)
        rigid, known = judge(values, radius, zero, mechanisms[rows], threshold, symmetric[:, None])
        # These eigenvalues stand, known or not: they go with their bounds.
        roots.values[rows], roots.rigid[rows], roots.known[rows] = values, rigid, known
    rows = roots.open()
    if rows.size and certify != NEVER:
        sizes = block_sizes(stiffness[rows])
        for size in np.unique(sizes[sizes > 0]):
            same = rows[sizes == size]
            values, radius = structured_eigenvalues(stiffness[same], roots.values[same], int(size))
            values, radius = conjugate_pairs(values, radius)
            zero = np.maximum(ZERO * norm[same], radius)
            judged = judge(values, radius, zero, mechanisms[same], threshold)
            roots.take(same, values, judged, STRUCTURED)
        _certify(roots, roots.open(), stiffness, mechanisms, threshold)
    return roots


def _certify(
    roots: Roots, rows: NDArray[np.intp], stiffness: Array, mechanisms: NDArray[np.intp], threshold: float
) -> None:
    """Let the certificate judge some samples, one by one."""
    for row in rows:
        m = int(mechanisms[row])
        proof = certify_undamped(stiffness[row], roots.values[row], m)
        if not proof.known.all():
            roots.known[row] = False
            continue
        values, radius = conjugate_pairs(proof.values[None], np.zeros((1, len(proof.values))))
        rigid = np.argsort(np.argsort(np.abs(values), axis=1, kind="stable"), axis=1) < m
        known = np.isfinite(radius)
        if threshold > 0 and known.all():
            root = np.sqrt(-values[0])
            sides = certify_damped(
                stiffness[row], np.zeros_like(stiffness[row]), threshold, np.append(root, -root)
            )
            known = np.broadcast_to(sides.all(), values.shape)
        roots.values[row], roots.rigid[row], roots.known[row] = values[0], rigid[0], known[0]
        roots.decided_by[row] = CERTIFICATE


def judge(
    values: Complex,
    radius: Array,
    zero: Array,
    mechanisms: NDArray[np.intp],
    threshold: float,
    symmetric: Mask | bool = False,
) -> tuple[Mask, Mask]:
    """Say which roots are mechanisms, and of which the verdict is known when each is off by `radius`.

    A declared mechanism that is farther from zero than `zero` leaves its whole sample unknown: then
    the declaration does not fit the matrix.
    """
    modulus = np.abs(values)
    rank = np.argsort(np.argsort(modulus, axis=1, kind="stable"), axis=1)
    rigid = rank < mechanisms[:, None]
    if threshold == 0:
        real = values.imag == 0
        flutter = np.abs(values.imag) > radius
        known: Mask = flutter | (real & (modulus > radius) & (symmetric | _apart(values, radius, rigid)))
    else:
        root = np.sqrt(modulus)
        error = np.divide(radius, 2 * root, out=np.full_like(root, np.inf), where=root > 0)
        growth = np.where(values.imag == 0, np.sqrt(np.maximum(-values.real, 0)), -np.sqrt(values).imag)
        known = (np.abs(growth - threshold) > error) & (modulus > radius)
    wrong = (rigid & (modulus > zero)).any(axis=1, keepdims=True)
    return rigid, (known | rigid) & ~wrong


def _apart(values: Complex, radius: Array, rigid: Mask) -> Mask:
    """Say of each root whether its disc touches no other root's, mechanisms left out; (s, n)."""
    x, y = values.real, values.imag
    distance = np.square(x[:, :, None] - x[:, None, :])
    distance += np.square(y[:, :, None] - y[:, None, :])
    diagonal = np.arange(values.shape[1])
    distance[:, diagonal, diagonal] = np.inf
    np.copyto(distance, np.inf, where=rigid[:, None, :])
    reach = np.square(radius[:, :, None] + radius[:, None, :])
    return np.asarray((distance > reach).all(axis=2), dtype=np.bool_)


def _gap_margin(values: Complex, rigid: Mask, scale: Array) -> Array:
    """Return the smallest squared gap of neighbours over scale**2, or the smallest w over scale; (s,).

    The squared gap of a complex pair is negative. Unlike the growth rate, which is zero on the
    stable side and has a square root at the onset, the squared gap passes through an onset smoothly.
    """
    real = (values.imag == 0) & ~rigid
    line = np.sort(np.where(real, values.real, np.inf), axis=1)
    with np.errstate(invalid="ignore"):
        gaps = np.diff(line, axis=1)
    nearest = np.where(np.isfinite(gaps), gaps, np.inf).min(axis=1, initial=np.inf)
    widest = np.abs(2 * values.imag).max(axis=1, where=~rigid, initial=0.0)
    # The square of a pair's gap may underflow; it stays negative.
    coupled = -np.maximum(np.square(widest / scale), np.finfo(np.float64).tiny)
    squared = np.where(widest > 0, coupled, np.square(nearest / scale))
    margin: Array = np.minimum(squared, line[:, 0] / scale)
    return margin
