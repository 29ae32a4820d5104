"""An expansion for each level of a discrete input: predictions, moments and Sobol indices.

With c_l the coefficients of level l, w_l its weight and ``cbar = sum_l w_l c_l``, the expansions are one
function of the continuous inputs X and the level L. The mean over L at fixed X has the coefficients cbar,
so sums of cbar**2 are variances of conditional means, and what depends on L is
``sum_l w_l (c_l - cbar)**2``; Sobol indices (Sobol, Math. Model. Comput. Exp. 1 (1993) 407; Sudret, Reliab.
Eng. Syst. Saf. 93 (2008) 964) follow by adding up the terms in which a group of inputs occurs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hipuq.errors import InputError
from hipuq.expansion.basis import Indices, tensor
from hipuq.expansion.germs import Germs

Array = NDArray[np.float64]

CHUNK_BYTES = 32 * 2**20
"""Memory for the polynomials of a chunk of points."""

_EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class Expansion:
    """Sums of orthonormal polynomials, one for each level and output.

    Attributes
    ----------
    germs : Germs
        The variables, d of them.
    indices : (terms, d) array of int
        Multi-indices of the terms, different ones, the first of them 0.
    coefficients : (levels, terms, outputs) array
        NaN where a level has no fit.
    weight : (levels,) array
        Probabilities of the levels, or in proportion to them; one level without a discrete input.

    Raises
    ------
    InputError
        If shapes do not fit, or the first term is not the constant one.
    """

    germs: Germs
    indices: Indices
    coefficients: Array
    weight: Array

    def __post_init__(self) -> None:
        levels, terms = len(self.weight), len(self.indices)
        if self.coefficients.ndim != 3 or self.coefficients.shape[:2] != (levels, terms):
            raise InputError(
                f"coefficients have the shape {self.coefficients.shape}: "
                f"they need {levels} levels of {terms} terms"
            )
        if self.indices.shape != (terms, len(self.germs.elements)) or not terms or self.indices[0].any():
            raise InputError("multi-indices need a column for each germ, and 0 in the first row")

    def predict(self, germs: Array, level: ArrayLike = 0) -> Array:
        """Return the outputs at points, in chunks of bounded memory.

        Parameters
        ----------
        germs : (s, d) array
        level : int or (s,) array of int
            Place of the level of each point.

        Returns
        -------
        (s, outputs) array
        """
        place = np.broadcast_to(np.asarray(level, np.intp), len(germs))
        found = np.empty((len(germs), self.coefficients.shape[2]))
        for rows, psi, coefficients in self._chunks(germs):
            here = place[rows]
            for own in np.unique(here):
                at = here == own
                found[rows][at] = (psi if at.all() else psi[at]) @ coefficients[own]
        return found

    def at_all_levels(self, germs: Array) -> Array:
        """Return the outputs of every level at points (s, d), as (s, levels, outputs)."""
        levels, _, outputs = self.coefficients.shape
        found = np.empty((len(germs), levels, outputs))
        for rows, psi, coefficients in self._chunks(germs):
            wide = psi @ coefficients.transpose(1, 0, 2).reshape(psi.shape[1], -1)
            found[rows] = wide.reshape(-1, levels, outputs)
        return found

    def _chunks(self, germs: Array) -> Iterator[tuple[slice, Array, Array]]:
        """Yield rows, the terms that have coefficients at them, and those coefficients."""
        used = (self.coefficients != 0).any(axis=(0, 2))
        used[0] = True
        indices, coefficients = self.indices[used], self.coefficients[:, used]
        degree = int(indices.max(initial=0))
        width = len(indices) + 2 * (degree + 1) * indices.shape[1]
        step = max(CHUNK_BYTES // (8 * width), 1)
        for start in range(0, len(germs), step):
            rows = slice(start, min(start + step, len(germs)))
            yield rows, tensor(self.germs.univariate(germs[rows], degree), indices), coefficients

    def mean(self) -> Array:
        """Return the mean of each level, (levels, outputs)."""
        return np.asarray(self.coefficients[:, 0])

    def variance(self) -> Array:
        """Return the variance of each level, (levels, outputs)."""
        return np.asarray(np.square(self.coefficients[:, 1:]).sum(axis=1))

    def mean_overall(self) -> Array:
        """Return the mean over all levels, (outputs,); NaN if a level of some weight has no fit."""
        return np.asarray(self._averaged()[0][0])

    def variance_overall(self) -> Array:
        """Return the variance over all levels, within and between them, (outputs,).

        NaN if a level of some weight has no fit.
        """
        average, spread = self._averaged()
        return np.asarray(np.square(average[1:]).sum(axis=0) + spread.sum(axis=0))

    def _averaged(self) -> tuple[Array, Array]:
        """Return cbar and ``sum_l w_l (c_l - cbar)**2``, both (terms, outputs)."""
        # A level that never happens must not spread a NaN.
        held = self.weight > 0
        coefficients, weight = self.coefficients[held], self.weight[held] / self.weight[held].sum()
        average = np.einsum("l,lto->to", weight, coefficients)
        spread = np.einsum("l,lto->to", weight, np.square(coefficients - average))
        return average, spread

    def sobol(self, groups: Sequence[Sequence[int]], levels: bool = False) -> tuple[Array, Array, Array]:
        """Return Sobol indices of groups of inputs.

        With V the variance over all levels, a sum running over terms alpha other than 0:

        - first order of a group: sum of cbar**2 of terms in variables of the group only, over V;
        - total of a group: sum of ``sum_l w_l c_l**2`` of terms with a variable of the group, over V;
        - second order of two groups: sum of cbar**2 of terms with variables of both and no others, over V;
        - first order of the level: variance of the means of levels, over V;
        - total of the level: 1 less the sum of all cbar**2, over V;
        - second order of a group and the level: sum of ``sum_l w_l (c_l - cbar)**2`` of terms in variables
          of the group only, over V.

        Parameters
        ----------
        groups : sequence of sequences of int
            Numbers of the columns of each group; a column belongs to at most one.
        levels : bool
            Whether the discrete input is a group too, the last one.

        Returns
        -------
        first, total : (groups, outputs) array
        second : (groups, groups, outputs) array
            Symmetric, NaN on the diagonal. All are NaN where the output does not vary but for rounding,
            or a level of some weight has no fit.
        """
        average, spread = self._averaged()
        shared, varying = np.square(average), spread
        shared[0] = 0.0
        variance = shared.sum(axis=0) + varying.sum(axis=0)
        still = variance <= np.square(64 * _EPS * np.abs(average[0]))
        variance = np.where(still, np.nan, variance)

        member = np.zeros((len(groups), self.indices.shape[1]), bool)
        for own, columns in zip(member, groups, strict=True):
            own[list(columns)] = True
        active = (self.indices > 0).astype(np.int64)
        inside = member @ active.T
        touched, rest = inside > 0, active.sum(axis=1) - inside
        only = touched & (rest == 0)

        count = len(groups) + levels
        first, total = np.empty((2, count, len(variance)))
        second = np.full((count, count, len(variance)), np.nan)
        for g in range(len(groups)):
            first[g] = shared[only[g]].sum(axis=0)
            total[g] = (shared + varying)[touched[g]].sum(axis=0)
            for h in range(g):
                both = touched[g] & touched[h] & (rest[g] == inside[h])
                second[g, h] = second[h, g] = shared[both].sum(axis=0)
            if levels:
                second[g, -1] = second[-1, g] = varying[only[g]].sum(axis=0)
        if levels:
            first[-1] = varying[0]
            total[-1] = varying.sum(axis=0)
        return first / variance, total / variance, second / variance
