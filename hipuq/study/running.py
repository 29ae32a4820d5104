"""Run a study: results of an analysis, and of a comparison, are on disk before the next one begins."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import xarray as xr

from hipuq import __version__
from hipuq.errors import InputError, StoreError
from hipuq.evaluation import MAX_FAILED, How
from hipuq.evidence import FIGURES, LITERATURE, literature
from hipuq.models.oscillator_ring import OscillatorRing
from hipuq.store import RESULTS_NAME, add_results, check_ours, save_results, versions
from hipuq.store.lock import locked
from hipuq.study.analysing import Groups, analysed, at_nominal, derived_again, outcomes_of
from hipuq.study.plan import Study
from hipuq.study.resuming import DEFINITIONS, Earlier, analysis_seed, definitions, earlier


def run_study(
    study: Study,
    out: str | os.PathLike[str],
    *,
    resume: bool = False,
    n_jobs: int | None = None,
    executor: Executor | str | Any = None,
    progress: bool | None = None,
    on_error: str = "mark",
    max_failed: float = MAX_FAILED,
    retry_failed: bool = False,
    say: Callable[[str], None] = lambda line: None,
) -> xr.DataTree:
    """Run a study and write its outcomes and results.

    Parameters
    ----------
    study : Study
        As from `load_study`.
    out : path
        Output folder; gets ``outcomes/<analysis>.zarr``, ``compare/<problem>.jsonl`` and ``results.nc``.
    resume : bool, default False
        Whether to go on from what is in the folder: analyses that are complete, outcomes of those that are
        not, and single runs of comparisons are kept, so that the results are those of a run that was not
        cut off; an analysis with a larger n takes the outcomes that are there. Old results of a comparison
        stay in the file until it is complete again.
    n_jobs : int, optional
        Threads or processes; all cores by default.
    executor : str, concurrent.futures.Executor or dask.distributed.Client, optional
        ``"threads"`` (the default), ``"processes"``, or what runs the blocks instead, as in `hipuq.evaluate`.
        Comparisons time their runs, so they take threads here whatever the executor.
    progress : bool, optional
        Whether to show a progress bar; by default on a terminal.
    on_error : str, default "mark"
        ``"mark"`` or ``"raise"``: what becomes of a sample that fails, as in `hipuq.evaluate`.
    max_failed : float, default 0.5
        Share of the samples that may fail before the run ends [1], as in `hipuq.evaluate`.
    retry_failed : bool, default False
        Whether, with `resume`, samples that failed are evaluated again.
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
        If it is no study, an argument cannot be used, results of a comparison lack what is compared, or its
        contenders or reference do not agree; each contender runs once for it before the first analysis.
    ModelError
        If too many samples fail, or one with ``on_error="raise"``.
    StoreError
        If the folder cannot be written, or what is to be kept in it was made in another way.
    """
    if not isinstance(study, Study):
        raise InputError(
            f"study is {type(study).__name__}: it must be one that hipuq.load_study returned; "
            "hipuq.run analyses a model"
        )
    folder = Path(out)
    how = How(n_jobs, executor, progress, on_error=on_error, max_failed=max_failed)
    if resume:
        how = replace(how, store=folder, resume=True, retry_failed=retry_failed)
    elif retry_failed:
        raise InputError("retry_failed needs resume: it is about the failures of an earlier run")
    if resume and _is_cut_off(folder / RESULTS_NAME):
        aside = folder / f"{RESULTS_NAME}.damaged"
        (folder / RESULTS_NAME).replace(aside)
        say(f"{folder / RESULTS_NAME} is cut off: it is now {aside.name}, and made again from the outcomes")
    _check_writable(folder)
    # The lock lies inside: the folder above need not be ours to write to.
    with locked(folder / RUN, folder):
        return _run(study, folder, how, say)


def _run(study: Study, folder: Path, how: How, say: Callable[[str], None]) -> xr.DataTree:
    resume, n_jobs, progress = how.resume, how.n_jobs, how.progress
    before = earlier(study, folder, retry_failed=how.retry_failed) if resume else Earlier()
    problems = [problem.rehearsed(n_jobs) for problem in study.problems]
    for name, why in before.dropped.items():
        say(f"{name}: dropped from {folder / RESULTS_NAME}, {why}")
    old = [] if resume else [one.store(folder) for one in problems]
    # The first analysis replaces its own outcomes.
    old += [] if resume else [outcomes_of(one, folder) for one in study.analyses[1:]]
    names = ["/", LITERATURE, *(one.name for one in study.analyses), *(one.group for one in problems)]
    groups = _root(study) | before.comparisons | _literature(study)
    results = _Results(folder, names, groups, old)
    if before.analyses:
        results.add({key: own for groups in before.analyses.values() for key, own in groups.items()})
    for i, analysis in enumerate(study.analyses):
        if analysis.name in before.analyses:
            there = before.analyses[analysis.name]
            results.add(derived_again(analysis, study.report, folder, there, say))
            results.add(at_nominal(analysis, study.report, n_jobs, there))
            say(f"{analysis.name}: kept, complete in {folder}")
            continue
        seed = analysis_seed(study, i)
        found = analysed(analysis, study.report, seed, folder, how=how, say=say)
        results.add(found | at_nominal(analysis, study.report, n_jobs, {}))
    results.give_way()
    for problem in problems:
        compared = problem.run(
            study.seed,
            folder,
            n_jobs=n_jobs,
            resume=resume,
            progress=progress,
            say=_about(problem.group, say),
        )
        results.add({problem.group: compared})
        say(
            f"{problem.group}: complete, {problem.evaluations:,} evaluations, "
            f"runs of {float(compared['seconds'].sum()):.1f} s in all"
        )
    return results.tree()


SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""First bytes of a file of results."""

