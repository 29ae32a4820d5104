"""Run a study: results of an analysis, and of a comparison, are on disk before the next one begins."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from hipuq import __version__, schema
from hipuq.driver import completed, estimated, method_named
from hipuq.errors import StoreError
from hipuq.evaluation import evaluate
from hipuq.models import CEAModel
from hipuq.store import RESULTS_NAME, add_results, load_results, save_outcomes, save_results
from hipuq.study.plan import Analysis, Study
from hipuq.study.resuming import DEFINITIONS, Earlier, Groups, analysis_seed, definitions, earlier
from hipuq.study.tables import ReportTable


def run_study(
    study: Study,
    out: str | os.PathLike[str],
    *,
    resume: bool = False,
    n_jobs: int | None = None,
    progress: bool | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> xr.DataTree:
    """Run a study and write its outcomes and results.

    Parameters
    ----------
    study : Study
    out : path
        Output folder; gets ``outcomes/<analysis>.zarr``, ``compare/<problem>.jsonl`` and ``results.nc``.
    resume : bool, default False
        Whether to go on from what is in the folder: analyses that are complete and single runs of
        comparisons are kept, so that the results are those of a run that was not cut off. Old results of
        a comparison stay in the file until it is complete again.
    n_jobs : int, optional
        Threads; all cores by default.
    progress : bool, optional
        Whether to show progress bars; by default on a terminal.
    say : callable, optional
        Gets a line about each analysis, each budget of a comparison, and what the file no longer has.

    Returns
    -------
    DataTree
        Groups ``<analysis>/<of>``; where the report asks for them also
        ``<analysis>/friction_sweep`` and ``<analysis>/mode_shapes`` at nominal values; and
        ``compare/<problem>``.

    Raises
    ------
    InputError
        If results of a comparison lack what is compared, or its contenders or reference do not agree; each
        contender runs once for it before the first analysis.
    StoreError
        If the folder cannot be written, or what is to be kept in it was made in another way.
    """
    folder = Path(out)
    _check_writable(folder)
    before = earlier(study, folder) if resume else Earlier()
    problems = [problem.rehearsed(n_jobs) for problem in study.problems]
    for name, why in before.dropped.items():
        say(f"{name}: dropped from {folder / RESULTS_NAME}, {why}")
    old = [] if resume else [one.store(folder) for one in problems]
    names = ["/", *(one.name for one in study.analyses), *(one.group for one in problems)]
    results = _Results(folder, names, _root(study) | before.comparisons, old)
    if before.analyses:
        results.add({key: own for groups in before.analyses.values() for key, own in groups.items()})
    for i, analysis in enumerate(study.analyses):
        if analysis.name in before.analyses:
            results.add(_at_nominal(analysis, study.report, n_jobs, before.analyses[analysis.name]))
            say(f"{analysis.name}: kept, complete in {folder}")
            continue
        results.add(_analysed(analysis, study, i, folder, n_jobs, progress, say))
    results.give_way()
    for problem in problems:
        found = problem.run(
            study.seed,
            folder,
            n_jobs=n_jobs,
            resume=resume,
            progress=progress,
            say=_about(problem.group, say),
        )
        results.add({problem.group: found})
        say(
            f"{problem.group}: complete, {problem.evaluations:,} evaluations, "
            f"runs of {float(found['seconds'].sum()):.1f} s in all"
        )
    return results.tree()


@dataclass
class _Results:
    """Results in memory and in the file; what is old gives way to the first ones, and not before."""

    folder: Path
    names: list[str]
    groups: Groups
    old: list[Path]
    begun: bool = False

    def add(self, found: Groups) -> None:
        replaced = not self.groups.keys().isdisjoint(found)
        self.groups |= found
        if not self.begun or replaced:
            self._save()
            self.begun = True
            self.give_way()
        elif found:
            add_results(found, self.folder / RESULTS_NAME)

    def give_way(self) -> None:
        """Remove runs of comparisons that belong to older results."""
        for file in self.old:
            try:
                file.unlink(missing_ok=True)
            except OSError as error:
                raise StoreError(f"cannot remove {file}: {error.strerror}") from error
        self.old = []

    def tree(self) -> xr.DataTree:
        """Return all results in the order of the study, and have the file in that order too."""
        if list(self.groups) != self._order():
            self._save()
        return xr.DataTree.from_dict(self.groups)

    def _order(self) -> list[str]:
        names = self.names
        return sorted(self.groups, key=lambda key: names.index(key if key in names else key.split("/")[0]))

    def _save(self) -> None:
        self.groups = {key: self.groups[key] for key in self._order()}
        save_results(xr.DataTree.from_dict(self.groups), self.folder / RESULTS_NAME)


def _root(study: Study) -> Groups:
    """Return the root of the results: what they are of."""
    attrs = {
        "hipuq_version": __version__,
        "study": study.name,
        "title": study.title,
        "description": study.description,
        "seed": study.seed,
        "report": study.report.model_dump_json(),
        "study_file": study.text,
        DEFINITIONS: json.dumps(definitions(study)),
    }
    return {"/": xr.Dataset(attrs=attrs)}


def _analysed(
    analysis: Analysis,
    study: Study,
    place: int,
    folder: Path,
    n_jobs: int | None,
    progress: bool | None,
    say: Callable[[str], None],
) -> Groups:
    """Return the results of an analysis; its outcomes are written."""
    method = method_named(analysis.method)
    outcomes = completed(
        analysis.model,
        analysis.inputs,
        method,
        analysis.n,
        analysis_seed(study, place),
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
    open_ = int((outcomes["status"] == schema.STATUS["undecided"]).sum())
    say(
        f"{analysis.name}: {outcomes.sizes['sample']:,} evaluations of {analysis.model.label} in "
        f"{outcomes.attrs['seconds']:.1f} s, {open_:,} undecided"
    )
    return found | _at_nominal(analysis, study.report, n_jobs, {})


def _at_nominal(analysis: Analysis, report: ReportTable, n_jobs: int | None, before: Groups) -> Groups:
    """Return what the report shows at nominal values, but for what is there already."""
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


def _about(group: str, say: Callable[[str], None]) -> Callable[[str], None]:
    return lambda line: say(f"{group}: {line}")


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
