"""An analysis over values of parameters that are known, such as the damping ratio: one after the other."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.combinations import Values, gathered, points
from hipuq.combinations import at as at
from hipuq.combinations import swept as swept
from hipuq.driver import check_arguments
from hipuq.errors import InputError, check_name
from hipuq.evaluation import How
from hipuq.inputs import Inputs
from hipuq.rounds import completed, estimated
from hipuq.sampling import Seed, seed_of

ESTIMATES = (
    *("probability", "mean", "variance", "S1", "ST", "S2", "q2", "quantile", "trusted", "known", "events"),
    *("evaluations", "failed", "undecided", "seconds", "of", "method", "bound", "interval", "frequency"),
)
"""What names of variables and dims of results begin with."""

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
    executor: Executor | str | Any = None,
    progress: bool | None = None,
    **options: Any,
) -> xr.Dataset:
    """Make an analysis at each value of a parameter that is not uncertain, such as the damping ratio.

    All get the same draws of the inputs, so that what differs between them is the parameter.

    Parameters
    ----------
    model : callable
        Samples Dataset -> outcomes Dataset, as in `evaluate`.
    inputs : Inputs
        The uncertain parameters.
    over : mapping
        Parameter, a single number for each sample -> its values, ascending, in the units of the schema; of
        several parameters every combination.
    method : str
        Name of a method: ``"monte_carlo"``, ``"chaos"`` or ``"sobol"``.
    n : int
        Size of the design at each value.
    of : str
        Name of the outcome to analyse.
    rng : int or Generator, optional
        Seed; without it one from the operating system, which the attribute ``seed`` then names.
    n_jobs : int, optional
        Threads or processes; all cores by default.
    executor : str, concurrent.futures.Executor or dask.distributed.Client, optional
        ``"threads"`` (the default), ``"processes"``, or what runs the blocks instead, as in `evaluate`.
    progress : bool, optional
        Whether to show a progress bar; by default on a terminal.
    **options
        Options of the method.

    Returns
    -------
    Dataset
        Results as from `run`, each variable with one more dim, first, for each parameter in `over`, such as
        ``probability(damping_ratio)``. What has
        other labels at each value, such as the terms of a sparse expansion, is left out.

    Raises
    ------
    InputError
        If a parameter is uncertain too, has several elements, or its values are not finite or do not ascend;
        or as in `run`.
    UnknownNameError
        If the model has no such parameter, or as in `run`.
    SchemaError, ModelError
        As in `run`.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.ring("oberst2016-calibrated")
    >>> inputs = model.inputs(friction=cp.Uniform(0.0, 0.4))
    >>> over = {"damping_ratio": [0.0, 0.01]}
    >>> how = {"method": "monte_carlo", "n": 1000, "of": "any_unstable"}
    >>> results = hipuq.sweep(model, inputs, over, rng=1, **how)
    >>> results["probability"].dims
    ('damping_ratio',)
    >>> results["probability"].values.round(3)
    array([0.861, 0.699])
    """
    record, stages = check_arguments(inputs, method, n, of, options)
    values = check_over(over, model, inputs)
    seed, how = seed_of(rng), How(n_jobs, executor, progress)
    parts = []
    for fixed in points(values):
        (outcomes,) = completed(model, inputs, record, n, seed, of=[of], stages=stages, at=[fixed], how=how)
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
        if not isinstance(name, str) or not name.isidentifier() or _taken(name):
            raise InputError(f"{name!r} in over cannot be a parameter: results use the name, or it is none")
        if name in schema.PARAMETERS and len(schema.PARAMETERS[name].dims) > 1:
            raise InputError(f"{name} in over has a value for each element: only single numbers are swept")
        found[name] = _ascending(name, given)
        if parameters is not None:
            # Now rather than after the analyses before it.
            parameters[name].check(name, np.array(found[name]))
    if np.prod([float(len(own)) for own in found.values()]) > LARGEST:
        raise InputError(f"over has more than {LARGEST:,} combinations: take fewer values")
    return found


def _taken(name: str) -> bool:
    """Say whether results have a variable, a dim or limits of the name."""
    return name in schema.COORDINATES or name in schema.RESULT_DIMS or name.startswith(ESTIMATES)


def _ascending(name: str, given: Iterable[float]) -> tuple[float, ...]:
    """Return values as numbers that ascend."""
    # One more than may be, of what might never end.
    listed = list(itertools.islice(given, LARGEST + 1)) if isinstance(given, Iterable) else []
    numbers = all(isinstance(v, int | float | np.number) and not isinstance(v, bool) for v in listed)
    array = np.array(listed if numbers else [], np.float64)
    if not array.size or not np.isfinite(array).all() or (np.diff(array) <= 0).any():
        raise InputError(f"{name} in over is {given!r}: it must be a list of finite numbers that ascend")
    return tuple(array.tolist())
