"""What of an earlier run of a study is kept, and why it cannot be where it cannot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from hipuq import __version__
from hipuq.errors import StoreError
from hipuq.sampling import seed_of
from hipuq.store import RESULTS_NAME, load_results
from hipuq.study.differences import difference
from hipuq.study.plan import Analysis, Study

DEFINITIONS = "analyses"
"""Root attribute of results: analysis -> what it was computed from, JSON."""

AT_NOMINAL = ("friction_sweep", "mode_shapes")
"""Groups of an analysis that hold what the report shows at nominal values."""

Groups = dict[str, xr.Dataset]


def analysis_seed(study: Study, place: int) -> int:
    """Return the seed of the analysis at a place: one more at the end changes no other."""
    return seed_of(np.random.SeedSequence(study.seed, spawn_key=(place,)))


def definitions(study: Study) -> dict[str, dict[str, Any]]:
    """Return what the results of each analysis follow from, JSON-able: the same gives the same numbers."""
    found = {one.name: _definition(one, analysis_seed(study, i)) for i, one in enumerate(study.analyses)}
    # Lists and tuples, integers and those of numpy: as they come back from a file.
    same: dict[str, dict[str, Any]] = json.loads(json.dumps(found, default=str))
    return same


def _definition(analysis: Analysis, seed: int) -> dict[str, Any]:
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
    }


def kept(study: Study, folder: Path) -> dict[str, Groups]:
    """Return the analyses of an earlier run that are complete.

    Parameters
    ----------
    study : Study
    folder : Path
        Output folder.

    Returns
    -------
    dict
        Analysis -> its groups, named as in the results. What the report shows at nominal values is left
        out if the report has changed. Analyses that are no longer in the study are left out.

    Raises
    ------
    StoreError
        If the results cannot be read, or an analysis in them was made in another way; it says what differs.
    """
    if not (folder / RESULTS_NAME).exists():
        return {}
    tree = load_results(folder)
    try:
        before = json.loads(tree.attrs.get(DEFINITIONS, "{}"))
    except (TypeError, ValueError):
        before = {}
    asked = definitions(study)
    same_report = tree.attrs.get("report") == study.report.model_dump_json()
    found: dict[str, Groups] = {}
    for one in study.analyses:
        if one.name not in tree.children:
            continue
        groups = {
            str(name): node.to_dataset(inherit=False).drop_encoding()
            for name, node in tree.children[one.name].children.items()
        }
        _check_same(one.name, before, asked[one.name], folder)
        if set(one.of) <= set(groups):
            wanted = {*one.of, *(AT_NOMINAL if same_report else ())}
            found[one.name] = {f"{one.name}/{key}": own for key, own in groups.items() if key in wanted}
    return found


def _check_same(name: str, before: Any, asked: dict[str, Any], folder: Path) -> None:
    """Raise a StoreError if an analysis in the folder is not the one that the study asks for."""
    rest = "run without --resume, or choose another folder with --out"
    there = before.get(name) if isinstance(before, dict) else None
    if there is None:
        raise StoreError(f"analysis {name!r} in {folder} does not say how it was made: {rest}")
    found = difference(there, asked)
    if found is not None:
        place, old, new = found
        raise StoreError(
            f"analysis {name!r} in {folder} was made with {place} {old}, the study asks for {new}: {rest}"
        )
