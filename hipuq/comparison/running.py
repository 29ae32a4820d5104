"""Methods compared on one problem with a known answer: error, coverage and cost over evaluations."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from hipuq import __version__
from hipuq.comparison.contender import Contender, Model, checked_budgets, contender, label_of
from hipuq.comparison.dataset import dataset
from hipuq.comparison.labels import in_order, labels_of
from hipuq.comparison.record import Record, Run
from hipuq.comparison.reference import Reference, Value, as_reference
from hipuq.errors import InputError, check_name
from hipuq.inputs import Inputs
from hipuq.intervals import check_confidence
from hipuq.progress import progress_bar
from hipuq.sampling import Seed, check_count, seed_of


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
        record = Record.opened(None if store is None else Path(store), self._definition(seed), resume)
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
                self._warm_up(one, seed, n_jobs, record)
        size = sum(one.evaluations(budget) for budget, _, one in left)
        with progress_bar("evaluations", size, progress) as advance:
            for place, (budget, k, one) in enumerate(left, 1):
                record.add(_run(one, budget, k, _seed(seed, one, budget, k), n_jobs, record.labels))
                advance(one.evaluations(budget))
                if place == len(left) or left[place][0] != budget:
                    say(f"{budget:,} evaluations: {', '.join(c.name for c in self.contenders)}")
        return dataset(self, record, self._aligned(record), seed)

    def check(self, seed: int, store: str | os.PathLike[str]) -> None:
        """Check that runs in a file, if there is one, are such that `run` can go on from them.

        Raises
        ------
        StoreError
            If it cannot be read, or holds runs of something else.
        """
        Record.read(Path(store), self._definition(seed))

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


def race(
    model: Model,
    inputs: Inputs,
    contenders: Mapping[str, Mapping[str, Any]],
    *,
    of: str,
    reference: Value | Reference,
    budgets: Sequence[int],
    replicates: int = 30,
    quantity: str | None = None,
    baseline: str | None = None,
    confidence: float = 0.95,
) -> Race:
    """Check a comparison; see `compare` for the arguments.

    Returns
    -------
    Race
        Nothing is evaluated yet.

    Raises
    ------
    InputError
        If a contender, a budget or the reference cannot be used.
    """
    level = check_confidence(confidence)
    check_count("replicates", replicates, 2)
    if not isinstance(inputs, Inputs):
        raise InputError(f"inputs is {type(inputs).__name__}: give hipuq.Inputs(...) or model.inputs(...)")
    sizes = checked_budgets(budgets)
    if not isinstance(contenders, Mapping) or not contenders:
        raise InputError("there are no contenders: give a mapping of names, each with its method")
    ready = tuple(
        contender(
            str(name),
            entry,
            model=model,
            inputs=inputs,
            of=of,
            quantity=quantity,
            budgets=sizes,
            replicates=replicates,
        )
        for name, entry in contenders.items()
    )
    first = next(iter(contenders)) if baseline is None else check_name("baseline", baseline, contenders)
    answer = as_reference(reference)
    return Race(
        ready, tuple(sizes), replicates, answer, first, level, label_of(model), inputs.to_json(), str(of)
    )


def compare(
    model: Model,
    inputs: Inputs,
    contenders: Mapping[str, Mapping[str, Any]],
    *,
    of: str,
    reference: Value | Reference,
    budgets: Sequence[int],
    replicates: int = 30,
    quantity: str | None = None,
    baseline: str | None = None,
    rng: Seed = None,
    confidence: float = 0.95,
    n_jobs: int | None = None,
    store: str | os.PathLike[str] | None = None,
    resume: bool = False,
    progress: bool | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> xr.Dataset:
    """Run methods again and again on one problem, and hold what they say against the answer.

    Parameters
    ----------
    model : callable
    inputs : Inputs
    contenders : mapping
        Name -> ``{"method": ..., "options": {...}}``, the options being those of the method. ``"model"``,
        ``"inputs"``, ``"of"`` and ``"quantity"`` beside them replace those of the comparison, as for friction
        integrated; ``"budgets"`` (some of all) and ``"replicates"`` (fewer) are for what is too dear.
    of : str
        The outcome analysed.
    reference : float, array, mapping, DataArray or Reference
        The exact answer, or a reference far better than any contender; for indices one for each
        parameter, by name or in the order of the first contender's inputs.
    budgets : sequence of int
        Numbers of evaluations; each contender takes as many as it can within them.
    replicates : int, default 30
        Independent repetitions.
    quantity : str, optional
        The result compared, such as ``"ST"``; by default the probability or mean over everything.
    baseline : str, optional
        The contender whose cost of the same error is told for all; the first by default.
    rng : int or Generator, optional
        Seed from which all runs get theirs. A contender's depend on its name and the budget alone.
    confidence : float, default 0.95
        Level of the limits of error and coverage told here; that of a contender's own intervals is its
        option.
    n_jobs : int, optional
        Threads; all cores by default.
    store : path, optional
        File that gets a line for each run as it is done.
    resume : bool, default False
        Whether to go on from what is in the file: more budgets, replicates and contenders may be asked for.
    progress : bool, optional
        Whether to show a progress bar; by default on a terminal.
    say : callable, optional
        Gets a line about each budget.

    Returns
    -------
    Dataset
        Over ``method``, ``budget`` and ``replicate``: ``estimate``, ``low``, ``high``; ``seconds`` of a run
        and ``model_seconds`` of the model in it, imports and compilation apart.
        Over ``method`` and ``budget``: ``evaluations``, ``replicates``; ``bias``, ``rmse`` and ``coverage``,
        the share of intervals that hold the reference, with limits; ``rmse_ratio`` to the lowest error of the
        budget, with limits; ``run_time`` and ``model_time``, medians of the seconds;
        ``baseline_evaluations``, with which the baseline has the same error if its error falls as n**-1/2;
        ``cost_ratio``, time over that of the baseline for the same error; ``break_even``, the time of one
        evaluation above which a contender on the baseline's model costs less than the baseline.
        Over ``method``: ``rate``, the slope of log error over log evaluations, with limits.
        Indices have also the dim ``parameter``, results by level that of the levels; ``rmse_overall`` and
        ``coverage_overall`` are over it too. NaN where a contender does not take part.

    Raises
    ------
    InputError
        If a contender, a budget or the reference cannot be used, or results lack the quantity.
    StoreError
        If the file cannot be used, or holds runs of something else.
    """
    plan = race(
        model,
        inputs,
        contenders,
        of=of,
        reference=reference,
        budgets=budgets,
        replicates=replicates,
        quantity=quantity,
        baseline=baseline,
        confidence=confidence,
    )
    return plan.run(seed_of(rng), n_jobs=n_jobs, store=store, resume=resume, progress=progress, say=say)


def _seed(seed: int, one: Contender, *cell: int) -> int:
    return seed_of(np.random.SeedSequence(seed, spawn_key=one.key(*cell)))


def _run(
    one: Contender, budget: int, k: int, seed: int, n_jobs: int | None, labels: Mapping[str, Any]
) -> Run:
    started = time.perf_counter()
    results = one.results(one.sizes[budget], seed, n_jobs)
    seconds = time.perf_counter() - started
    estimate, low, high = (part.tolist() for part in in_order(one, results, labels))
    count, spent = int(results["evaluations"]), float(results["seconds"])
    return Run(one.name, budget, k, one.sizes[budget], count, seconds, spent, estimate, low, high)
