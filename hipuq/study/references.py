"""Known answers of problems: given as numbers, found in stored results, or computed exactly."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from hipuq.comparison import QUANTITIES, Reference, reference_from
from hipuq.differences import difference
from hipuq.driver import run as run_method
from hipuq.errors import InputError, StudyError, check_name
from hipuq.evaluation import evaluate
from hipuq.friction import FRICTION, INTEGRATED_OUTCOME, FrictionIntegrated
from hipuq.inputs import Inputs
from hipuq.models import CEAModel
from hipuq.rounds import with_bounds
from hipuq.store import load_results
from hipuq.study.building import without_friction
from hipuq.study.compare_tables import ExactTable, ProblemTable, ResultsTable

INDICES = ("S1", "ST")
"""Results over ``parameter``."""


@dataclass(frozen=True)
class Exact:
    """A reference that a study computes itself: friction integrated, every level once.

    Attributes
    ----------
    model : FrictionIntegrated
    inputs : Inputs or None
        The discrete input; None where friction is the only one.
    of : str
        Outcome of the model.
    quantity : str or None
        The result that is compared.
    source : str
    """

    model: FrictionIntegrated
    inputs: Inputs | None
    of: str
    quantity: str | None
    source: str

    def reference(self, n_jobs: int | None = None) -> Reference:
        """Compute it.

        Raises
        ------
        InputError
            If a verdict stays unknown everywhere.
        """
        if self.inputs is None:
            keep = with_bounds([self.of], self.model)
            outcomes = evaluate(self.model, self.model.nominal(), keep=keep, n_jobs=n_jobs, progress=False)
            return reference_from(outcomes[keep].isel(sample=0, drop=True), self.of, self.source)
        results = run_method(
            self.model,
            self.inputs,
            method="monte_carlo",
            n=1,
            of=self.of,
            rng=0,
            stratify=True,
            n_jobs=n_jobs,
            progress=False,
        )
        return reference_from(results, self.quantity, self.source)


def reference_of(
    table: ProblemTable, model: CEAModel, given: Mapping[str, object], folder: Path
) -> Reference | Exact:
    """Return the reference of a problem, checked; an exact one is computed when the study runs.

    Parameters
    ----------
    table : ProblemTable
        With all its settings.
    model : CEAModel
    given : mapping
        Parameter -> its distribution.
    folder : Path
        Of the study file.

    Raises
    ------
    InputError
        If it cannot be had, or is one of something else.
    """
    asked, source = table.reference, table.source
    if isinstance(asked, ExactTable):
        return _exact(table, model, given)
    if isinstance(asked, ResultsTable):
        return _stored(table, asked, model, given, folder)
    if isinstance(asked, dict):
        if table.quantity is None:
            raise InputError("reference is given by parameter: name the quantity too, such as 'ST'")
        for name in asked:
            check_name("parameter in reference", name, given)
        missing = [name for name in given if name not in asked]
        if missing:
            raise InputError(f"reference has no number for {', '.join(missing)}: give one by parameter")
        return Reference(dict(asked), source=source)
    if table.quantity in INDICES:
        raise InputError(
            f"reference is {asked}, one number: {table.quantity} needs one by parameter, "
            f"reference = {{ {', '.join(f'{name} = ...' for name in given)} }}"
        )
    assert isinstance(asked, (int, float))
    return Reference(float(asked), source=source)


def _exact(table: ProblemTable, model: CEAModel, given: Mapping[str, object]) -> Exact:
    """Return an exact reference, if the problem has one."""
    of = table.of
    if of not in INTEGRATED_OUTCOME:
        raise InputError(
            f"reference = {{ exact = true }} is for {' and '.join(INTEGRATED_OUTCOME)}, not for {of!r}"
        )
    inputs = model.inputs(**given)
    others = [name for name in inputs if name != FRICTION and name not in inputs.discrete]
    if others:
        raise InputError(
            "reference = { exact = true } needs friction as the only continuous input, "
            f"there is also {', '.join(others)}"
        )
    integrated, rest = without_friction(model, given)
    own = integrated.inputs(**rest) if rest else None
    known: tuple[str, ...] = ("probability",)
    what = "friction integrated exactly"
    if own is not None:
        known = ("probability_overall", "probability", "probability_mean", "probability_weighted")
        (name,) = own.discrete
        what += f", all {own.levels(name)['weight'].size:,} levels of {name}"
    if table.quantity is not None:
        check_name("quantity with an exact reference", table.quantity, known)
    source = "; ".join(filter(None, [table.source, what]))
    return Exact(integrated, own, INTEGRATED_OUTCOME[of], table.quantity, source)


def _stored(
    table: ProblemTable,
    asked: ResultsTable,
    model: CEAModel,
    given: Mapping[str, object],
    folder: Path,
) -> Reference:
    """Return a reference from a results file, if it is one of the same problem."""
    place = Path(asked.results)
    if place.is_absolute() or ".." in place.parts or "\\" in asked.results:
        raise StudyError(
            f"reference results {asked.results!r}: give a file in the study's folder, such as reference.nc"
        )
    if not (folder / place).resolve().is_relative_to(folder.resolve()):
        raise StudyError(
            f"reference results {asked.results!r} is a link that leads out of the study's folder"
        )
    tree = load_results(folder / place)
    of = asked.of if asked.of is not None else table.of
    check_name(f"analysis in {asked.results}", asked.analysis, tree.children)
    groups = tree.children[asked.analysis].children
    check_name(f"outcome of {asked.analysis!r} in {asked.results}", of, groups)
    results = groups[of].to_dataset(inherit=False)
    where = f"{asked.results}, {asked.analysis}/{of}"
    _check_same(results, where, model, given)
    _check_numbers(results, where, table.quantity)
    return reference_from(results, table.quantity, "; ".join(filter(None, [table.source, where])))


def _check_numbers(results: xr.Dataset, where: str, quantity: str | None) -> None:
    """Raise an InputError if what may become the reference is not one of numbers."""
    for name in QUANTITIES if quantity is None else (quantity,):
        for end in ("", "_low", "_high"):
            found = results.get(f"{name}{end}")
            if found is None:
                continue
            if found.dtype.kind not in "iuf":
                raise InputError(f"{where} has a {name}{end} of type {found.dtype}, not of real numbers")
            if name in results and (found.dims, found.shape) != (results[name].dims, results[name].shape):
                raise InputError(f"{where} has a {name}{end} of another shape than {name}")


def _check_same(results: xr.Dataset, where: str, model: CEAModel, given: Mapping[str, object]) -> None:
    """Raise an InputError if results are not of this problem; friction may be integrated in them."""
    unsaid = f"{where} does not say of which model and inputs it is: no reference"
    try:
        there = {
            "model": json.loads(results.attrs["options"])["model"],
            "inputs": json.loads(results.attrs["inputs"]),
        }
    except (KeyError, TypeError, ValueError, RecursionError):
        raise InputError(unsaid) from None
    own: CEAModel | FrictionIntegrated = model
    rest = dict(given)
    if isinstance(there["model"], dict) and "integrated" in there["model"] and FRICTION in rest:
        own, rest = without_friction(model, given)
    inputs = json.loads(own.inputs(**rest).to_json()) if rest else {}
    here: dict[str, Any] = {"model": json.loads(json.dumps(own.options)), "inputs": inputs}
    try:
        found = difference(there, here)
    except RecursionError:
        raise InputError(unsaid) from None
    if found is not None:
        place, before, after = found
        raise InputError(f"{where} is of another problem: it has {place} {before}, this one {after}")
