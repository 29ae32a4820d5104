"""What a study is: its analyses and problems, checked and ready to run."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from hipuq.combinations import Values, points
from hipuq.driver import method_named
from hipuq.errors import HipuqError, InputError, StudyError, check_name
from hipuq.friction import FrictionIntegrated
from hipuq.inputs import Inputs
from hipuq.methods import Method
from hipuq.models import CEAModel
from hipuq.models.oscillator_ring import OscillatorRing
from hipuq.sampling import seed_of
from hipuq.study.building import distributions_of, model_of, without_friction
from hipuq.study.file import StudyFile, read_study_file, refused
from hipuq.study.headline import check_headline, damping_sweep, headline_of
from hipuq.study.problems import Problem, problems_of
from hipuq.study.tables import AnalysisTable, ReportTable
from hipuq.sweeping import check_over


@dataclass(frozen=True)
class Analysis:
    """One analysis of a study, ready to run.

    Attributes
    ----------
    name : str
        Name of its group in the results.
    model : CEAModel or FrictionIntegrated
        The model with the analysis' preset and options.
    inputs : Inputs
        The uncertain parameters.
    method : str
        Name of the method.
    n : int
        Size of the design.
    of : tuple of str
        Outcomes to analyse.
    options : mapping
        Options of the method by stage.
    evaluations : int
        Model runs that it takes.
    over : dict
        Parameter -> values at which it is made; empty for an ordinary analysis.
    sources : mapping
        Input -> where its distribution is from, as far as the study says it.
    like : str
        The analysis that it has model and inputs of, if the study adds it by itself; else empty.
    """

    name: str
    model: CEAModel | FrictionIntegrated
    inputs: Inputs
    method: str
    n: int
    of: tuple[str, ...]
    options: Mapping[str, Mapping[str, Any]]
    evaluations: int
    over: Values = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)
    like: str = ""

    @property
    def implied(self) -> bool:
        """Whether the study adds it by itself."""
        return bool(self.like)


@dataclass(frozen=True)
class Study:
    """A study, checked and ready to run.

    Attributes
    ----------
    name : str
        Name of its folder.
    title, description : str
        For people.
    seed : int
        Seed from which each analysis and each problem gets its own.
    analyses : tuple of Analysis
        In the order in which they run.
    problems : tuple of Problem
        On which methods are compared.
    report : ReportTable
        What figures show.
    text : str
        The study file as it was read.
    headline : str or None
        Analysis whose probability is told first, whether asked for or found.
    """

    name: str
    title: str
    description: str
    seed: int
    analyses: tuple[Analysis, ...]
    problems: tuple[Problem, ...]
    report: ReportTable
    text: str
    headline: str | None = None

    @property
    def evaluations(self) -> int:
        """Model runs that it takes, of analyses and comparisons together."""
        analyses = sum(one.evaluations for one in self.analyses)
        return analyses + sum(one.evaluations for one in self.problems)


def load_study(path: str | os.PathLike[str], *, seed: int | None = None) -> Study:
    """Read and check a study.

    Parameters
    ----------
    path : path
        A study folder or its study.toml.
    seed : int, optional
        In place of the study's own.

    Returns
    -------
    Study
        Checked: its ``analyses``, its ``evaluations``, and what `run_study` takes.

    Raises
    ------
    StudyError
        If it cannot be read, or anything in it cannot be used; one line that says where.
    """
    file = Path(path)
    if file.is_dir():
        file = file / "study.toml"
    text, table = read_study_file(file)
    analyses = []
    for entry in table.analysis:
        try:
            analyses.append(_analysis(table, entry))
        except HipuqError as error:
            raise refused(f"{file}, analysis {entry.name!r}: ", error) from error
    try:
        check_headline(table, analyses)
        # What the study takes for its headline the report takes too.
        head = headline_of(table, analyses)
        if (swept := damping_sweep(table, analyses)) is not None:
            analyses.append(replace(_analysis(table, swept[0]), like=swept[1]))
    except HipuqError as error:
        raise refused(f"{file}, report: ", error) from error
    try:
        problems = problems_of(table, file.parent)
    except HipuqError as error:
        raise refused(f"{file}, ", error) from error
    try:
        chosen = table.seed if seed is None else seed_of(seed)
    except InputError as error:
        raise StudyError(f"seed is {seed!r}: it must be an integer from 0 to 2**63 - 1") from error
    name = file.resolve().parent.name if file.name == "study.toml" else file.stem
    return Study(
        name,
        table.title,
        table.description,
        chosen,
        tuple(analyses),
        problems,
        table.report,
        text,
        None if head is None else head.name,
    )


def _analysis(table: StudyFile, entry: AnalysisTable) -> Analysis:
    """Return one analysis with what it overrides."""
    base = model_of({**table.model, **({"preset": entry.preset} if entry.preset else {}), **entry.model})
    tables = {name: own for name, own in table.inputs.items() if name not in entry.over} | entry.inputs
    given = distributions_of(tables)
    model: CEAModel | FrictionIntegrated = base
    if entry.integrate_friction:
        model, given = without_friction(base, given)
    inputs = model.inputs(**given)
    method: Method = method_named(entry.method)
    options = method.split(entry.options)
    for of in entry.of:
        check_name("outcome in of", of, model.outcomes)
    evaluations = method.plan(inputs, entry.n, entry.of, options)
    over = check_over(entry.over, model, inputs) if entry.over else {}
    _check_report(table.report, base)
    return Analysis(
        entry.name,
        model,
        inputs,
        entry.method,
        entry.n,
        tuple(entry.of),
        options,
        evaluations * len(points(over)),
        over,
        {name: one.source for name, one in tables.items() if one.source},
    )


def _check_report(report: ReportTable, model: CEAModel) -> None:
    """Raise an InputError if the report asks for what the model does not have."""
    pairs = [mode for pair in report.pairs for mode in pair]
    for mode in [*report.mode_shapes, *pairs, *map(int, report.mode_names)]:
        if not 1 <= mode <= model.dofs:
            raise InputError(f"report names mode {mode}: {model.label} has the modes 1 to {model.dofs}")
    if report.mode_shapes and not isinstance(model, OscillatorRing):
        raise InputError(f"report asks for mode_shapes: only a ring has a shape to draw, not {model.label}")
