"""Monte Carlo: the share of unstable samples, or the mean of anything, with its interval.

Plain random samples, a latin hypercube or scrambled Sobol points; over everything at once or
stratified over the levels of a discrete input, n draws each, as Oberst et al. (INTER-NOISE 2016) do
with contact patterns. Points that are not independent need replicates to show their own error.
"""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import InputError, check_name
from hipuq.estimation.budgets import by_budget, shell, shells_of
from hipuq.estimation.limits import columns
from hipuq.estimation.reduction import Groups, by_block, one_group, read, reduced
from hipuq.estimation.results import (
    ENDS,
    Kind,
    check_independent,
    finished,
    kind_of,
    labelled,
    levels_of,
    with_summaries,
)
from hipuq.inputs import Inputs
from hipuq.intervals import check_confidence
from hipuq.sampling import (
    SAMPLERS,
    Seed,
    check_count,
    check_size,
    rows_of,
    samples_by_block,
    seed_of,
    unit_points,
)

Array = NDArray[np.float64]

REPLICATES = {"random": 1, "latin_hypercube": 8, "sobol": 8}
"""Replicates by sampler where none are asked for: what its own error bar needs."""


def design(
    inputs: Inputs,
    n: int,
    rng: Seed,
    *,
    rows: slice | None = None,
    sampler: str = "random",
    stratify: str | bool = False,
    replicates: int | None = None,
) -> xr.Dataset:
    """Return samples of the inputs: random, a latin hypercube, or scrambled Sobol points.

    Parameters
    ----------
    inputs : Inputs
        The uncertain parameters.
    n : int
        Number of samples; for each level in a stratified design. All replicates together.
    rng : int or Generator
        Seed.
    rows : slice, optional
        Only these rows of the design.
    sampler : str
        ``"random"``, ``"latin_hypercube"`` or ``"sobol"``.
    stratify : str or bool
        Name of the discrete input of which every level gets n samples; True for the only one.
    replicates : int, optional
        Number of independent designs that n is divided into: 1 for ``"random"``, else 8.

    Returns
    -------
    Dataset
        The inputs over ``sample``. Coords ``replicate(sample)``, if there are several, and in a stratified
        design the level's number and ``weight(sample)``, its probability.

    Raises
    ------
    InputError
        If n does not suit the sampler or the replicates, or `stratify` is True and there is not exactly one
        discrete input.
    UnknownNameError
        If there is no such sampler or discrete input.
    """
    share, parts, levels = _plan(inputs, n, sampler, stratify, replicates)
    seed = seed_of(rng)
    name, rest = _stratum(inputs, stratify)
    strata = 1 if levels is None else levels.sizes[levels.attrs["dim"]]
    total = strata * parts * share
    wanted = rows_of(total, rows)

    def points(part: slice) -> Array:
        pieces = []
        for cell in range(part.start // share, -(-part.stop // share)):
            inside = slice(max(part.start - cell * share, 0), min(part.stop - cell * share, share))
            pieces.append(unit_points(sampler, share, rest.dimension, seed, divmod(cell, parts), inside))
        return np.concatenate(pieces)

    samples = samples_by_block(rest, points, wanted, total)
    numbers = samples["sample"].values
    if parts > 1:
        replicate = numbers // share % parts + 1
        samples = samples.assign_coords(
            replicate=("sample", replicate, schema.COORDINATES["replicate"].attrs)
        )
    if levels is not None:
        level = numbers // (share * parts)
        dim = levels.attrs["dim"]
        along = {key: levels[key].variable.isel({dim: level}) for key in (name, dim, *_carried(levels))}
        drawn = {key: (("sample", *part.dims[1:]), part.values, part.attrs) for key, part in along.items()}
        samples = samples.assign({name: drawn.pop(name)}).assign_coords(drawn)
        samples = samples.assign_coords({d: levels[d] for d in levels[name].dims[1:]})
    options = {"design": {"n": int(n), "sampler": sampler, "stratify": name or False, "replicates": parts}}
    return schema.stamp(
        samples,
        f"design monte_carlo, {total} samples",
        method="monte_carlo",
        seed=seed,
        options=options,
        inputs=inputs.to_json(),
    )


def _carried(levels: xr.Dataset) -> list[str]:
    """Return what samples of a stratum carry besides its number: its weight and group."""
    return ["weight", levels.attrs["group"]]


def evaluations(
    inputs: Inputs,
    n: int,
    *,
    sampler: str = "random",
    stratify: str | bool = False,
    replicates: int | None = None,
) -> int:
    """Return the number of model runs of a design.

    Parameters
    ----------
    inputs : Inputs
        The uncertain parameters.
    n : int
        As in `design`.
    sampler : str
        As in `design`.
    stratify : str or bool
        As in `design`.
    replicates : int, optional
        As in `design`.

    Returns
    -------
    int
        n, times the number of levels in a stratified design.

    Raises
    ------
    InputError
        As `design`.
    UnknownNameError
        As `design`.
    """
    share, parts, levels = _plan(inputs, n, sampler, stratify, replicates)
    strata = 1 if levels is None else levels.sizes[levels.attrs["dim"]]
    return share * parts * strata


def _plan(
    inputs: Inputs, n: int, sampler: str, stratify: str | bool, replicates: int | None
) -> tuple[int, int, xr.Dataset | None]:
    """Return samples for each replicate, replicates, and the levels of the strata."""
    n = check_count("n", n)
    check_name("sampler", sampler, SAMPLERS)
    parts = REPLICATES[sampler] if replicates is None else check_count("replicates", replicates)
    if n % parts:
        raise InputError(f"n is {n}: it must be a multiple of the {parts} replicates")
    check_size(sampler, n // parts, parts)
    name, _ = _stratum(inputs, stratify)
    return n // parts, parts, inputs.levels(name) if name else None


def _stratum(inputs: Inputs, stratify: str | bool) -> tuple[str, Inputs]:
    """Return the name of the input that makes the strata, empty without one, and the other inputs."""
    if stratify is False:
        return "", inputs
    if stratify is True:
        if len(inputs.discrete) != 1:
            raise InputError(
                f"stratify is True, but the discrete inputs are {inputs.discrete or 'none'}: name one"
            )
        stratify = inputs.discrete[0]
    check_name("discrete input to stratify", stratify, inputs.discrete)
    return stratify, inputs.without(stratify)


def estimate(
    outcomes: xr.Dataset, inputs: Inputs, *, of: str, rng: Seed = None, confidence: float = 0.95
) -> xr.Dataset:
    """Estimate the probability that an outcome is true, or its mean and variance.

    A variable of role ``"verdict"``, a boolean one, and one without units and role that holds
    nothing but 0, 1 and NaN gives probabilities with a Wilson interval; one of role
    ``"probability"`` their mean with a t interval; any other mean and variance. With replicates the
    interval is that between replicates; where they do not differ, that of the pooled sample. Where no
    input is left to chance, as with friction integrated and every contact pattern once or no other input,
    there is no sampling error: the limits are what is unknown alone, and the confidence is 1.

    Parameters
    ----------
    outcomes : Dataset
        As from `evaluate`, or any Dataset with the variable over ``sample``.
    inputs : Inputs
        The inputs of the design; their levels label the strata.
    of : str
        Name of the outcome. If the outcomes hold ``<of>_low`` and ``<of>_high``, they bound each sample.
    rng : int or Generator, optional
        Not used: nothing here is random.
    confidence : float, default 0.95
        Level of the intervals [1].

    Returns
    -------
    Dataset
        ``probability`` with ``_low`` and ``_high`` (interval, every unknown counted as 0 in the
        one and as 1 in the other), or ``mean`` with ``_low`` and ``_high`` and ``variance``; by level
        in a stratified analysis, then also ``probability_overall``, weighted, and for each group
        of levels ``probability_mean``, ``_min``, ``_max`` and ``probability_weighted``. Without strata
        ``probability_by_budget`` (or ``mean_by_budget``) with its limits shows the convergence.

    Raises
    ------
    InputError
        If the outcome has infinite values or the confidence is not one.
    SchemaError
        If the samples are of another method's design and no plain draws of the inputs, or the outcome does
        not hold numbers over ``sample``.
    UnknownNameError
        If there is no such outcome.
    """
    confidence = check_confidence(confidence)
    values = schema.check_outcomes(outcomes, of)
    check_independent(outcomes)
    kind = kind_of(values)
    levels, level = levels_of(outcomes, inputs)
    strata = 1 if levels is None else levels.sizes[levels.attrs["dim"]]
    replicates, replicate = _replicates(outcomes)

    def cell(rows: slice) -> NDArray[np.intp]:
        return level(rows) * replicates + replicate(rows)

    groupings = [(cell, strata * replicates)]
    if levels is None and replicates == 1:
        groupings.append((shell, shells_of(values.sizes["sample"])))
    cells, *shells = reduced([values, *_bounds(outcomes, of, values.dims)], groupings)
    table, *bounds = (part.reshaped(strata, replicates) for part in cells)
    if set(inputs) <= set(inputs.discrete) and (levels is not None or not inputs):
        confidence = 1.0
    dims = ([] if levels is None else [levels.attrs["dim"]]) + [str(d) for d in values.dims[1:]]
    found = columns(table, bounds, kind, confidence)
    arrays = {
        name: xr.DataArray(column if levels is not None else column[0], dims=dims)
        for name, column in found.items()
    }
    results = labelled(values, kind, arrays)
    if levels is not None:
        independent = kind == Kind("probability") and replicates == 1 and confidence < 1
        level_of_limits = confidence if independent else None
        results = with_summaries(results, levels, kind.quantity, arrays, level_of_limits)
    else:
        # Only whole replicates are designs of their own.
        parts = by_budget(values.dims[1:], shells[0] if shells else cells, bool(shells), kind, confidence)
        for (end, text), part in zip(ENDS.items(), parts.values(), strict=True):
            attrs = results[f"{kind.quantity}{end}"].attrs
            name = f"{attrs['long_name'].removesuffix(text)} after part of the samples{text}"
            results[f"{kind.quantity}_by_budget{end}"] = part.assign_attrs(attrs, long_name=name)
    return finished(results, outcomes, inputs, of=of, method="monte_carlo", confidence=confidence)


def _replicates(outcomes: xr.Dataset) -> tuple[int, Groups]:
    """Return the number of replicates and what gives the number of each sample's, from 0."""
    numbers = outcomes.coords.get("replicate")
    if numbers is None or not numbers.dims:
        return 1, one_group
    names = np.unique(np.concatenate([np.unique(part) for part in by_block(numbers)]))
    return len(names), lambda rows: np.searchsorted(names, read(numbers, rows))


def _bounds(outcomes: xr.Dataset, of: str, dims: tuple[Hashable, ...]) -> list[xr.DataArray]:
    """Return the bounds of each sample's outcome, if the outcomes hold them."""
    names = [f"{of}_low", f"{of}_high"]
    return [outcomes[name].transpose(*dims) for name in names if all(end in outcomes for end in names)]
