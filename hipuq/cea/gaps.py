"""Squared gaps between eigenvalues at neighbouring frictions: which can vanish, and which has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hipuq.cea.bounds import Complex
from hipuq.cea.pencils import Array


@dataclass(frozen=True)
class Point:
    """Eigenvalues at one friction, mechanisms left out: real ones ascending, upper ones of pairs."""

    friction: float
    real: Array
    pairs: Complex

    @property
    def count(self) -> int:
        """Number of coalesced pairs."""
        return len(self.pairs)

    def without(self, k: int | None, pair: int | None) -> Point:
        """Return the point without the real roots k and k + 1, or without a pair."""
        real = self.real if k is None else np.delete(self.real, [k, k + 1])
        pairs = self.pairs if pair is None else np.delete(self.pairs, pair)
        return Point(self.friction, real, pairs)


def apart(a: Point, m: Point, b: Point, scale: float) -> bool:
    """Say whether no squared gap can reach zero between two frictions, judged by three points.

    Parameters
    ----------
    a, m, b : Point
        The ends and the middle, with the same number of pairs.
    scale : float
        Size of the eigenvalues [1/s^2].

    Returns
    -------
    bool
        True if each gap stays larger than its second difference.
    """
    real = np.array([np.diff(point.real) for point in (a, m, b)]) ** 2
    pairs = np.array([_matched(point, m) for point in (a, m, b)])
    lowest = np.array([[point.real[0] * scale] for point in (a, m, b)]) if m.real.size else np.zeros((3, 0))
    tracked = np.concatenate([real, 4 * pairs.imag**2, lowest], axis=1)
    bend = np.abs(tracked[0] - 2 * tracked[1] + tracked[2])
    return bool((tracked.min(axis=0) > bend).all())


def _matched(point: Point, reference: Point) -> Complex:
    """Return the pairs of a point in the order of those of the reference, each the nearest one left."""
    left = list(point.pairs)
    return np.array(
        [left.pop(int(np.argmin([abs(z - other) for other in left]))) for z in reference.pairs],
        np.complex128,
    )


def single(a: Point, m: Point, b: Point, scale: float) -> bool:
    """Say whether exactly one squared gap passes through zero between a and b, and none other can.

    Parameters
    ----------
    a, m, b : Point
        The ends and the middle.
    scale : float
        Size of the eigenvalues [1/s^2].

    Returns
    -------
    bool
    """
    if abs(a.count - b.count) != 1 or m.count not in (a.count, b.count):
        return False
    fewer = min(a.count, b.count)
    below = [point for point in (a, m, b) if point.count == fewer]
    above = [point for point in (a, m, b) if point.count != fewer]
    signed, reduced = {}, {}
    for point in below:
        k, _ = merging(point, above[0])
        signed[point.friction] = (point.real[k + 1] - point.real[k]) ** 2
        reduced[point.friction] = point.without(k, None)
    for point in above:
        _, pair = merging(below[0], point)
        signed[point.friction] = -4 * point.pairs[pair].imag ** 2
        reduced[point.friction] = point.without(None, pair)
    s = [signed[point.friction] for point in (a, m, b)]
    straight = abs(s[0] - 2 * s[1] + s[2]) <= 0.25 * abs(s[2] - s[0])
    first, second, third = (reduced[point.friction] for point in (a, m, b))
    return bool(straight) and apart(first, second, third, scale)


def merging(below: Point, above: Point) -> tuple[int, int]:
    """Return which real roots k, k + 1 of the one point make which pair of the other.

    Those that leave the remaining roots nearest to each other.

    Parameters
    ----------
    below, above : Point
        The second has one pair more.

    Returns
    -------
    k, pair : int
    """
    left = list(range(above.count))
    for z in below.pairs:
        left.remove(min(left, key=lambda j: abs(above.pairs[j] - z)))
    pair = left[0]
    x, y = below.real, above.real
    low = np.concatenate([[0.0], np.cumsum((x[: len(y)] - y) ** 2)])
    high = np.concatenate([np.cumsum(((x[2:] - y) ** 2)[::-1])[::-1], [0.0]])
    centre = (x[:-1] + x[1:]) / 2
    return int(np.argmin(low + high + (centre - above.pairs[pair].real) ** 2)), pair
