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

    Parameters
    ----------
    name : str
        Such as ``"monte_carlo"``.

    Returns
    -------
    Method
        Its record in `hipuq.methods.METHODS`.

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
        Name of a method: ``"monte_carlo"``, ``"chaos"`` or ``"sobol"``.
    inputs : Inputs
        The uncertain parameters.
    n : int
        Size of the design; what it counts is the method's to say.
    rng : int or Generator, optional
        Seed; without it one from the operating system, which the attribute ``seed`` then names.
    rows : slice, optional
        Only these rows of the design; needs an integer seed to belong to the same design.
    **options
        Options of the method's design, such as those of `hipuq.methods.monte_carlo.design`.

    Returns
    -------
    Dataset
        Over ``sample``, one variable for each uncertain parameter, in the units of the schema; coords over
        ``sample`` are the method's bookkeeping.

    Raises
    ------
    InputError
        If `inputs` is something else, n does not suit the method, or an option cannot be used.
    UnknownNameError
        If there is no such method or option.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> inputs = model.inputs(friction=cp.Uniform(0.0, 1.0))
    >>> samples = hipuq.design("monte_carlo", inputs, n=4, rng=1)
    >>> samples["friction"].values.round(4)
    array([0.3787, 0.4766, 0.5994, 0.2052])
    >>> samples.attrs["seed"]
    1
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
        Name of a method: ``"monte_carlo"``, ``"chaos"`` or ``"sobol"``.
    outcomes : Dataset
        As from `evaluate`: the outcome over ``sample`` with the samples.
    inputs : Inputs
        The inputs of the design.
    of : str
        Name of the outcome to analyse.
    rng : int or Generator, optional
        Seed of what the method draws, if anything; by default it follows from the design's.
    **options
        Options of the method's estimate, such as those of `hipuq.methods.monte_carlo.estimate`.

    Returns
    -------
    Dataset
        What the method tells of the outcome, each estimate with its limits ``_low`` and ``_high``: see the
        ``estimate`` of the method. The attributes say from what it was made.

    Raises
    ------
    InputError
        If `inputs` is something else, `of` is not a name, or an option cannot be used.
    UnknownNameError
        If there is no such method, option or outcome.
    SchemaError
        If the outcomes do not follow the schema, or are of a design that the method cannot use.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> inputs = model.inputs(friction=cp.Uniform(0.0, 1.0))
    >>> samples = hipuq.design("monte_carlo", inputs, n=10_000, rng=1)
    >>> outcomes = hipuq.evaluate(model, samples)
    >>> results = hipuq.estimate(
    ...     "monte_carlo", outcomes, inputs, of="any_unstable"
    ... )
    >>> names = ["probability_low", "probability", "probability_high"]
    >>> [round(results[name].item(), 3) for name in names]
    [0.522, 0.532, 0.542]
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
    method : str
        Name of a method: ``"monte_carlo"``, ``"chaos"`` or ``"sobol"``.
    inputs : Inputs
        The uncertain parameters.
    n : int
        Size of the design; what it counts is the method's to say.
    rng : int or Generator, optional
        Seed; without it one from the operating system, which the attribute ``seed`` then names.
    **options
        Options of the method's design.

    Returns
    -------
    Design
        For `evaluate` with a store: the same samples as of `design`, never in memory together.

    Raises
    ------
    InputError
        If `inputs` is something else, n does not suit the method, or an option cannot be used.
    UnknownNameError
        If there is no such method or option.

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
        Samples Dataset -> outcomes Dataset, as in `evaluate`.
    inputs : Inputs
        The uncertain parameters.
    method : str
        Name of a method: ``"monte_carlo"``, ``"chaos"`` or ``"sobol"``.
    n : int
        Size of the design; what it counts is the method's to say.
    of : str
        Name of the outcome to analyse; nothing else is evaluated.
    rng : int or Generator, optional
        Seed; without it one from the operating system, which the attribute ``seed`` then names.
    n_jobs : int, optional
        Threads or processes; all cores by default.
    executor : str, concurrent.futures.Executor or dask.distributed.Client, optional
        ``"threads"`` (the default), ``"processes"``, or what runs the blocks instead, as in `evaluate`.
    progress : bool, optional
        Whether to show a progress bar; by default on a terminal.
    store : path, optional
        Zarr store to which outcomes are written as they come. Samples are then made by rows, and memory does
        not grow with them.
    resume : bool, default False
        Whether to go on with what the store has.
    on_error : str, default "mark"
        ``"mark"`` or ``"raise"``: what becomes of a sample that fails, as in `evaluate`.
    max_failed : float, default 0.5
        Share of the samples that may fail before the run ends [1], as in `evaluate`.
    retry_failed : bool, default False
        Whether, when a store is gone on with, its samples that failed are evaluated again.
    **options
        Options of the method; each stage gets its own.

    Returns
    -------
    Dataset
        Results, as from `estimate`.

    Raises
    ------
    InputError
        If an argument or an option cannot be used.
    UnknownNameError
        If there is no such method, option or outcome.
    SchemaError
        If samples or outputs do not follow the contract.
    ModelError
        If too many samples fail, or one with ``on_error="raise"``.
    StoreError
        If the store cannot be written, holds something else, or another run writes to it.

    Examples
    --------
    With all else known this model is unstable above a friction of 0.4724, so the exact answer is 0.5276.

    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> inputs = model.inputs(friction=cp.Uniform(0.0, 1.0))
    >>> results = hipuq.run(
    ...     model, inputs, method="monte_carlo", n=10_000, of="any_unstable", rng=1
    ... )
    >>> names = ["probability_low", "probability", "probability_high"]
    >>> [round(results[name].item(), 3) for name in names]
    [0.522, 0.532, 0.542]
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
    inputs : object
        Refused if not `Inputs`.
    method : str
        Name of a method.
    n : int
        Size of the design.
    of : object
        Refused if not the name of an outcome.
    options : mapping
        Options of the method, of all stages together.

    Returns
    -------
    method : Method
        The record of the method.
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
