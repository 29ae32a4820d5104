"""A boundary of instability, solved for and proved with the exact characteristic polynomial."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from hipuq.cea.bounds import Complex
from hipuq.cea.brackets import Bracket
from hipuq.cea.certificate import certify_polynomial
from hipuq.cea.eigenvalues import eigenvalues
from hipuq.cea.exact import ExactPencil, coalescence, exact_gap, gap_about, scaled, whole
from hipuq.cea.pencils import Array
from hipuq.cea.points import Rows, Sweep, structured_values
from hipuq.cea.structured import structured_eigenvalues
from hipuq.errors import InputError

SIDE = 1e-12
"""Relative distance from a boundary at which both its sides are looked at for the certificate."""

CLOSE = 1e-6
"""Boundaries nearer to each other than this are looked at together, see `_beyond_rounding`."""


@dataclass(frozen=True)
class Boundary:
    """A friction at which modes become unstable or stable again.

    Attributes
    ----------
    friction : float
        mu [1].
    direction : int
        How many more modes are unstable above it, negative if fewer; 1 or -1 unless several change
        within less than can be resolved.
    mode : int
        Number of the growing mode, by frequency, on the unstable side.
    frequency : float
        Frequency there [Hz]: common to the pair, 0 for divergence.
    certified : bool
        Whether the change is proved between (1 - SIDE) and (1 + SIDE) times the friction.
    """

    friction: float
    direction: int
    mode: int
    frequency: float
    certified: bool


def inside(found: list[Boundary], lower: float, upper: float) -> list[Boundary]:
    """Return the boundaries of a range, without those at its ends to within what is solved for."""
    reach = SIDE * max(abs(lower), abs(upper))
    return [one for one in found if lower + reach < one.friction < upper - reach]


def proved(sweep: Sweep, brackets: list[Bracket]) -> list[list[Boundary]]:
    """Solve for the boundaries in brackets and prove them.

    Parameters
    ----------
    sweep : Sweep
    brackets : list of Bracket

    Returns
    -------
    list of list of Boundary
        For each sample, ascending. Brackets whose ends have the same proved number of unstable modes
        hold none.
    """
    exact: dict[int, ExactPencil] = {}
    for i in {bracket.row for bracket in brackets}:
        exact[i] = ExactPencil(sweep.constant[i], sweep.slope[i])
    if not brackets:
        return [[] for _ in range(len(sweep.constant))]
    row = np.array([one.row for one in brackets], np.intp)
    solved = [_solved(exact[one.row], one, int(sweep.mechanisms[one.row])) for one in brackets]
    # Both sides of a boundary are so near to it that its roots will do for them.
    near = _approximations(sweep, row, np.array([one.friction for one in solved]))
    result: list[list[Boundary]] = [[] for _ in range(len(sweep.constant))]
    for bracket, place, start in zip(brackets, solved, near, strict=True):
        prove = _flutter if bracket.change[0] else _divergence
        own = exact[bracket.row]
        boundary = prove(sweep, own, bracket, place, start)
        if place.by_newton and not boundary.certified:
            # The double root that Newton's method found may be another one.
            place = _Solved(*_bracketed(own, bracket, int(sweep.mechanisms[bracket.row])))
            boundary = prove(sweep, own, bracket, place, start)
        if boundary.certified or _differs(sweep, own, bracket):
            result[bracket.row].append(boundary)
    ordered = (sorted(part, key=lambda one: one.friction) for part in result)
    return [_beyond_rounding(sweep, i, part) for i, part in enumerate(ordered)]


@dataclass(frozen=True)
class _Solved:
    """Where something passes through zero: the friction, and the root or middle of the pair there."""

    friction: float
    centre: float
    by_newton: bool = False

    @property
    def sides(self) -> tuple[float, float]:
        """The frictions below and above between which the change is proved."""
        return self.friction - SIDE * abs(self.friction), self.friction + SIDE * abs(self.friction)


def _solved(exact: ExactPencil, bracket: Bracket, mechanisms: int) -> _Solved:
    """Return the zero in a bracket: where two roots coalesce by Newton's method, if that stays in it."""
    (x0, x1), (f0, f1), (c0, c1) = bracket.friction, bracket.values, bracket.centre
    if abs(sum(bracket.change)) > 1:
        return _Solved(float((x0 + x1) / 2), float(c0))
    if bracket.change[0] and f0 * f1 < 0:
        t = float(f0 / (f0 - f1))
        found = coalescence(exact, float(x0 + (x1 - x0) * t), float(c0 + (c1 - c0) * t))
        if found is not None and x0 < found[0] < x1:
            return _Solved(found[0], scaled(found[1], exact.exponent), by_newton=True)
    return _Solved(*_bracketed(exact, bracket, mechanisms))


