"""Samples go out in blocks, outcomes come back in units, in order, whoever evaluates and however many."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.designs import Design
from hipuq.errors import HipuqError, ModelError
from hipuq.evaluation.calling import Answer, Call, ask
from hipuq.evaluation.layout import Layout
from hipuq.evaluation.workers import Workers
from hipuq.store.reuse import Reuse

HOPELESS = 100
"""Failures after which a run ends if no sample has succeeded."""

Places = slice | NDArray[np.intp]


@dataclass
class Unit:
    """Rows that are evaluated together and come back together.

    Attributes
    ----------
    number : int
    rows : slice
    samples : Dataset
    pieces : list
        Places in the unit, and the outputs of the samples there.
    failures : dict
        Row of a failed sample in the whole -> message.
    lost : int
        How many of them gave nothing; the others gave NaN.
    left : int
        Blocks that are not back.
    """

    number: int
    rows: slice
    samples: xr.Dataset
    pieces: list[tuple[Places, xr.Dataset]] = field(default_factory=list)
    failures: dict[int, str] = field(default_factory=dict)
    lost: int = 0
    left: int = 0

    @property
    def size(self) -> int:
        """Number of its samples."""
        return int(self.rows.stop - self.rows.start)

    def outcomes(self, layout: Layout) -> xr.Dataset:
        """Return samples, outputs and status."""
        outputs = layout.joined(self.pieces, self.size)
        if "status" not in outputs or self.failures:
            given = outputs["status"].values if "status" in outputs else np.zeros(self.size, np.int8)
            status = np.array(given, np.int8)
            status[[row - self.rows.start for row in self.failures]] = schema.STATUS["failed"]
            attrs = schema.flag_attrs("status of the sample", schema.STATUS)
            outputs = outputs.assign(status=("sample", status, attrs))
        return self.samples.assign(outputs.data_vars).assign_coords(outputs.coords)


@dataclass
class Limit:
    """How many samples may fail without an answer; NaN is one.

    Attributes
    ----------
    share : float
        Of all samples.
    size : int
        Number of all.
    failed, known : int
        Those that gave nothing so far, and those that gave something.
    """

    share: float
    size: int
    failed: int = 0
    known: int = 0

    def add(self, failures: dict[int, str], lost: int, known: int, kind: type[HipuqError]) -> None:
        """Count a block, and raise an error if too many have failed.

        Raises
        ------
        HipuqError
            Of the kind given; it tells the first of these failures.
        """
        self.failed += lost
        self.known += known
        if not lost:
            return
        row, message = min(failures.items())
        if not self.known and self.failed >= min(HOPELESS, self.size):
            raise kind(
                f"the model failed on all of the first {self.failed:,} samples; sample {row}: {message}"
            )
        self.check(failures, kind)

    def check(self, failures: dict[int, str], kind: type[HipuqError] = ModelError) -> None:
        """Raise an error if too many have failed; it tells the first of these failures."""
        if self.failed > self.share * self.size:
            row, message = min(failures.items())
            raise (ModelError if self.known else kind)(
                f"{self.failed:,} of {self.failed + self.known:,} samples failed, more than max_failed = "
                f"{self.share:g} allows of {self.size:,}; sample {row}: {message}"
            )


@dataclass
class Stream:
    """A run of a model over samples.

    Attributes
    ----------
    call : Call
    design : Design
    workers : Workers
    block : int
        Samples handed to the model at a time.
    limit : Limit
    advance : callable
        Gets the number of samples that came back, and counts of failed and undecided ones.
    layout : Layout or None
        What outputs look like, once some are known.
    """

    call: Call
    design: Design
    workers: Workers
    block: int
    limit: Limit
    advance: Callable[..., None]
    layout: Layout | None = None

    def units(self, wanted: Iterable[tuple[int, slice]], reuse: Reuse | None = None) -> Iterator[Unit]:
        """Yield units that are complete, in order.

        Parameters
        ----------
        wanted : iterable of (int, slice)
            Numbers and rows.
        reuse : Reuse, optional
            Outcomes that need not be evaluated.
        """
        # Until a sample has succeeded nobody knows what outputs look like.
        waiting: list[Unit] = []
        blocks = self._blocks(wanted, reuse)
        for (unit, places), answer in self.workers.in_order(blocks):
            if places is not None and answer is not None:
                self._take(unit, places, answer)
            unit.left -= 1
            if unit.left:
                continue
            waiting.append(unit)
            # If none ever does, the limit ends the run.
            if self.layout is not None:
                yield from waiting
                waiting = []

    def _blocks(self, wanted: Iterable[tuple[int, slice]], reuse: Reuse | None) -> Iterator[Any]:
        """Yield calls for the executor: blocks of samples that have no outcome yet."""
        for number, rows in wanted:
            unit = Unit(number, rows, self.design.rows(rows.start, rows.stop))
            open_ = None if reuse is None else self._reused(unit, reuse)
            count = unit.size if open_ is None else len(open_)
            starts = range(0, count, self.block)
            unit.left = max(len(starts), 1)
            if not count:
                yield (unit, None), _nothing, ()
            for start in starts:
                stop = min(start + self.block, count)
                places = slice(start, stop) if open_ is None else open_[start:stop]
                numbers = (
                    range(rows.start, rows.stop)[places] if open_ is None else rows.start + open_[start:stop]
                )
                part = unit.samples.isel(sample=places) if stop - start < unit.size else unit.samples
                yield (unit, places), ask, (self.call, part, numbers)

    def _reused(self, unit: Unit, reuse: Reuse) -> NDArray[np.intp]:
        """Give a unit the outcomes that are there, and return the places of the rest."""
        places, outputs, failures = reuse.of(unit.samples)
        if places.size:
            if self.layout is None:
                self.learn(outputs)
            unit.pieces.append((places, outputs))
            failed = {unit.rows.start + place: message for place, message in failures.items()}
            unit.failures |= failed
            self.limit.add(failed, 0, int(places.size), ModelError)
            self.advance(int(places.size), failed=len(failed), undecided=undecided_in(outputs))
        return np.setdiff1d(np.arange(unit.size), places)

    def _take(self, unit: Unit, places: Places, answer: Answer) -> None:
        """Give a unit what came back."""
        count = len(range(unit.size)[places]) if isinstance(places, slice) else len(places)
        if self.layout is None:
            if answer.unfit is not None:
                raise answer.unfit
        elif answer.unfit is not None or (answer.outputs is not None and self.layout.fault(answer.outputs)):
            # Outputs of others are known to be right: find out which of these samples differ.
            part = unit.samples.isel(sample=places)
            numbers = np.arange(unit.rows.start, unit.rows.stop)[places]
            answer = self.workers.now(ask, replace(self.call, layout=self.layout), part, numbers)
        where = np.arange(unit.rows.start, unit.rows.stop)[places]
        failures = {int(where[place]): message for place, message in answer.failures.items()}
        self.limit.add(failures, answer.lost, count - answer.lost, answer.kind)
        unit.failures |= failures
        unit.lost += answer.lost
        undecided = 0
        if answer.outputs is not None:
            if self.layout is None:
                self.learn(answer.outputs)
            unit.pieces.append((places, answer.outputs))
            undecided = undecided_in(answer.outputs)
        self.advance(count, failed=len(failures), undecided=undecided)

    def learn(self, outputs: xr.Dataset) -> None:
        """Take what outputs look like from some of them."""
        self.layout = Layout.of(outputs, getattr(self.call.model, "ragged", ()))


def undecided_in(outcomes: xr.Dataset) -> int:
    """Return the number of undecided samples."""
    return int((outcomes["status"].values == schema.STATUS["undecided"]).sum())


def _nothing() -> None:
    """Stand for a unit of which nothing is left to evaluate."""
