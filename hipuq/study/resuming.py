"""What of an earlier run of a study is kept, and why it cannot be where it cannot."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from hipuq import __version__
from hipuq.comparison.record import Record
from hipuq.differences import difference
from hipuq.errors import StoreError
from hipuq.evidence import LITERATURE
from hipuq.sampling import seed_of
from hipuq.store import RESULTS_NAME, load_results
from hipuq.store.completeness import missing_in, progress_of
from hipuq.store.ledger import ABOUT
from hipuq.study.analysing import Groups, outcomes_of
from hipuq.study.file import COMPARE
from hipuq.study.plan import Analysis, Study
from hipuq.study.problems import Problem

DEFINITIONS = "analyses"
"""Root attribute of results: analysis -> what it was computed from, JSON."""

REST = "run without --resume, or choose another folder with --out"

AT_NOMINAL = ("friction_sweep", "mode_shapes")
"""Groups of an analysis that hold what the report shows at nominal values."""


DEPENDS_ON: dict[str, tuple[str, ...]] = {
    "friction_sweep": ("friction_sweep", "friction_points", "damping_ratio"),
    "mode_shapes": ("mode_shapes", "shape_friction", "damping_ratio"),
    "verdicts": (),
    "onsets": (),
    "frequencies": (),
    "fragility": ("fragility_points",),
    "friction_limit": ("targets",),
}
"""Group beside the results of an analysis -> keys of the report that it depends on."""


def analysis_seed(study: Study, place: int) -> int:
    """Return the seed of the analysis at a place: one more at the end changes no other.

    An analysis which the study adds by itself has that of the one that it is like: the same draws.
    """
    names = [one.name for one in study.analyses]
    like = study.analyses[place].like
    key = names.index(like) if like else place
    return seed_of(np.random.SeedSequence(study.seed, spawn_key=(key,)))


def definitions(study: Study) -> dict[str, dict[str, Any]]:
    """Return what the results of each analysis follow from, JSON-able: the same gives the same numbers."""
    found = {one.name: _definition(one, analysis_seed(study, i)) for i, one in enumerate(study.analyses)}
    # Lists and tuples, integers and those of numpy: as they come back from a file.
    same: dict[str, dict[str, Any]] = json.loads(json.dumps(found, default=str))
    return same


def _definition(analysis: Analysis, seed: int) -> dict[str, Any]:
    over = {"over": {name: list(own) for name, own in analysis.over.items()}} if analysis.over else {}
    return {
        "hipuq_version": __version__,
        "seed": seed,
        "method": analysis.method,
        "n": analysis.n,
        "of": list(analysis.of),
        "model": analysis.model.label,
        "model_options": analysis.model.options,
        "inputs": json.loads(analysis.inputs.to_json()),
        "options": {stage: dict(own) for stage, own in analysis.options.items()},
        **over,
    }


@dataclass(frozen=True)
class Earlier:
    """What an output folder holds of a study.

    Attributes
    ----------
    analyses : dict
        Complete analysis -> its groups, named as in the results. What the report shows at nominal values is
        left out if the report has changed.
    comparisons : dict
        Groups of problems, as they are until the problem is complete again.
    runs : dict
        Problem -> number of runs that need not be done again.
    dropped : dict
        Analyses and groups that are left out -> why.
    """

    analyses: dict[str, Groups] = field(default_factory=dict)
    comparisons: Groups = field(default_factory=dict)
    runs: dict[str, int] = field(default_factory=dict)
    dropped: dict[str, str] = field(default_factory=dict)


def earlier(study: Study, folder: Path, *, retry_failed: bool = False) -> Earlier:
    """Return what of an earlier run is kept; nothing is written.

    Parameters
    ----------
    study : Study
    folder : Path
        Output folder.
    retry_failed : bool
        Whether analyses with failed samples are not kept.

    Returns
    -------
    Earlier

    Raises
    ------
    StoreError
        If results or runs cannot be read, or were made in another way; it says what differs.
    """
    runs = {one.name: _runs(one, study.seed, folder) for one in study.problems}
    if not (folder / RESULTS_NAME).exists():
        return Earlier(runs=runs)
    tree = load_results(folder)
    analyses = _analyses(study, folder, tree)
    if retry_failed:
        analyses = {name: groups for name, groups in analyses.items() if not _failed(groups)}
    report = dict(zip(AT_NOMINAL, (study.report.friction_sweep, study.report.mode_shapes), strict=True))
    gone = [
        name
        for name in tree.children
        if name not in {COMPARE, LITERATURE, *(one.name for one in study.analyses)}
    ]
    for one in analyses:
        gone += [f"{one}/{name}" for name, own in report.items() if not own and name in tree.children[one]]
    dropped = {str(name): "the study no longer has it" for name in gone}
    seeds = {one.group: one.seed(study.seed) for one in study.problems}
    comparisons: Groups = {}
    for name, node in tree.children[COMPARE].children.items() if COMPARE in tree.children else ():
        group, own = f"{COMPARE}/{name}", node.to_dataset(inherit=False).drop_encoding()
        if group not in seeds:
            dropped[group] = "the study no longer has it"
        elif str(own.attrs.get("seed")) != str(seeds[group]):
            dropped[group] = "it was made with another seed"
        else:
            comparisons[group] = own
    return Earlier(analyses, comparisons, runs, dropped)


def would_keep(study: Study, folder: Path) -> list[str]:
    """Return lines about what `run_study` with resume would keep; nothing is written.

    Parameters
    ----------
    study : Study
    folder : Path
        Output folder.

    Raises
    ------
    StoreError
        Where it would refuse what is in the folder.
    """
    before = earlier(study, folder)
    lines = [f"{name}: would be kept, complete in {folder}" for name in before.analyses]
    for analysis in study.analyses:
        store = outcomes_of(analysis, folder)
        if analysis.name not in before.analyses and (store / ABOUT).is_file():
            done, size = progress_of(store)
            lines.append(
                f"{analysis.name}: would go on, {done:,} of {size:,} samples are in {store}, "
                f"{analysis.evaluations:,} asked for"
            )
    for one in study.problems:
        runs = sum(len(own.sizes) * own.replicates for own in one.race.contenders)
        lines.append(f"{one.group}: {before.runs[one.name]:,} of {runs:,} runs would be kept")
    return lines + [f"{name}: would be dropped, {why}" for name, why in before.dropped.items()]


def _runs(problem: Problem, seed: int, folder: Path) -> int:
    """Return how many runs of a problem are there."""
    race, file = problem.race, problem.store(folder)
    race.check(problem.seed(seed), file)
    there = Record.read(file, None).runs
    return sum(
        (one.name, budget, k) in there and there[one.name, budget, k].n == n
        for one in race.contenders
        for budget, n in one.sizes.items()
        for k in range(one.replicates)
    )


def _analyses(study: Study, folder: Path, tree: xr.DataTree) -> dict[str, Groups]:
    """Return the analyses that are complete."""
    try:
        before = json.loads(tree.attrs.get(DEFINITIONS, "{}"))
    except (TypeError, ValueError, RecursionError):
        before = {}
    asked = definitions(study)
    kept = _as_before(tree, study)
    found: dict[str, Groups] = {}
    for one in study.analyses:
        if one.name not in tree.children:
            continue
        groups = {
            str(name): node.to_dataset(inherit=False).drop_encoding()
            for name, node in tree.children[one.name].children.items()
        }
        if (seed := tree.attrs.get("seed")) is not None and str(seed) != str(study.seed):
            raise StoreError(
                f"analysis {one.name!r} in {folder} was made with seed {seed}, the study asks for "
                f"{study.seed}: {REST}"
            )
        same = _check_same(one.name, before, asked[one.name], folder)
        store = outcomes_of(one, folder)
        # Outcomes that were damaged since are made again, and the results with them.
        there = not (store / ABOUT).is_file() or not missing_in(store)
        if same and there and set(one.of) <= set(groups):
            wanted = {*one.of, *kept}
            found[one.name] = {f"{one.name}/{key}": own for key, own in groups.items() if key in wanted}
    return found


def _failed(groups: Groups) -> bool:
    """Say whether samples of an analysis failed."""
    return any(int(own["failed"].sum()) for own in groups.values() if "failed" in own)


def _as_before(tree: xr.DataTree, study: Study) -> list[str]:
    """Return the groups beside the results of analyses that the report asks for as it did before."""
    try:
        before = json.loads(tree.attrs.get("report", "{}"))
        before = before if isinstance(before, dict) else {}
    except (TypeError, ValueError, RecursionError):
        before = {}
    now = json.loads(study.report.model_dump_json())
    return [
        name
        for name, keys in DEPENDS_ON.items()
        if all(key in before and before[key] == now[key] for key in keys)
    ]


def _check_same(name: str, before: Any, asked: dict[str, Any], folder: Path) -> bool:
    """Say whether an analysis in the folder is the one that the study asks for, False if it only has fewer n.

    Raises
    ------
    StoreError
        If it is another one.
    """
    there = before.get(name) if isinstance(before, dict) else None
    try:
        # Outcomes of fewer samples are taken over.
        fewer = isinstance(there, dict) and type(there.get("n")) is int and there["n"] < asked["n"]
        found = difference(there | {"n": asked["n"]} if isinstance(there, dict) and fewer else there, asked)
    except RecursionError:
        there = None
    if there is None:
        raise StoreError(f"analysis {name!r} in {folder} does not say how it was made: {REST}")
    if found is not None:
        place, old, new = found
        raise StoreError(
            f"analysis {name!r} in {folder} was made with {place} {old}, the study asks for {new}: {REST}"
        )
    return not fewer
