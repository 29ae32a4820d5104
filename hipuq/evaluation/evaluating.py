"""Samples and a model give outcomes: in blocks, on all cores, the same bits however it is divided."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from hipuq import __version__, schema
from hipuq.designs import Design, as_design
from hipuq.errors import InputError, ModelError, check_name, unknown_name
from hipuq.evaluation.calling import MARK, ON_ERROR, RAISE, Call, Model, here, inputs_of
from hipuq.evaluation.stream import Limit, Stream, Unit, undecided_in
from hipuq.evaluation.workers import check_travels, workers
from hipuq.progress import progress_bar
from hipuq.sampling import check_count
from hipuq.store.blocks import BlockStore, labels_of, units_of
from hipuq.store.failures import failure_table, part_of
from hipuq.store.opening import opened
from hipuq.store.outcomes import load_outcomes

BLOCK = 1024
"""Samples handed to the model at a time, unless its attribute ``block`` says how many it takes at most."""

MAX_FAILED = 0.5
"""Share of the samples that may fail."""


def evaluate(
    model: Model,
    samples: xr.Dataset | Design,
    *,
    keep: Iterable[str] | None = None,
    n_jobs: int | None = None,
    executor: Executor | str | Any = None,
    progress: bool | None = None,
    store: str | os.PathLike[str] | None = None,
    resume: bool = False,
    on_error: str = MARK,
    max_failed: float = MAX_FAILED,
    retry_failed: bool = False,
) -> xr.Dataset:
    """Evaluate a model on samples.

    Parameters
    ----------
    model : callable
        ``samples Dataset -> Dataset of outputs over the same samples``. If it has an attribute
        ``outcomes``, the names it can give, it is called with ``keep=``; if it has a method
        ``check``, that sees all samples first, or the first of a Design. An attribute ``block`` says how many
        samples it takes at a time, by default 1024; ``ragged`` names dims that may differ between blocks.
    samples : Dataset or Design
        Over ``sample``, in the units of the schema; see `hipuq.schema.check_samples`. A Design, from
        `hipuq.lazy_design`, makes its samples when they are needed.
    keep : iterable of str, optional
        Outcomes wanted; nothing else is computed (where the model knows how) or stored.
    n_jobs : int, optional
        Threads or processes; all cores by default.
    executor : str, concurrent.futures.Executor or dask.distributed.Client, optional
        ``"threads"`` (the default), ``"processes"``, or what runs the blocks instead.
    progress : bool, optional
        Whether to show a progress bar; by default on a terminal. Elsewhere the logger ``hipuq`` gets a line
        a minute.
    store : path, optional
        Zarr store to which outcomes are written as they come, so that neither they nor the samples of a
        Design are ever in memory together.
    resume : bool, default False
        Whether to go on with what the store has: of a run that was cut off, or of fewer samples of the same
        design. Without a store there it just runs.
    on_error : str, default "mark"
        ``"mark"`` gives a sample that fails (an error, NaN, a wrong shape) the status ``failed``, missing
        outputs and a line in the table ``failure_message``; ``"raise"`` ends the run at the first one. Where
        a model gives no status of its own, a verdict that is NaN is undecided, any other NaN a failure.
    max_failed : float, default 0.5
        Share of the samples that may fail with an error or a wrong shape before the run ends [1]; NaN is an
        answer, and as much of it as there is stays.
    retry_failed : bool, default False
        Whether, when a store is gone on with, its samples that failed are evaluated again.

    Returns
    -------
    Dataset
        The samples, what the model gave, and ``status``, over ``sample``; outputs are floating point numbers,
        in the units of the schema if the model is one of hipuq. Results do not
        depend on `n_jobs`, `executor` or `store`; the attribute ``seconds`` and the time in ``history`` do.
        Values of a store are read when they are used.

    Raises
    ------
    InputError
        If an argument cannot be used, or a value in the samples is not allowed.
    UnknownNameError
        If the model has no such parameter or outcome.
    SchemaError
        If samples or outputs do not follow the contract.
    ModelError
        If too many samples fail, or one with ``on_error="raise"``; its message tells inputs and reason.
    StoreError
        If the store cannot be written, holds something else, or another run writes to it.

    Examples
    --------
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> outcomes = hipuq.evaluate(model, model.nominal(friction=[0.4, 0.5]))
    >>> outcomes["any_unstable"].values
    array([0., 1.], dtype=float32)
    >>> outcomes["growth_rate"].values[1].round(4)
    array([-0.1187,  0.1187])

    Any function from samples to outputs is a model:

    >>> import xarray as xr
    >>> def root(samples):
    ...     return samples[["x"]].rename(x="root") ** 0.5
    >>> samples = xr.Dataset({"x": ("sample", [1.0, 4.0])})
    >>> hipuq.evaluate(root, samples)["root"].values
    array([1., 2.])
    """
    how = How(n_jobs, executor, progress, store, resume, on_error, max_failed, retry_failed)
    return evaluated(model, samples, keep, how)


@dataclass(frozen=True)
class How:
    """How to evaluate; what comes out does not depend on it, but for what becomes of failures.

    Attributes
    ----------
    n_jobs, executor, progress, store, resume, on_error, max_failed, retry_failed
        As in `evaluate`.
    replace : bool
        Whether a store that is there gives way to the new one, as soon as that has outcomes.
    """

    n_jobs: int | None = None
    executor: Any = None
    progress: bool | None = None
    store: str | os.PathLike[str] | None = None
    resume: bool = False
    on_error: str = MARK
    max_failed: float = MAX_FAILED
    retry_failed: bool = False
    replace: bool = False

    def __post_init__(self) -> None:
        check_name("way to take errors, on_error,", self.on_error, ON_ERROR)
        share = self.max_failed
        if isinstance(share, bool) or not isinstance(share, int | float) or not 0 <= share <= 1:
            raise InputError(f"max_failed is {share!r}: it must be a share of the samples from 0 to 1")
        if self.resume and self.store is None:
            raise InputError("resume needs a store: give the path of one, store=")
        if self.retry_failed and not self.resume:
            raise InputError("retry_failed needs resume: it is about the failures of an earlier run")


def evaluated(model: Model, samples: xr.Dataset | Design, keep: Iterable[str] | None, how: How) -> xr.Dataset:
    """Evaluate a model on samples, see `evaluate`.

    Parameters
    ----------
    model : callable
    samples : Dataset or Design
    keep : iterable of str or None
    how : How

    Returns
    -------
    Dataset
    """
    started = time.perf_counter()
    design = as_design(samples)
    names = None if keep is None else _checked_names(model, keep)
    block = check_count("block of the model", getattr(model, "block", BLOCK))
    checker = getattr(model, "check", None)
    if callable(checker):
        # What is wrong with a distribution shows in the first samples; a rare value fails by itself.
        checker(
            design.rows(0, design.size if design.given else min(design.size, units_of(design.size, block)))
        )
    if how.store is None and not design.given:
        design = as_design(design.rows(0, design.size))
    if how.executor == "processes":
        check_travels(model)
    run = _Run(model, design, names, min(block, units_of(design.size, block)), how)
    if how.store is None:
        return run.in_memory().assign_attrs(seconds=time.perf_counter() - started)
    # One name for one folder, whatever the model makes the current one.
    return run.stored(Path(os.path.realpath(how.store)))


@dataclass(frozen=True)
class _Run:
    model: Model
    design: Design
    keep: tuple[str, ...] | None
    block: int
    how: How

    def in_memory(self) -> xr.Dataset:
        size = self.design.size
        rows = [slice(start, min(start + self.block, size)) for start in range(0, size, self.block)]
        with self._stream(0, 0) as stream:
            units = list(stream.units(enumerate(rows)))
        assert stream.layout is not None
        whole = Unit(0, slice(0, size), self.design.rows(0, size))
        whole.failures = {row: text for unit in units for row, text in unit.failures.items()}
        for unit in units:
            whole.pieces += [(_within(unit.rows, places), part) for places, part in unit.pieces]
        outcomes = whole.outcomes(stream.layout)
        if whole.failures:
            outcomes = outcomes.merge(failure_table(whole.failures))
        return outcomes.assign_attrs(self._attrs())

    def stored(self, folder: Path) -> xr.Dataset:
        how = self.how
        first = self.design.rows(0, 1)
        variables = map(str, first.data_vars)
        with opened(
            folder, self._definition(), variables, self.block, resume=how.resume, replace=how.replace
        ) as target:
            if how.retry_failed:
                target.forget_failed()
            try:
                self._into(target)
            except KeyboardInterrupt:
                done = target.done
                raise KeyboardInterrupt(
                    f"{done:,} of {target.size:,} samples are in {folder}; go on with resume=True"
                ) from None
            found = target.folder
        outcomes, size = load_outcomes(found), self.design.size
        return outcomes if outcomes.sizes["sample"] == size else part_of(outcomes, slice(0, size))

    def _into(self, target: BlockStore) -> None:
        if self.design.given:
            target.labels = labels_of(self.design.rows(0, self.design.size))
            target.check_samples(self.design.rows)
        lost = sum(unit.lost for unit in target.units.values())
        if target.failures and self.how.on_error == RAISE:
            row, message = next(iter(target.failures.items()))
            inputs = inputs_of(self.design.rows(row, row + 1).isel(sample=0))
            raise ModelError(
                f"the model failed on sample {row}, as {target.folder} tells: {message}; its inputs are "
                f"{inputs}"
            )
        Limit(self.how.max_failed, self.design.size, lost, target.done - lost).check(target.failures)
        if target.complete:
            return
        with self._stream(lost, target.done) as stream:
            stream.advance(0, failed=target.failed, undecided=target.undecided)
            if (example := target.example(self.design.rows(0, 1))) is not None:
                stream.learn(example)
            wanted = [(number, target.rows(number)) for number in target.open_units]
            for unit in stream.units(wanted, target.reuse):
                assert stream.layout is not None
                outcomes = unit.outcomes(stream.layout)
                target.write(unit.number, outcomes, unit.failures, unit.lost, undecided_in(outcomes))
        target.finish({**self._attrs(), "seconds": target.seconds})

    @contextmanager
    def _stream(self, failed: int, done: int) -> Iterator[Stream]:
        how, size = self.how, self.design.size
        with (
            workers(how.executor, how.n_jobs) as staff,
            progress_bar("samples", size, how.progress, done=done) as advance,
        ):
            call = Call(self.model, self.keep, how.on_error, here())
            limit = Limit(how.max_failed, size, failed, done - failed)
            yield Stream(call, self.design, staff, self.block, limit, advance)

    def _label(self) -> str:
        model = self.model
        return str(getattr(model, "label", getattr(model, "__qualname__", type(model).__qualname__)))

    def _options(self) -> Any:
        """Return what rebuilds the model, or its name: only a model with a label says it in its options."""
        if hasattr(self.model, "label") and hasattr(self.model, "options"):
            return json.loads(json.dumps(self.model.options, default=str))
        return self._label()

    def _definition(self) -> dict[str, Any]:
        return {
            "schema_version": schema.VERSION,
            "hipuq_version": __version__,
            "model": self._label(),
            "model_options": self._options(),
            "keep": None if self.keep is None else sorted(self.keep),
            **self.design.definition,
        }

    def _attrs(self) -> dict[Any, Any]:
        label, like = self._label(), self.design.rows(0, 1).attrs
        text = f"evaluate {label} on {self.design.size} samples"
        stamped = schema.stamp(xr.Dataset(), text, model=label, options={"model": self._options()}, like=like)
        return {**like, **stamped.attrs}


def _within(rows: slice, places: Any) -> Any:
    """Return places in a unit as places in the whole."""
    if isinstance(places, slice):
        return slice(rows.start + places.start, rows.start + places.stop)
    return rows.start + places


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
