"""Eigenvalues of block tridiagonal matrices by an iteration that keeps their structure.

Near an onset the last modes of the ring form a nearly defective cluster, and eigenvalues from dense
LAPACK are off by 1e-6 there, because its rounding errors fill the zeros of the matrix. An
Ehrlich-Aberth iteration on det(A - w), evaluated by block LU, makes errors in the entries that are
there only, and to those the eigenvalues are insensitive (D. A. Bini, L. Gemignani, F. Tisseur, SIAM
J. Matrix Anal. Appl. 27 (2005) 153, for the tridiagonal case).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import EPS, Complex
from hipuq.cea.pencils import Array

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


def structured_eigenvalues(matrices: Array, start: Complex, b: int) -> tuple[Complex, Array]:
    """Return the eigenvalues of block tridiagonal matrices and their error bounds.

    Parameters
    ----------
    matrices : (s, n, n) array
    start : (s, n) complex array
        Approximations, such as LAPACK's.
    b : int
        Block size.

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
    blocks = _Blocks(matrices, b)
    n = matrices.shape[1]
    scale = np.abs(start).max(axis=1, keepdims=True)
    scale[scale == 0] = 1.0
    # Conjugate approximations would stay conjugate though the roots are real: set them off unevenly.
    golden = np.exp(2j * np.pi * 0.381966 * np.arange(1, n + 1))
    values = start + 1e-9 * scale * golden
    step = np.full(values.shape, np.inf)
    moving = np.ones(values.shape, bool)
    with np.errstate(all="ignore"):
        for _ in range(MAXIMUM_STEPS):
            rows = np.flatnonzero(moving.any(axis=1))
            if not rows.size:
                break
            delta = _correction(blocks.rows(rows), values[rows])
            delta[~(np.isfinite(delta) & moving[rows])] = 0.0
            size = np.abs(delta)
            values[rows] -= delta
            # Corrections of rounding size no longer shrink: the attainable accuracy is reached.
            settled = (size <= 4 * EPS * scale[rows]) | (
                (size <= 64 * EPS * scale[rows]) & (size >= 0.5 * step[rows])
            )
            step[rows] = np.where(moving[rows], size, step[rows])
            moving[rows] &= ~settled
        radius = SAFETY * EPS * np.maximum(_structured_condition(blocks, values), scale)
        radius += 0.5 * n * step
    radius[~np.isfinite(radius) | moving] = np.inf
    # Two approximations of one root would leave another root out, and the trace wrong.
    stray = np.abs(values.sum(axis=1) - np.trace(matrices, axis1=1, axis2=2))
    radius[stray > radius.sum(axis=1)] = np.inf
    return _real_where_sure(values, radius), radius


class _Blocks:
    """Block diagonals of a batch, (s, 1, b, b) each, so that they go with (s, roots, b, b)."""

    def __init__(self, matrices: Array, b: int) -> None:
        s, n, _ = matrices.shape
        self.count = n // b
        tiles = matrices.reshape(s, self.count, b, self.count, b).transpose(1, 3, 0, 2, 4)
        index = np.arange(self.count)
        self.diagonal = tiles[index, index][:, :, None]
        self.lower = tiles[index[1:], index[:-1]][:, :, None]
        self.upper = tiles[index[:-1], index[1:]][:, :, None]

    def rows(self, rows: NDArray[np.intp]) -> _Blocks:
        """Return the blocks of some samples."""
        part = object.__new__(_Blocks)
        part.count = self.count
        part.diagonal, part.lower, part.upper = (
            blocks[:, rows] for blocks in (self.diagonal, self.lower, self.upper)
        )
        return part


def _times(left: Complex, right: Complex) -> Complex:
    """Return the products of small matrices; matmul would cost a call for each."""
    product = left[..., :, :1] * right[..., :1, :]
    for k in range(1, left.shape[-1]):
        product = product + left[..., :, k : k + 1] * right[..., k : k + 1, :]
    return np.asarray(product, dtype=np.complex128)


def _inverse(matrices: Complex) -> Complex:
    """Return the inverses of small matrices, not finite for singular ones."""
    b = matrices.shape[-1]
    if b == 1:
        return np.asarray(1.0 / matrices, dtype=np.complex128)
    if b == 2:
        (p, q), (r, t) = np.moveaxis(matrices, (-2, -1), (0, 1))
        adjoint = np.stack([np.stack([t, -q], -1), np.stack([-r, p], -1)], -2)
        return np.asarray(adjoint / (p * t - q * r)[..., None, None], dtype=np.complex128)
    try:
        return np.asarray(np.linalg.inv(matrices), dtype=np.complex128)
    except np.linalg.LinAlgError:
        singular = (np.linalg.slogdet(matrices)[0] == 0)[..., None, None]
        inverse = np.linalg.inv(np.where(singular, np.eye(b), matrices))
        return np.where(singular, np.inf, inverse).astype(np.complex128)


