"""Squared gaps between eigenvalues at neighbouring frictions: which can vanish, and which has.

Intervals of friction come as three `Points`: their lower ends, middles and upper ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

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

ISOLATED = 3.0
"""Distance of other roots from a merging pair, over half its gap and its way, from which they are apart."""


REACH = 0.04
"""How far from the minimum of a gap an interval is cut on both sides, as part of half its width."""

WIDEST = 0.1
"""The same at most where it is known how far the roots are from crossing in straight lines."""

MARGIN = 1.5
"""How much farther than it need be."""


@dataclass(frozen=True)
class Bracket:
    """An interval of friction in which something passes through zero once.

    Attributes
    ----------
    row : int
        Sample.
    friction : (2,) array
        Ends of the interval [1].
    change : (2,) array of int
        Change of the number of coalesced pairs and of the number of negative roots, from the lower
        end to the upper one.
    values : (2,) array
        The squared gap [1/s^4], or the root w itself [1/s^2], at the ends; NaN where not known.
    centre : (2,) array
        Middle of the two roots w, or the root itself, at the ends [1/s^2].
    """

    row: int
    friction: Array
    change: tuple[int, int]
    values: Array
    centre: Array


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


def crossing(points: Triple) -> tuple[list[Bracket | None], Array]:
    """Return the bracket of each interval in which exactly one thing passes through zero, once.

    Parameters
    ----------
    points : three Points
        With different numbers of pairs or of negative roots in each interval.

    Returns
    -------
    brackets : list of Bracket or None
        None where more than one thing may pass through zero, it may do so more than once, or other
        roots come as near to the pair that merges as its own gap.
    zero : (N,) array
        Estimate of the friction at which it happens, NaN where there is none.
    """
    pairs = np.stack([point.coalesced for point in points])
    negative = np.stack([point.negative for point in points])
    rest = [replace(point, real=point.real.copy(), pairs=point.pairs.copy()) for point in points]
    values = np.full(pairs.shape, np.nan)
    centre = np.full(pairs.shape, np.nan)
    for counts, other, follow in ((pairs, negative, _merged), (negative, pairs, _negated)):
        fit = (np.abs(counts[2] - counts[0]) == 1) & (other == other[0]).all(axis=0)
        fit &= (counts[1] == counts[0]) | (counts[1] == counts[2])
        for j in np.flatnonzero(fit):
            values[:, j], centre[:, j] = follow(points, rest, counts[:, j], int(j))
    bend = np.abs(values[0] - 2 * values[1] + values[2])
    with np.errstate(invalid="ignore"):
        single = bend <= STRAIGHT * np.abs(values[2] - values[0])
    open_, _, _ = vanishing((rest[0], rest[1], rest[2]))
    single &= ~open_
    zero = np.full(len(single), np.nan)
    found: list[Bracket | None] = [None] * len(single)
    for k in np.flatnonzero(single):
        i = int(k)
        zero[i] = _secant(points, values[:, i], i)
        if pairs[0, i] != pairs[2, i] and not _isolated(rest, values[:, i], centre[:, i], i):
            continue
        ends = _change_of_sign(values[:, i])
        found[i] = Bracket(
            int(points[0].row[i]),
            np.array([points[j].friction[i] for j in ends]),
            (int(pairs[2, i] - pairs[0, i]), int(negative[2, i] - negative[0, i])),
            values[ends, i],
            centre[ends, i],
        )
    return found, zero


def _secant(points: Triple, values: Array, i: int) -> float:
    """Return where the line through the two values of different sign is zero."""
    ends = _change_of_sign(values)
    x0, x1 = (float(points[j].friction[i]) for j in ends)
    f0, f1 = values[ends]
    return float((x0 * f1 - x1 * f0) / (f1 - f0))


def _change_of_sign(values: Array) -> list[int]:
    """Return which two neighbours of three values differ in sign."""
    return [0, 1] if (values[0] < 0) != (values[1] < 0) else [1, 2]


def _isolated(rest: list[Points], values: Array, centre: Array, i: int) -> bool:
    """Say whether all other roots stay farther from the pair that merges than its own gap and way."""
    own = np.sqrt(np.abs(values)).max() / 2 + np.ptp(centre)
    others = np.concatenate(
        [np.append(point.real[i], point.pairs[i]) - x for point, x in zip(rest, centre, strict=True)]
    )
    return bool(np.nanmin(np.abs(others), initial=np.inf) > ISOLATED * own)


def _merged(points: Triple, rest: list[Points], counts: NDArray[np.intp], i: int) -> tuple[Array, Array]:
    """Return the squared gap and centre of the pair that merges, and take it out of the rest."""
    values, centre = np.empty(3), np.empty(3)
    few = counts.min()
    below, above = (next(j for j in range(3) if (counts[j] == few) == low) for low in (True, False))
    places: dict[tuple[int, int], tuple[int, int]] = {}
    for j, point in enumerate(points):
        # Of the point itself and the nearest one on the other side of the crossing.
        both = (j, above) if counts[j] == few else (below, j)
        if both not in places:
            one, two = points[both[0]], points[both[1]]
            places[both] = merging(one.real[i], one.pairs[i], two.real[i], two.pairs[i])
        k, pair = places[both]
        if counts[j] == few:
            x, y = point.real[i, k : k + 2]
            values[j], centre[j] = (y - x) ** 2, (x + y) / 2
            rest[j].real[i] = np.append(np.delete(point.real[i], [k, k + 1]), [np.nan, np.nan])
        else:
            z = point.pairs[i, pair]
            values[j], centre[j] = -4 * z.imag**2, z.real
            rest[j].pairs[i] = np.append(np.delete(point.pairs[i], pair), complex(np.nan, np.nan))
    return values, centre


def _negated(points: Triple, rest: list[Points], counts: NDArray[np.intp], i: int) -> tuple[Array, Array]:
    """Return the real root that passes through zero, and take it out of the rest."""
    k = int(counts.min())
    values = np.array([point.real[i, k] for point in points])
    for part, point in zip(rest, points, strict=True):
        part.real[i] = np.append(np.delete(point.real[i], k), np.nan)
    return values, values


def merging(x: Array, fewer: Complex, y: Array, more: Complex) -> tuple[int, int]:
    """Return which real roots k, k + 1 of one point make which pair of another.

    Those that leave the remaining roots nearest to each other.

    Parameters
    ----------
    x, y : (n,) array
        Real roots, ascending, then NaN; the second point has two fewer.
    fewer, more : (p,) complex array
        Pairs, then NaN; the second point has one more.

    Returns
    -------
    k, pair : int
    """
    x, y = x[~np.isnan(x)], y[~np.isnan(y)]
    left = list(np.flatnonzero(~np.isnan(more)))
    for z in fewer[~np.isnan(fewer)]:
        left.remove(min(left, key=lambda j: abs(more[j] - z)))
    pair = int(left[0])
    low = np.concatenate([[0.0], np.cumsum((x[: len(y)] - y) ** 2)])
    high = np.concatenate([np.cumsum(((x[2:] - y) ** 2)[::-1])[::-1], [0.0]])
    centre = (x[:-1] + x[1:]) / 2
    return int(np.argmin(low + high + (centre - more[pair].real) ** 2)), pair


def unresolved(points: Triple, i: int) -> Bracket:
    """Return an interval too narrow to divide whose ends differ, as it is."""
    a, _, b = points
    change = (int(b.coalesced[i] - a.coalesced[i]), int(b.negative[i] - a.negative[i]))
    more = b if change[0] > 0 else a
    pairs = more.pairs[i, ~np.isnan(more.pairs[i])]
    # The pair nearest to the real axis is the one that has just coalesced.
    centre = float(pairs[np.argmin(np.abs(pairs.imag))].real) if change[0] else 0.0
    friction = np.array([a.friction[i], b.friction[i]])
    return Bracket(int(a.row[i]), friction, change, np.full(2, np.nan), np.full(2, centre))
