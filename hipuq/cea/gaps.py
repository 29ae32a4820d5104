"""Squared gaps between eigenvalues at neighbouring frictions: which can vanish, and where to cut.

Intervals of friction come as three `Points`: their lower ends, middles and upper ends.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import Complex
from hipuq.cea.pencils import Array
from hipuq.cea.points import Points

Mask = NDArray[np.bool_]
Triple = tuple[Points, Points, Points]

NARROWEST = 3e-8
"""Windows of instability narrower than this in friction are not looked for."""

PARABOLIC = 16 * NARROWEST
"""Width of an interval up to which the parabola through three squared gaps tells how wide a window is."""

CLEAR = 16.0
"""How many times its second difference a gap must stay, in intervals wider than COARSE, to be cleared: over
a wide one the curvature of the roots can hide from three points that two of them cross."""

CLEAR_NARROW = 2.0
"""The same in narrower intervals, where roots are nearly straight."""

COARSE = 1e-4
"""See CLEAR."""

STRAIGHT = 0.25
"""Second difference of a squared gap, over its first, below which it passes through zero only once."""

REACH = 0.04
"""How far from the minimum of a gap an interval is cut on both sides, as part of half its width."""

WIDEST = 0.1
"""The same at most where it is known how far the roots are from crossing in straight lines."""

MARGIN = 1.5
"""How much farther than it need be."""


def vanishing(points: Triple) -> tuple[Mask, Array, Array]:
    """Say which intervals may hold a zero of a squared gap, though no count differs at their points.

    A gap that stays well above its second difference, or whose square does, does not vanish: the gap
    is smooth where two real roots cross without coupling, its square where they merge. Both are
    so only while no third root comes near, so the gaps between all roots must pass, complex ones too.

    Parameters
    ----------
    points : three Points
        With the same numbers of pairs and of negative roots in each interval.

    Returns
    -------
    open : (N,) array of bool
    vertex : (N,) array
        Friction at which the least squared gap has its minimum, by the parabola through its three
        values; NaN where that is not inside the interval.
    reach : (N,) array
        How far from there the interval is best cut [1], see `_cut`.
    """
    a, m, b = points
    width = (b.friction - a.friction)[:, None]
    factor = np.where(width > COARSE, CLEAR, CLEAR_NARROW)
    gap = np.stack([np.diff(point.real, axis=1) for point in points])
    squared = np.square(gap)
    paired = np.stack([_matched(point.pairs, m.pairs) for point in points])
    roots = np.abs(np.stack([point.real for point in points]))
    every = _packed(np.stack([point.real for point in points]), paired)
    sure = [_stays(np.square(paired.imag), factor), _stays(roots, factor)]
    # Parabola of the squared gap over -1, 0, 1: c t^2 + s t + e, lowest at t = -s / 2c.
    c = (squared[0] - 2 * squared[1] + squared[2]) / 2
    s = (squared[2] - squared[0]) / 2
    bowl = (c > 0) & (np.abs(s) < 2 * c)
    t = np.divide(-s, 2 * c, out=np.zeros_like(s), where=bowl)
    depth = np.square(t) - np.divide(squared[1], c, out=np.zeros_like(s), where=bowl)
    window = np.sqrt(np.maximum(depth, 0.0)) * width
    clear = (
        _stays(gap, factor) | _stays(squared, factor) | ((width <= PARABOLIC) & bowl & (window < NARROWEST))
    )
    low = np.where(~clear & bowl, squared[1] - c * np.square(t), np.inf)
    if not low.shape[1]:
        # A single root has no gap.
        low, t = np.full((len(low), 1), np.inf), np.zeros((len(low), 1))
    k = np.argmin(low, axis=1)
    rows = np.arange(len(k))
    if gap.shape[2]:
        place, reach = _cut(gap[:, rows, k], t[rows, k], factor[:, 0])
    else:
        place, reach = np.zeros((2, len(low)))
    half = width[:, 0] / 2
    vertex = np.where(np.isfinite(low[rows, k]), m.friction + place * half, np.nan)
    sure += [_stays(part, factor) | _stays(np.square(part), factor) for part in _differences(every)]
    return ~(clear.all(axis=1) & np.all(np.concatenate(sure, axis=1), axis=1)), vertex, reach * half


def _cut(gap: Array, vertex: Array, factor: Array) -> tuple[Array, Array]:
    """Return where two roots are nearest to each other, and how far from there their gap is clear again.

    Roots that cross without coupling have a gap with a sign that changes there, and nearly straight. Cut so
    far from its zero that it exceeds `factor` times the second difference that it has on the longer side,
    the rest of the interval needs no more cuts.

    Parameters
    ----------
    gap : (3, N) array
        At the ends and the middle of the interval, from -1 to 1.
    vertex : (N,) array
        Minimum of its square, by a parabola.
    factor : (N,) array

    Returns
    -------
    place, reach : (N,) array
    """
    a, m, b = gap
    bends = np.stack([a + 2 * m - b, a - 2 * m - b])
    late = np.abs(bends[1]) < np.abs(bends[0])
    bend, middle = np.where(late, bends[1], bends[0]), np.where(late, m, -m)
    slope = -(a + b) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        place = -middle / slope
        place = -(middle + bend / 2 * np.square(place)) / slope
        length = 1 + np.abs(place)
        reach = MARGIN * factor * np.abs(bend / slope) * np.square(length) / 4
        straight = (np.abs(bend) < STRAIGHT * np.abs(slope)) & (np.abs(place) < 1)
    return np.where(straight, place, vertex), np.where(straight, np.minimum(reach, WIDEST), REACH)


def _packed(real: Array, pairs: Complex) -> Complex:
    """Return real roots, upper and lower ones of the pairs in columns, without the gaps of NaN."""
    every = np.concatenate([real, pairs, pairs.conj()], axis=-1)
    order = np.argsort(np.isnan(every[0]), axis=1, kind="stable")[:, : real.shape[-1]]
    return np.stack([np.take_along_axis(one, order, axis=1) for one in every])


def _differences(roots: Complex) -> Iterator[Complex]:
    """Give the differences between roots that are not real neighbours, (3, N, k)."""
    both_real = (roots.imag == 0).all(axis=0)
    for shift in range(1, roots.shape[-1]):
        part = roots[..., shift:] - roots[..., :-shift]
        if shift == 1:
            part[:, both_real[:, 1:] & both_real[:, :-1]] = np.nan
        yield part


def _stays(values: Array | Complex, factor: Array) -> Mask:
    """Say whether values at three points stay larger than factor times their second difference; NaN do."""
    bend = np.abs(values[0] - 2 * values[1] + values[2])
    return np.asarray((np.abs(values).min(axis=0) > factor * bend) | np.isnan(bend))


def _matched(pairs: Complex, reference: Complex) -> Complex:
    """Return pairs in the order of those of the reference, each the nearest one left; (N, p)."""
    with np.errstate(invalid="ignore"):
        distance = np.abs(reference[:, :, None] - pairs[:, None, :])
    distance[np.isnan(distance)] = np.inf
    index = np.empty(pairs.shape, np.intp)
    rows = np.arange(len(pairs))
    for j in range(pairs.shape[1]):
        # The pairs come first, as many as the reference has; what is left is NaN and stays in place.
        index[:, j] = np.where(np.isnan(reference[:, j]), j, distance[:, j].argmin(axis=1))
        distance[rows, :, index[:, j]] = np.inf
    return np.take_along_axis(pairs, index, axis=1)
