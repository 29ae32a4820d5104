"""One call of a model: its outputs checked, and what fails narrowed down to single samples."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.errors import HipuqError, InputError, ModelError, SchemaError, UnknownNameError, unknown_name
from hipuq.evaluation.layout import Layout
from hipuq.store.arrays import outputs_of
from hipuq.store.reporting import one_line
from hipuq.threads import one_thread

Model = Callable[..., xr.Dataset]

MARK, RAISE = ON_ERROR = ("mark", "raise")
"""What becomes of a sample that fails: it is marked, or ends the run."""

LONGEST = 500
"""Characters of a message that are kept."""

BOOKS = ("status", "decided_by")
"""Outputs that are flags, not numbers; they come whether or not they are kept."""


class _FaultError(Exception):
    """What a model gave for these samples cannot be used."""


@dataclass(frozen=True)
class Call:
    """What to ask a model, and how to take its answer; it travels to where the model runs.

    Attributes
    ----------
    model : callable
    keep : tuple of str or None
        Outcomes wanted; None for all.
    on_error : str
        One of `ON_ERROR`.
    home : tuple or None
        Machine and process in which threads are looked after already; None where they never are.
    layout : Layout or None
        What the outputs of other samples look like.
    """

    model: Model
    keep: tuple[str, ...] | None
    on_error: str = MARK
    home: tuple[str, int] | None = None
    layout: Layout | None = None


@dataclass(frozen=True)
class Answer:
    """What a model gave for one block of samples.

    Attributes
    ----------
    outputs : Dataset or None
        Over ``sample``, missing where a sample failed; with ``status``. None if all failed.
    failures : dict
        Place of a failed sample in the block -> message.
    lost : int
        How many of them gave nothing; the others gave NaN.
    kind : type
        Error that says it best if nothing else succeeds.
    unfit : HipuqError or None
        Why model and samples do not go together at all, if nothing has shown yet that they do.
    """

    outputs: xr.Dataset | None
    failures: dict[int, str] = field(default_factory=dict)
    lost: int = 0
    kind: type[HipuqError] = ModelError
    unfit: HipuqError | None = None


def ask(call: Call, samples: xr.Dataset, rows: Sequence[int]) -> Answer:
    """Return what a model gives for a block of samples.

    Parameters
    ----------
    call : Call
    samples : Dataset
    rows : sequence of int
        Numbers of the samples, for messages.

    Returns
    -------
    Answer

    Raises
    ------
    ModelError
        If a sample fails and ``on_error`` is ``"raise"``; it tells the sample's inputs.
    """
    # Threads of the process that asks are seen to there.
    with one_thread() if call.home not in (None, here()) else nullcontext():
        try:
            return _Asked(call, samples, rows).answer()
        except (SchemaError, UnknownNameError) as error:
            return Answer(None, unfit=error)


class _Asked:
    """Samples of one block, halved until what fails stands alone."""

    def __init__(self, call: Call, samples: xr.Dataset, rows: Sequence[int]) -> None:
        self.call, self.samples, self.rows = call, samples, rows
        self.size = samples.sizes["sample"]
        self.pieces: list[tuple[slice, xr.Dataset]] = []
        self.failures: dict[int, str] = {}
        self.kind: type[HipuqError] | None = None

    def answer(self) -> Answer:
        self._try(slice(0, self.size))
        if not self.pieces:
            return Answer(None, self.failures, len(self.failures), self.kind or ModelError)
        outputs = self.pieces[0][1]
        if len(self.pieces) > 1 or self.failures:
            outputs = self._alike().joined(self.pieces, self.size)
        # From here on samples fail by NaN, which is an answer.
        lost = len(self.failures)
        outputs = self._with_status(outputs)
        return Answer(outputs, dict(sorted(self.failures.items())), lost, self.kind or ModelError)

    def _alike(self) -> Layout:
        """Return the layout of all pieces; those that differ from the largest one are tried again for it."""
        if self.call.layout is None:
            _, largest = max(self.pieces, key=lambda piece: piece[1].sizes["sample"])
            layout = Layout.of(largest, getattr(self.call.model, "ragged", ()))
            self.call = replace(self.call, layout=layout)
            odd = [rows for rows, part in self.pieces if layout.fault(part)]
            self.pieces = [(rows, part) for rows, part in self.pieces if rows not in odd]
            for rows in odd:
                self._try(rows)
        assert self.call.layout is not None
        return self.call.layout

    def _try(self, rows: slice) -> None:
        part = self.samples.isel(sample=rows) if rows.stop - rows.start < self.size else self.samples
        try:
            self.pieces.append((rows, _checked(self.call, part)))
            return
        # A script that ends itself must not end the run.
        except (Exception, SystemExit) as error:
            if isinstance(error, (SchemaError, UnknownNameError)) and not (self.pieces or self.call.layout):
                raise
            if rows.stop - rows.start == 1:
                self._failed(rows.start, error)
                return
        middle = (rows.start + rows.stop) // 2
        self._try(slice(rows.start, middle))
        self._try(slice(middle, rows.stop))

    def _failed(self, place: int, error: BaseException) -> None:
        try:
            text = one_line(str(error))
        except Exception:
            # Whatever an error of someone else's does when it is asked.
            text = ""
        if isinstance(error, InputError):
            # The model saw this one alone.
            text = text.replace(" in sample 0", "", 1)
        # Messages of our own and of what was given back say what is wrong without a name of an error.
        plain = isinstance(error, (HipuqError, _FaultError))
        message = text if plain and text else f"{type(error).__name__}: {text}".removesuffix(": ")
        if self.call.on_error == RAISE:
            raise ModelError(
                f"the model failed on sample {self.rows[place]}: {_shortened(message)}; "
                f"its inputs are {inputs_of(self.samples.isel(sample=place))}"
            ) from error
        self.failures[place] = _shortened(message)
        if self.kind is None:
            self.kind = SchemaError if isinstance(error, _FaultError) else ModelError
            self.kind = InputError if isinstance(error, InputError) else self.kind

    def _with_status(self, outputs: xr.Dataset) -> xr.Dataset:
        """Mark failed samples; where the model gives no status, missing outputs tell it."""
        if "status" in outputs:
            if outputs["status"].dims != ("sample",):
                raise SchemaError(
                    f"status of the model has the dims {outputs['status'].dims}: it needs ('sample',)"
                )
            given = outputs["status"]
            if not self.failures and given.dtype == np.int8 and "flag_meanings" in given.attrs:
                return outputs
            status = outputs["status"].values.astype(np.int8)
        else:
            status = np.full(self.size, schema.STATUS["ok"], np.int8)
            ragged = set(getattr(self.call.model, "ragged", ()))
            for name, values in outputs_of(outputs).items():
                # What others have and this one has not is no failure.
                if name in BOOKS or not ragged.isdisjoint(values.dims):
                    continue
                other = [dim for dim in values.dims if dim != "sample"]
                missing = values.isnull().any(other).values
                if values.attrs.get("role") == schema.VERDICT or _is_verdict(str(name)):
                    status[missing] = schema.STATUS["undecided"]
                    continue
                for place in np.flatnonzero(missing):
                    if int(place) not in self.failures:
                        self._failed(int(place), _FaultError(f"the model gave nan in {str(name)!r}"))
        status[list(self.failures)] = schema.STATUS["failed"]
        attrs = schema.flag_attrs("status of the sample", schema.STATUS)
        return outputs.assign(status=("sample", status, attrs))


def _is_verdict(name: str) -> bool:
    return name in schema.OUTCOMES and schema.OUTCOMES[name].role == schema.VERDICT


def _checked(call: Call, samples: xr.Dataset) -> xr.Dataset:
    """Return the model's outputs, checked, without coords over sample."""
    keep, size = call.keep, samples.sizes["sample"]
    # A model may change what it gets, as when it converts units in place.
    own = samples.copy(deep=True)
    everything = keep is None or not hasattr(call.model, "outcomes")
    given = call.model(own) if everything else call.model(own, keep=keep)
    if not isinstance(given, xr.Dataset):
        raise SchemaError(f"the model must return an xarray Dataset, not {type(given).__name__}")
    both = [str(name) for name in given.data_vars if name in samples.variables]
    if both:
        raise SchemaError(
            f"the model returned {both[0]!r}, which is a name in the samples: return the outputs alone"
        )
    for name, values in outputs_of(given).items():
        if values.dtype.kind not in "biufc":
            raise SchemaError(f"output {str(name)!r} of the model must hold numbers, it holds {values.dtype}")
        if "sample" not in values.dims:
            raise SchemaError(
                f"output {str(name)!r} of the model has the dims {dict(values.sizes)}: "
                f"it needs 'sample' of length {size}"
            )
        if values.sizes["sample"] != size:
            raise _FaultError(
                f"output {str(name)!r} of the model has the dims {dict(values.sizes)}: "
                f"it needs 'sample' of length {size}"
            )
    if "status" in given and not np.isin(given["status"].values, list(schema.STATUS.values())).all():
        wrong = given["status"].values[~np.isin(given["status"].values, list(schema.STATUS.values()))][0]
        flags = ", ".join(f"{value} ({name})" for name, value in schema.STATUS.items())
        raise _FaultError(f"the model gave the status {wrong}: it must be one of {flags}")
    given = _in_order(given, samples)
    if keep is not None:
        missing = [name for name in keep if name not in given]
        if missing:
            raise unknown_name("outcome in keep", missing[0], [str(name) for name in given.data_vars])
        always = [name for name in BOOKS if name in given and name not in keep]
        given = given[[*keep, *always]]
    made = outputs_of(given)
    books = [name for name, values in given.coords.items() if "sample" in values.dims and name not in made]
    if books:
        given = given.drop_vars(books)
    # Without their coords too: what is assigned brings its own along.
    whole_numbers = {
        name: _floating(values.drop_vars(books, errors="ignore"))
        for name, values in made.items()
        if _counts(name, values)
    }
    if whole_numbers:
        given = given.assign(whole_numbers)
    if call.layout is not None and (fault := call.layout.fault(given)):
        raise _FaultError(fault)
    return given


def _counts(name: Hashable, values: xr.DataArray) -> bool:
    return name not in BOOKS and values.dtype.kind in "biu"


def _floating(values: xr.DataArray) -> xr.DataArray:
    """Return an output as floating point numbers, so that it can be missing where a sample fails."""
    if values.dtype.kind == "b":
        return values.astype(np.float32).assign_attrs({"role": schema.VERDICT, **values.attrs})
    return values.astype(np.float64)


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
    return given.assign(bare) if bare else given


def inputs_of(sample: xr.Dataset) -> str:
    """Return the values of one sample as text of limited length.

    Parameters
    ----------
    sample : Dataset
        Without the dim ``sample``.
    """
    given: Mapping[Any, xr.DataArray] = sample.data_vars
    text = ", ".join(f"{name}={np.array2string(values.values)}" for name, values in given.items())
    return _shortened(one_line(text))


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ..."


def here() -> tuple[str, int]:
    """Return machine and process."""
    return platform.node(), os.getpid()
