"""Problems on which a study compares methods: what ``[compare]`` means, checked."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.comparison import Race, Reference, race
from hipuq.driver import method_named
from hipuq.errors import HipuqError, InputError, StudyError, check_name
from hipuq.friction import FRICTION, INTEGRATED_OUTCOME
from hipuq.models import CEAModel
from hipuq.sampling import seed_of
from hipuq.study.building import distributions_of, model_of, without_friction
from hipuq.study.compare_tables import ContenderTable, ProblemTable
from hipuq.study.file import COMPARE, StudyFile
from hipuq.study.references import Exact, reference_of

NEEDED = ("of", "budgets", "reference")
"""What a problem must have, of its own or shared."""

STAND_IN = Reference([])
"""In place of an exact reference until it is computed: it fits no result, so that none is held against it."""


@dataclass(frozen=True)
class Problem:
    """A problem with a known answer, and the methods compared on it, ready to run.

    Attributes
    ----------
    name : str
        Name of its group in the results, below ``compare``, and of the file of its runs.
    title : str
        For people.
    race : Race
        What is compared; without a reference where there is an exact one.
    exact : Exact or None
        The reference where the study itself computes it, when it runs.
    """

    name: str
    title: str
    race: Race
    exact: Exact | None = None

    @property
    def evaluations(self) -> int:
        """Model runs that it takes; those of an exact reference and to warm up come on top."""
        return self.race.evaluations

    @property
    def group(self) -> str:
        """Name of its group in the results."""
        return f"{COMPARE}/{self.name}"

    def store(self, folder: Path) -> Path:
        """Return the file of its runs in an output folder."""
        return folder / COMPARE / f"{self.name}.jsonl"

    def seed(self, study_seed: int) -> int:
        """Return its seed: it depends on its name, not on its company."""
        key = zlib.crc32(COMPARE.encode()), zlib.crc32(self.name.encode())
        return seed_of(np.random.SeedSequence(study_seed, spawn_key=key))

    def rehearsed(self, n_jobs: int | None = None) -> Problem:
        """Return it with its reference computed, after one small run of each contender.

        Parameters
        ----------
        n_jobs : int, optional
            Threads; all cores by default.

        Raises
        ------
        InputError
            If results lack what is compared, or contenders or reference do not agree; it names the problem.
        """
        try:
            whole = self._with_reference(n_jobs)
            whole.race.rehearse(n_jobs)
        except InputError as error:
            raise InputError(f"problem {self.name!r}: {error}") from error
        return whole

    def run(
        self,
        study_seed: int,
        folder: Path,
        *,
        n_jobs: int | None = None,
        resume: bool = False,
        progress: bool | None = None,
        say: Callable[[str], None] = lambda line: None,
    ) -> xr.Dataset:
        """Compare the methods.

        Parameters
        ----------
        study_seed : int
        folder : Path
            Output folder of the study.
        n_jobs, resume, progress, say
            As of `hipuq.comparison.Race.run`.

        Returns
        -------
        Dataset
        """
        results = self._with_reference(n_jobs).race.run(
            self.seed(study_seed),
            n_jobs=n_jobs,
            store=self.store(folder),
            resume=resume,
            progress=progress,
            say=say,
        )
        return results.assign_attrs(title=self.title)

    def _with_reference(self, n_jobs: int | None) -> Problem:
        """Return it with its reference computed, where the study has to."""
        if self.exact is None:
            return self
        return replace(self, race=replace(self.race, reference=self.exact.reference(n_jobs)), exact=None)


def problems_of(table: StudyFile, folder: Path) -> tuple[Problem, ...]:
    """Return the problems of a study.

    Parameters
    ----------
    table : StudyFile
    folder : Path
        Of the study file, in which references are.

    Returns
    -------
    tuple of Problem
        None without ``[compare]``.

    Raises
    ------
    StudyError
        If one cannot be used; it names the contender or the problem.
    """
    if table.compare is None:
        return ()
    for name, contender in table.compare.contenders.items():
        try:
            method_named(contender.method).split(contender.options)
        except HipuqError as error:
            raise StudyError(f"contender {name!r}: {error}") from error
    found = []
    for entry in table.compare.problems():
        try:
            found.append(_problem(table, table.compare.contenders, entry, folder))
        except HipuqError as error:
            raise StudyError(f"problem {entry.name!r}: {error}") from error
    return tuple(found)


def _problem(
    table: StudyFile, contenders: Mapping[str, ContenderTable], entry: ProblemTable, folder: Path
) -> Problem:
    """Return one problem with what it shares and what it overrides."""
    for key in NEEDED:
        if getattr(entry, key) in (None, "", []):
            raise InputError(f"{key} is missing: give it in the problem, or in [compare] for all")
    if "name" in entry.model:
        model, given = model_of(entry.model), distributions_of(entry.inputs)
    else:
        model = model_of({**table.model, **entry.model})
        given = distributions_of({**table.inputs, **entry.inputs})
    inputs = model.inputs(**given)
    of = check_name("outcome in of", entry.of, model.outcomes)
    names = list(contenders) if entry.contenders is None else entry.contenders
    for name in names:
        check_name("contender", name, contenders)
        if names.count(name) > 1:
            raise InputError(f"contender {name!r} is named twice")
    several = [dim for dim in schema.OUTCOMES[of].dims if dim != "sample"] if of in schema.OUTCOMES else []
    if several and entry.quantity is None:
        raise InputError(
            f"{of!r} is over {several[0]}: name the quantity to compare, such as 'probability', and a "
            "reference with the same dims"
        )
    reference = reference_of(entry, model, given, folder)
    exact = reference if isinstance(reference, Exact) else None
    ready = race(
        model,
        inputs,
        {name: _entry(name, contenders[name], model, given, of) for name in names},
        of=of,
        reference=reference if isinstance(reference, Reference) else STAND_IN,
        budgets=entry.budgets,
        replicates=entry.replicates,
        quantity=entry.quantity,
        baseline=entry.baseline,
        confidence=entry.confidence,
    )
    return Problem(entry.name, entry.title, ready, exact)


def _entry(
    name: str, table: ContenderTable, model: CEAModel, given: Mapping[str, object], of: str
) -> dict[str, Any]:
    """Return a contender as `race` takes it."""
    entry: dict[str, Any] = {"method": table.method, "options": table.options}
    for key in ("of", "quantity", "budgets", "replicates"):
        if getattr(table, key) is not None:
            entry[key] = getattr(table, key)
    if table.integrate_friction:
        integrated, rest = without_friction(model, given)
        if not rest:
            raise InputError(
                f"contender {name!r} integrates {FRICTION}, the only input: nothing is left to sample; "
                "take reference = { exact = true } instead"
            )
        if "of" not in entry:
            if of not in INTEGRATED_OUTCOME:
                raise InputError(
                    f"contender {name!r} integrates friction, which gives no {of!r}: name its own of, "
                    f"one of {', '.join(integrated.outcomes)}"
                )
            entry["of"] = INTEGRATED_OUTCOME[of]
        entry |= {"model": integrated, "inputs": integrated.inputs(**rest)}
    return entry
