"""The three stages by name of the method, and all of them in one call."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.errors import InputError, check_name
from hipuq.evaluation import evaluate, together
from hipuq.inputs import Inputs
from hipuq.methods import METHODS, Method
from hipuq.sampling import Seed, seed_of, spawn


def method_named(name: str) -> Method:
    """Return a method by name.

    Raises
    ------
    UnknownNameError
        If there is none.
    """
    return METHODS[check_name("method", name, METHODS)]


def design(
    method: str, inputs: Inputs, n: int, rng: Seed = None, *, rows: slice | None = None, **options: Any
) -> xr.Dataset:
    """Return the samples that a method wants evaluated.

    Parameters
    ----------
    method : str
        Name of a method.
    inputs : Inputs
        The uncertain parameters.
    n : int
        Size of the design; what it counts is the method's to say.
    rng : int or Generator, optional
        Seed; without it one from the operating system, which the attribute ``seed`` then names.
    rows : slice, optional
        Only these rows of the design; needs an integer seed to belong to the same design.
    **options
        Options of the method's design.

    Returns
    -------
    Dataset
        Over ``sample``, one variable for each uncertain parameter.
    """
    _check_inputs(inputs)
    record = method_named(method)
    record.check("design", options)
    return record.design(inputs, n, rng, rows=rows, **options)


def estimate(
    method: str, outcomes: xr.Dataset, inputs: Inputs, *, of: str, rng: Seed = None, **options: Any
) -> xr.Dataset:
    """Return the results of a method from outcomes.

    Parameters
    ----------
    method : str
        Name of a method.
    outcomes : Dataset
        As from `evaluate`.
    inputs : Inputs
        The inputs of the design.
    of : str
        Name of the outcome to analyse.
    rng : int or Generator, optional
        Seed of what the method draws, if anything; by default it follows from the design's.
    **options
        Options of the method's estimate.

    Returns
    -------
    Dataset
    """
    _check_inputs(inputs)
    _check_of(of)
    record = method_named(method)
    record.check("estimate", options)
    return estimated(record, outcomes, inputs, of=of, rng=rng, **options)


def run(
    model: Callable[..., xr.Dataset],
    inputs: Inputs,
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
    """Design, evaluate and estimate in one call.

    Parameters
    ----------
    model : callable
        Samples Dataset -> outcomes Dataset.
    inputs : Inputs
        The uncertain parameters.
    method : str
        Name of a method.
    n : int
        Size of the design.
    of : str
        Name of the outcome to analyse; nothing else is evaluated.
    rng : int or Generator, optional
        Seed.
    n_jobs, executor, progress
        As in `evaluate`.
    **options
        Options of the method; each stage gets its own.

    Returns
    -------
    Dataset
        Results, as from `estimate`.
    """
    record, stages = check_arguments(inputs, method, n, of, options)
    outcomes = completed(
        model,
        inputs,
        record,
        n,
        seed_of(rng),
        of=[of],
        stages=stages,
        n_jobs=n_jobs,
        executor=executor,
        progress=progress,
    )
    return estimated(record, outcomes, inputs, of=of, **stages["estimate"])


def check_arguments(
    inputs: object, method: str, n: int, of: object, options: Mapping[str, Any]
) -> tuple[Method, dict[str, dict[str, Any]]]:
    """Return the method and its options by stage, once an analysis is known to be one that can be made.

    Parameters
    ----------
    inputs, method, n, of, options
        As in `run`.

    Returns
    -------
    method : Method
    stages : dict
        Options by stage.

    Raises
    ------
    InputError
        If one of them cannot be used.
    """
    _check_of(of)
    record = method_named(method)
    stages = record.split(options)
    record.plan(_check_inputs(inputs), n, [str(of)], stages)
    return record, stages


def completed(
    model: Callable[..., xr.Dataset],
    inputs: Inputs,
    record: Method,
    n: int,
    seed: int,
    *,
    of: Sequence[str],
    stages: Mapping[str, Mapping[str, Any]],
    fixed: Mapping[str, float] | None = None,
    keep: Sequence[str] = (),
    n_jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool | None = None,
) -> xr.Dataset:
    """Design and evaluate, and what a sequential method then still wants, round after round.

    Parameters
    ----------
    model : callable
    inputs : Inputs
    record : Method
    n : int
        Size of the design.
    seed : int
        Seed of the design; round k draws from ``spawn(seed, k)``.
    of : list of str
        Outcomes to analyse; the first one is what a sequential method looks at.
    stages : mapping
        Options by stage, as from `Method.split`.
    fixed : mapping, optional
        Parameters that are not uncertain -> the value that all samples get.
    keep : sequence of str
        Outcomes wanted besides.
    n_jobs, executor, progress
        As in `evaluate`.

    Returns
    -------
    Dataset
        Outcomes of all rounds.
    """

    def evaluated(samples: xr.Dataset) -> xr.Dataset:
        wanted = [*with_bounds(of, model), *(name for name in keep if name not in of)]
        values = {
            name: ("sample", np.full(samples.sizes["sample"], value), _attrs(name))
            for name, value in (fixed or {}).items()
        }
        samples = samples.assign(values)
        return evaluate(model, samples, keep=wanted, n_jobs=n_jobs, executor=executor, progress=progress)

    outcomes = evaluated(record.design(inputs, n, seed, **stages["design"]))
    number = 1
    while record.refine is not None:
        with one_thread():
            more = record.refine(outcomes, inputs, spawn(seed, number), of=of[0], **stages["refine"])
        if more is None:
            break
        outcomes = together(outcomes, evaluated(more))
        number += 1
    return outcomes


def estimated(record: Method, outcomes: xr.Dataset, inputs: Inputs, **options: Any) -> xr.Dataset:
    """Return what a method estimates, the same to the last bit whatever number of threads BLAS would take.

    Parameters
    ----------
    record : Method
    outcomes : Dataset
    inputs : Inputs
    **options
        Of the method's estimate, `of` among them.

    Returns
    -------
    Dataset
    """
    with one_thread():
        return record.estimate(outcomes, inputs, **options)


def one_thread() -> AbstractContextManager[Any]:
    """Return a context in which BLAS takes one thread: its matrices are small here, more would wait."""
    from threadpoolctl import threadpool_limits

    limits: AbstractContextManager[Any] = threadpool_limits(1, "blas")
    return limits


def with_bounds(of: Iterable[str], model: Callable[..., xr.Dataset]) -> list[str]:
    """Return outcomes to analyse, and the bounds ``<of>_low``, ``<of>_high`` that a model gives of them."""
    names = list(of)
    known = getattr(model, "outcomes", ())
    bounds = [f"{name}_{end}" for name in names for end in ("low", "high")]
    return [*names, *(name for name in bounds if name in known)]


def _attrs(name: str) -> dict[str, Any]:
    """Return the attributes of a parameter that all samples have alike."""
    return schema.PARAMETERS[name].attrs if name in schema.PARAMETERS else {"long_name": name, "units": ""}


def _check_of(of: object) -> None:
    if not isinstance(of, str):
        raise InputError(f"of is {of!r}: it must be the name of one outcome, such as 'margin'")


def _check_inputs(inputs: object) -> Inputs:
    if not isinstance(inputs, Inputs):
        raise InputError(f"inputs is {type(inputs).__name__}: give hipuq.Inputs(...) or model.inputs(...)")
    return inputs
