"""The frictions at which the number of unstable modes changes, certified from both sides where possible.

Undamped pencils A0 + mu A1. Where two real eigenvalues w merge, or a complex pair parts, their squared
gap passes through zero and is analytic there (Kirillov and Seyranian, SIAM J. Appl. Math. 64 (2004)
1383), so it can be interpolated and solved for where the eigenvalues themselves have a square root.
The search divides intervals of friction until the gaps at three points show, by their second
difference, that none of them can vanish in between, or that exactly one squared gap passes through
zero. The boundary is then solved for and proved with the exact characteristic polynomial.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hipuq.cea.boundary import Boundary, inside, proved
from hipuq.cea.brackets import Bracket, crossing, unresolved
from hipuq.cea.gaps import NARROWEST, PARABOLIC, REACH, Mask, Triple, vanishing
from hipuq.cea.pencils import Array, Pencils
from hipuq.cea.points import Points, Rows, Sweep, interpolated
from hipuq.errors import InputError

MOST = 1000
"""Open intervals of one sample at once from which those narrower than `CROWDED` are left unresolved."""

CROWDED = 1e-4
"""See `MOST`. Parts nearer to each other than this are left as one."""

GRID = 17
"""Frictions at which every pencil is looked at first."""


def boundaries(pencils: Pencils, lower: float, upper: float) -> list[list[Boundary]]:
    """Find every friction in a range at which the number of unstable modes changes.

    Parameters
    ----------
    pencils : Pencils
        s samples without damping; their own friction is not used.
    lower, upper : float
        Range of friction, lower < upper [1].

    Returns
    -------
    list of list of Boundary
        For each sample, ascending. A change exactly at an end of the range is not one inside it.

    Raises
    ------
    InputError
        As `search`; or if a part of the range is left unresolved.
    """
    found = search(pencils, lower, upper)
    for i, parts in enumerate(found.unresolved):
        if len(parts):
            raise InputError(
                f"sample {i} cannot be resolved between friction {parts[0, 0]:.6g} and {parts[-1, 1]:.6g}: "
                "its eigenvalues nearly meet there all the way, to within their rounding"
            )
    return found.boundaries


@dataclass(frozen=True)
class Search:
    """What a search found.

    Attributes
    ----------
    boundaries : list of list of Boundary
        For each sample, ascending.
    unresolved : list of (k, 2) array
        For each sample the parts of the range in which so many eigenvalues nearly meet, to within
        their rounding, that nothing can be said.
    """

    boundaries: list[list[Boundary]]
    unresolved: list[Array]


def search(pencils: Pencils, lower: float, upper: float) -> Search:
    """Find every friction in a range at which the number of unstable modes changes, as far as it can be.

    Parameters
    ----------
    pencils : Pencils
        s samples without damping; their own friction is not used.
    lower, upper : float
        Range of friction, lower < upper [1].

    Returns
    -------
    Search

    Raises
    ------
    InputError
        If the range does not ascend, is not finite, a sample is damped, or has fewer mechanisms than
        declared.
    """
    check_range(lower, upper)
    if pencils.damping is not None and pencils.damping.any():
        raise InputError("boundaries are found for undamped pencils only: damping must be zero")
    sweep = Sweep(pencils, max(abs(lower), abs(upper)))
    brackets, unresolved = _brackets(sweep, lower, upper)
    return Search([inside(own, lower, upper) for own in proved(sweep, brackets)], unresolved)


def check_range(lower: float, upper: float) -> None:
    """Raise an InputError unless a range of friction ascends between finite ends."""
    if not (np.isfinite([lower, upper]).all() and lower < upper):
        raise InputError(f"the range of friction is {lower} to {upper}: it must be finite and ascend")


def start_grid(lower: float, upper: float) -> Array:
    """Return the frictions at which pencils are looked at first: evenly, but by factors beyond 1 and -1."""
    low, high = min(max(lower, -1.0), upper), max(min(upper, 1.0), lower)
    parts = [np.linspace(low, high, GRID)] if low < high else [np.array([low])]
    if lower < low:
        parts.insert(0, -np.geomspace(-lower, max(-low, -lower * 1e-3), GRID)[:-1])
    if upper > high:
        parts.append(np.geomspace(max(high, upper * 1e-3), upper, GRID)[1:])
    return np.unique(np.concatenate([[lower, upper], *parts]))


def _brackets(sweep: Sweep, lower: float, upper: float) -> tuple[list[Bracket], list[Array]]:
    """Return intervals of friction that hold one boundary each, and what is left of each sample."""
    samples = len(sweep.constant)
    grid = start_grid(lower, upper)
    points = sweep.points(np.repeat(np.arange(samples), len(grid)), np.tile(grid, samples))
    index = np.arange(samples * len(grid)).reshape(samples, -1)
    todo = np.stack([index[:, :-1].ravel(), index[:, 1:].ravel()])
    found: list[Bracket] = []
    left: list[list[tuple[float, float]]] = [[] for _ in range(samples)]
    while todo.size:
        a, b = points.take(todo[0]), points.take(todo[1])
        centre = (a.friction + b.friction) / 2
        m = sweep.points(a.row, centre, interpolated(a, b, centre))
        middle = len(points.row) + np.arange(len(m.row))
        points += m
        open_, vertex, reach, brackets = _judged((a, m, b))
        found += brackets
        crowd = np.bincount(a.row[open_], minlength=samples)[a.row] > MOST
        for i in np.flatnonzero(open_ & crowd & (b.friction - a.friction < CROWDED)):
            left[a.row[i]].append((float(a.friction[i]), float(b.friction[i])))
            open_[i] = False
        halves = np.flatnonzero(open_ & np.isnan(vertex))
        parts = [[todo[0, halves], middle[halves]], [middle[halves], todo[1, halves]]]
        # Where the gap has a minimum: a narrow interval about it, and what is left on both sides. It
        # is put such that none of its points is the minimum, where two roots may be one.
        thirds = np.flatnonzero(open_ & ~np.isnan(vertex))
        reach = np.maximum(reach, PARABOLIC / 5)[thirds]
        below = np.maximum(vertex[thirds] - 3 * reach, a.friction[thirds])
        above = np.minimum(vertex[thirds] + reach, b.friction[thirds])
        low, high = (part.take(np.tile(thirds, 2)) for part in (a, b))
        cut = np.concatenate([below, above])
        cuts = sweep.points(low.row, cut, interpolated(low, high, cut))
        first, second = len(points.row) + np.arange(2 * len(thirds)).reshape(2, -1)
        points += cuts
        parts += [[todo[0, thirds], first], [first, second], [second, todo[1, thirds]]]
        todo = np.concatenate([np.stack(part) for part in parts], axis=1)
        todo = todo[:, points.friction[todo[0]] < points.friction[todo[1]]]
    return found, [_joined(parts) for parts in left]


def _joined(parts: list[tuple[float, float]]) -> Array:
    """Return intervals in order, those nearer than CROWDED made one, (k, 2)."""
    made: list[list[float]] = []
    for start, end in sorted(parts):
        if made and start - made[-1][1] < CROWDED:
            made[-1][1] = max(made[-1][1], end)
        else:
            made.append([start, end])
    return np.array(made, dtype=np.float64).reshape(-1, 2)


def _judged(points: Triple) -> tuple[Mask, Array, Array, list[Bracket]]:
    """Return which intervals must be divided, where and how near a gap is least or zero, and the brackets."""
    a, m, b = points
    width = b.friction - a.friction
    even = _same(a, m) & _same(a, b)
    vertex, reach = np.full(len(width), np.nan), REACH * width / 2
    open_ = np.ones(len(width), bool)
    rows = np.flatnonzero(even)
    open_[rows], vertex[rows], reach[rows] = vanishing(_take(points, rows))
    rows = np.flatnonzero(~even)
    found = []
    crossings, vertex[rows] = crossing(_take(points, rows))
    for i, bracket in zip(rows, crossings, strict=True):
        if bracket is not None:
            found.append(bracket)
            open_[i] = False
        elif width[i] <= NARROWEST and not _same(a, b)[i]:
            found.append(unresolved(points, int(i)))
    vertex[width <= PARABOLIC] = np.nan
    return open_ & (width > NARROWEST), vertex, reach, found


def _same(a: Points, b: Points) -> Mask:
    """Say where two points have the same numbers of pairs and of negative roots."""
    return np.asarray((a.coalesced == b.coalesced) & (a.negative == b.negative))


def _take(points: Triple, rows: Rows) -> Triple:
    """Return some of the intervals."""
    a, m, b = points
    return a.take(rows), m.take(rows), b.take(rows)
