"""The samples that a surrogate is made from: those to fit, and those held out to check it."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import SchemaError, check_name
from hipuq.estimation.results import levels_of
from hipuq.expansion.germs import Germs
from hipuq.inputs import Inputs
from hipuq.sampling import SAMPLERS, check_count, check_size, rows_of, samples_by_block, spawn, unit_points
from hipuq.surrogates.options import QUADRATURE, check_share, discrete_of
from hipuq.surrogates.surrogate import FIRST_KEY

Array = NDArray[np.float64]

FIT, HELD_OUT = -1, 0
"""Values of the coordinate ``stratum``: to fit, and held out; from 1 strata of the correction."""


def plan(inputs: Inputs, n: int, sampler: str, held_out: float) -> tuple[int, int, int]:
    """Return samples to fit for each level, levels, and samples held out.

    Parameters
    ----------
    inputs : Inputs
    n : int
        Samples to fit for each level, or quadrature nodes for each column of the unit cube.
    sampler : str
    held_out : float
        Samples held out as a share of those to fit.

    Raises
    ------
    UnknownNameError
        If there is no such sampler.
    InputError
        If n does not suit the sampler, or `held_out` is not a number from 0.
    """
    n = check_count("n", n)
    check_name("sampler", sampler, (*SAMPLERS, QUADRATURE))
    check_share(held_out)
    name, rest = discrete_of(inputs)
    if sampler == QUADRATURE:
        share = len(Germs.of(rest).grid(n)[1])
    else:
        share = n
        check_size(sampler, _length(sampler, n))
    levels = 1
    if name:
        table = inputs.levels(name)
        levels = table.sizes[table.attrs["dim"]]
    return share, levels, math.ceil(held_out * share * levels)


def drawn(inputs: Inputs, n: int, seed: int, rows: slice | None, sampler: str, held_out: float) -> xr.Dataset:
    """Return rows of a design: samples to fit level by level, then random ones of all inputs.

    Parameters
    ----------
    inputs : Inputs
        The uncertain parameters.
    n : int
        As in `plan`.
    seed : int
        Seed of the design.
    rows : slice or None
        Only these rows of it.
    sampler : str
        As in `plan`.
    held_out : float
        As in `plan`.

    Returns
    -------
    Dataset
        With the coords ``round``, ``stratum``, ``stratum_weight`` and, of quadrature nodes,
        ``quadrature_weight`` over sample.
    """
    share, levels, held = plan(inputs, n, sampler, held_out)
    name, rest = discrete_of(inputs)
    size = share * levels
    wanted = rows_of(size + held, rows)
    parts = []
    if wanted.start < size:
        part = slice(wanted.start, min(wanted.stop, size))
        if sampler == QUADRATURE:
            made = _nodes(rest, n, part)
        else:
            made = _points(rest, sampler, share, seed, part, size)
        parts.append(_at_levels(made, inputs, name, share) if name else made)
    if wanted.stop > size:
        part = slice(max(wanted.start, size) - size, wanted.stop - size)

        def points(at: slice) -> Array:
            return unit_points("random", held, inputs.dimension, seed, (1, 0), at)

        made = samples_by_block(inputs, points, part, held)
        made = made.assign_coords(sample=made["sample"] + size)
        if sampler == QUADRATURE:
            made = _with(made, {"quadrature_weight": np.full(made.sizes["sample"], np.nan)})
        parts.append(made if not parts else made[list(parts[0].data_vars)])
    samples = parts[0]
    if len(parts) > 1:
        samples = xr.concat(parts, "sample", data_vars="all", join="exact")
    fit = samples["sample"].values < size
    return _with(
        samples,
        {
            "round": np.zeros(len(fit), np.int64),
            "stratum": np.where(fit, FIT, HELD_OUT),
            "stratum_weight": np.where(fit, 0.0, 1.0),
        },
    )


def with_books(outcomes: xr.Dataset, inputs: Inputs, held_out: float, seed: int) -> xr.Dataset:
    """Return outcomes that say which samples are to fit and which are held out.

    Raises
    ------
    SchemaError
        If they say so in part, or leave nothing to fit.
    """
    names = [name for name in ("round", "stratum", "stratum_weight") if name in outcomes.coords]
    if "stratum" not in names:
        return divided(outcomes, inputs, held_out, seed)
    if len(names) < 3:
        raise SchemaError(
            f"the outcomes have of the coords round, stratum and stratum_weight only {', '.join(names)}: "
            "keep all of them, or drop 'stratum' to divide the samples anew"
        )
    if not (outcomes["stratum"].values == FIT).any():
        raise SchemaError(
            "all samples of the outcomes are held out, none is left to fit: "
            "drop the coord 'stratum' to divide them anew"
        )
    return outcomes


def divided(outcomes: xr.Dataset, inputs: Inputs, held_out: float, seed: int) -> xr.Dataset:
    """Return outcomes that say nothing of their use with a random part held out, level by level.

    Parameters
    ----------
    outcomes : Dataset
        Random samples of the inputs, or so many of each level in a stratified design.
    inputs : Inputs
    held_out : float
        Samples held out as a share of those to fit.
    seed : int

    Returns
    -------
    Dataset
        With the coords that `drawn` gives.

    Raises
    ------
    InputError
        If `held_out` is not a number from 0.
    """
    check_share(held_out)
    size = outcomes.sizes["sample"]
    levels, level_of = levels_of(outcomes, inputs)
    place = level_of(slice(0, size))
    share = np.ones(1) if levels is None else levels["weight"].values
    stratum, weight = np.full(size, FIT), np.zeros(size)
    rng = spawn(seed, FIRST_KEY, 2)
    for level in range(len(share)):
        own = np.flatnonzero(place == level)
        held = rng.permutation(own)[: math.ceil(len(own) * held_out / (1 + held_out))]
        stratum[held], weight[held] = HELD_OUT + level, share[level]
    books = {"round": np.zeros(size, np.int64), "stratum": stratum, "stratum_weight": weight}
    return _with(outcomes, books)


def _length(sampler: str, n: int) -> int:
    """Return the length of the whole sequence that n points are the first of."""
    return 1 << (n - 1).bit_length() if sampler == "sobol" else n


def _points(rest: Inputs, sampler: str, share: int, seed: int, rows: slice, size: int) -> xr.Dataset:
    """Return rows of the samples to fit: a design of its own for each level."""
    length = _length(sampler, share)

    def points(part: slice) -> Array:
        pieces = []
        for level in range(part.start // share, -(-part.stop // share)):
            inside = slice(max(part.start - level * share, 0), min(part.stop - level * share, share))
            pieces.append(unit_points(sampler, length, rest.dimension, seed, (0, level), inside))
        return np.concatenate(pieces)

    return samples_by_block(rest, points, rows, size)


def _nodes(rest: Inputs, n: int, rows: slice) -> xr.Dataset:
    """Return rows of the tensor Gauss rule, once more for each level."""
    germs = Germs.of(rest)
    nodes, weights = germs.grid(n)
    number = np.arange(rows.start, rows.stop)
    place = number % len(nodes)
    return _with(germs.samples(nodes[place]), {"sample": number, "quadrature_weight": weights[place]})


def _at_levels(samples: xr.Dataset, inputs: Inputs, name: str, share: int) -> xr.Dataset:
    """Return samples with the discrete input at the level that each belongs to."""
    levels = inputs.levels(name)
    dim, group = levels.attrs["dim"], levels.attrs["group"]
    own = levels[[name]].assign_coords({group: levels[group]}).drop_vars(dim)
    place = samples["sample"].values // share
    part = own.isel({dim: place}).rename({dim: "sample"})
    return samples.assign(part.data_vars).assign_coords(part.coords)


def _with(samples: xr.Dataset, books: dict[str, NDArray[np.float64] | NDArray[np.int64]]) -> xr.Dataset:
    """Return samples with coordinates over them."""
    return samples.assign_coords(
        {key: ("sample", book, schema.COORDINATES[key].attrs) for key, book in books.items()}
    )