def _shifted(blocks: _Blocks, values: Complex) -> list[Complex]:
    """Return D_i - w for every block and root."""
    eye = np.eye(blocks.diagonal.shape[-1])
    return [diagonal - values[:, :, None, None] * eye for diagonal in blocks.diagonal]


def _correction(blocks: _Blocks, values: Complex) -> Complex:
    """Return the Ehrlich-Aberth correction of every root, (s, roots).

    The logarithmic derivative of det(A - w) is the sum of tr(S_i^-1 S_i') over the pivots of the
    block LU, S_i = D_i - w - L S_(i-1)^-1 U.
    """
    shifted = _shifted(blocks, values)
    eye = np.eye(blocks.diagonal.shape[-1])
    derivative: Complex = np.broadcast_to(-eye, shifted[0].shape).astype(np.complex128)
    inverse = _inverse(shifted[0])
    ratio = np.trace(_times(inverse, derivative), axis1=-2, axis2=-1)
    for i in range(1, blocks.count):
        left = _times(blocks.lower[i - 1], inverse)
        right = _times(inverse, blocks.upper[i - 1])
        derivative = -eye + _times(_times(left, derivative), right)
        inverse = _inverse(shifted[i] - _times(left, blocks.upper[i - 1]))
        ratio = ratio + np.trace(_times(inverse, derivative), axis1=-2, axis2=-1)
    gaps = values[:, :, None] - values[:, None, :]
    diagonal = np.arange(values.shape[1])
    gaps[:, diagonal, diagonal] = np.inf
    return np.asarray(1.0 / (ratio - (1.0 / gaps).sum(axis=2)), dtype=np.complex128)


def _structured_condition(blocks: _Blocks, values: Complex) -> Array:
    """Return how far each root moves if every entry moves by its own size, (s, roots).

    Near a simple root the resolvent is x y^H / (y^H x) over the distance, so the sum of |G_jk||A_kj|
    over the entries of the block tridiagonal, over |tr G|, is the componentwise condition number. G is
    evaluated close to the root, at a small part of the distance to the next one.
    """
    gaps = np.abs(values[:, :, None] - values[:, None, :])
    diagonal = np.arange(values.shape[1])
    gaps[:, diagonal, diagonal] = np.inf
    shifted = _shifted(blocks, values + 1e-4j * gaps.min(axis=2))
    below = [_inverse(shifted[0])]
    for i in range(1, blocks.count):
        below.append(
            _inverse(shifted[i] - _times(_times(blocks.lower[i - 1], below[-1]), blocks.upper[i - 1]))
        )
    above = [_inverse(shifted[-1])]
    for i in range(blocks.count - 2, -1, -1):
        above.append(_inverse(shifted[i] - _times(_times(blocks.upper[i], above[-1]), blocks.lower[i])))
    above.reverse()
    size = np.zeros(values.shape)
    trace = np.zeros(values.shape, np.complex128)
    own = np.abs(values)[:, :, None, None] * np.eye(blocks.diagonal.shape[-1])

    def add(resolvent: Complex, entries: Array) -> None:
        size[...] += (np.abs(resolvent) * np.abs(entries).swapaxes(-2, -1)).sum(axis=(-2, -1))

    for i in range(blocks.count):
        pivot = shifted[i]
        if i > 0:
            pivot = pivot - _times(_times(blocks.lower[i - 1], below[i - 1]), blocks.upper[i - 1])
        if i < blocks.count - 1:
            pivot = pivot - _times(_times(blocks.upper[i], above[i + 1]), blocks.lower[i])
        centre = _inverse(pivot)
        trace += np.trace(centre, axis1=-2, axis2=-1)
        add(centre, np.abs(blocks.diagonal[i]) + own)
        if i < blocks.count - 1:
            add(_times(_times(above[i + 1], blocks.lower[i]), centre), blocks.upper[i])
        if i > 0:
            add(_times(_times(below[i - 1], blocks.upper[i - 1]), centre), blocks.lower[i - 1])
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
