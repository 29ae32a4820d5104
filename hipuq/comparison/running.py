"""Methods compared on one problem with a known answer: error, coverage and cost over evaluations."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from hipuq import __version__
from hipuq.comparison.contender import Contender, options_of
from hipuq.comparison.dataset import dataset
from hipuq.comparison.labels import in_order, labels_of
from hipuq.comparison.record import Record, Run
from hipuq.comparison.reference import Reference
from hipuq.errors import InputError
from hipuq.progress import progress_bar
from hipuq.sampling import check_count, seed_of


@dataclass(frozen=True)
class Race:
    """A comparison, checked and ready to run.

    Attributes
    ----------
    contenders : tuple of Contender
    budgets : tuple of int
        Evaluations.
    replicates : int
        Most of a contender.
    reference : Reference
    baseline : str
        Name of the contender that others are held against.
    confidence : float
        Of the limits of error and coverage.
    label, inputs, of : str
        Name of the problem's model, its inputs as JSON, its outcome.
    """

    contenders: tuple[Contender, ...]
    budgets: tuple[int, ...]
    replicates: int
    reference: Reference
    baseline: str
    confidence: float
    label: str
    inputs: str
    of: str

    @property
    def evaluations(self) -> int:
        """Model runs in all; one run to warm up each contender comes on top."""
        return sum(one.replicates * one.evaluations(b) for one in self.contenders for b in one.sizes)

    def run(
        self,
        seed: int,
        *,
        n_jobs: int | None = None,
        store: str | os.PathLike[str] | None = None,
        resume: bool = False,
        progress: bool | None = None,
        say: Callable[[str], None] = lambda line: None,
    ) -> xr.Dataset:
        """Run what is not done yet, and sum up.

        Parameters
        ----------
        seed : int
            Seed from which all runs get theirs.
        n_jobs : int, optional
            Threads; all cores by default.
        store : path, optional
            File that gets a line for each run as it is done.
        resume : bool, default False
            Whether to go on from what is in the file.
        progress : bool, optional
            Whether to show a progress bar; by default on a terminal.
        say : callable, optional
            Gets a line about each budget.

        Returns
        -------
        Dataset
            See `compare`.

        Raises
        ------
        InputError
            If results lack what is compared, or the reference does not fit them.
        StoreError
            If the file cannot be used, or holds runs of something else.
        """
        jobs = os.cpu_count() or 1 if n_jobs is None else check_count("n_jobs", n_jobs)
        if resume:
            self._check_models()
        record = Record.opened(self._file(store), self._definition(seed), resume)
        done = {key: run.n for key, run in record.runs.items()}
        # Contenders take turns, so that another load on the machine hits all alike.
        left = [
            (budget, k, one)
            for budget in self.budgets
            for k in range(self.replicates)
            for one in self.contenders
            if budget in one.sizes and k < one.replicates
            if done.get((one.name, budget, k)) != one.sizes[budget]
        ]
        if record.labels:
            self._aligned(record)
        for one in self.contenders:
            if any(other is one for _, _, other in left):
                self._warm_up(one, seed, jobs, record)
        size = sum(one.evaluations(budget) for budget, _, one in left)
        with progress_bar("evaluations", size, progress) as advance:
            for place, (budget, k, one) in enumerate(left, 1):
                record.add(_run(one, budget, k, _seed(seed, one, budget, k), jobs, record.labels))
                advance(one.evaluations(budget))
                if place == len(left) or left[place][0] != budget:
                    say(f"{budget:,} evaluations: {', '.join(c.name for c in self.contenders)}")
        return dataset(self, record, self._aligned(record), seed)

    def check(self, seed: int, store: str | os.PathLike[str] | None) -> None:
        """Check that runs in a file, if there is one, are such that `run` can go on from them.

        Raises
        ------
        InputError
            If a model does not say what it is: nobody could tell whether the runs are its own.
        StoreError
            If the file cannot be read, or holds runs of something else.
        """
        self._check_models()
        Record.read(self._file(store), self._definition(seed))

    def rehearse(self, n_jobs: int | None = None) -> None:
        """Run each contender once in its smallest size: all that a run could refuse shows now.

        Raises
        ------
        InputError
            If results lack what is compared, or the reference does not fit them.
        """
        record = Record(None, {})
        for one in self.contenders:
            self._warm_up(one, 0, n_jobs, record)

    def _check_models(self) -> None:
        for one in self.contenders:
            if options_of(one.model) is None:
                raise InputError(
                    f"the model of {one.name!r} has no label and options, by which resume could tell whether "
                    "runs are its own: set both (options: what it depends on), or do not resume"
                )

    @staticmethod
    def _file(store: str | os.PathLike[str] | None) -> Path | None:
        if store is not None and not isinstance(store, (str, os.PathLike)):
            raise InputError(f"store is {store!r}: it must be the path of a file")
        return None if store is None else Path(store)

    def _definition(self, seed: int) -> dict[str, Any]:
        contenders = {one.name: one.definition for one in self.contenders}
        return {"hipuq_version": __version__, "seed": int(seed), "contenders": contenders}

    def _aligned(self, record: Record) -> Any:
        what = f"{record.labels['name']} of {record.labels['contender']!r}"
        return self.reference.aligned(record.labels["dims"], record.labels["coords"], what)

    def _warm_up(self, one: Contender, seed: int, n_jobs: int | None, record: Record) -> None:
        """Make a first run that does not count: it imports and compiles, and shows that all fits."""
        results = one.results(min(one.sizes.values()), _seed(seed, one), n_jobs)
        if not record.labels:
            record.label(labels_of(one, results))
            self._aligned(record)
        in_order(one, results, record.labels)


def _seed(seed: int, one: Contender, *cell: int) -> int:
    return seed_of(np.random.SeedSequence(seed, spawn_key=one.key(*cell)))


def _run(one: Contender, budget: int, k: int, seed: int, jobs: int, labels: Mapping[str, Any]) -> Run:
    started = time.perf_counter()
    results = one.results(one.sizes[budget], seed, jobs)
    seconds = time.perf_counter() - started
    estimate, low, high = (part.tolist() for part in in_order(one, results, labels))
    count, spent = int(results["evaluations"]), float(results["seconds"])
    return Run(one.name, budget, k, one.sizes[budget], count, seconds, spent, jobs, estimate, low, high)
