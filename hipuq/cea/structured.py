"""Eigenvalues of block tridiagonal matrices by an iteration that keeps their structure.

Near an onset the last modes of the ring form a nearly defective cluster, and eigenvalues from dense
LAPACK are off by 1e-6 there, because its rounding errors fill the zeros of the matrix. An
Ehrlich-Aberth iteration on det(A - w), evaluated by block LU, makes errors in the entries that are
there only, and to those the eigenvalues are insensitive (D. A. Bini, L. Gemignani, F. Tisseur, SIAM
J. Matrix Anal. Appl. 27 (2005) 153, for the tridiagonal case).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import EPS, Complex
from hipuq.cea.pencils import Array

Rows = NDArray[np.intp]
Numbers = NDArray[Any]
"""Real or complex numbers: where all are real that is cheaper."""

MAXIMUM_STEPS = 60
"""Steps after which a root that still moves is taken as not found."""

SAFETY = 100.0
"""Factor on the first-order bound eps * structured condition number, for the rounding in n block
steps of the LU: twelve times the largest error seen, 8.3, in 5,000 samples compared with exact roots;
``tests/validate_filter.py`` repeats the comparison."""


def block_sizes(matrices: Array) -> NDArray[np.intp]:
    """Return the block size of each matrix of a batch.

    Parameters
    ----------
    matrices : (s, n, n) array

    Returns
    -------
    (s,) array of int
        The smallest b that divides n and leaves at least three blocks, such that all entries outside
        the three block diagonals are zero; 0 if there is none.
    """
    n = matrices.shape[1]
    index = np.arange(n)
    filled = matrices != 0
    sizes = np.zeros(len(matrices), np.intp)
    for b in range(n // 3, 0, -1):
        if n % b == 0:
            outside = np.abs(index[:, None] // b - index // b) > 1
            sizes[~filled[:, outside].any(axis=1)] = b
    return sizes


def structured_eigenvalues(
    matrices: Array,
    start: Complex,
    b: int,
    fixed: NDArray[np.bool_] | None = None,
) -> tuple[Complex, Array]:
    """Return the eigenvalues of block tridiagonal matrices and their error bounds.

    Parameters
    ----------
    matrices : (s, n, n) array
    start : (s, n) complex array
        Approximations, such as LAPACK's.
    b : int
        Block size.
    fixed : (s, n) array of bool, optional
        Approximations that are roots as they are and not to be moved, such as those of mechanisms, to
        which the iteration would converge slowly. Their bound is 0.

    Returns
    -------
    values : (s, n) complex array
        Real ones have an imaginary part of exactly 0 where the bound says that they are real.
    radius : (s, n) array
        SAFETY * eps * structured condition number: how far an eigenvalue moves if every entry of the
        block tridiagonal moves by its own relative rounding, or SAFETY * eps * scale if that is more;
        and n / 2 times the last correction, because towards an n-fold root the iteration converges
        linearly. Infinite where it did not converge.
    """
    n = matrices.shape[1]
    scale = np.abs(start).max(axis=1, keepdims=True)
    scale[scale == 0] = 1.0
    # Conjugate approximations would stay conjugate though the roots are real: set them off unevenly.
    golden = np.exp(2j * np.pi * 0.381966 * np.arange(1, n + 1))
    moving = np.ones(start.shape, bool) if fixed is None else ~fixed
    values = start + np.where(moving, 1e-9 * scale * golden, 0.0)
    step = np.where(moving, np.inf, 0.0)
    blocks = Blocks(matrices, b)
    row, root = np.nonzero(moving)
    own = blocks.rows(row)
    with np.errstate(all="ignore"):
        for _ in range(MAXIMUM_STEPS):
            still = moving[row, root]
            if not still.any():
                break
            if still.mean() < 0.7:
                row, root = row[still], root[still]
                own = blocks.rows(row)
            delta = _correction(own, values, row, root)
            delta[~(np.isfinite(delta) & moving[row, root])] = 0.0
            size = np.abs(delta)
            values[row, root] -= delta
            # Corrections of rounding size no longer shrink: the attainable accuracy is reached.
            fine = EPS * scale[row, 0]
            settled = (size <= 4 * fine) | ((size <= 128 * fine) & (size >= 0.5 * step[row, root]))
            step[row, root] = np.where(moving[row, root], size, step[row, root])
            moving[row, root] &= ~settled
        row, root = np.nonzero(np.ones_like(moving))
        condition = structured_condition(blocks.rows(row), values, row, root).reshape(values.shape)
        radius = SAFETY * EPS * np.maximum(condition, scale)
        radius += 0.5 * n * step
    if fixed is not None:
        radius[fixed] = 0.0
    radius[~np.isfinite(radius) | moving] = np.inf
    # Two approximations of one root would leave another root out, and the trace wrong.
    stray = np.abs(values.sum(axis=1) - np.trace(matrices, axis1=1, axis2=2))
    radius[stray > radius.sum(axis=1)] = np.inf
    return _real_where_sure(values, radius), radius


class Blocks:
    """Block diagonals of a batch, (count, b, b, s) each: long loops over the samples are fast."""

    def __init__(self, matrices: Array, b: int) -> None:
        s, n, _ = matrices.shape
        self.count = n // b
        tiles = matrices.reshape(s, self.count, b, self.count, b).transpose(1, 3, 2, 4, 0)
        index = np.arange(self.count)
        self.diagonal = tiles[index, index].copy()
        self.lower = tiles[index[1:], index[:-1]].copy()
        self.upper = tiles[index[:-1], index[1:]].copy()

    def rows(self, rows: NDArray[np.intp]) -> Blocks:
        """Return the blocks of some samples, repeated as they are."""
        part = object.__new__(Blocks)
        part.count = self.count
        part.diagonal, part.lower, part.upper = (
            blocks.take(rows, axis=-1) for blocks in (self.diagonal, self.lower, self.upper)
        )
        return part


def _times(left: Numbers, right: Numbers) -> Numbers:
    """Return the products of small matrices, (b, b, N); matmul would cost a call for each."""
    product: Numbers = left[:, :1] * right[:1]
    for k in range(1, left.shape[0]):
        product += left[:, k : k + 1] * right[k : k + 1]
    return product


def _trace_of_product(left: Numbers, right: Numbers) -> Numbers:
    """Return the traces of products of small matrices, (N,)."""
    trace: Numbers = (left * right.swapaxes(0, 1)).sum(axis=(0, 1))
    return trace


def _inverse(matrices: Numbers) -> Numbers:
    """Return the inverses of small matrices, (b, b, N), not finite for singular ones."""
    b = len(matrices)
    if b == 1:
        return np.asarray(1.0 / matrices)
    if b == 2:
        (p, q), (r, t) = matrices
        inverse = np.empty_like(matrices)
        one = 1.0 / (p * t - q * r)
        inverse[0, 0], inverse[0, 1], inverse[1, 0], inverse[1, 1] = t * one, -q * one, -r * one, p * one
        return inverse
    stack = matrices.transpose(2, 0, 1)
    try:
        made = np.linalg.inv(stack)
    except np.linalg.LinAlgError:
        singular = (np.linalg.slogdet(stack)[0] == 0)[:, None, None]
        made = np.where(singular, np.inf, np.linalg.inv(np.where(singular, np.eye(b), stack)))
    return np.ascontiguousarray(made.transpose(1, 2, 0))


def _shifted(blocks: Blocks, values: Numbers) -> Numbers:
    """Return D_i - w for every block, (count, b, b, N)."""
    shifted: Numbers = blocks.diagonal.astype(values.dtype)
    index = np.arange(shifted.shape[1])
    shifted[:, index, index] -= values
    return shifted


def logarithmic_derivative(blocks: Blocks, at: Numbers) -> Numbers:
    """Return the logarithmic derivative of det(A - w) by w, (N,), of N matrices, at a real or complex w each.

    The sum of tr(S_i^-1 S_i') over the pivots of the block LU, S_i = D_i - w - L S_(i-1)^-1 U.
    """
    shifted = _shifted(blocks, at)
    b = shifted.shape[1]
    index = np.arange(b)
    derivative = np.zeros_like(shifted[0])
    derivative[index, index] = -1.0
    inverse = _inverse(shifted[0])
    ratio = _trace_of_product(inverse, derivative)
    for i in range(1, blocks.count):
        left = _times(blocks.lower[i - 1], inverse)
        right = _times(inverse, blocks.upper[i - 1])
        derivative = _times(_times(left, derivative), right)
        derivative[index, index] -= 1.0
        inverse = _inverse(shifted[i] - _times(left, blocks.upper[i - 1]))
        ratio += _trace_of_product(inverse, derivative)
    return ratio


def _correction(blocks: Blocks, values: Complex, row: Rows, root: Rows) -> Complex:
    """Return the Ehrlich-Aberth corrections of some roots of values, (N,)."""
    own = values[row, root]
    gaps = own[:, None] - values[row]
    gaps[np.arange(len(row)), root] = np.inf
    ratio = logarithmic_derivative(blocks, own)
    return np.asarray(1.0 / (ratio - (1.0 / gaps).sum(axis=1)), dtype=np.complex128)


def structured_condition(blocks: Blocks, values: Complex, row: Rows, root: Rows) -> Array:
    """Return how far each root moves if every entry moves by its own size, (N,).

    Near a simple root the resolvent is x y^H / (y^H x) over the distance, so the sum of |G_jk||A_kj|
    over the entries of the block tridiagonal, over |tr G|, is the componentwise condition number. G is
    evaluated close to the root, at a small part of the distance to the next one.
    """
    own = values[row, root]
    gaps = np.abs(own[:, None] - values[row])
    gaps[np.arange(len(row)), root] = np.inf
    shifted = _shifted(blocks, own + 1e-4j * gaps.min(axis=1))
    below = [_inverse(shifted[0])]
    for i in range(1, blocks.count):
        below.append(
            _inverse(shifted[i] - _times(_times(blocks.lower[i - 1], below[-1]), blocks.upper[i - 1]))
        )
    above = [_inverse(shifted[-1])]
    for i in range(blocks.count - 2, -1, -1):
        above.append(_inverse(shifted[i] - _times(_times(blocks.upper[i], above[-1]), blocks.lower[i])))
    above.reverse()
    size = np.zeros(own.shape)
    trace = np.zeros(own.shape, np.complex128)
    index = np.arange(shifted.shape[1])

    def add(resolvent: Complex, entries: Array) -> None:
        size[...] += (np.abs(resolvent) * entries.swapaxes(0, 1)).sum(axis=(0, 1))

    for i in range(blocks.count):
        pivot = shifted[i]
        if i > 0:
            pivot = pivot - _times(_times(blocks.lower[i - 1], below[i - 1]), blocks.upper[i - 1])
        if i < blocks.count - 1:
            pivot = pivot - _times(_times(blocks.upper[i], above[i + 1]), blocks.lower[i])
        centre = _inverse(pivot)
        trace += centre[index, index].sum(axis=0)
        entries = np.abs(blocks.diagonal[i])
        entries[index, index] += np.abs(own)
        add(centre, entries)
        if i < blocks.count - 1:
            add(_times(_times(above[i + 1], blocks.lower[i]), centre), np.abs(blocks.upper[i]))
        if i > 0:
            add(_times(_times(below[i - 1], blocks.upper[i - 1]), centre), np.abs(blocks.lower[i - 1]))
    return np.asarray(size / np.abs(trace), dtype=np.float64)


def _real_where_sure(values: Complex, radius: Array) -> Complex:
    """Return the roots, exactly real where their disc meets the real axis and no other disc.

    The matrix is real, so a root alone near the axis is its own conjugate. Complex ones are paired
    with the conjugate nearest to them.
    """
    gaps = np.abs(values[:, :, None] - values[:, None, :])
    diagonal = np.arange(values.shape[1])
    gaps[:, diagonal, diagonal] = np.inf
    alone = (gaps > radius[:, :, None] + radius[:, None, :]).all(axis=2)
    real = alone & (np.abs(values.imag) <= radius)
    return np.where(real, values.real.astype(np.complex128), values)


def conjugate_pairs(values: Complex, radius: Array) -> tuple[Complex, Array]:
    """Return roots of real matrices with exact conjugates side by side, the upper one first.

    Parameters
    ----------
    values : (s, n) complex array
        Roots; exactly real ones count as real.
    radius : (s, n) array
        Their error bounds.

    Returns
    -------
    values : (s, n) complex array
        Real roots ascending, then the pairs.
    radius : (s, n) array
        The bounds in the same order, widened by what a root was moved. Infinite where there are not
        as many upper as lower roots; those are as they came.
    """
    ordered, bounds = values.copy(), radius.copy()
    paired = (values.imag > 0).sum(axis=1) == (values.imag < 0).sum(axis=1)
    bounds[~paired] = np.inf
    for row in np.flatnonzero(paired):
        own, bound = values[row], radius[row]
        order = np.lexsort((np.abs(own.imag), own.real))
        real, upper = order[own.imag[order] == 0], order[own.imag[order] > 0]
        lower = list(order[own.imag[order] < 0])
        index, widened = list(real), list(bound[real])
        for k in upper:
            distance = np.abs(own[lower] - own[k].conj())
            partner = lower.pop(int(distance.argmin()))
            index += [k, partner]
            widened += [max(bound[k], bound[partner]) + distance.min()] * 2
        ordered[row], bounds[row] = own[index], widened
        ordered[row, len(real) + 1 :: 2] = ordered[row, len(real) :: 2].conj()
    return ordered, bounds
