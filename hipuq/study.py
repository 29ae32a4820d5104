"""Study files: study.toml -> `Study`, checked as a whole -> run.

A study names a model, its uncertain inputs and one or more analyses. All of it is checked before
anything is computed, and the results of an analysis are on disk before the next one begins.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from hipuq import __version__, schema
from hipuq.contact import ContactPatterns
from hipuq.driver import completed, estimated, method_named
from hipuq.errors import HipuqError, InputError, StoreError, StudyError, check_name
from hipuq.evaluation import evaluate
from hipuq.friction import FrictionIntegrated, integrate_friction
from hipuq.inputs import Inputs
from hipuq.methods import Method
from hipuq.models import MODELS, CEAModel
from hipuq.models.oscillator_ring import OscillatorRing
from hipuq.sampling import seed_of
from hipuq.store import RESULTS_NAME, add_results, load_results, save_outcomes, save_results
from hipuq.study_file import ReportTable, StudyFile, read_study_file
from hipuq.variation import Variation


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
    """

    name: str
    model: CEAModel | FrictionIntegrated
    inputs: Inputs
    method: str
    n: int
    of: tuple[str, ...]
    options: Mapping[str, Mapping[str, Any]]
    evaluations: int


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
        Seed from which each analysis gets its own.
    analyses : tuple of Analysis
    report : ReportTable
        What figures show.
    text : str
        The study file as it was read.
    """

    name: str
    title: str
    description: str
    seed: int
    analyses: tuple[Analysis, ...]
    report: ReportTable
    text: str


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
            analyses.append(_analysis(table, entry.name))
        except HipuqError as error:
            raise StudyError(f"{file}, analysis {entry.name!r}: {error}") from error
    try:
        chosen = table.seed if seed is None else seed_of(seed)
    except InputError as error:
        raise StudyError(f"seed is {seed!r}: it must be an integer from 0 to 2**63 - 1") from error
    name = file.resolve().parent.name if file.name == "study.toml" else file.stem
    return Study(name, table.title, table.description, chosen, tuple(analyses), table.report, text)


def run_study(
    study: Study,
    out: str | os.PathLike[str],
    *,
    n_jobs: int | None = None,
    progress: bool | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> xr.DataTree:
    """Run a study and write its outcomes and results.

    Parameters
    ----------
    study : Study
    out : path
        Output folder; gets ``outcomes/<analysis>.zarr`` and ``results.nc``.
    n_jobs : int, optional
        Threads; all cores by default.
    progress : bool, optional
        Whether to show progress bars; by default on a terminal.
    say : callable, optional
        Gets a line about each analysis.

    Returns
    -------
    DataTree
        Groups ``<analysis>/<of>``; where the report asks for them also
        ``<analysis>/friction_sweep`` and ``<analysis>/mode_shapes`` at nominal values.

    Raises
    ------
    StoreError
        If the folder cannot be written.
    """
    folder = Path(out)
    _check_writable(folder)
    root = xr.Dataset(
        attrs={
            "hipuq_version": __version__,
            "study": study.name,
            "title": study.title,
            "description": study.description,
            "seed": study.seed,
            "report": study.report.model_dump_json(),
            "study_file": study.text,
        }
    )
    groups: dict[str, xr.Dataset] = {"/": root}
    for i, analysis in enumerate(study.analyses):
        # Each analysis has its own stream, so that one more at the end changes no other.
        seed = seed_of(np.random.SeedSequence(study.seed, spawn_key=(i,)))
        method = method_named(analysis.method)
        outcomes = completed(
            analysis.model,
            analysis.inputs,
            method,
            analysis.n,
            seed,
            of=analysis.of,
            stages=analysis.options,
            n_jobs=n_jobs,
            progress=progress,
        )
        save_outcomes(outcomes, folder / "outcomes" / f"{analysis.name}.zarr")
        found = {
            f"{analysis.name}/{of}": estimated(
                method, outcomes, analysis.inputs, of=of, **analysis.options["estimate"]
            )
            for of in analysis.of
        }
        found |= _at_nominal(analysis, study.report, n_jobs)
        # An old file gives way to the first results, and not before.
        if i == 0:
            save_results(xr.DataTree.from_dict(groups | found), folder / RESULTS_NAME)
        else:
            add_results(found, folder / RESULTS_NAME)
        groups |= found
        open_ = int((outcomes["status"] == schema.STATUS["undecided"]).sum())
        say(
            f"{analysis.name}: {outcomes.sizes['sample']:,} evaluations of {analysis.model.label} in "
            f"{outcomes.attrs['seconds']:.1f} s, {open_:,} undecided"
        )
    return xr.DataTree.from_dict(groups)


def _at_nominal(analysis: Analysis, report: ReportTable, n_jobs: int | None) -> dict[str, xr.Dataset]:
    """Return the friction sweep and the mode shapes at nominal values that the report shows."""
    groups: dict[str, xr.Dataset] = {}
    model = analysis.model
    if not isinstance(model, CEAModel):
        return groups
    if report.friction_sweep is not None:
        grid = np.linspace(*report.friction_sweep, report.friction_points)
        sweep = evaluate(model, model.nominal(friction=grid), n_jobs=n_jobs, progress=False)
        groups[f"{analysis.name}/friction_sweep"] = sweep
    if report.mode_shapes:
        sample = model.nominal(friction=report.shape_friction)
        groups[f"{analysis.name}/mode_shapes"] = model.mode_shapes(sample)
    return groups


def _check_writable(folder: Path) -> None:
    """Raise a StoreError now rather than after the computation."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / RESULTS_NAME).exists():
            load_results(folder)  # raises for a file that is not ours to replace
        probe = folder / f".hipuq-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except StoreError:
        raise
    except OSError as error:
        raise StoreError(
            f"cannot write to {folder}: {error.strerror}; choose another folder with --out"
        ) from error


