"""What an analysis of a study gives: results of each outcome, and what the report shows beside them."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from pathlib import Path

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.driver import completed, estimated, method_named
from hipuq.evaluation import evaluate, together
from hipuq.fragility_curve import fragility
from hipuq.friction import FrictionIntegrated
from hipuq.friction_limits import friction_limit
from hipuq.models import CEAModel
from hipuq.occurring import frequency_ranges, verdict_counts
from hipuq.store import load_outcomes, save_outcomes
from hipuq.study.plan import Analysis
from hipuq.study.tables import ReportTable
from hipuq.sweeping import gathered, points

Groups = dict[str, xr.Dataset]
"""Name of a group of the results -> its Dataset."""

INTEGRATED = ("onset", "interval")
"""Outcomes kept of a model whose friction is integrated: fragility and friction limits follow from them."""


BESIDE = ("verdicts", "fragility", "onsets", "friction_limit", "frequencies")
"""Groups of an analysis that follow from its outcomes without its method."""


def analysed(
    analysis: Analysis,
    report: ReportTable,
    seed: int,
    folder: Path,
    *,
    n_jobs: int | None = None,
    progress: bool | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> Groups:
    """Return the results of an analysis; its outcomes are written.

    Parameters
    ----------
    analysis : Analysis
    report : ReportTable
    seed : int
    folder : Path
        Output folder of the study; gets ``outcomes/<analysis>.zarr``.
    n_jobs, progress
        As in `hipuq.evaluate`.
    say : callable, optional
        Gets a line about it.

    Returns
    -------
    dict
        ``<analysis>/<of>`` for each outcome; ``<analysis>/verdicts``; with friction integrated
        ``<analysis>/fragility``, ``onsets`` and ``friction_limit``; where ``unstable`` is analysed
        ``<analysis>/frequencies``.
    """
    method = method_named(analysis.method)
    found: list[xr.Dataset] = []
    parts: dict[str, list[xr.Dataset]] = {}
    for fixed in points(analysis.over):
        outcomes = completed(
            analysis.model,
            analysis.inputs,
            method,
            analysis.n,
            seed,
            of=analysis.of,
            stages=analysis.options,
            fixed=fixed,
            keep=_kept(analysis),
            n_jobs=n_jobs,
            progress=progress,
        )
        found.append(outcomes)
        for of in analysis.of:
            results = estimated(method, outcomes, analysis.inputs, of=of, **analysis.options["estimate"])
            parts.setdefault(of, []).append(results)
        for name, shown in beside(analysis, report, outcomes).items():
            parts.setdefault(name, []).append(shown)
    whole = reduce(together, found)
    save_outcomes(whole, folder / "outcomes" / f"{analysis.name}.zarr")
    open_ = int((whole["status"] == schema.STATUS["undecided"]).sum())
    say(
        f"{analysis.name}: {whole.sizes['sample']:,} evaluations of {analysis.model.label} in "
        f"{whole.attrs['seconds']:.1f} s, {open_:,} undecided"
    )
    return {f"{analysis.name}/{name}": gathered(own, analysis.over) for name, own in parts.items()}


def _kept(analysis: Analysis) -> tuple[str, ...]:
    """Return the outcomes that the report needs besides those analysed."""
    if isinstance(analysis.model, FrictionIntegrated):
        return INTEGRATED
    return ("frequency",) if "unstable" in analysis.of else ()


def beside(analysis: Analysis, report: ReportTable, outcomes: xr.Dataset) -> Groups:
    """Return what the report shows of outcomes besides what the method estimates.

    Parameters
    ----------
    analysis : Analysis
    report : ReportTable
    outcomes : Dataset
        At one combination of what is swept.

    Returns
    -------
    dict
        Name, one of `BESIDE` -> its Dataset, as far as the outcomes have it.
    """
    shown = {"verdicts": verdict_counts(outcomes)}
    if "onset" in outcomes and "interval" in outcomes and _plain(outcomes):
        lower, upper = outcomes["onset"].attrs["range"]
        grid = np.linspace(lower, upper, report.fragility_points)
        confidence = float(analysis.options["estimate"].get("confidence", 0.95))
        shown["fragility"] = fragility(outcomes, grid, confidence=confidence)
        shown["onsets"] = schema.stamp(outcomes[["onset"]], "onsets", like=outcomes.attrs)
        shown["friction_limit"] = friction_limit(outcomes, report.targets, confidence=confidence)
    if "unstable" in analysis.of and "frequency" in outcomes:
        shown["frequencies"] = frequency_ranges(outcomes)
    return shown


def beside_again(analysis: Analysis, report: ReportTable, folder: Path, before: Groups) -> Groups:
    """Return what the report shows beside results that are kept, from stored outcomes.

    Parameters
    ----------
    analysis : Analysis
    report : ReportTable
    folder : Path
        Output folder of the study.
    before : dict
        Groups that are there already; nothing is read where these are all.

    Returns
    -------
    dict
        Empty where there are no outcomes.
    """
    stored = folder / "outcomes" / f"{analysis.name}.zarr"
    if f"{analysis.name}/verdicts" in before or not stored.exists():
        return {}
    whole = load_outcomes(stored).load()
    parts: dict[str, list[xr.Dataset]] = {}
    for fixed in points(analysis.over):
        here = np.ones(whole.sizes["sample"], bool)
        for name, value in fixed.items():
            here &= whole[name].values == value
        for name, shown in beside(analysis, report, whole.isel(sample=here)).items():
            parts.setdefault(name, []).append(shown)
    return {f"{analysis.name}/{name}": gathered(own, analysis.over) for name, own in parts.items()}


def _plain(outcomes: xr.Dataset) -> bool:
    """Say whether samples are draws of the inputs or strata of them: their shares are probabilities."""
    return "matrix" not in outcomes.coords and "stratum" not in outcomes.coords


def at_nominal(analysis: Analysis, report: ReportTable, n_jobs: int | None, before: Groups) -> Groups:
    """Return what the report shows at nominal values, but for what is there already.

    Parameters
    ----------
    analysis : Analysis
    report : ReportTable
    n_jobs : int or None
        As in `hipuq.evaluate`.
    before : dict
        Groups that are there already.

    Returns
    -------
    dict
        ``<analysis>/friction_sweep`` and ``<analysis>/mode_shapes``, where the report asks for them.
    """
    groups: Groups = {}
    model = analysis.model
    if not isinstance(model, CEAModel):
        return groups
    sweep, shapes = f"{analysis.name}/friction_sweep", f"{analysis.name}/mode_shapes"
    if report.friction_sweep is not None and sweep not in before:
        grid = np.linspace(*report.friction_sweep, report.friction_points)
        groups[sweep] = evaluate(model, model.nominal(friction=grid), n_jobs=n_jobs, progress=False)
    if report.mode_shapes and shapes not in before:
        groups[shapes] = model.mode_shapes(model.nominal(friction=report.shape_friction))
    return groups
