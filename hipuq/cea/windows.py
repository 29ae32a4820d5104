"""Where the flutter of undamped pencils grows faster than a threshold: crossings within its windows.

Between two boundaries of an undamped pencil the number of coalesced pairs is the same, and so is what can
grow. A pair w = c +- i e of eigenvalues w = -l**2 has Re l = g where

    F = 16 g**2 (c + g**2) - 4 e**2

is zero, and below g where F is positive. Like the squared gap -4 e**2 it is analytic where the pair
merges, so three frictions show by its second difference whether it can vanish in between. The
eigenvalues l themselves have a square root there, close to where they pass the threshold if that is small.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import Complex
from hipuq.cea.eigenvalues import eigenvalues
from hipuq.cea.gaps import NARROWEST
from hipuq.cea.pencils import Array

GRID = 33
"""Frictions at which every window is looked at first."""

STRAIGHT = 0.25
"""A curve passes zero once if its second difference is at most this part of its change."""


@dataclass(frozen=True)
class Guess:
    """An interval in which one eigenvalue passes the threshold.

    Attributes
    ----------
    lower, upper : float
        Its ends [1].
    friction : float
        Where it passes, by interpolation [1].
    value : complex
        About the eigenvalue l there [1/s].
    shape : (n,) complex array
        About its eigenvector.
    direction : int
        1 if it begins to grow faster than the threshold, -1 if it ceases to.
    """

    lower: float
    upper: float
    friction: float
    value: complex
    shape: Complex
    direction: int


def pair_crossings(constant: Array, slope: Array, ends: list[float], threshold: float) -> list[Guess] | None:
    """Find the intervals in which a pair passes the threshold.

    Parameters
    ----------
    constant, slope : (n, n) array
        A0 and A1 [1/s^2], mechanisms taken out.
    ends : list of float
        Ends of the range of friction, and the boundaries of the pencil in between [1].
    threshold : float
        g, above 0 [1/s].

    Returns
    -------
    list of Guess, or None
        None if a mode diverges, or several pairs pass too close to each other to tell them apart.
    """
    found = []
    for a, b in pairwise(ends):
        grid = np.linspace(a, b, GRID)
        values = _values(constant, slope, grid, threshold)
        if values is None:
            return None
        left, right, at, bt = grid[:-1], grid[1:], values[:-1], values[1:]
        while left.size:
            middle = (left + right) / 2
            mt = _values(constant, slope, middle, threshold)
            if mt is None:
                return None
            bend = np.abs(at - 2 * mt + bt)
            clear = np.minimum(np.minimum(np.abs(at), np.abs(bt)), np.abs(mt)) > 2 * bend
            clear &= (np.sign(at) == np.sign(bt)) & (np.sign(at) == np.sign(mt))
            passes = (np.sign(at) != np.sign(bt)) & (bend <= STRAIGHT * np.abs(bt - at))
            ready = ((clear | passes).all(axis=1)) & (passes.sum(axis=1) == 1)
            for j in np.flatnonzero(ready):
                k = int(np.argmax(passes[j]))
                found.append(_guess(constant, slope, threshold, (left[j], right[j]), (at[j, k], bt[j, k])))
            open_ = ~(clear.all(axis=1) | ready)
            narrow = open_ & (right - left < NARROWEST)
            if (narrow & ((at > 0).sum(axis=1) != (bt > 0).sum(axis=1))).any():
                return None
            open_ &= ~narrow
            left, middle, right = left[open_], middle[open_], right[open_]
            at, mt, bt = at[open_], mt[open_], bt[open_]
            left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
            at, bt = np.concatenate([at, mt]), np.concatenate([mt, bt])
    return found


def _values(constant: Array, slope: Array, friction: Array, threshold: float) -> Array | None:
    """Return F of all eigenvalues with Im w >= 0 in ascending order, over its scale; None if one diverges.

    Real ones, of which there are more or fewer, count as pairs with e = 0: far from the threshold.
    """
    squares = eigenvalues(constant + friction[:, None, None] * slope)
    if (squares.real <= 0).any():
        return None
    n = squares.shape[1]
    scale = 16 * threshold**2 * (squares.real + threshold**2)
    value = np.sort(1 - 4 * np.square(squares.imag) / scale, axis=1)
    # Both of a pair have the same F: every second one, real ones filled in with theirs, 1.
    return np.asarray(value[:, : n - n % 2 : 2])


def _guess(
    constant: Array, slope: Array, threshold: float, ends: tuple[float, float], values: tuple[float, float]
) -> Guess:
    """Return the crossing in an interval by interpolation."""
    friction = ends[0] + (ends[1] - ends[0]) * values[0] / (values[0] - values[1])
    squares, shapes = np.linalg.eig(constant + friction * slope)
    roots = np.sqrt(-squares.astype(np.complex128))
    nearest = int(np.argmin(np.where(roots.imag >= 0, np.abs(roots.real - threshold), np.inf)))
    shape: NDArray[np.complex128] = shapes[:, nearest].astype(np.complex128)
    direction = 1 if values[1] < values[0] else -1
    return Guess(float(ends[0]), float(ends[1]), float(friction), complex(roots[nearest]), shape, direction)
