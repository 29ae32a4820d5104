"""The three stages by name of the method, and all of them in one call."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from typing import Any

import xarray as xr

from hipuq.designs import Design
from hipuq.errors import InputError, check_name
from hipuq.evaluation import MAX_FAILED, How
from hipuq.inputs import Inputs
from hipuq.methods import METHODS, Method
from hipuq.rounds import by_rows, completed, estimated
from hipuq.sampling import Seed, seed_of


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


def lazy_design(method: str, inputs: Inputs, n: int, rng: Seed = None, **options: Any) -> Design:
    """Return the samples that a method wants evaluated, made when they are needed, rows at a time.

    Parameters
    ----------
    method, inputs, n, rng
        As in `design`.
    **options
        Options of the method's design.

    Returns
    -------
    Design
        For `evaluate` with a store: the same samples as of `design`, never in memory together.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> inputs = model.inputs(friction=cp.Uniform(0.0, 1.0))
    >>> design = hipuq.lazy_design("monte_carlo", inputs, n=10_000_000, rng=1)
    >>> len(design), design.rows(9_999_000, 10_000_000).sizes["sample"]
    (10000000, 1000)
    """
    _check_inputs(inputs)
    record = method_named(method)
    record.check("design", options)
    return by_rows(record, inputs, n, seed_of(rng), options)


def run(
    model: Callable[..., xr.Dataset],
    inputs: Inputs,
    *,
    method: str,
    n: int,
    of: str,
    rng: Seed = None,
    n_jobs: int | None = None,
    executor: Executor | str | Any = None,
    progress: bool | None = None,
    store: str | os.PathLike[str] | None = None,
    resume: bool = False,
    on_error: str = "mark",
    max_failed: float = MAX_FAILED,
    retry_failed: bool = False,
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
    n_jobs, executor, progress, store, resume, on_error, max_failed, retry_failed
        As in `evaluate`. With a store samples are made by rows, and memory does not grow with them.
    **options
        Options of the method; each stage gets its own.

    Returns
    -------
    Dataset
        Results, as from `estimate`.
    """
    record, stages = check_arguments(inputs, method, n, of, options)
    how = How(n_jobs, executor, progress, store, resume, on_error, max_failed, retry_failed)
    (outcomes,) = completed(model, inputs, record, n, seed_of(rng), of=[of], stages=stages, how=how)
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


def _check_of(of: object) -> None:
    if not isinstance(of, str):
        raise InputError(f"of is {of!r}: it must be the name of one outcome, such as 'margin'")


def _check_inputs(inputs: object) -> Inputs:
    if not isinstance(inputs, Inputs):
        raise InputError(f"inputs is {type(inputs).__name__}: give hipuq.Inputs(...) or model.inputs(...)")
    return inputs
