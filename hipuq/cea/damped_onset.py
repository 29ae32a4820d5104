"""Every friction at which a mode begins or ceases to grow faster than a threshold, each proved.

Pencils ``l**2 + l D + A0 + mu A1`` with damping, or without it and with a threshold g above 0: eigenvalues
pass the line Re l = g, in pairs g +- i omega (flutter) or real ones alone (divergence). The search divides
intervals of friction until it is shown of each (`hipuq.cea.crossing`) that no eigenvalue can pass the line
in it, or just one, and once. The crossing is then solved for, with residuals in exact integers, and
proved: the exact numbers of eigenvalues right of the line at a relative distance of 1e-12 below and above
it differ as they should (`hipuq.cea.growing`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.boundary import SIDE, Boundary
from hipuq.cea.bounds import Complex
from hipuq.cea.crossing import Expansion, expansion, passing
from hipuq.cea.gaps import NARROWEST
from hipuq.cea.growing import Sides, exact_sides
from hipuq.cea.mechanisms import without_mechanisms
from hipuq.cea.newton import Crossing, solve_crossing
from hipuq.cea.numbering import TIE, mode_order
from hipuq.cea.onset import boundaries, check_range
from hipuq.cea.pencils import Array, Pencils
from hipuq.cea.windows import pair_crossings
from hipuq.errors import InputError

GRID = 16
"""Intervals of friction at which every pencil is looked at first."""

MOST = 3000
"""Open intervals of one pencil at once: more mean that a mode stays on the threshold."""

MOST_NARROW = 100
"""The same of intervals too narrow to be divided: each costs exact arithmetic at both its ends."""

CHUNK = 512
"""Intervals looked at together."""

Found = tuple[int, Crossing, int]
"""Sample, crossing and whether it leads out of (1) or back into (-1) stability."""


def damped_boundaries(
    pencils: Pencils, lower: float, upper: float, threshold: float = 0.0
) -> list[list[Boundary]]:
    """Find every friction in a range at which an eigenvalue passes the line Re l = threshold.

    Parameters
    ----------
    pencils : Pencils
        s samples; their own friction is not used. Damping must be the same for every friction.
    lower, upper : float
        Range of friction, lower < upper [1].
    threshold : float, default 0
        Growth rate g above which a mode is unstable, not negative [1/s].

    Returns
    -------
    list of list of Boundary
        For each sample, ascending. A pair that passes the line is one mode, and so is a single real
        eigenvalue. A change exactly at an end of the range is not one inside it. Windows narrower than
        `NARROWEST` may be missed.

    Raises
    ------
    InputError
        If the range does not ascend or is not finite, the threshold is negative or not finite, a sample
        is undamped and the threshold 0, mechanisms cannot be taken out, or an eigenvalue stays on the
        line or several pass it at once.
    """
    check_range(lower, upper)
    if not (np.isfinite(threshold) and threshold >= 0):
        raise InputError(f"threshold is {threshold}: it must be a finite number of 1/s, 0 or above")
    constant, slope = pencils.reduced_parts()
    damping = pencils.reduced()[1]
    if damping is None:
        damping = np.zeros_like(constant)
    damped = np.asarray(damping.any(axis=(1, 2)))
    if threshold == 0 and not damped.all():
        raise InputError(
            f"sample {int(np.argmin(damped))} is undamped: its modes cannot pass a threshold of 0 one by one"
        )
    result: list[list[Boundary]] = [[] for _ in constant]
    for m, drag in sorted({(int(m), bool(drag)) for m, drag in zip(pencils.mechanisms, damped, strict=True)}):
        rows = np.flatnonzero((pencils.mechanisms == m) & (damped == drag))
        matrices = without_mechanisms(rows, constant[rows], slope[rows], damping[rows], m)
        family = _Family(rows, *matrices, drag, threshold)
        for i, crossing, direction in _all_crossings(family, pencils, lower, upper):
            result[rows[i]].append(_proved(family, i, crossing, direction, m))
    return [sorted(part, key=lambda one: one.friction) for part in result]


@dataclass(frozen=True)
class _Family:
    """Samples with as many mechanisms, taken out, all damped or all undamped."""

    samples: NDArray[np.intp]
    constant: Array
    slope: Array
    damping: Array
    damped: bool
    threshold: float

    def about(self, rows: NDArray[np.intp], friction: Array) -> Expansion:
        """Return the state spaces of samples about frictions."""
        damping = self.damping[rows] if self.damped else None
        return expansion(self.constant[rows], self.slope[rows], damping, friction)

    def sides(self, i: int, friction: float) -> Sides:
        """Return the exact eigenvalues of a sample and their sides."""
        return exact_sides(self.constant[i], self.slope[i], self.damping[i], self.threshold, friction)

    def null_vector(self, i: int, near: complex, friction: float) -> Complex:
        """Return the vector that the pencil of a sample at an approximate eigenvalue nearly maps to 0."""
        stiffness = self.constant[i] + friction * self.slope[i]
        if near.imag == 0:
            near = near.real
        pencil = near**2 * np.eye(len(stiffness)) + near * self.damping[i] + stiffness
        return np.asarray(np.linalg.svd(pencil)[2][-1].conj(), np.complex128)

    def solve(self, i: int, near: complex, shape: Complex, friction: float) -> Crossing | None:
        """Return the crossing of a sample near an eigenvalue and a friction."""
        parts = (self.constant[i], self.slope[i], self.damping[i])
        return solve_crossing(*parts, self.threshold, abs(near.imag), shape, friction)


def _all_crossings(family: _Family, pencils: Pencils, lower: float, upper: float) -> list[Found]:
    """Return the crossings inside the range; of undamped pencils within their windows of flutter."""
    if family.damped:
        return _crossings(family, np.arange(len(family.samples)), lower, upper)
    found, rest = [], []
    undamped = replace(pencils.rows(family.samples), damping=None)
    for i, own in enumerate(boundaries(undamped, lower, upper)):
        ends = [lower, *(one.friction for one in own), upper]
        guesses = pair_crossings(family.constant[i], family.slope[i], ends, family.threshold)
        solved = [(family.solve(i, one.value, one.shape, one.friction), one) for one in guesses or ()]
        if guesses is None or not all(
            crossing is not None and one.lower <= crossing.friction <= one.upper for crossing, one in solved
        ):
            rest.append(i)
            continue
        found += [(i, crossing, one.direction) for crossing, one in solved if crossing is not None]
    return _inside(found, lower, upper) + _crossings(family, np.array(rest, np.intp), lower, upper)


def _crossings(family: _Family, samples: NDArray[np.intp], lower: float, upper: float) -> list[Found]:
    """Return the crossings of some samples inside the range."""
    search = _Search(family)
    width = (upper - lower) / GRID
    row = np.repeat(samples, GRID)
    middle = np.tile(lower + width * (np.arange(GRID) + 0.5), len(samples))
    half = np.full(row.size, width / 2)
    while row.size:
        search.limit(np.bincount(row), MOST, middle[0])
        chunks = [slice(start, start + CHUNK) for start in range(0, row.size, CHUNK)]
        rest = [search.judged(row[chunk], middle[chunk], half[chunk]) for chunk in chunks]
        row, middle, half = (np.concatenate(parts) for parts in zip(*rest, strict=True))
    return _inside(search.found, lower, upper)


class _Search:
    """Crossings of a family found so far."""

    def __init__(self, family: _Family) -> None:
        self.family = family
        self.found: list[Found] = []
        self.narrow_count = np.zeros(len(family.samples), np.intp)

    def judged(
        self, row: NDArray[np.intp], middle: Array, half: Array
    ) -> tuple[NDArray[np.intp], Array, Array]:
        """Find the crossings of intervals, and return the new intervals to look at."""
        family = self.family
        about = family.about(row, middle)
        new: list[tuple[NDArray[np.intp], Array, Array]] = []
        while row.size:
            verdict = passing(about, half, family.threshold)
            again = verdict == -2
            for j in np.flatnonzero(verdict >= 0):
                again[j] = not self.solved(about, int(j), int(verdict[j]), int(row[j]), middle[j], half[j])
            narrow = again & (2 * half < NARROWEST)
            for j in np.flatnonzero(narrow):
                self.narrow(about, int(j), int(row[j]), middle[j], half[j])
            keep = again & ~narrow
            # Thirds: the middle one is judged anew from the same eigenvalues.
            row, middle, half, about = row[keep], middle[keep], half[keep] / 3, about.rows(keep)
            new += [(row, middle + side * half, half) for side in (-2, 2)]
        rows, middles, halves = (np.concatenate(parts) for parts in zip(*new, strict=True))
        return rows, middles, halves

    def solved(self, about: Expansion, j: int, k: int, i: int, middle: float, half: float) -> bool:
        """Solve for the one crossing that an interval can have, by eigenvalue k; say whether that worked."""
        at, speed = about.values[j, k], about.slope[j, k, k]
        step = (self.family.threshold - at.real) / speed.real
        # A real eigenvalue stays real.
        near = at + step * speed if at.imag > 0 else complex(self.family.threshold)
        crossing = self.family.solve(i, near, about.vectors[j, :, k], middle + step)
        if crossing is None:
            return False
        if abs(crossing.friction - middle) <= half * (1 + 1e-9):
            self.found.append((i, crossing, 1 if speed.real > 0 else -1))
        return True

    def narrow(self, about: Expansion, j: int, i: int, middle: float, half: float) -> None:
        """Find the crossing of an interval too narrow to be divided, if the exact counts differ."""
        family = self.family
        self.narrow_count[i] += 1
        self.limit(self.narrow_count, MOST_NARROW, middle)
        below, above = (family.sides(i, friction).right for friction in (middle - half, middle + half))
        if below is None or above is None:
            raise self.undecided(i, middle)
        change = above - below
        if change == 0:
            return
        at = about.values[j]
        nearest = int(np.argmin(np.where(at.imag >= 0, np.abs(at.real - family.threshold), np.inf)))
        # One alone is real, though the nearest eigenvalue may be a pair about to part into two real ones.
        near = complex(family.threshold, 0.0 if abs(change) == 1 else at[nearest].imag)
        crossing = family.solve(i, near, family.null_vector(i, near, middle), middle)
        if (
            crossing is None
            or abs(crossing.friction - middle) > half * (1 + 1e-9)
            or abs(change) != (2 if crossing.omega > 0 else 1)
        ):
            raise InputError(
                f"several eigenvalues of sample {family.samples[i]} pass the growth rate "
                f"{family.threshold} 1/s at friction {middle}: they cannot be told apart"
            )
        self.found.append((i, crossing, int(np.sign(change))))

    def limit(self, numbers: NDArray[np.intp], most: int, friction: float) -> None:
        """Refuse a sample of which so many intervals stay open that an eigenvalue must follow the line."""
        crowded = int(numbers.argmax())
        if numbers[crowded] > most:
            raise self.undecided(crowded, friction)

    def undecided(self, i: int, friction: float) -> InputError:
        """Return the error that says that an eigenvalue of a sample stays on the line."""
        return InputError(
            f"an eigenvalue of sample {self.family.samples[i]} stays within rounding of the growth rate "
            f"{self.family.threshold} 1/s about friction {friction}: no boundary can be told"
        )


def _inside(found: list[Found], lower: float, upper: float) -> list[Found]:
    """Return the crossings inside the range, without those found twice at the common end of intervals."""
    kept: list[Found] = []
    for one in sorted(found, key=lambda one: (one[0], one[1].friction)):
        same = kept and kept[-1][0] == one[0] and kept[-1][2] == one[2]
        if same and abs(kept[-1][1].friction - one[1].friction) <= 1e-14 * one[1].friction:
            a, b = kept[-1][1].omega, one[1].omega
            if abs(a - b) <= 1e-9 * max(a, b):
                continue
        kept.append(one)
    return [one for one in kept if lower < one[1].friction < upper]


def _proved(family: _Family, i: int, crossing: Crossing, direction: int, m: int) -> Boundary:
    """Return the boundary with whether it is proved, and its mode on the unstable side."""
    at = crossing.friction
    sides = [family.sides(i, friction) for friction in (at - SIDE * abs(at), at + SIDE * abs(at))]
    counts = [side.right for side in sides]
    change = direction * (2 if crossing.omega > 0 else 1)
    certified = counts[0] is not None and counts[1] == counts[0] + change
    mode = m + _number(sides[direction > 0].values, complex(family.threshold, crossing.omega))
    return Boundary(at, direction, mode, crossing.omega / (2 * np.pi), certified)


def _number(values: Complex, growing: complex) -> int:
    """Return the number of the mode nearest to `growing`, counted as modes without mechanisms are."""
    # Upper ones first, then real ones from the largest down: the first n are the modes.
    modes = values[np.lexsort((-values.real, -np.sign(values.imag)))[: len(values) // 2]]
    ordered = modes[mode_order(modes.imag[None], modes.real[None], TIE)[0]]
    return int(np.argmin(np.abs(ordered - growing))) + 1
