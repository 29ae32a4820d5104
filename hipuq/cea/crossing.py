"""Which eigenvalues of a state space can pass a vertical line while friction changes a little.

About a friction c the state space is ``X (diag(l) + t G) X^-1``, t the distance from c: exact, since it
is linear in friction. By Gershgorin's theorem its eigenvalues lie in discs about ``l_i + t G_ii`` with
radius ``|t| sum_j |G_ij| s_j / s_i``, whatever the scales s > 0. A point z of the line is in no disc if

    dist_i(z) s_i > h sum_j |G_ij| s_j   for all i and |t| <= h,

and such scales exist if and only if the spectral radius of the nonnegative matrix h |G| / dist is below
1 (Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, chapter 6). That needs no
matching of eigenvalues between frictions, and holds across coalescences. What rounding does to l and G
enters as a perturbation of the matrix by eps times its norm, in the same basis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import EPS, Complex, norms
from hipuq.cea.pencils import Array

ROUNDING = 1.0
"""Backward error of LAPACK's eigenvalues, over eps times the Frobenius norm: see the tests."""

ROUNDS = 8
"""Steps of the power iteration: each interval it leaves open is halved further, so few are enough."""


@dataclass(frozen=True)
class Expansion:
    """State spaces about k frictions in the basis of their N = 2n eigenvectors.

    Attributes
    ----------
    values : (k, N) complex array
        l [1/s].
    slope : (k, N, N) complex array
        G [1/s]; its diagonal holds dl / dmu.
    rounding : (k, N, N) array
        Bound of what rounding adds to ``diag(l) + t G`` [1/s].
    vectors : (k, n, N) complex array
        Right eigenvectors: displacements.
    """

    values: Complex
    slope: Complex
    rounding: Array
    vectors: Complex

    def rows(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> Expansion:
        """Return the state spaces that `index` selects."""
        return Expansion(self.values[index], self.slope[index], self.rounding[index], self.vectors[index])


def expansion(constant: Array, slope: Array, damping: Array | None, friction: Array) -> Expansion:
    """Return the state spaces of k pencils about their frictions.

    Parameters
    ----------
    constant, slope : (k, n, n) array
        A0 and A1 [1/s^2].
    damping : (k, n, n) array or None
        D [1/s]; None if all are undamped.
    friction : (k,) array
        mu [1].

    Returns
    -------
    Expansion
    """
    stiffness = constant + friction[:, None, None] * slope
    n = stiffness.shape[1]
    size = np.sqrt(np.maximum(norms(stiffness), np.finfo(np.float64).tiny))
    rate = 2.0 ** np.round(np.log2(size))
    square = np.square(rate)[:, None, None]
    if damping is None:
        # The eigenvalues w = -l**2 of A itself, and from them both l: half the size, more accurate.
        squares, shapes = np.linalg.eig(stiffness / square)
        shapes = shapes.astype(np.complex128)
        left = _inverses(shapes)
        half = np.sqrt(-squares.astype(np.complex128))
        values = np.concatenate([half, -half], axis=1)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            back = np.concatenate([left, left], axis=1) / (2 * values)[:, :, None]
        right = np.concatenate([shapes, shapes], axis=2)
        error = norms(stiffness / square)
        tall = right
    else:
        states = np.zeros((len(stiffness), 2 * n, 2 * n))
        states[:, :n, n:] = np.eye(n)
        states[:, n:, :n] = -stiffness / square
        states[:, n:, n:] = -damping / rate[:, None, None]
        values, tall = np.linalg.eig(states)
        values, tall = values.astype(np.complex128), tall.astype(np.complex128)
        whole = _inverses(tall)
        back, right = whole[:, :, n:], tall[:, :n]
        error = norms(states)
    with np.errstate(invalid="ignore", over="ignore"):
        change = -back @ ((slope / square) @ right)
        left_norm = np.linalg.norm(back if damping is None else whole, axis=2)
        rounding = left_norm[:, :, None] * np.linalg.norm(tall, axis=1)[:, None, :]
        rounding *= (ROUNDING * EPS * error)[:, None, None]
    # Dependent eigenvectors say nothing: infinite bounds keep the interval open.
    rounding[~(np.isfinite(change) & np.isfinite(rounding)).all(axis=(1, 2))] = np.inf
    scale = rate[:, None]
    return Expansion(values * scale, np.nan_to_num(change) * scale[:, None], rounding * scale[:, None], right)


def _inverses(vectors: Complex) -> Complex:
    """Return the inverses of bases, not finite where there is none."""
    try:
        return np.asarray(np.linalg.inv(vectors), np.complex128)
    except np.linalg.LinAlgError:
        if len(vectors) == 1:
            return np.full_like(vectors, np.nan)
        return np.concatenate([_inverses(one[None]) for one in vectors])


def passing(about: Expansion, half: Array, threshold: float) -> NDArray[np.intp]:
    """Say which eigenvalue can pass the line ``Re l = threshold`` within a distance of each friction.

    Parameters
    ----------
    about : Expansion
        k state spaces.
    half : (k,) array
        h, half the width of the interval of friction [1].
    threshold : float
        g [1/s].

    Returns
    -------
    (k,) array of int
        -1: none does. i: none but i, and i once at most, in one direction. -2: that is not known.
    """
    distance, coupling = _distances(about, half, threshold)
    verdict = np.full(len(half), -2, np.intp)
    contained = _contained(coupling, distance)
    verdict[contained.all(axis=1)] = -1
    open_ = np.flatnonzero(verdict == -2)
    if not open_.size:
        return verdict
    part = about.rows(open_)
    k = np.arange(open_.size)
    h = half[open_]
    own = np.diagonal(part.slope, axis1=1, axis2=2)
    room = np.abs(part.values.real - threshold) / np.maximum(np.abs(own.real) * h[:, None], 1e-300)
    candidate = np.argmin(np.where(part.values.imag >= 0, room, np.inf), axis=1)
    rest, d = coupling[open_].copy(), distance[open_].copy()
    out, into = rest[k, candidate].copy(), rest[k, :, candidate].copy()
    rest[k, candidate], rest[k, :, candidate] = 0.0, 0.0
    d[k, candidate] = np.inf
    alone = _contained(2 * rest, d).all(axis=1)
    # Without i none reaches the line, so on it i obeys z = l_i + t G_ii + f(t, z), and f, with its
    # derivatives by t and z, is bounded by series that converge at least as fast as powers of 1/2.
    with np.errstate(divide="ignore", invalid="ignore"):
        first = _series(rest, d, into[:, :, None] / d)
        second = _series(rest, d, first / d)
        reach = np.einsum("kj,kjs->ks", out, first)
        tilt = np.einsum("kj,kjs->ks", out, second)
    # Only where the line is failed with i: elsewhere i does not come near it.
    near = ~contained[open_]
    reach = np.where(near, reach, 0.0).max(axis=1)
    tilt = np.where(near, tilt, 0.0).max(axis=1)
    speed = own[k, candidate]
    bend = 4 * reach / h + tilt * np.abs(speed)
    once = alone & (np.abs(speed.real) > 2 * bend) & (tilt < 0.25)
    verdict[open_[once]] = candidate[once]
    return verdict


def _distances(about: Expansion, half: Array, threshold: float) -> tuple[Array, Array]:
    """Return distances of the eigenvalues from the segments of the line, and h |G| off the diagonal.

    The upper half of the line is cut halfway between the frequencies of the eigenvalues: whatever is
    close to one segment is far from the others, which the distance to the whole line would not show.

    Returns
    -------
    distance : (k, N, S) array
        At least so far from each segment is ``l_i + t G_ii``; 0 if it can be on it [1/s].
    coupling : (k, N, N) array
        [1/s]
    """
    values, h = about.values, half[:, None]
    own = np.diagonal(about.slope, axis1=1, axis2=2)
    error = np.diagonal(about.rounding, axis1=1, axis2=2)
    levels = np.sort(np.abs(values.imag), axis=1)[:, 1::2]
    middles = (levels[:, 1:] + levels[:, :-1]) / 2
    none = np.zeros((len(values), 1))
    lower = np.concatenate([none, middles], axis=1)[:, None, :]
    upper = np.concatenate([middles, none + np.inf], axis=1)[:, None, :]
    across = np.maximum(np.abs(values.real - threshold) - h * np.abs(own.real), 0)[:, :, None]
    at = values.imag[:, :, None]
    along = np.maximum(lower - at, at - upper) - (h * np.abs(own.imag))[:, :, None]
    distance = np.hypot(across, np.maximum(along, 0)) - error[:, :, None]
    coupling = h[:, :, None] * np.abs(about.slope) + about.rounding
    diagonal = np.arange(values.shape[1])
    coupling[:, diagonal, diagonal] = 0.0
    return np.maximum(distance, 0), coupling


def _contained(coupling: Array, distance: Array) -> NDArray[np.bool_]:
    """Say for each segment whether the spectral radius of coupling / distance is proved below 1; (k, S).

    For any v > 0 it is at most ``max_i (B v)_i / v_i`` (Collatz and Wielandt).
    """
    found = np.zeros((len(distance), distance.shape[2]), bool)
    good = np.flatnonzero(np.isfinite(coupling).all(axis=(1, 2)))
    b, d = coupling[good], distance[good]
    possible = (d > 0).all(axis=1)
    d = np.where(d > 0, d, 1.0)
    v = np.ones_like(d)
    for _ in range(ROUNDS):
        image = (b @ v) / d
        found[good] |= possible & (image < v).all(axis=1)
        # Averaged, so that pairs coupled to each other alone do not swing.
        v = v + image
        v /= v.max(axis=1, keepdims=True)
        v = np.maximum(v, 1e-100)
    return found


def _series(coupling: Array, distance: Array, start: Array) -> Array:
    """Return twice the first terms of ``(1 - B)^-1 start`` with B = coupling / distance; (k, N, S)."""
    total = term = start
    for _ in range(4):
        term = (coupling @ term) / distance
        total = total + term
    return 2 * total
