"""From outcomes to a surrogate: one polynomial expansion for each level of the discrete input."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.errors import InputError, SchemaError
from hipuq.expansion.basis import MOST_TERMS, count, leading, multi_indices, tensor
from hipuq.expansion.expansion import Expansion
from hipuq.expansion.fitting import Fit, least_squares, project, sparse
from hipuq.expansion.germs import Germs
from hipuq.inputs import Inputs
from hipuq.sampling import unit_points
from hipuq.surrogates.options import QUADRATURE, Basis, discrete_of

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Mask = NDArray[np.bool_]

HIGHEST = 15
"""Highest degree that is tried where none is asked for."""

PER_TERM = 1.5
"""Samples for each term of the largest basis that is tried by least squares where no degree is asked for."""

SPARSE_TERMS = 4
"""Terms for each sample of the largest basis that is tried by sparse regression, likewise."""

VALUES_MAXIMUM = 2**25
"""Values of terms at samples that are held at a time where no degree is asked for."""

FIRST_KEY = 2**31
"""Key of the random streams of estimates; those below it belong to designs."""


@dataclass(frozen=True)
class Surrogate:
    """A polynomial surrogate of an outcome, or of several at once.

    Attributes
    ----------
    expansion : Expansion
        Coefficients by level and output.
    inputs : Inputs
        The continuous inputs.
    discrete : str
        Name of the discrete input, empty without one.
    loo, spread : (levels, outputs) array
        Relative corrected leave-one-out error, and the sample variance that it is relative to.
    degree, terms, used : (levels, outputs) array of int
        Degree, number of terms that are not zero, and samples used; -1 where there was nothing to fit.
    """

    expansion: Expansion
    inputs: Inputs
    discrete: str
    loo: Array
    spread: Array
    degree: NDArray[np.int64]
    terms: NDArray[np.int64]
    used: NDArray[np.int64]

    @property
    def loo_overall(self) -> Array:
        """Corrected leave-one-out error over all levels, relative to the variance over all, (outputs,)."""
        # Where a level does not vary there is no error.
        error = np.where(self.spread == 0, 0.0, self.loo * self.spread)
        used = self.expansion.weight > 0
        weight = self.expansion.weight[used, None]
        between = np.square(self.expansion.mean() - self.expansion.mean_overall())[used]
        whole = (weight * (self.spread[used] + between)).sum(axis=0)
        total = (weight * error[used]).sum(axis=0)
        return np.asarray(np.divide(total, whole, out=np.full_like(whole, np.nan), where=whole > 0))

    def at(self, samples: xr.Dataset, inputs: Inputs) -> Array:
        """Return the predictions at samples of all inputs, (s, outputs)."""
        return self.expansion.predict(self.expansion.germs.values(samples), places(samples, inputs))

    def everywhere(self, size: int, seed: int) -> Array:
        """Return predictions at Sobol points of the continuous inputs, for each level.

        Parameters
        ----------
        size : int
            Number of points, a power of 2.
        seed : int

        Returns
        -------
        (size, levels, outputs) array
        """
        levels, outputs = self.loo.shape
        made = np.empty((size, levels, outputs))
        step = 4096
        for start in range(0, size, step):
            rows = slice(start, min(start + step, size))
            u = unit_points("sobol", size, self.inputs.dimension, seed, (FIRST_KEY, 1), rows)
            germs = self.expansion.germs.values(self.inputs.samples(u))
            made[rows] = self.expansion.at_all_levels(germs)
        return made


def places(samples: xr.Dataset, inputs: Inputs) -> Places:
    """Return the place of each sample's level, from 0; 0 without a discrete input.

    Raises
    ------
    SchemaError
        If the samples lack the discrete input, or have a value that is none of its levels.
    """
    name, _ = discrete_of(inputs)
    if not name:
        return np.zeros(samples.sizes["sample"], np.intp)
    if name not in samples:
        raise SchemaError(f"the samples have no variable {name!r}: the inputs name it")
    levels = inputs.levels(name)
    known = levels[name].values.reshape(levels.sizes[levels.attrs["dim"]], -1)
    asked = samples[name].transpose("sample", ...).values.reshape(samples.sizes["sample"], -1)
    if asked.shape[1] != known.shape[1]:
        raise SchemaError(
            f"{name} has {asked.shape[1]} elements, the levels of the inputs have {known.shape[1]}"
        )
    _, number = np.unique(np.concatenate([known, asked]), axis=0, return_inverse=True)
    place = np.full(number.max() + 1, -1, np.intp)
    place[number[: len(known)]] = np.arange(len(known))
    found = place[number[len(known) :]]
    if (found < 0).any():
        where = int(np.argmax(found < 0))
        raise SchemaError(
            f"{name} of sample {where} is none of the levels of the inputs: they are of another design"
        )
    return found


def fitted(
    outcomes: xr.Dataset, y: Array, use: Mask, inputs: Inputs, basis: Basis, weights: Array | None = None
) -> Surrogate:
    """Fit a surrogate to outcomes.

    Parameters
    ----------
    outcomes : Dataset
        Holds the samples.
    y : (s, outputs) array
        The outcome; NaN where it is unknown, which leaves the sample out of the fit.
    use : (s,) array of bool
        Samples to fit.
    inputs : Inputs
        All inputs.
    basis : Basis
    weights : (s,) array, optional
        Quadrature weights, where the samples are nodes.

    Returns
    -------
    Surrogate

    Raises
    ------
    InputError
        If there are too few samples.
    """
    name, rest = discrete_of(inputs)
    levels = inputs.levels(name) if name else None
    weight = np.ones(1) if levels is None else levels["weight"].values.astype(np.float64)
    chosen = outcomes.isel(sample=use)
    place, values = places(chosen, inputs), y[use]
    nodes = None if weights is None else weights[use]
    germs = Germs.of(rest)
    points = germs.values(chosen)
    indices = _indices(germs, basis, points, int(np.bincount(place, minlength=len(weight)).max()))
    shape = (len(weight), values.shape[1])
    coefficients = np.full((shape[0], len(indices), shape[1]), np.nan)
    loo, spread = np.full(shape, np.nan), np.full(shape, np.nan)
    degree, terms, used = (np.full(shape, -1, np.int64) for _ in range(3))
    for level in range(shape[0]):
        own = np.flatnonzero(place == level)
        for columns, known in _alike(~np.isnan(values[own])):
            rows = own[known]
            used[level, columns] = len(rows)
            # What is unknown may leave a level too little, and does not stop the others.
            if len(rows) < len(own) and len(rows) <= (1 if basis.degree is None else len(indices)):
                continue
            psi = tensor(germs.univariate(points[rows], int(indices.max(initial=0))), indices)
            spread[level, columns] = values[np.ix_(rows, columns)].var(axis=0)
            whole = None if nodes is None else nodes[rows]
            fit = _fit(psi, values[np.ix_(rows, columns)], indices, basis, whole)
            coefficients[level][:, columns] = fit.coefficients
            loo[level, columns], degree[level, columns], terms[level, columns] = (
                fit.loo,
                fit.degree,
                fit.terms,
            )
    kept = np.any(np.nan_to_num(coefficients, nan=0.0) != 0, axis=(0, 2))
    kept[0] = True
    expansion = Expansion(germs, indices[kept], coefficients[:, kept], weight)
    return Surrogate(expansion, rest, name, loo, spread, degree, terms, used)


def basis_of(
    outcomes: xr.Dataset, fit: str | None, degree: int | None, q: float, interaction: int | None
) -> tuple[Basis, Array | None]:
    """Return what the fit may use, and the quadrature weights (s,) where it takes them.

    Raises
    ------
    SchemaError
        If quadrature is asked for and the outcomes are not those of nodes.
    """
    nodes = outcomes.coords.get("quadrature_weight")
    if fit is None:
        fit = "least_squares" if nodes is None else QUADRATURE
    basis = Basis(fit, degree, q, interaction)
    if fit != QUADRATURE:
        return basis, None
    if nodes is None:
        raise SchemaError("fit 'quadrature' needs quadrature nodes: design with sampler='quadrature'")
    return basis, nodes.values.astype(np.float64)


def _indices(germs: Germs, basis: Basis, points: Array, samples: int) -> NDArray[np.int64]:
    """Return the multi-indices of the asked degree, or of the highest that is worth trying.

    `points` are the germs (s, d) of all levels together, `samples` how many the largest level has.
    """
    shape: dict[str, Any] = {"q": basis.q, "interaction": basis.interaction, "largest": germs.largest}
    dimension, degree = len(germs.elements), basis.degree
    if basis.fit == "quadrature":
        # Products of two terms are integrated exactly up to this degree.
        exact = max(len(np.unique(column)) for column in points.T) - 1
        degree = exact if degree is None else degree
        if degree > exact:
            raise InputError(
                f"degree is {degree}: {exact + 1} quadrature nodes for each input are exact to {exact}"
            )
    if degree is None:
        most = samples * SPARSE_TERMS if basis.fit == "sparse" else samples / PER_TERM
        most = min(most, MOST_TERMS, VALUES_MAXIMUM // max(samples, 1))
        degree = 0
        while degree < HIGHEST and count(dimension, degree + 1, **shape) <= most:
            degree += 1
    return multi_indices(dimension, degree, **shape)


def _fit(psi: Array, y: Array, indices: NDArray[np.int64], basis: Basis, nodes: Array | None) -> Fit:
    """Return the fit of one level."""
    if nodes is not None:
        return project(psi, y, nodes, degree=int(indices.sum(axis=1).max(initial=0)))
    counts = leading(indices, basis.q) if basis.degree is None else [(len(indices), basis.degree)]
    if basis.fit == "sparse":
        return sparse(psi, y, counts)
    return least_squares(psi, y, counts)


def _alike(known: Mask) -> list[tuple[NDArray[np.intp], Mask]]:
    """Return the columns that have the same samples known, and those samples."""
    patterns, number = np.unique(known, axis=1, return_inverse=True)
    number = number.reshape(-1)
    return [(np.flatnonzero(number == i), patterns[:, i]) for i in range(patterns.shape[1])]
