"""Samples and a model give outcomes: in blocks, on all cores, the same bits however it is divided."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Hashable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import HipuqError, InputError, ModelError, SchemaError, unknown_name
from hipuq.progress import progress_bar
from hipuq.sampling import check_count

Model = Callable[..., xr.Dataset]

BLOCK = 1024
"""Samples handed to the model at a time, unless it says in an attribute ``block`` how many it takes."""


def evaluate(
    model: Model,
    samples: xr.Dataset,
    *,
    keep: Iterable[str] | None = None,
    n_jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool | None = None,
) -> xr.Dataset:
    """Evaluate a model on samples.

    Parameters
    ----------
    model : callable
        ``samples Dataset -> Dataset of outputs over the same samples``. If it has an attribute
        ``outcomes``, the names it can give, it is called with ``keep=``; if it has a method
        ``check``, that sees all samples first.
    samples : Dataset
        Over ``sample``; see `hipuq.schema.check_samples`.
    keep : iterable of str, optional
        Outcomes wanted; nothing else is computed (where the model knows how) or stored.
    n_jobs : int, optional
        Threads; all cores by default.
    executor : concurrent.futures.Executor, optional
        Runs the blocks instead of threads.
    progress : bool, optional
        Whether to show a progress bar; by default on a terminal.

    Returns
    -------
    Dataset
        The samples, what the model gave, and ``status``. Results do not depend on `n_jobs` or
        `executor`; the attribute ``seconds`` and the time in ``history`` do.

    Raises
    ------
    SchemaError
        If samples or outputs do not follow the contract.
    ModelError
        If the model fails; its message names the samples.
    """
    size = schema.check_samples(samples)
    names = None if keep is None else _checked_names(model, keep)
    checker = getattr(model, "check", None)
    if callable(checker):
        checker(samples)
    jobs = (os.cpu_count() or 1) if n_jobs is None else check_count("n_jobs", n_jobs)
    step = check_count("block of the model", getattr(model, "block", BLOCK))
    blocks = [slice(start, min(start + step, size)) for start in range(0, size, step)]
    started = time.perf_counter()
    parts: list[xr.Dataset | None] = [None] * len(blocks)
    with _workers(jobs, executor) as pool, progress_bar("samples", size, progress) as advance:
        futures: dict[Future[xr.Dataset], int] = {
            pool.submit(_block, model, samples.isel(sample=rows), names, rows.start): i
            for i, rows in enumerate(blocks)
        }
        try:
            for future in as_completed(futures):
                i = futures[future]
                parts[i] = future.result()
                advance(blocks[i].stop - blocks[i].start)
        except BaseException:
            for future in futures:
                future.cancel()
            raise
    outputs = _joined([part for part in parts if part is not None])
    outcomes = samples.assign(_outputs(outputs)).assign_coords(outputs.coords)
    if "status" not in outcomes:
        outcomes["status"] = _status(outcomes, list(outputs.data_vars))
    label = str(getattr(model, "label", getattr(model, "__qualname__", type(model).__qualname__)))
    # Only a model with a label says in its options what rebuilds it.
    options = {"model": model.options if hasattr(model, "label") and hasattr(model, "options") else label}
    outcomes = schema.stamp(
        outcomes, f"evaluate {label} on {size} samples", model=label, options=options, like=samples.attrs
    )
    return outcomes.assign_attrs(seconds=time.perf_counter() - started)


def _checked_names(model: Model, keep: Iterable[str]) -> tuple[str, ...]:
    """Return the outcomes to keep, known ones if the model says which it has."""
    if isinstance(keep, str) or not isinstance(keep, Iterable):
        raise InputError(f"keep is {keep!r}: it must be a list of outcome names, ['margin']")
    names = tuple(dict.fromkeys(keep))
    if not names:
        raise InputError("keep is empty: name at least one outcome, or leave it out for all")
    known = getattr(model, "outcomes", None)
    for name in names:
        if known is not None and name not in known:
            raise unknown_name("outcome in keep", name, known)
    return names


def _block(model: Model, samples: xr.Dataset, keep: tuple[str, ...] | None, start: int) -> xr.Dataset:
    """Return the model's outputs over one block, checked, without coords over sample."""
    size = samples.sizes["sample"]
    try:
        given = model(samples) if keep is None or not hasattr(model, "outcomes") else model(samples, keep)
    except HipuqError:
        raise
    except Exception as error:
        raise ModelError(
            f"the model failed on samples {start} to {start + size - 1}: {type(error).__name__}: {error}"
        ) from error
    if not isinstance(given, xr.Dataset):
        raise SchemaError(f"the model must return an xarray Dataset, not {type(given).__name__}")
    both = [str(name) for name in given.data_vars if name in samples.variables]
    if both:
        raise SchemaError(
            f"the model returned {both[0]!r}, which is a name in the samples: return the outputs alone"
        )
    for name, values in _outputs(given).items():
        if values.sizes.get("sample") != size:
            raise SchemaError(
                f"output {str(name)!r} of the model has the dims {dict(values.sizes)}: "
                f"it needs 'sample' of length {size}"
            )
        if values.dtype.kind not in "biufc":
            raise SchemaError(f"output {str(name)!r} of the model must hold numbers, it holds {values.dtype}")
    given = _in_order(given, samples)
    if keep is not None:
        missing = [name for name in keep if name not in given]
        if missing:
            raise unknown_name("outcome in keep", missing[0], [str(name) for name in given.data_vars])
        always = [name for name in ("status", "decided_by") if name in given and name not in keep]
        given = given[[*keep, *always]]
    made = _outputs(given)
    return given.drop_vars([n for n in given.coords if "sample" in given[n].dims and n not in made])


