"""The three stages by name of the method, and all of them in one call."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.designs import Design, definition_of, with_fixed
from hipuq.errors import InputError, check_name
from hipuq.evaluation import MAX_FAILED, How, evaluated, together
from hipuq.inputs import Inputs
from hipuq.methods import METHODS, Method
from hipuq.sampling import Seed, seed_of, spawn

DEFAULT: How = How()
"""Evaluation in memory, with threads."""


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


def by_rows(record: Method, inputs: Inputs, n: int, seed: int, options: Mapping[str, Any]) -> Design:
    """Return a design of a method by rows."""
    known = record.options("evaluations")
    size = record.evaluations(inputs, n, **{key: own for key, own in options.items() if key in known})

    def make(rows: slice) -> xr.Dataset:
        return record.design(inputs, n, seed, rows=rows, **options)

    return Design(size, make, definition_of(make(slice(0, 1)).attrs, size))


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
    n_jobs, executor, progress, store, resume, on_error, max_failed
        As in `evaluate`. With a store samples are made by rows, and memory does not grow with them.
    **options
        Options of the method; each stage gets its own.

    Returns
    -------
    Dataset
        Results, as from `estimate`.
    """
    record, stages = check_arguments(inputs, method, n, of, options)
    how = How(n_jobs, executor, progress, store, resume, on_error, max_failed)
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


def completed(
    model: Callable[..., xr.Dataset],
    inputs: Inputs,
    record: Method,
    n: int,
    seed: int,
    *,
    of: Sequence[str],
    stages: Mapping[str, Mapping[str, Any]],
    at: Sequence[Mapping[str, float]] = ({},),
    keep: Sequence[str] = (),
    how: How = DEFAULT,
) -> list[xr.Dataset]:
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
    at : sequence of mapping
        Points at which the same samples are evaluated: parameter that is not uncertain -> its value.
    keep : sequence of str
        Outcomes wanted besides.
    how : How
        How to evaluate.

    Returns
    -------
    list of Dataset
        Outcomes of all rounds, at each point.
    """
    wanted = [*with_bounds(of, model), *(name for name in keep if name not in of)]
    base = by_rows(record, inputs, n, seed, stages["design"])
    design = base.at(at)
    whole = evaluated(model, design, wanted, how)
    places: list[Places] = [slice(k * base.size, (k + 1) * base.size) for k in range(len(at))]
    number = 1
    while record.refine is not None:
        with one_thread():
            more = [
                record.refine(part, inputs, spawn(seed, number), of=of[0], **stages["refine"])
                for part in _parts(whole, places)
            ]
        for k, (own, point) in enumerate(zip(more, at, strict=True)):
            if own is None:
                continue
            own = with_fixed(own, point)
            size = whole.sizes["sample"]
            design = design.followed_by(own)
            # What is there already is in the store, or in memory.
            if how.store is None:
                whole = together(whole, evaluated(model, own, wanted, how))
            else:
                whole = evaluated(model, design, wanted, replace(how, resume=True, replace=False))
            places[k] = np.concatenate([_numbers(places[k]), np.arange(size, design.size)])
        if all(own is None for own in more):
            break
        number += 1
    return _parts(whole, places)


Places = slice | NDArray[np.int64]


def _numbers(places: Places) -> NDArray[np.int64]:
    return np.arange(places.start, places.stop) if isinstance(places, slice) else places


def _parts(whole: xr.Dataset, places: Sequence[Places]) -> list[xr.Dataset]:
    """Return parts of outcomes, each with its share of the time."""
    if len(places) == 1:
        return [whole]
    size, seconds = whole.sizes["sample"], float(whole.attrs.get("seconds", np.nan))
    parts = [whole.isel(sample=rows) for rows in places]
    return [part.assign_attrs(seconds=seconds * part.sizes["sample"] / size) for part in parts]


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


def _check_of(of: object) -> None:
    if not isinstance(of, str):
        raise InputError(f"of is {of!r}: it must be the name of one outcome, such as 'margin'")


def _check_inputs(inputs: object) -> Inputs:
    if not isinstance(inputs, Inputs):
        raise InputError(f"inputs is {type(inputs).__name__}: give hipuq.Inputs(...) or model.inputs(...)")
    return inputs