def _analysis(table: StudyFile, name: str) -> Analysis:
    """Return one analysis with what it overrides."""
    entry = next(entry for entry in table.analysis if entry.name == name)
    base = _model({**table.model, **({"preset": entry.preset} if entry.preset else {}), **entry.model})
    given = {key: value.distribution_for(key) for key, value in {**table.inputs, **entry.inputs}.items()}
    model = base if not entry.integrate_friction else _integrated(base, given)
    inputs = model.inputs(**given)
    method: Method = method_named(entry.method)
    options = method.split(entry.options)
    for of in entry.of:
        check_name("outcome in of", of, model.outcomes)
    evaluations = method.plan(inputs, entry.n, entry.of, options)
    _check_report(table.report, base)
    return Analysis(name, model, inputs, entry.method, entry.n, tuple(entry.of), options, evaluations)


def _integrated(model: CEAModel, inputs: dict[str, object]) -> FrictionIntegrated:
    """Return the model with friction integrated over its distribution, which is taken out of the inputs."""
    if "friction" not in inputs:
        raise InputError("integrate_friction needs the distribution [inputs.friction]")
    friction = inputs.pop("friction")
    if isinstance(friction, (ContactPatterns, Variation)):
        raise InputError("integrate_friction needs a distribution of friction itself, apply = 'absolute'")
    return integrate_friction(model, friction)


def _check_report(report: ReportTable, model: CEAModel) -> None:
    """Raise an InputError if the report asks for what the model does not have."""
    pairs = [mode for pair in report.pairs for mode in pair]
    for mode in [*report.mode_shapes, *pairs, *map(int, report.mode_names)]:
        if not 1 <= mode <= model.dofs:
            raise InputError(f"report names mode {mode}: {model.label} has the modes 1 to {model.dofs}")
    if report.mode_shapes and not isinstance(model, OscillatorRing):
        raise InputError(f"report asks for mode_shapes: only a ring has a shape to draw, not {model.label}")


def _model(options: Mapping[str, Any]) -> CEAModel:
    """Return the model that a [model] table describes."""
    rest = dict(options)
    name = rest.pop("name", None)
    try:
        return MODELS[check_name("model", name, MODELS)](**rest)
    except TypeError as error:
        raise InputError(f"model {name!r} does not take these options: {error}") from error
