"""An analysis over values of parameters that are known, such as the damping ratio: one after the other."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.driver import check_arguments, completed, estimated
from hipuq.errors import InputError, SchemaError, check_name
from hipuq.inputs import Inputs
from hipuq.sampling import Seed, seed_of

OVER = "over"
"""Attribute of results over values of parameters: their names, JSON."""

Values = dict[str, tuple[float, ...]]
"""Parameter -> its values, ascending."""

ALIKE = ("weight",)
"""Variables of results that no parameter changes."""

LARGEST = 10_000
"""Most analyses in one sweep."""


def sweep(
    model: Callable[..., xr.Dataset],
    inputs: Inputs,
    over: Mapping[str, Iterable[float]],
    *,
    method: str,
    n: int,
    of: str,
    rng: Seed = None,
    n_jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool | None = None,
    **options: Any,
) -> xr.Dataset:
    """Make an analysis at each value of a parameter that is not uncertain, such as the damping ratio.

    All get the same draws of the inputs, so that what differs between them is the parameter.

    Parameters
    ----------
    model : callable
        Samples Dataset -> outcomes Dataset.
    inputs : Inputs
        The uncertain parameters.
    over : mapping
        Parameter, a single number for each sample -> its values, ascending; of several parameters every
        combination.
    method : str
        Name of a method.
    n : int
        Size of the design at each value.
    of : str
        Name of the outcome to analyse.
    rng : int or Generator, optional
        Seed.
    n_jobs, executor, progress
        As in `evaluate`.
    **options
        Options of the method.

    Returns
    -------
    Dataset
        Results as from `run`, each variable with one more dim, first, for each parameter in `over`. What has
        other labels at each value, such as the terms of a sparse expansion, is left out.

    Raises
    ------
    InputError
        If a parameter is uncertain too, has several elements, or its values are not finite or do not ascend.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.ring("oberst2016-calibrated")
    >>> inputs = model.inputs(friction=cp.Uniform(0.0, 0.4))
    >>> over = {"damping_ratio": [0.0, 0.01]}
    >>> results = hipuq.sweep(model, inputs, over, method="monte_carlo", n=1000, of="any_unstable", rng=1)
    >>> results["probability"].dims
    ('damping_ratio',)
    """
    record, stages = check_arguments(inputs, method, n, of, options)
    values = check_over(over, model, inputs)
    seed = seed_of(rng)
    parts = []
    for fixed in points(values):
        outcomes = completed(
            model,
            inputs,
            record,
            n,
            seed,
            of=[of],
            stages=stages,
            fixed=fixed,
            n_jobs=n_jobs,
            executor=executor,
            progress=progress,
        )
        parts.append(estimated(record, outcomes, inputs, of=of, **stages["estimate"]))
    return gathered(parts, values)


def check_over(over: Mapping[str, Iterable[float]], model: object, inputs: Inputs) -> Values:
    """Return the values of a sweep, once they are known to be ones that the model takes.

    Parameters
    ----------
    over : mapping
        As in `sweep`.
    model : callable
    inputs : Inputs

    Returns
    -------
    dict
        Parameter -> its values.

    Raises
    ------
    InputError
        As in `sweep`.
    """
    if not isinstance(over, Mapping) or not over:
        raise InputError(
            f"over is {over!r}: it must name parameters with their values, such as "
            "{'damping_ratio': [0.0, 0.01]}"
        )
    parameters = getattr(model, "parameters", None)
    found: Values = {}
    for name, given in over.items():
        if parameters is not None:
            check_name("parameter in over", name, parameters)
        if name in inputs:
            raise InputError(f"{name} is uncertain and in over too: take it out of one of them")
        if not isinstance(name, str) or name in schema.COORDINATES or name in schema.RESULT_DIMS:
            raise InputError(f"{name!r} in over cannot be a parameter: results use the name")
        if name in schema.PARAMETERS and len(schema.PARAMETERS[name].dims) > 1:
            raise InputError(f"{name} in over has a value for each element: only single numbers are swept")
        found[name] = _ascending(name, given)
    if np.prod([float(len(own)) for own in found.values()]) > LARGEST:
        raise InputError(f"over has more than {LARGEST:,} combinations: take fewer values")
    return found


def _ascending(name: str, given: Iterable[float]) -> tuple[float, ...]:
    """Return values as numbers that ascend."""
    try:
        array = np.asarray(given if isinstance(given, Sequence | np.ndarray) else list(given), np.float64)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if array.ndim != 1 or not array.size or not np.isfinite(array).all() or (np.diff(array) <= 0).any():
        raise InputError(f"{name} in over is {given!r}: it must be a list of finite numbers that ascend")
    return tuple(array.tolist())


def points(values: Values) -> list[dict[str, float]]:
    """Return every combination of the values, the last parameter changing fastest; one of none is empty."""
    return [dict(zip(values, place, strict=True)) for place in itertools.product(*values.values())]


def gathered(parts: Sequence[xr.Dataset], values: Values) -> xr.Dataset:
    """Return Datasets of all combinations as one.

    Parameters
    ----------
    parts : sequence of Dataset
        One for each of `points`; dims that differ between them are left out.
    values : dict
        Parameter -> its values.

    Returns
    -------
    Dataset
        Each data variable with the parameters as first dims; what is the only one is returned as it is where
        nothing is swept.

    Raises
    ------
    SchemaError
        If nothing is left.
    """
    if not values:
        return parts[0]
    whole = _joined(list(parts), list(values.items()))
    first = parts[0].attrs
    text = ", ".join(f"{name} at {len(own)} values" for name, own in values.items())
    options = {OVER: {name: list(own) for name, own in values.items()}}
    whole = schema.stamp(whole.assign_attrs(first), f"sweep over {text}", options=options, like=first)
    if "seconds" in first:
        whole.attrs["seconds"] = sum(float(part.attrs["seconds"]) for part in parts)
    return whole.assign_attrs({OVER: json.dumps(list(values))})


def _joined(parts: list[xr.Dataset], values: list[tuple[str, tuple[float, ...]]]) -> xr.Dataset:
    """Return Datasets joined along the first parameter, each made of those along the others."""
    (name, own), *rest = values
    step = len(parts) // len(own)
    inner = parts
    if rest:
        inner = [_joined(parts[i : i + step], rest) for i in range(0, len(parts), step)]
    attrs = schema.PARAMETERS[name].attrs if name in schema.PARAMETERS else {"long_name": name, "units": ""}
    along = xr.Variable(name, np.array(own), attrs)
    # A coordinate that was fixed in the samples gives way to the dim.
    inner = [part.drop_vars(name, errors="ignore").drop_dims(_unlike(inner)) for part in inner]
    if not inner[0].data_vars:
        raise SchemaError(f"the results at different {name} have nothing alike: their dims differ")
    return xr.concat(
        inner,
        xr.DataArray(along, name=name),
        data_vars=[str(key) for key in inner[0].data_vars if key not in ALIKE],
        coords="different",
        compat="equals",
        join="exact",
        combine_attrs="override",
    )


def _unlike(parts: list[xr.Dataset]) -> list[Hashable]:
    """Return the dims whose length or labels differ between Datasets."""
    first, *rest = parts
    return [
        dim
        for dim in first.dims
        if any(
            dim not in part.dims or part.sizes[dim] != first.sizes[dim] or not part[dim].equals(first[dim])
            for part in rest
        )
    ]


def swept(results: xr.Dataset) -> tuple[str, ...]:
    """Return the parameters that results are over; none of ordinary ones."""
    return tuple(json.loads(results.attrs.get(OVER, "[]")))


def at(results: xr.Dataset, **values: float) -> xr.Dataset:
    """Return the results of a sweep at a value of one or more of its parameters.

    Parameters
    ----------
    results : Dataset
        As from `sweep`.
    **values
        Parameter = one of its values.

    Returns
    -------
    Dataset
        Ordinary results where no parameter is left; the values are scalar coords.

    Raises
    ------
    InputError
        If the results are not over the parameter, or have no such value.
    """
    names = swept(results)
    for name, value in values.items():
        check_name("parameter of the sweep", name, names)
        there = results[name].values
        near = np.isclose(there, value, rtol=1e-9, atol=1e-15)
        if not near.any():
            raise InputError(f"the results have no {name} {value!r}: it must be one of {there.tolist()}")
        results = results.isel({name: int(near.argmax())})
    left = [name for name in names if name not in values]
    attrs = {key: own for key, own in results.attrs.items() if key != OVER}
    found = results.copy()
    found.attrs = attrs | ({OVER: json.dumps(left)} if left else {})
    return found
