"""Every friction at which the number of unstable modes changes, each certified from both sides.

Undamped pencils A0 + mu A1. Where two real eigenvalues w merge, or a complex pair parts, their squared
gap passes through zero and is analytic there (Kirillov and Seyranian, SIAM J. Appl. Math. 64 (2004)
1383), so it can be interpolated and solved for where the eigenvalues themselves have a square root.
The search halves intervals of friction until the squared gaps at three points show, by their second
difference, that none of them can reach zero in between, or that exactly one passes through it. The
boundary is then solved for with the exact characteristic polynomial, and proved: the verdicts at a
relative distance of 1e-12 below and above it are certified and differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import AUTO, Complex, norms
from hipuq.cea.certificate import certify_polynomial
from hipuq.cea.exact import ExactPencil
from hipuq.cea.gaps import Point, apart, merging, single
from hipuq.cea.pencils import Array, Pencils
from hipuq.cea.structured import block_sizes, structured_eigenvalues
from hipuq.cea.undamped import judged_roots
from hipuq.errors import InputError

GRID = 33
"""Frictions at which every pencil is looked at first."""

NARROWEST = 3e-8
"""Intervals of friction are not halved below this: narrower windows are not looked for."""

CLOSE = 1e-6
"""Boundaries nearer to each other than this are looked at together, see `_Search.beyond_rounding`."""

SIDE = 1e-12
"""Relative distance from a boundary at which the verdicts on both its sides are certified."""


@dataclass(frozen=True)
class Boundary:
    """A friction at which a pair of modes becomes unstable or stable again.

    Attributes
    ----------
    friction : float
        mu [1].
    direction : int
        1 if one more mode is unstable above it, -1 if one fewer.
    mode : int
        Number of the growing mode, by frequency, on the unstable side.
    frequency : float
        Common frequency of the pair there [Hz].
    certified : bool
        Whether the verdicts at (1 - SIDE) and (1 + SIDE) times the friction are proved.
    """

    friction: float
    direction: int
    mode: int
    frequency: float
    certified: bool


def boundaries(pencils: Pencils, lower: float, upper: float) -> list[list[Boundary]]:
    """Find every friction in a range at which the number of coalesced pairs changes.

    Parameters
    ----------
    pencils : Pencils
        s samples without damping; their own friction is not used.
    lower, upper : float
        Range of friction, 0 <= lower < upper [1].

    Returns
    -------
    list of list of Boundary
        For each sample, ascending. A change exactly at an end of the range is not one inside it.

    Raises
    ------
    InputError
        If the range does not ascend, is not finite, a sample is damped, or several pairs merge at once.
    """
    if not (np.isfinite([lower, upper]).all() and 0 <= lower < upper):
        raise InputError(f"the range of friction is {lower} to {upper}: it must ascend from 0 or above")
    if pencils.damping is not None and pencils.damping.any():
        raise InputError("boundaries are found for undamped pencils only: damping must be zero")
    search = _Search(pencils)
    samples = len(pencils.stiffness)
    grid = np.linspace(lower, upper, GRID)
    points = search.points(np.repeat(np.arange(samples), GRID), np.tile(grid, samples))
    todo = []
    for i in range(samples):
        own = points[i * GRID : (i + 1) * GRID]
        todo += [(i, a, b) for a, b in pairwise(own)]
    found: list[tuple[int, Point, Point]] = []
    while todo:
        middles = search.points(
            np.array([i for i, _, _ in todo]), np.array([(a.friction + b.friction) / 2 for _, a, b in todo])
        )
        rest = []
        for (i, a, b), m in zip(todo, middles, strict=True):
            if a.count == b.count == m.count:
                if b.friction - a.friction > NARROWEST and not apart(a, m, b, search.scale[i]):
                    rest += [(i, a, m), (i, m, b)]
            elif single(a, m, b, search.scale[i]):
                found.append((i, a, m) if a.count != m.count else (i, m, b))
            elif b.friction - a.friction > NARROWEST:
                rest += [(i, a, m), (i, m, b)]
            else:
                found.append((i, a, b))
        todo = rest
    result: list[list[Boundary]] = [[] for _ in range(samples)]
    for i, a, b in found:
        # Where several roots nearly meet, the rounding of A0 + mu A1 alone can couple them.
        if search.exact_count(i, a) != search.exact_count(i, b):
            if abs(a.count - b.count) != 1:
                raise InputError(
                    f"several pairs of sample {i} merge at friction {a.friction}: they cannot be told apart"
                )
            result[i].append(search.solve(i, a, b))
    return [
        search.beyond_rounding(i, sorted(part, key=lambda one: one.friction)) for i, part in enumerate(result)
    ]


class _Search:
    """The pencils of a batch, with what is computed from them once."""

    def __init__(self, pencils: Pencils) -> None:
        self.constant, self.slope = pencils.reduced_parts()
        self.mechanisms = pencils.mechanisms
        self.filter_radius = pencils.filter_radius
        self.scale = norms(self.constant) / np.sqrt(self.constant.shape[1])
        self.norm = norms(self.constant)
        self._exact: dict[int, ExactPencil] = {}

    def points(self, rows: NDArray[np.intp], friction: Array) -> list[Point]:
        """Return the eigenvalues of samples at frictions, real and complex ones told apart for sure."""
        made = []
        for start in range(0, len(rows), 4096):
            part, mu = rows[start : start + 4096], friction[start : start + 4096]
            matrices = self.constant[part] + mu[:, None, None] * self.slope[part]
            roots = judged_roots(matrices, self.mechanisms[part], 0.0, AUTO, self.filter_radius)
            for value, rigid, at in zip(roots.values, roots.rigid, mu, strict=True):
                own = value[~rigid]
                made.append(Point(float(at), np.sort(own[own.imag == 0].real), own[own.imag > 0]))
        return made

    def exact(self, i: int) -> ExactPencil:
        """Return the exact characteristic polynomial of a sample's pencil."""
        if i not in self._exact:
            self._exact[i] = ExactPencil(self.constant[i], self.slope[i])
        return self._exact[i]

    def exact_count(self, i: int, point: Point) -> int:
        """Return the proved number of coalesced pairs of the exact pencil at a point.

        Raises
        ------
        InputError
            If the mechanisms that were declared are not there.
        """
        m = int(self.mechanisms[i])
        near = np.concatenate([np.zeros(m, np.complex128), point.real, point.pairs, point.pairs.conj()])
        exact = self.exact(i)
        values = certify_polynomial(exact.at(point.friction), exact.exponent, near, m, self.norm[i])
        if values is None:
            raise InputError(
                f"sample {i} has fewer mechanisms than the {m} declared, at friction {point.friction}"
            )
        return int((values.imag > 0).sum())

    def beyond_rounding(self, i: int, found: list[Boundary]) -> list[Boundary]:
        """Return the boundaries without windows that the rounding of the entries alone has opened.

        Where real eigenvalues cross without coupling, any change of the entries in their last digit
        couples them over some 1e-7 of friction. Such a window opens and closes at once, and within it
        no pair is farther from the real axis than rounding can put it.
        """
        kept: list[Boundary] = []
        group: list[Boundary] = []
        for one in [*found, None]:
            if group and (one is None or one.friction - group[-1].friction > CLOSE):
                if sum(part.direction for part in group) or not self._within_rounding(i, group):
                    kept += group
                group = []
            if one is not None:
                group.append(one)
        return kept

    def _within_rounding(self, i: int, group: list[Boundary]) -> bool:
        """Say whether no pair of a window is proved by more than the rounding of its entries."""
        b = int(block_sizes(self.constant[[i]] + self.slope[[i]])[0])
        if not b:
            return False
        friction = np.linspace(group[0].friction, group[-1].friction, 17)
        matrices = self.constant[i] + friction[:, None, None] * self.slope[i]
        values, radius = structured_eigenvalues(matrices, np.linalg.eigvals(matrices).astype(complex), b)
        # Only the pairs of the window: others are far from the axis at both its ends too.
        here = np.abs(values - (2 * np.pi * group[0].frequency) ** 2) < 1e-6 * np.abs(values)
        return bool((np.abs(values.imag) <= radius)[here].all())

    def solve(self, i: int, a: Point, b: Point) -> Boundary:
        """Solve for the one boundary between two points by a bracketed secant on the exact squared gap."""
        exact = self.exact(i)
        unit = 2.0**exact.exponent
        below, above = (a, b) if a.count < b.count else (b, a)
        k, pair = merging(below, above)
        gap = {below.friction: (below.real[k + 1] - below.real[k]) ** 2}
        gap[above.friction] = -4 * above.pairs[pair].imag ** 2
        centre = float(above.pairs[pair].real)
        (x0, x1), (f0, f1) = (a.friction, b.friction), (gap[a.friction], gap[b.friction])
        x = x0
        for _ in range(100):
            last = x
            x = (x0 * f1 - x1 * f0) / (f1 - f0)
            if not min(x0, x1) < x < max(x0, x1):
                x = (x0 + x1) / 2
            f, centre = _exact_gap(exact, x, centre, unit)
            if f == 0 or abs(x - last) <= 1e-15 * abs(x):
                break
            # Illinois: an end that stays is weighed down, so that both ends come in.
            if (f > 0) == (f1 > 0):
                x1, f1, f0 = x, f, f0 / 2
            else:
                x0, f0, x1, f1 = x1, f1, x, f
        return self._proved(i, x, centre, 1 if b.count > a.count else -1)

    def _proved(self, i: int, friction: float, centre: float, direction: int) -> Boundary:
        """Return the boundary with whether it is proved, its mode and frequency."""
        exact = self.exact(i)
        unit = 2.0**exact.exponent
        m = int(self.mechanisms[i])
        counts, mode = [], 0
        for side in (friction * (1 - SIDE), friction * (1 + SIDE)):
            gap, middle = _exact_gap(exact, side, centre, unit)
            near = self._approximations(i, side, middle, gap)
            values = certify_polynomial(exact.at(side), exact.exponent, near, m, self.norm[i])
            counts.append(None if values is None else int((values.imag > 0).sum()))
            if values is not None and gap < 0:
                frequency = np.sqrt(values).real
                own = frequency[np.argmin(np.abs(values - complex(middle, np.sqrt(-gap) / 2)))]
                mode = int((frequency < own).sum()) + 2
        certified = None not in counts and counts[1] == (counts[0] or 0) + direction
        return Boundary(float(friction), direction, mode, float(np.sqrt(centre) / (2 * np.pi)), certified)

    def _approximations(self, i: int, friction: float, middle: float, gap: float) -> Complex:
        """Return approximations of all roots beside a boundary, those of the pair from its squared gap."""
        matrix = (self.constant[i] + friction * self.slope[i])[None]
        near = np.linalg.eigvals(matrix).astype(np.complex128)
        size = int(block_sizes(matrix)[0])
        if size:
            near, _ = structured_eigenvalues(matrix, near, size)
        m = int(self.mechanisms[i])
        rest = near[0][np.argsort(np.abs(near[0]), kind="stable")[m:]]
        rest = np.delete(rest, np.argsort(np.abs(rest - middle), kind="stable")[:2])
        half = np.sqrt(complex(gap)) / 2
        return np.concatenate([np.zeros(m), rest, [middle + half, middle - half]])


def _exact_gap(exact: ExactPencil, friction: float, centre: float, unit: float) -> tuple[float, float]:
    """Return the squared gap of the pair about `centre`, and its centre, from exact values.

    About the extremum of p between the roots p is p'' / 2 ((w - m)^2 - gap^2 / 4) up to third order.
    """
    p = exact.at(friction)
    first = p.derivative()
    second = first.derivative()
    w = int(centre / unit)
    for _ in range(3):
        curvature = int(second(w))
        if curvature == 0:
            break
        step = int(first(w)) / curvature
        w -= round(step)
    curvature = int(second(w))
    offset = int(first(w)) / curvature
    squared = 4 * (offset**2 - 2 * (int(p(w)) / curvature))
    return squared * unit**2, (w - offset) * unit