def _bracketed(exact: ExactPencil, bracket: Bracket, mechanisms: int) -> tuple[float, float]:
    """Return the zero in a bracket, by a bracketed secant on exact values, and the root there."""
    (x0, x1), (f0, f1), (c0, c1) = bracket.friction, bracket.values, bracket.centre

    def value(x: float, centre: float, gap: float) -> tuple[float, float]:
        if bracket.change[0]:
            return exact_gap(exact, x, centre, gap)
        p = exact.at(x)
        # Proportional to the product of the roots other than mechanisms.
        ratio = Fraction(int(p[mechanisms]), int(p[exact.n]) << (exact.n - mechanisms) * exact.bits)
        return float(ratio), 0.0

    if not np.all(f0 * f1 < 0) or not bracket.change[0]:
        (f0, c0), (f1, c1) = value(float(x0), float(c0), 0.0), value(float(x1), float(c1), 0.0)
    for x, f, centre in ((x0, f0, c0), (x1, f1, c1)):
        # An end of the bracket may be the boundary itself.
        if f == 0:
            return float(x), float(centre)
    if np.isnan([f0, f1]).any():
        return float((x0 + x1) / 2), float(c0)
    x, centre = float(x0), float(c0)
    for _ in range(100):
        last = x
        x = float((x0 * f1 - x1 * f0) / (f1 - f0) if f1 != f0 else x0)
        if not min(x0, x1) < x < max(x0, x1):
            x = float((x0 + x1) / 2)
        # Gap and middle of the pair are smooth in friction: a line through two values finds it again.
        t = (x - x0) / (x1 - x0)
        f, centre = value(x, float(c0 + (c1 - c0) * t), float(f0 + (f1 - f0) * t))
        if f == 0 or np.isnan(f) or abs(x - last) <= 1e-15 * abs(x):
            break
        # Illinois: an end that stays is weighed down, so that both ends come in.
        if (f > 0) == (f1 > 0):
            x1, f1, c1, f0 = x, f, centre, f0 / 2
        else:
            x0, f0, c0, x1, f1, c1 = x1, f1, c1, x, f, centre
    return x, centre


def _approximations(sweep: Sweep, row: Rows, friction: Array) -> Complex:
    """Return approximations of all roots, mechanisms too, (N, n)."""
    matrices = sweep.matrices(row, friction)
    values = eigenvalues(matrices)
    sizes = sweep.sizes[row]
    for size in np.unique(sizes[sizes > 0]):
        same = np.flatnonzero(sizes == size)
        values[same] = structured_values(matrices[same], values[same], int(size), sweep.mechanisms[row[same]])
    return values


def _flutter(sweep: Sweep, exact: ExactPencil, bracket: Bracket, solved: _Solved, near: Complex) -> Boundary:
    """Return the boundary at which a pair of roots coalesces or parts, with what is proved of it."""
    m = int(sweep.mechanisms[bracket.row])
    rest = near[np.argsort(np.abs(near), kind="stable")[m:]]
    rest = np.delete(rest, np.argsort(np.abs(rest - solved.centre), kind="stable")[:2])
    counts: list[int | None] = []
    mode = 0
    for side in solved.sides:
        polynomial = exact.at(side)
        # The pair itself from its exact squared gap: approximations of it are not good enough.
        gap, middle = gap_about(polynomial, whole(solved.centre, exact.exponent), exact.exponent)
        if np.isnan(gap):
            counts.append(None)
            continue
        half = np.sqrt(complex(gap)) / 2
        roots = np.concatenate([np.zeros(m), rest, [middle + half, middle - half]])
        values = certify_polynomial(polynomial, exact.exponent, roots, m, sweep.norm[bracket.row])
        counts.append(None if values is None else int((values.imag > 0).sum()))
        if gap < 0:
            frequencies = np.sqrt(roots).real
            mode = int((frequencies < frequencies[-1]).sum()) + 2
    certified = None not in counts and counts[1] == (counts[0] or 0) + bracket.change[0]
    frequency = float(np.sqrt(max(solved.centre, 0.0)) / (2 * np.pi))
    return Boundary(solved.friction, sum(bracket.change), mode, frequency, certified)


