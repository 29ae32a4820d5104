"""What an analysis of a study gives: results of each outcome, and what the report shows beside them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.combinations import at, gathered, points
from hipuq.driver import method_named
from hipuq.estimation.reduction import flag_counts
from hipuq.evaluation import How, evaluate
from hipuq.fragility_curve import fragility
from hipuq.friction import FRICTION, OF_ANY_MODE, FrictionIntegrated
from hipuq.friction_limits import friction_limit
from hipuq.models import CEAModel
from hipuq.occurring import frequency_ranges, verdict_counts
from hipuq.rounds import DEFAULT, completed, estimated
from hipuq.store import load_outcomes
from hipuq.store.completeness import progress_of
from hipuq.store.ledger import ABOUT
from hipuq.study.headline import DAMPING
from hipuq.study.plan import Analysis
from hipuq.study.tables import ReportTable

Groups = dict[str, xr.Dataset]
"""Name of a group of the results -> its Dataset."""

INTEGRATED = ("onset", "interval")
"""Outcomes kept of a model whose friction is integrated: fragility and friction limits follow from them."""


DRAWS = ("monte_carlo",)
"""Methods whose samples are draws of the inputs, or of strata of them."""


def analysed(
    analysis: Analysis,
    report: ReportTable,
    seed: int,
    folder: Path,
    *,
    how: How = DEFAULT,
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
    how : How
        How to evaluate.
    say : callable, optional
        Gets a line about it.

    Returns
    -------
    dict
        ``<analysis>/<of>`` for each outcome; ``<analysis>/verdicts``; with friction integrated
        ``<analysis>/fragility``, ``onsets`` and ``friction_limit``, the last one of a sweep over friction
        too; where ``unstable`` is analysed ``<analysis>/frequencies``.
    """
    method, store = method_named(analysis.method), outcomes_of(analysis, folder)
    if not how.resume and (store / ABOUT).is_file():
        done, _ = progress_of(store)
        say(f"{analysis.name}: {done:,} samples of an earlier run are replaced, --resume would keep them")
    found = completed(
        analysis.model,
        analysis.inputs,
        method,
        analysis.n,
        seed,
        of=analysis.of,
        stages=analysis.options,
        at=points(analysis.over),
        keep=_kept(analysis),
        how=replace(how, store=store, replace=not how.resume),
    )
    parts: dict[str, list[xr.Dataset]] = {}
    for outcomes in found:
        for of in analysis.of:
            results = estimated(method, outcomes, analysis.inputs, of=of, **analysis.options["estimate"])
            parts.setdefault(of, []).append(results)
        for name in _derived(analysis):
            parts.setdefault(name, []).append(DERIVED[name](analysis, report, outcomes))
    _tell(analysis, load_outcomes(store), store, say)
    groups = {name: gathered(own, analysis.over) for name, own in parts.items()}
    groups |= _limits_of_a_sweep(analysis, report, groups)
    return {f"{analysis.name}/{name}": own for name, own in groups.items()}


def outcomes_of(analysis: Analysis, folder: Path) -> Path:
    """Return where in the output folder of a study the outcomes of an analysis lie."""
    return folder / "outcomes" / f"{analysis.name}.zarr"


def _tell(analysis: Analysis, whole: xr.Dataset, store: Path, say: Callable[[str], None]) -> None:
    """Say how many samples were evaluated, and what became of them."""
    counts = flag_counts(whole["status"], schema.STATUS)
    line = (
        f"{analysis.name}: {whole.sizes['sample']:,} evaluations of {analysis.model.label} in "
        f"{whole.attrs['seconds']:.1f} s, {counts['undecided']:,} undecided"
    )
    if counts["failed"]:
        line += f", {counts['failed']:,} failed"
    if "failure_message" in whole:
        row, message = (whole[name].values[0] for name in ("failed_sample", "failure_message"))
        line += f" (sample {row}: {message}; more in {store})"
    say(line)


def _kept(analysis: Analysis) -> tuple[str, ...]:
    """Return the outcomes that the report needs besides those analysed."""
    if isinstance(analysis.model, FrictionIntegrated):
        return INTEGRATED
    return ("frequency",) if "unstable" in analysis.of else ()


def _derived(analysis: Analysis) -> tuple[str, ...]:
    """Return which of `DERIVED` an analysis has."""
    # Of samples that are no plain draws no share is a probability.
    drawn = isinstance(analysis.model, FrictionIntegrated) and analysis.method in DRAWS
    return (
        "verdicts",
        *(("fragility", "onsets", "friction_limit") if drawn else ()),
        *(("frequencies",) if "unstable" in analysis.of and not drawn else ()),
    )


def _confidence(analysis: Analysis) -> float:
    return float(analysis.options["estimate"].get("confidence", 0.95))


