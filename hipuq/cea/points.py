"""Eigenvalues of undamped pencils A0 + mu A1 at many frictions: what the search for boundaries looks at.

They only steer the search: whether a boundary is one is proved apart. So a root whose imaginary part
is within its error bound counts as real here, and nothing needs a certificate unless the iteration
that keeps the structure of the matrix cannot be used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import AUTO, ZERO, Complex, norms
from hipuq.cea.eigenvalues import eigenvalues
from hipuq.cea.factors import factored_eigenvalues
from hipuq.cea.pencils import Array, Pencils
from hipuq.cea.structured import block_sizes, structured_eigenvalues
from hipuq.cea.undamped import judge, judged_roots

Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]

BLOCK = 2048
"""Matrices looked at together: enough to forget the cost of a call, few enough for little memory."""


@dataclass(frozen=True)
class Points:
    """Eigenvalues w at N frictions, mechanisms left out [1/s^2].

    Attributes
    ----------
    row : (N,) array of int
        Sample that the point belongs to.
    friction : (N,) array
        mu [1].
    real : (N, n) array
        Real roots, ascending, then NaN.
    pairs : (N, n // 2) complex array
        Upper roots of the pairs by ascending real part, then NaN.
    """

    row: Rows
    friction: Array
    real: Array
    pairs: Complex

    @property
    def coalesced(self) -> Rows:
        """Number of pairs, (N,)."""
        count: Rows = (~np.isnan(self.pairs)).sum(axis=1)
        return count

    @property
    def negative(self) -> Rows:
        """Number of negative real roots, (N,)."""
        count: Rows = (self.real < 0).sum(axis=1)
        return count

    def take(self, index: Rows) -> Points:
        """Return some of the points."""
        return Points(self.row[index], self.friction[index], self.real[index], self.pairs[index])

    def __add__(self, other: Points) -> Points:
        """Return these points and then the others."""
        names = ("row", "friction", "real", "pairs")
        return Points(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names))


class Sweep:
    """The pencils of a batch as functions of friction.

    Parameters
    ----------
    pencils : Pencils
        s samples without damping; their own friction is not used.
    largest : float
        Largest modulus of friction that is looked at [1].

    Attributes
    ----------
    constant, slope : (s, n, n) array
        A0 and A1 [1/s^2].
    norm : (s,) array
        Largest Frobenius norm that A0 and A1 times the largest friction have [1/s^2].
    scale : (s,) array
        Size of the eigenvalues [1/s^2].
    """

    def __init__(self, pencils: Pencils, largest: float) -> None:
        self.constant, self.slope = pencils.reduced_parts()
        self.mechanisms = pencils.mechanisms
        self.filter_radius = pencils.filter_radius
        self.norm = np.maximum(norms(self.constant), norms(self.slope) * largest)
        self.scale = self.norm / np.sqrt(self.constant.shape[1])
        self.sizes = block_sizes((self.constant != 0) + (self.slope != 0.0).astype(float))

    def matrices(self, row: Rows, friction: Array) -> Array:
        """Return A0 + mu A1, (N, n, n) [1/s^2]."""
        made: Array = self.slope[row] * friction[:, None, None]
        made += self.constant[row]
        return made

    def points(self, row: Rows, friction: Array, guess: Complex | None = None) -> Points:
        """Return the eigenvalues of samples at frictions.

        Parameters
        ----------
        row : (N,) array of int
        friction : (N,) array
            [1]
        guess : (N, n) complex array, optional
            What they may be, as from `interpolated`: where rounding blurs those of the matrix itself, those
            of its neighbours are nearer to the truth.

        Returns
        -------
        Points
        """
        values = np.empty((len(row), self.constant.shape[1]), np.complex128)
        for start in range(0, len(row), BLOCK):
            block = slice(start, start + BLOCK)
            values[block] = self._values(row[block], friction[block], None if guess is None else guess[block])
        # The declared mechanisms, the smallest roots, become NaN and sort last.
        rank = np.argsort(np.argsort(np.abs(values), axis=1, kind="stable"), axis=1)
        values[rank < self.mechanisms[row][:, None]] = complex(np.nan, np.nan)
        real = np.sort(np.where(values.imag == 0, values.real, np.nan), axis=1)
        upper = np.where(values.imag > 0, values, complex(np.nan, np.nan))
        pairs = np.sort(upper, axis=1)[:, : values.shape[1] // 2]
        return Points(row, friction, real, pairs)

    def _values(self, row: Rows, friction: Array, guess: Complex | None = None) -> Complex:
        """Return all eigenvalues, those that are real within their bounds exactly so."""
        matrices = self.matrices(row, friction)
        mechanisms = self.mechanisms[row]
        values = eigenvalues(matrices)
        norm = norms(matrices)[:, None]
        radius = np.broadcast_to(self.filter_radius * norm if self.filter_radius else np.inf, values.shape)
        _, known = judge(values, radius, ZERO * norm, mechanisms, 0.0)
        unclear = np.flatnonzero(~known.all(axis=1))
        if guess is not None and self.filter_radius:
            reach = self.filter_radius * norm[unclear, 0]
            values[unclear] = _nearer(values[unclear], guess[unclear], ~known[unclear], reach)
        sizes = self.sizes[row[unclear]]
        for size in np.unique(sizes):
            same = unclear[sizes == size]
            part = matrices[same]
            if size:
                values[same] = structured_values(part, values[same], int(size), mechanisms[same], known[same])
            else:
                values[same] = judged_roots(part, mechanisms[same], 0.0, AUTO, self.filter_radius).values
        return values


def interpolated(a: Points, b: Points, friction: Array) -> Complex:
    """Return the roots of the same samples at other frictions, on the lines through those at two points.

    Returns
    -------
    (N, n) complex array
        By their real parts; NaN for mechanisms, and for all roots where the points have not as many pairs.
    """
    part = ((friction - a.friction) / (b.friction - a.friction))[:, None]
    real = a.real + (b.real - a.real) * part
    pairs = a.pairs + (b.pairs - a.pairs) * part
    every: Complex = np.sort(np.concatenate([real, pairs, pairs.conj()], axis=1), axis=1)[:, : real.shape[1]]
    every[a.coalesced != b.coalesced] = np.nan
    return every


def _nearer(values: Complex, guess: Complex, moving: Mask, reach: Array) -> Complex:
    """Return values, with those that move replaced by a guess where all its roots are within reach of them.

    Both are compared in the order of their real parts.
    """
    order = np.argsort(values, axis=1, kind="stable")
    ordered: Complex = np.take_along_axis(values, order, axis=1)
    moves: Mask = np.take_along_axis(moving, order, axis=1)
    # Mechanisms come first, as the least roots, and there as NaN last.
    missing = np.isnan(guess).sum(axis=1)
    index = (np.arange(guess.shape[1]) - missing[:, None]) % guess.shape[1]
    guess = np.take_along_axis(guess, index, axis=1)
    with np.errstate(invalid="ignore"):
        near = (np.abs(guess - ordered) <= reach[:, None]) | ~moves
    heights = np.sign(np.where(moves, guess.imag, 0.0))
    usable = near.all(axis=1) & (heights.sum(axis=1) == 0)
    usable &= ~(moves & np.isnan(guess)).any(axis=1)
    made = np.where(moves & usable[:, None], guess, ordered)
    result = np.empty_like(values)
    np.put_along_axis(result, order, made, axis=1)
    return result


def structured_values(
    matrices: Array, start: Complex, size: int, mechanisms: Rows, known: Mask | None = None
) -> Complex:
    """Return eigenvalues from the structured solver, real ones and pairs told apart as its bounds can.

    Parameters
    ----------
    matrices : (s, n, n) array
    start : (s, n) complex array
        Approximations.
    size : int
        Block size.
    mechanisms : (s,) array of int
    known : (s, n) array of bool, optional
        Approximations that are good enough as they are.

    Returns
    -------
    (s, n) complex array
    """
    rank = np.argsort(np.argsort(np.abs(start), axis=1, kind="stable"), axis=1)
    zero = (rank < mechanisms[:, None]) & (np.abs(start) <= ZERO * norms(matrices)[:, None])
    fixed = zero if known is None else zero | known
    values, radius = factored_eigenvalues(matrices, np.where(zero, 0.0, start), size, ~fixed)
    left = np.flatnonzero(~np.isfinite(radius).all(axis=1))
    if left.size:
        own = np.where(zero[left], 0.0, start[left])
        values[left], radius[left] = structured_eigenvalues(matrices[left], own, size, zero[left])
    found = np.isfinite(radius)
    values = np.where(found & (np.abs(values.imag) <= radius), values.real, values)
    # Roots whose number of upper and lower ones differs are not those of a real matrix.
    usable = found.all(axis=1) & ((values.imag > 0).sum(axis=1) == (values.imag < 0).sum(axis=1))
    return np.where(usable[:, None], values, start)
