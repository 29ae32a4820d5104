"""Real roots and pairs of block tridiagonal matrices, as factors of the characteristic polynomial.

What the search for boundaries asks of many matrices is whether two near eigenvalues are real or a pair. The
iteration of `hipuq.cea.structured` moves every root by itself, and where two nearly meet it converges
linearly. Here two near roots are moved together, as the two numbers that make their quadratic factor: real
ones, whether the roots are or not, and smooth where the roots have a square root. With the other roots as
they are, the logarithmic derivative of the polynomial at two points, or at one that is not real, gives the
factor: as Newton's method does, with errors that are squared in each step, also for a double root.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import EPS, Complex
from hipuq.cea.pencils import Array
from hipuq.cea.structured import (
    SAFETY,
    Blocks,
    Numbers,
    Rows,
    logarithmic_derivative,
    structured_condition,
)

Mask = NDArray[np.bool_]

STEPS = 20
"""Steps after which factors that still move are left as they are, with their last step in the bound."""

FINE = 200 * EPS
"""Last step, over the largest root, of a factor that is found."""

STILL = 1e-9
"""The same of one that no longer comes nearer."""

NEAR = 1e-6
"""Roots this near to the real axis, over the largest root, may be real ones that rounding has moved."""

TRACE = 1e-7
"""Error of the sum of the roots, over the largest, that does not speak against them."""

APART = 1e-11
"""Least distance, over the largest root, of the points at which a factor is looked at from its middle."""


BESIDE = 1.25
"""Distance of these points over that of the roots, at which the derivative is not finite."""

ANEW = (3, 6)
"""Steps before which roots are put together anew."""


@dataclass
class _Factors:
    """Factors ``(w - middle)**2 - square``, with the columns of their roots, both the same for just one."""

    row: Rows
    first: Rows
    second: Rows
    middle: Array
    square: Array

    def take(self, index: Mask) -> _Factors:
        """Return some of them."""
        columns = self.row[index], self.first[index], self.second[index]
        return _Factors(*columns, self.middle[index], self.square[index])

    def put(self, values: Complex, scale: Array) -> None:
        """Put their roots in place, (s, n); real ones nearer than rounding can tell stay that far apart."""
        least = np.square(FINE * scale[self.row, 0])
        square = np.where(self.square < 0, self.square, np.maximum(self.square, least))
        half = np.sqrt(square.astype(np.complex128))
        pair = self.second != self.first
        values[self.row, self.first] = self.middle + np.where(pair, half, 0.0)
        values[self.row[pair], self.second[pair]] = (self.middle - half)[pair]


def factored_eigenvalues(matrices: Array, start: Complex, b: int, moving: Mask) -> tuple[Complex, Array]:
    """Return eigenvalues of block tridiagonal matrices of which some are refined, and their error bounds.

    Parameters
    ----------
    matrices : (s, n, n) array
    start : (s, n) complex array
        Approximations; exact conjugates are side by side, the upper one first.
    b : int
        Block size.
    moving : (s, n) array of bool
        Which are to be refined, of a pair both; the others are good as they are, and their bound is 0.

    Returns
    -------
    values : (s, n) complex array
        Those that are real within their bounds exactly so. Those that rounding cannot tell apart are apart
        by as much as it can, so that roots that are one for every friction keep their distance.
    radius : (s, n) array
        SAFETY * eps * structured condition number of roots near the real axis, whose bound says whether
        they are real, and an estimate for others. Infinite for all of a matrix of which one was not found.
    """
    values, n = start.copy(), start.shape[1]
    scale = np.maximum(np.abs(start).max(axis=1, keepdims=True), np.finfo(np.float64).tiny)
    step = np.where(moving, np.inf, 0.0)
    blocks = Blocks(matrices, b)
    factors = _factors(values, np.arange(len(values)), moving)
    with np.errstate(all="ignore"):
        for number in range(STEPS):
            if not factors.row.size:
                break
            if number in ANEW:
                # Roots that two factors share would come to rest slowly.
                rows = np.unique(factors.row)
                factors = _factors(values[rows], rows, moving[rows])
            own = scale[factors.row, 0]
            size = _step(blocks, values, factors, own)
            factors.put(values, scale)
            # A small step that is no smaller than the one before is what rounding leaves.
            still = size >= 0.9 * step[factors.row, factors.first]
            rest = (size <= FINE * own) | ((size <= STILL * own) & still)
            step[factors.row, factors.first] = step[factors.row, factors.second] = size
            # Each leans on the others: a matrix is done when all of its factors rest.
            moved = np.bincount(factors.row, weights=~rest, minlength=len(values)) > 0
            factors = factors.take(moved[factors.row])
        height = np.abs(values.imag)
        near = moving & (height < NEAR * scale) & (height > SAFETY * EPS * scale)
        row, root = np.nonzero(near)
        condition = np.broadcast_to(scale, values.shape).copy()
        if row.size:
            known = structured_condition(blocks.rows(row), values, row, root)
            # A root of which no condition number can be had is as good as double.
            condition[row, root] = np.nan_to_num(known, nan=NEAR / EPS / SAFETY * scale[row, 0])
    radius = SAFETY * EPS * np.maximum(condition, scale) + n / 2 * step
    # The square of half the gap is as good as its value at the points at which a factor is looked at.
    with np.errstate(divide="ignore", over="ignore"):
        radius[near] += (SAFETY * EPS * APART * np.square(scale) / height)[near]
    radius[~moving] = 0.0
    # Two approximations of one root would leave another root out, and the trace wrong.
    stray = np.abs(values.sum(axis=1) - np.trace(matrices, axis1=1, axis2=2))
    wrong = ~(stray <= radius.sum(axis=1) + TRACE * scale[:, 0]) | ~np.isfinite(radius).all(axis=1)
    radius[wrong] = np.inf
    blurred = np.isfinite(radius) & (np.abs(values.imag) <= radius)
    values = np.where(blurred, values.real + np.sign(values.imag) * FINE * scale, values)
    for side in (1, -1):
        values += _apart(np.where(side * values.imag > 0, values, np.nan), FINE * scale)
    return values, radius


def _folded(values: Complex) -> Complex:
    """Return values with their conjugates in place of lower ones."""
    return values.real + 1j * np.abs(values.imag)


def _apart(values: Complex, least: Array) -> Array:
    """Return by how much to move roots nearer to each other than what rounding tells, 0 for NaN; (s, n)."""
    key = _folded(values)
    order = np.argsort(key, axis=1, kind="stable")
    with np.errstate(invalid="ignore"):
        near = np.abs(np.diff(np.take_along_axis(key, order, axis=1), axis=1)) < least
    moves = np.zeros(values.shape)
    moves[:, :-1] -= near * least
    moves[:, 1:] += near * least
    result = np.empty_like(moves)
    np.put_along_axis(result, order, moves, axis=1)
    return result


def _factors(values: Complex, rows: Rows, moving: Mask) -> _Factors:
    """Return the factors of the roots of some matrices: conjugates, and real ones nearest to each other."""
    real = moving & (values.imag == 0)
    line = np.where(real, values.real, np.inf)
    order = np.argsort(line, axis=1, kind="stable")
    with np.errstate(invalid="ignore"):
        gap = np.diff(np.take_along_axis(line, order, axis=1), axis=1)
    gap[~np.isfinite(gap)] = np.inf
    beyond = np.full((len(line), 1), np.inf)
    below = np.concatenate([beyond, gap[:, :-1]], axis=1)
    above = np.concatenate([gap[:, 1:], beyond], axis=1)
    row, place = np.nonzero(np.isfinite(gap) & (gap < below) & (gap <= above))
    first, second = order[row, place], order[row, place + 1]
    alone = real.copy()
    alone[row, first] = alone[row, second] = False
    # Conjugates have the same place among the upper and the lower ones.
    up, down = (
        np.argsort(
            np.where(moving & (side * values.imag > 0), _folded(values), np.nan), axis=1, kind="stable"
        )
        for side in (1, -1)
    )
    upper_row, place = np.nonzero(
        np.arange(values.shape[1]) < (moving & (values.imag > 0)).sum(axis=1)[:, None]
    )
    upper, lower = up[upper_row, place], down[upper_row, place]
    single_row, single = np.nonzero(alone)
    row = np.concatenate([row, upper_row, single_row])
    first, second = np.concatenate([first, upper, single]), np.concatenate([second, lower, single])
    one, two = values[row, first], values[row, second]
    square = np.where(one.imag > 0, -np.square(one.imag), np.square((one.real - two.real) / 2))
    return _Factors(rows[row], first, second, (one.real + two.real) / 2, square)


def _step(blocks: Blocks, values: Complex, factors: _Factors, scale: Array) -> Array:
    """Move the factors by one step, in place; return by how much their roots move, (N,).

    With u counted from the middle and G the inverse of the logarithmic derivative of ``u**2 - s u + q``:
    ``s (u - G) - q = u**2 - 2 u G``, two linear equations for s and q from u = d and -d, or from u = i e.
    """
    pair = factors.second != factors.first
    apart = np.maximum(BESIDE * np.sqrt(np.abs(factors.square)), APART * scale)
    real = np.flatnonzero(pair & (factors.square >= 0))
    upper = np.flatnonzero(pair & (factors.square < 0))
    single = np.flatnonzero(~pair)
    d, e = apart[real], apart[upper]
    which = np.concatenate([real, real, single])
    at = factors.middle[which] + np.concatenate([d, -d, apart[single]])
    g = _inverse_derivative(blocks, values, factors, which, at)
    above, below, alone = np.split(g, [len(real), 2 * len(real)])
    z = _inverse_derivative(blocks, values, factors, upper, factors.middle[upper] + 1j * e)
    total, product = np.zeros(len(pair)), np.zeros(len(pair))
    total[real] = -2 * d * (above + below) / (2 * d - above + below)
    product[real] = total[real] * (d - above) - np.square(d) + 2 * d * above
    total[upper] = -2 * e * z.real / (e - z.imag)
    product[upper] = -total[upper] * z.real + np.square(e) - 2 * e * z.imag
    total[single] = 2 * (apart[single] - alone)
    move = total / 2
    square = np.where(pair, np.square(move) - product, 0.0)
    spread = np.abs(square - factors.square) / (2 * np.maximum(np.sqrt(np.abs(square)), apart))
    factors.middle, factors.square = factors.middle + move, square
    return np.asarray(np.maximum(np.abs(move), np.where(pair, spread, 0.0)), np.float64)


def _inverse_derivative(
    blocks: Blocks, values: Complex, factors: _Factors, which: Rows, at: Numbers
) -> Numbers:
    """Return the inverse of the logarithmic derivative of factors at points, real at real ones."""
    if not which.size:
        return at
    row = factors.row[which]
    gaps = at[:, None] - values[row]
    index = np.arange(len(row))
    gaps[index, factors.first[which]] = gaps[index, factors.second[which]] = np.inf
    others = (1.0 / gaps).sum(axis=1)
    whole = logarithmic_derivative(blocks.rows(row), at)
    if not np.iscomplexobj(at):
        others = others.real
    inverse: Numbers = 1.0 / (whole - others)
    return inverse