def _fragility(analysis: Analysis, report: ReportTable, outcomes: xr.Dataset) -> xr.Dataset:
    lower, upper = outcomes["onset"].attrs["range"]
    grid = np.linspace(lower, upper, report.fragility_points)
    return fragility(outcomes, grid, confidence=_confidence(analysis))


DERIVED: dict[str, Callable[[Analysis, ReportTable, xr.Dataset], xr.Dataset]] = {
    "verdicts": lambda analysis, report, outcomes: verdict_counts(outcomes),
    "fragility": _fragility,
    "onsets": lambda analysis, report, outcomes: schema.stamp(
        outcomes[["onset"]], "onsets", like=outcomes.attrs
    ),
    "friction_limit": lambda analysis, report, outcomes: friction_limit(
        outcomes, report.targets, confidence=_confidence(analysis)
    ),
    "frequencies": lambda analysis, report, outcomes: frequency_ranges(outcomes),
}
"""Group beside the results of an analysis -> what makes it of the outcomes, without the method."""


NEEDS = {
    "fragility": {"onset", "interval"},
    "onsets": {"onset"},
    "friction_limit": {"onset"},
    "frequencies": {"frequency", "unstable"},
}
"""Group of `DERIVED` -> outcomes that it is made of."""


def _limits_of_a_sweep(analysis: Analysis, report: ReportTable, groups: Groups) -> Groups:
    """Return the friction limits of an analysis over friction, by what else it is over."""
    curve = next((groups[of] for of in OF_ANY_MODE if of in groups), None)
    if curve is None or len(analysis.over.get(FRICTION, ())) < 2:
        return {}
    name = "probability_overall" if "probability_overall" in curve else "probability"
    if name not in curve:
        return {}
    rest = {key: own for key, own in analysis.over.items() if key != FRICTION}
    if set(curve[name].dims) != set(analysis.over):
        return {}
    plain = {f"probability{end}": curve[name + end] for end in ("", "_low", "_high")}
    curve = xr.Dataset(plain, attrs=curve.attrs)
    limits = [friction_limit(at(curve, **fixed), report.targets) for fixed in points(rest)]
    return {"friction_limit": gathered(limits, rest)}


def derived_again(
    analysis: Analysis,
    report: ReportTable,
    folder: Path,
    before: Groups,
    say: Callable[[str], None] = lambda line: None,
) -> Groups:
    """Return what is shown beside results that are kept and is not there, from stored outcomes.

    Parameters
    ----------
    analysis : Analysis
    report : ReportTable
    folder : Path
        Output folder of the study.
    before : dict
        Groups that are there already.
    say : callable, optional
        Gets a line about what cannot be made again.

    Returns
    -------
    dict
    """
    own = {key.partition("/")[2]: group for key, group in before.items()}
    found: Groups = {} if "friction_limit" in own else _limits_of_a_sweep(analysis, report, own)
    missing = [name for name in _derived(analysis) if name not in own]
    stored = outcomes_of(analysis, folder)
    if missing and stored.exists():
        whole = load_outcomes(stored)
        for name in [name for name in missing if NEEDS.get(name, set()) <= set(whole.variables)]:
            parts = [DERIVED[name](analysis, report, one) for one in _by_value(whole, analysis)]
            found[name] = gathered(parts, analysis.over)
            missing.remove(name)
    if missing:
        say(
            f"{analysis.name}: {', '.join(missing)} cannot be made from the outcomes that are stored; run "
            "without --resume for the whole report"
        )
    return {f"{analysis.name}/{name}": group for name, group in found.items()}


def _by_value(whole: xr.Dataset, analysis: Analysis) -> list[xr.Dataset]:
    """Return outcomes at each combination of what is swept."""
    parts = []
    for fixed in points(analysis.over):
        here = np.ones(whole.sizes["sample"], bool)
        for name, value in fixed.items():
            here &= whole[name].values == value
        parts.append(whole.isel(sample=here))
    return parts


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
    # An analysis over damping is shown at the headline's.
    damping = report.damping_ratio if report.damping_ratio in analysis.over.get(DAMPING, ()) else None
    fixed = {} if damping is None else {DAMPING: damping}
    if report.friction_sweep is not None and sweep not in before:
        grid = np.linspace(*report.friction_sweep, report.friction_points)
        samples = model.nominal(friction=grid, **{name: np.full(grid.size, v) for name, v in fixed.items()})
        groups[sweep] = evaluate(model, samples, n_jobs=n_jobs, progress=False)
    if report.mode_shapes and shapes not in before:
        place = {FRICTION: report.shape_friction, **fixed}
        found = model.mode_shapes(model.nominal(**place))
        coords = {name: ((), value, schema.PARAMETERS[name].attrs) for name, value in place.items()}
        groups[shapes] = found.assign_coords(coords)
    return groups