RUN = "run"
"""What of an output folder one run at a time has."""


@dataclass
class _Results:
    """Results in memory and in the file; what is old gives way to the first ones, and not before."""

    folder: Path
    names: list[str]
    groups: Groups
    old: list[Path]
    begun: bool = False

    def add(self, found: Groups) -> None:
        found = {key: own for key, own in found.items() if not self._has(key, own)}
        replaced = not self.groups.keys().isdisjoint(found)
        self.groups |= found
        if not self.begun or replaced:
            self._save()
            self.begun = True
            self.give_way()
        elif found:
            add_results(found, self.folder / RESULTS_NAME)

    def _has(self, key: str, own: xr.Dataset) -> bool:
        """Say whether a group is there already and in the file, but for the time at which it was made."""
        there = self.groups.get(key)
        return self.begun and there is not None and there.equals(own) and _attrs(there) == _attrs(own)

    def give_way(self) -> None:
        """Remove runs of comparisons and outcomes that belong to older results."""
        for path in self.old:
            try:
                if path.is_dir():
                    shutil.rmtree(path)
                else:
                    path.unlink(missing_ok=True)
            except OSError as error:
                raise StoreError(f"cannot remove {path}: {error.strerror}") from error
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


def _attrs(group: xr.Dataset) -> dict[str, str]:
    """Return the attributes of a group and its variables as text, without the history."""
    own = {
        f"{name}/{key}": str(value) for name, v in group.variables.items() for key, value in v.attrs.items()
    }
    return own | {str(key): str(value) for key, value in group.attrs.items() if key != "history"}


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
        "headline": study.headline or "",
        "command": f"hipuq run {study.name} --seed {study.seed}",
        "sources": json.dumps({one.name: dict(one.sources) for one in study.analyses}),
        "versions": json.dumps(versions()),
        DEFINITIONS: json.dumps(definitions(study)),
    }
    return {"/": xr.Dataset(attrs=attrs)}


def _literature(study: Study) -> Groups:
    """Return what is published of hips, for models of one."""
    models = [getattr(one.model, "model", one.model) for one in study.analyses]
    if not study.report.literature or not any(isinstance(model, OscillatorRing) for model in models):
        return {}
    return {f"{LITERATURE}/{quantity}": literature(quantity) for quantity in FIGURES}


def _about(group: str, say: Callable[[str], None]) -> Callable[[str], None]:
    return lambda line: say(f"{group}: {line}")


def _is_cut_off(file: Path) -> bool:
    """Say whether a file begins as results do and cannot be read, as after a power cut."""
    try:
        with file.open("rb") as stream:
            if stream.read(len(SIGNATURE)) != SIGNATURE:
                return False
        check_ours(file)
    except StoreError as error:
        return "truncated" in str(error)
    except OSError:
        return False
    return False


def _check_writable(folder: Path) -> None:
    """Raise a StoreError now rather than after the computation."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / RESULTS_NAME).exists():
            check_ours(folder / RESULTS_NAME)
        probe = folder / f".hipuq-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except StoreError:
        raise
    except OSError as error:
        raise StoreError(
            f"cannot write to {folder}: {error.strerror}; choose another folder with --out"
        ) from error
