"""Brackets: intervals of friction in which a squared gap of eigenvalues, or one of them, passes zero once.

Intervals of friction come as three `Points`: their lower ends, middles and upper ends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import Complex
from hipuq.cea.gaps import STRAIGHT, Triple, vanishing
from hipuq.cea.pencils import Array
from hipuq.cea.points import Points

ISOLATED = 3.0
"""Distance of other roots from a merging pair, over half its gap and its way, from which they are apart."""


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
    x : (n,) array
        Real roots of the first point, ascending, then NaN.
    fewer : (p,) complex array
        Its pairs, then NaN.
    y : (n,) array
        Real roots of the second point, two fewer.
    more : (p,) complex array
        Its pairs, one more.

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