def _outputs(given: xr.Dataset) -> dict[Hashable, xr.DataArray]:
    """Return what a model gave: xarray takes one named like a dim of its own for a coordinate."""
    named = {name: values for name, values in given.coords.items() if name in values.dims and values.ndim > 1}
    return {**given.data_vars, **named}


def _in_order(given: xr.Dataset, samples: xr.Dataset) -> xr.Dataset:
    """Return outputs in the order of the samples, without attributes that are those of a sample variable.

    A model may sort its samples, if it keeps their labels. Arithmetic hands on name and unit of the
    first operand, which are not those of the result.
    """
    if "sample" in given.coords and "sample" in samples.coords:
        here, there = given["sample"].values, samples["sample"].values
        if not np.array_equal(here, there):
            if not np.array_equal(np.sort(here), np.sort(there)):
                raise SchemaError("the model returned other labels of 'sample' than it was given")
            given = given.isel(sample=np.argsort(here)[np.argsort(np.argsort(there))])
    # Of several operands what they have in common is left.
    inherited = [{"units": ""}, *(values.attrs for values in samples.variables.values() if values.attrs)]
    bare = {n: v.drop_attrs() for n, v in given.data_vars.items() if v.attrs and v.attrs in inherited}
    return given.assign(bare)


def _joined(parts: list[xr.Dataset]) -> xr.Dataset:
    """Return the blocks one after the other; xr.concat would compare coords block by block."""
    first = parts[0]
    data: dict[Any, Any] = {}
    for name, values in _outputs(first).items():
        if any(name not in part or part[name].dims != values.dims for part in parts):
            raise SchemaError(f"the model returned {str(name)!r} with different dims in different blocks")
        axis = values.dims.index("sample")
        arrays = _padded([part[name].values for part in parts], axis)
        data[name] = (values.dims, np.concatenate(arrays, axis), values.attrs)
    coords = {name: values for name, values in first.coords.items() if name not in data}
    return xr.Dataset(data, coords=coords)


def together(first: xr.Dataset, more: xr.Dataset) -> xr.Dataset:
    """Return outcomes of two rounds of one analysis as one.

    Parameters
    ----------
    first, more : Dataset
        Outcomes of the same model; bookkeeping that only the first one has is missing (NaN) in the rest.

    Returns
    -------
    Dataset
        With the attributes of the first one, but seconds and options of both.
    """
    variables: dict[Any, Any] = {}
    for name, values in first.variables.items():
        if "sample" not in values.dims:
            variables[name] = values
            continue
        axis = values.dims.index("sample")
        if name in more.variables:
            rest = more[name].transpose(*values.dims).values
        else:
            shape = list(values.shape)
            shape[axis] = more.sizes["sample"]
            rest = np.full(shape, np.nan)
        arrays = _padded([values.values, rest], axis)
        variables[name] = (values.dims, np.concatenate(arrays, axis), values.attrs)
    data = {name: values for name, values in variables.items() if name in first.data_vars}
    coords = {name: values for name, values in variables.items() if name in first.coords}
    seconds = sum(float(part.attrs.get("seconds", np.nan)) for part in (first, more))
    options = {**json.loads(more.attrs.get("options", "{}")), **json.loads(first.attrs.get("options", "{}"))}
    return xr.Dataset(data, coords, first.attrs).assign_attrs(seconds=seconds, options=json.dumps(options))


def _padded(arrays: list[NDArray[Any]], axis: int) -> list[NDArray[Any]]:
    """Return float arrays made equally long but for one axis, with NaN: blocks may need different lengths."""
    shape = np.max([array.shape for array in arrays], axis=0)
    made = []
    for array in arrays:
        width = [(0, int(n) - k) for n, k in zip(shape, array.shape, strict=True)]
        width[axis] = (0, 0)
        padding = any(after for _, after in width)
        if padding and array.dtype.kind != "f":
            raise SchemaError("the model returned arrays of different lengths in different blocks")
        made.append(np.pad(array, width, constant_values=np.nan) if padding else array)
    return made


def _status(outcomes: xr.Dataset, outputs: list[Any]) -> xr.DataArray:
    """Return the status of outcomes of a model that gives none: undecided where an output is missing."""
    status = np.full(outcomes.sizes["sample"], schema.STATUS["ok"], np.int8)
    for name in outputs:
        values = outcomes[name]
        missing = values.isnull().any([dim for dim in values.dims if dim != "sample"]).values
        status[missing] = schema.STATUS["undecided"]
    attrs = schema.flag_attrs("status of the sample", schema.STATUS)
    return xr.DataArray(status, dims="sample", attrs=attrs)


@contextmanager
def _workers(jobs: int, executor: Executor | None) -> Iterator[Executor]:
    """Give the executor, or threads with one BLAS thread each: the matrices are small."""
    if executor is not None:
        if not callable(getattr(executor, "submit", None)):
            raise InputError(f"executor is {executor!r}: it must be a concurrent.futures.Executor")
        yield executor
        return
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"), ThreadPoolExecutor(jobs) as pool:
        yield pool
