"""Sobol indices of a table of outcomes: which blocks count, whether they can tell, estimates and limits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hipuq import _salib
from hipuq.saltelli.resampling import limits, split

Array = NDArray[np.float64]

EPS = float(np.finfo(np.float64).eps)


def complete(table: Array) -> Array:
    """Return the blocks of an outcome, (blocks, width), of which every sample is known."""
    known = ~np.isnan(table).any(axis=1)
    return table if known.all() else table[known]


def base(table: Array) -> Array:
    """Return the samples of A and B, (blocks, 2), of the complete blocks of an outcome."""
    return complete(table)[:, [0, -1]]


def standardised(table: Array) -> Array:
    """Return outcomes with mean 0 and variance 1, as SALib does; 0 where they vary by rounding alone."""
    # Divided by the largest first, so that no square overflows or vanishes.
    largest = max(float(table.max()), -float(table.min()))
    scaled = table / max(largest, float(np.finfo(np.float64).tiny))
    spread = scaled.std()
    if not spread > 16 * EPS:
        return np.zeros_like(scaled)
    scaled -= scaled.mean()
    scaled /= spread
    return scaled


def reason(table: Array, minimum_events: int, verdict: bool) -> str:
    """Return why an outcome has no indices; empty if it has.

    Parameters
    ----------
    table : (blocks, width) array
        Columns A, AB by group, BA by group or none, B; NaN is unknown.
    minimum_events : int
        Of an outcome of 0 and 1 how many of each there must be in A and B, of any other how many that
        differ from the commonest value.
    verdict : bool
        Whether it is one of 0 and 1.

    Returns
    -------
    str
    """
    known = complete(table)
    if len(known) < 2:
        return (
            f"{len(known)} of {len(table)} base points have no failed, unknown or missing sample: it takes 2"
        )
    both = known[:, [0, -1]]
    if standardised(known)[:, [0, -1]].var() <= EPS:
        return f"the outcome does not vary: it is {both[0, 0]:.6g} in all samples of A and B"
    if verdict:
        events = int((both == 1).sum())
        others = both.size - events
        if min(events, others) < minimum_events:
            return (
                f"{events} events and {others} non-events among the samples of A and B, at least "
                f'{minimum_events} of each are needed: take more samples, or analyse of="margin"'
            )
        return ""
    values, counts = np.unique(both, return_counts=True)
    others = both.size - int(counts.max())
    # A small design may not hold as many samples that differ.
    if others < min(minimum_events, both.size // 4):
        return (
            f"only {others} of {both.size} samples of A and B differ from {values[counts.argmax()]:.6g}, "
            f"at least {minimum_events} are needed: take more samples"
        )
    return ""


def indices(
    tables: Array,
    reasons: Sequence[str],
    groups: int,
    pairs: Sequence[tuple[int, int]],
    *,
    seed: int,
    resamples: int,
    confidence: float,
) -> Array:
    """Return Sobol indices of several outcomes with their limits.

    Parameters
    ----------
    tables : (outcomes, blocks, width) array
        As in `reason`.
    reasons : sequence of str
        Of each outcome; those that have one are left out.
    groups : int
        Number of parameters.
    pairs : sequence of (int, int)
        Parameters of which to return second-order indices, the smaller number first.
    seed, resamples, confidence
        Of the limits.

    Returns
    -------
    (3, 2 groups + pairs, outcomes) array
        Estimate, lower and upper limit; first order, total order, second order. NaN if undefined.
    """
    found = np.full((3, 2 * groups + len(pairs), len(tables)), np.nan)
    places = [i for i, why in enumerate(reasons) if not why]
    cases = [standardised(complete(tables[i])) for i in places]
    ends = limits(cases, groups, seed, resamples, confidence, pairs)
    for i, case, pair in zip(places, cases, ends, strict=True):
        a, ab, ba, b = split(case, groups)
        found[0, :, i] = _salib.indices(a, ab, ba, b, pairs)
        found[1:, :, i] = pair
    return found
