"""Undamped modes: eigenvalues w = -l**2 of A, the stiffness for unit mass.

All w real and positive: stable. A complex pair: flutter by mode coupling, one growing and one
decaying mode of the same frequency. A negative real w: divergence. Without a growth threshold the
question is whether eigenvalues are real, so a verdict is known when no eigenvalue can meet another.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import EPS, FILTER, SAFETY, ZERO, Complex, conditioned_eigenvalues, norms, scales
from hipuq.cea.pencils import Array

Mask = NDArray[np.bool_]


def undamped_modes(
    stiffness: Array, mechanisms: NDArray[np.intp], threshold: float
) -> tuple[Array, Array, Mask, Array]:
    """Return the modes of a batch by ascending frequency.

    Parameters
    ----------
    stiffness : (s, n, n) array
        A [1/s^2].
    mechanisms : (s,) array of int
        Number of zero eigenvalues by construction.
    threshold : float
        Growth rate above which a mode is unstable [1/s].

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
    """
    values, rigid, known = _judged_roots(stiffness, mechanisms, threshold)
    root = np.sqrt(values)
    real = values.imag == 0
    frequency = np.where(rigid, 0.0, root.real / (2 * np.pi))
    growth = np.where(rigid, 0.0, np.where(real, root.imag, -root.imag))
    # LAPACK puts the members of a pair side by side, the decaying one first, and their frequencies
    # are equal to the last bit: a stable sort keeps them so. Divergent modes all have frequency 0.
    key = np.where(rigid, -np.inf, np.where(frequency > 0, frequency, np.minimum(values.real, 0.0)))
    order = np.argsort(key, axis=1, kind="stable")
    frequency, growth, known = (
        np.take_along_axis(part, order, axis=1) for part in (frequency, growth, known)
    )
    scale = scales(stiffness, mechanisms)
    if threshold == 0:
        margin = _gap_margin(values, rigid, scale)
    else:
        margin = (threshold - growth.max(axis=1)) / np.sqrt(scale)
    return frequency, growth, known, margin


def _judged_roots(
    stiffness: Array, mechanisms: NDArray[np.intp], threshold: float
) -> tuple[Complex, Mask, Mask]:
    """Return the roots w, which of them are mechanisms, and of which the verdict is known; (s, n)."""
    values: Complex = np.linalg.eigvals(stiffness).astype(np.complex128)
    norm = norms(stiffness)[:, None]
    radius = np.broadcast_to(FILTER * norm, values.shape)
    nowhere = np.zeros((len(values), 1), bool)
    rigid, known = _judge(values, radius, ZERO * norm, mechanisms, threshold, nowhere)
    flagged = np.flatnonzero(~known.all(axis=1))
    if flagged.size:
        part = stiffness[flagged]
        values[flagged], radius = conditioned_eigenvalues(part)
        # Eigenvalues of a symmetric matrix are real, however close: nothing couples them.
        symmetric = (part == part.transpose(0, 2, 1)).all(axis=(1, 2))
        if symmetric.any():
            values[flagged[symmetric]] = np.linalg.eigvalsh(part[symmetric])
            radius[symmetric] = SAFETY * EPS * norm[flagged[symmetric]]
        zero = np.maximum(ZERO * norm[flagged], radius)
        rigid[flagged], known[flagged] = _judge(
            values[flagged], radius, zero, mechanisms[flagged], threshold, symmetric[:, None]
        )
    return values, rigid, known


def _judge(
    values: Complex,
    radius: Array,
    zero: Array,
    mechanisms: NDArray[np.intp],
    threshold: float,
    symmetric: Mask,
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
    squared = np.where(np.isfinite(gaps), np.square(gaps), np.inf).min(axis=1, initial=np.inf)
    pairs = -np.square(2 * values.imag).max(axis=1, where=~rigid, initial=0.0)
    squared = np.where(pairs < 0, pairs, squared) / np.square(scale)
    margin: Array = np.minimum(squared, line[:, 0] / scale)
    return margin