def _divergence(
    sweep: Sweep, exact: ExactPencil, bracket: Bracket, solved: _Solved, near: Complex
) -> Boundary:
    """Return the boundary at which a real root passes through zero.

    Proved by the sign of the determinant on both sides, which mechanisms would make zero.
    """
    m = int(sweep.mechanisms[bracket.row])
    signs = [int(exact.at(side)[0]) > 0 for side in solved.sides]
    certified = m == 0 and abs(bracket.change[1]) == 1 and signs[0] != signs[1]
    return Boundary(solved.friction, bracket.change[1], m + 1, 0.0, certified)


def _differs(sweep: Sweep, exact: ExactPencil, bracket: Bracket) -> bool:
    """Say whether the numbers of unstable roots proved at the ends of a bracket differ.

    Raises
    ------
    InputError
        If the mechanisms that were declared are not there.
    """
    m = int(sweep.mechanisms[bracket.row])
    counts = []
    near = _approximations(sweep, np.full(2, bracket.row), bracket.friction)
    for friction, start in zip(bracket.friction, near, strict=True):
        p = exact.at(float(friction))
        values = certify_polynomial(p, exact.exponent, start, m, sweep.norm[bracket.row])
        if values is None:
            raise InputError(
                f"sample {bracket.row} has fewer mechanisms than the {m} declared, at friction {friction}"
            )
        counts.append(((values.imag > 0) | (values.real < 0) & (values.imag == 0)).sum())
    return bool(counts[0] != counts[1])


def _beyond_rounding(sweep: Sweep, row: int, found: list[Boundary]) -> list[Boundary]:
    """Return the boundaries without windows that the rounding of the entries alone has opened.

    Where real eigenvalues cross without coupling, any change of the entries in their last digit
    couples them over some 1e-7 of friction. Such a window opens and closes at once, and within it
    no pair is farther from the real axis than rounding can put it.
    """
    kept: list[Boundary] = []
    group: list[Boundary] = []
    for one in [*found, None]:
        if group and (one is None or one.friction - group[-1].friction > CLOSE):
            if sum(part.direction for part in group) or not _within_rounding(sweep, row, group):
                kept += group
            group = []
        if one is not None:
            group.append(one)
    return kept


def _within_rounding(sweep: Sweep, row: int, group: list[Boundary]) -> bool:
    """Say whether the rounding of the entries can have opened a window.

    It can where no pair inside is farther from the real axis than its bound or, of a window in which
    a pair has parted, where its real roots are nowhere apart.
    """
    size = int(sweep.sizes[row])
    if not size:
        return False
    friction = np.linspace(group[0].friction, group[-1].friction, 17)
    matrices = sweep.matrices(np.full(17, row), friction)
    values, radius = structured_eigenvalues(matrices, eigenvalues(matrices), size)
    near = np.abs(values - (2 * np.pi * group[0].frequency) ** 2)
    if group[0].direction > 0:
        # Only the pairs of the window: others are far from the axis at both its ends too.
        return not ((near < 1e-6 * np.abs(values)) & (np.abs(values.imag) > radius)).any()
    own, bound = (np.take_along_axis(part, near.argsort(axis=1)[:, :2], axis=1) for part in (values, radius))
    return not (np.abs(own[:, 1] - own[:, 0]) > bound.sum(axis=1)).any()
