"""Percentile bootstrap of Sobol indices over the base points of their design.

A resample draws as many blocks (the rows of one base point) as there are, with replacement. It is the
number of times that each block is drawn, and every estimator is made of means of products inside
blocks, so all resamples together are one matrix product (Archer, Saltelli and Sobol, J. Stat. Comput.
Simul. 58 (1997) 99, for the bootstrap of indices).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from hipuq.sampling import spawn

Array = NDArray[np.float64]
Places = NDArray[np.intp]

CHUNK = 2**22
"""Draws that are held in memory at a time."""

PIECE = 2**16
"""Blocks whose products are held in memory at a time. Of more of them the sums are made piece by piece."""


def multiplicities(seed: int, blocks: int, resamples: int, chunk: int = CHUNK) -> Iterator[Array]:
    """Give how many times each block is drawn in each resample, in parts of several resamples.

    Parameters
    ----------
    seed : int
    blocks, resamples : int
    chunk : int
        Draws to a part; which draws are made does not depend on it.

    Yields
    ------
    (resamples of the part, blocks) array
        Rows add up to `blocks`.
    """
    rng = spawn(seed, blocks)
    step = max(1, chunk // blocks)
    for start in range(0, resamples, step):
        size = min(step, resamples - start)
        drawn = rng.integers(blocks, size=(size, blocks))
        drawn += blocks * np.arange(size)[:, None]
        yield np.bincount(drawn.ravel(), minlength=size * blocks).reshape(size, blocks).astype(np.float64)


def resampled(outcomes: Array, groups: int, times: Array, pairs: Sequence[tuple[int, int]] = ()) -> Array:
    """Return the Sobol indices of resamples, each what `hipuq._salib.indices` gives of its blocks.

    Parameters
    ----------
    outcomes : (blocks, matrices) array
        Columns A, AB by group, for pairs BA by group, B. Scaled to the order of 1.
    groups : int
        Number of groups.
    times : (resamples, blocks) array
        How many times each block is drawn.
    pairs : sequence of (int, int)
        Groups of which to return second-order indices, the smaller number first.

    Returns
    -------
    (resamples, 2 groups + pairs) array
        NaN in a resample where A and B do not vary.
    """
    j, k = (np.array([pair[i] for pair in pairs], np.intp) for i in (0, 1))
    sums = np.zeros(1)
    for start in range(0, len(outcomes), PIECE):
        products = _products(outcomes[start : start + PIECE], groups, j, k)
        sums = sums + times[:, start : start + PIECE] @ np.concatenate(products, axis=1)
    ends = np.cumsum([part.shape[1] for part in products])[:-1]
    centre, half, square, first, ab_a, total, both, ba_b = np.split(sums / len(outcomes), ends, axis=1)
    variance = square - half**2
    variance = np.where(variance > np.finfo(np.float64).eps, variance, np.nan)
    first = (first - centre * ab_a) / variance
    second = (both - centre * (ba_b[:, j] + ab_a[:, k])) / variance - first[:, j] - first[:, k]
    return np.concatenate([first, total / variance, second], axis=1)


def _products(outcomes: Array, groups: int, j: Places, k: Places) -> list[Array]:
    """Return what means over the blocks are taken of, (blocks, columns) each."""
    a, ab, ba, b = split(outcomes, groups)
    return [
        # for the mean that indices are centred with, and for the variance
        outcomes.mean(axis=1)[:, None],
        ((a + b) / 2)[:, None],
        ((a * a + b * b) / 2)[:, None],
        # first order, and what it changes by when centred; total order
        b[:, None] * (ab - a[:, None]),
        ab - a[:, None],
        np.square(ab - a[:, None]) / 2,
        # second order, and again what it changes by
        ba[:, j] * ab[:, k] - (a * b)[:, None],
        ba - b[:, None],
    ]


def limits(
    cases: Sequence[Array],
    groups: int,
    seed: int,
    resamples: int,
    confidence: float,
    pairs: Sequence[tuple[int, int]] = (),
) -> list[Array]:
    """Return percentile intervals of the Sobol indices of several outcomes.

    Parameters
    ----------
    cases : sequence of (blocks, matrices) array
        Outcomes as in `resampled`. Those with as many blocks share their resamples.
    groups : int
    seed : int
    resamples : int
    confidence : float
    pairs : sequence of (int, int)

    Returns
    -------
    list of (2, 2 groups + pairs) array
        Lower and upper limits, which need not hold the estimate between them; NaN where one of the
        resamples does not vary.
    """
    levels = [0.5 - confidence / 2, 0.5 + confidence / 2]
    found: dict[int, Array] = {}
    for blocks in {len(case) for case in cases}:
        members = [i for i, case in enumerate(cases) if len(case) == blocks]
        parts: dict[int, list[Array]] = {i: [] for i in members}
        for times in multiplicities(seed, blocks, resamples):
            for i in members:
                parts[i].append(resampled(cases[i], groups, times, pairs))
        for i in members:
            found[i] = np.quantile(np.concatenate(parts[i]), levels, axis=0)
    return [found[i] for i in range(len(cases))]


def split(outcomes: Array, groups: int) -> tuple[Array, Array, Array, Array]:
    """Return the columns A, AB, BA (none of them without second order) and B of outcomes."""
    return outcomes[:, 0], outcomes[:, 1 : groups + 1], outcomes[:, groups + 1 : -1], outcomes[:, -1]
