"""What the headline stands on: inputs, fixed values, limits of the model, how to repeat it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.distributions import regimes, sources
from hipuq.distributions.words import LAMBDA_RATIO
from hipuq.report.block import Block
from hipuq.report.damping import differences, preset_of, value_text
from hipuq.report.partners import case_of
from hipuq.report.reading import Reading, model_options, nominal_of
from hipuq.report.summary import inputs_table, integrated
from hipuq.report.table import Table, sentence, share

INPUTS_TITLE, LIMITS_TITLE, REPEAT_TITLE = "Inputs", "Limits of the model", "How to repeat this"


INPUT_CELLS = 5
"""Cells of a row of inputs before that of the source."""


def inputs(reading: Reading) -> Block:
    """Return the uncertain inputs of the headline with their sources, and the values that are fixed.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
        Empty without a headline: the inputs of an analysis stand with it.
    """
    results, analysis = reading.results, reading.analysis
    if results is None or analysis is None:
        return Block("inputs", INPUTS_TITLE)
    tables = [*drawn_tables(reading, analysis, results), fixed_table(reading, results)]
    others = [
        name
        for name, groups in reading.found.items()
        if any(_inputs(one) != _inputs(results) for one in groups.values() if "of" in one.attrs)
    ]
    lines = [f"Those of the headline's analysis, {analysis!r}"]
    if others:
        lines.append(f"Other inputs have {', '.join(others)}: see there")
    return Block("inputs", INPUTS_TITLE, lines, text=[table for table in tables if table.rows])


def drawn_tables(reading: Reading, analysis: str, results: xr.Dataset) -> list[Table]:
    """Return the uncertain inputs of an analysis with their sources, and the regimes of those that have any.

    Parameters
    ----------
    reading : Reading
    analysis : str
    results : Dataset
        Those of the analysis.
    """
    told = dict(json.loads(reading.tree.attrs.get("sources") or "{}").get(analysis, {}))
    for name in _mixtures(results):
        told.setdefault(name, "see below")
    return [inputs_table(results, told), *regime_tables(results)]


def differing(reading: Reading, analysis: str, results: xr.Dataset) -> tuple[list[Table], str]:
    """Return the inputs of an analysis that are not those of the headline, and a sentence on the others.

    Parameters
    ----------
    reading : Reading
    analysis : str
    results : Dataset
        Those of the analysis.

    Returns
    -------
    tables : list of Table
        All inputs where there is no headline; none where they are those of the headline.
    told : str
        Empty where there is no headline.
    """
    first, *mixed = drawn_tables(reading, analysis, results)
    head = reading.results
    if head is None:
        return [first, *mixed], ""
    known = {row[0]: row[:INPUT_CELLS] for row in inputs_table(head).rows}
    rows = [row for row in first.rows if row[:INPUT_CELLS] != known.get(row[0])]
    gone = [name for name in known if name not in {row[0] for row in first.rows}]
    others = len(first.rows) - len(rows)
    lines = [f"Not drawn here: {', '.join(gone)}"] if gone else []
    if others:
        text = f"the {'other ' if rows else ''}uncertain inputs are those of the headline"
        lines.append(text if lines else sentence(text))
    titles = {_regimes_title(row[0]) for row in rows}
    own = replace(first, title="Uncertain inputs that are not those of the headline", rows=rows)
    return [own, *(table for table in mixed if table.title in titles)], "; ".join(lines)


def _regimes_title(name: str) -> str:
    return f"Regimes of {name.replace('_', ' ')}"


def _mixtures(results: xr.Dataset) -> dict[str, Mapping[str, Any]]:
    """Return the inputs that are mixtures of named regimes, with their descriptions."""
    drawn = json.loads(results.attrs.get("inputs") or "{}")
    found = {name: entry["distribution"] for name, entry in drawn.items() if "distribution" in entry}
    found |= dict(integrated(results))
    return {name: one for name, one in found.items() if regimes(one)}


def regime_tables(results: xr.Dataset) -> list[Table]:
    """Return the regimes that are drawn of inputs that are mixtures of named ones, with their sources."""
    made = []
    for name, description in _mixtures(results).items():
        drawn = [one for one in regimes(description) if one.weight > 0]
        rows = [[one.name, share(one.weight, 3), one.distribution, one.source] for one in drawn]
        ratio = sources(description).get(LAMBDA_RATIO, "")
        note = f"Probabilities of the regimes from the {LAMBDA_RATIO}, {ratio}" if ratio else ""
        columns = ["regime", "probability", "distribution", "source"]
        made.append(Table(_regimes_title(name), columns, rows, note))
    return made


def _inputs(results: xr.Dataset) -> tuple[object, object]:
    drawn, _, friction = (*case_of(results), None)[:3]
    return drawn, friction


def fixed_table(reading: Reading, results: xr.Dataset) -> Table:
    """Return the nominal values of the model: what no input replaces, with the unit and where it is from."""
    drawn = json.loads(results.attrs.get("inputs") or "{}")
    own, preset = set(differences(results)), str(model_options(results).get("preset", ""))
    known = preset_of(results) is not None
    rows = []
    for name, value in nominal_of(results).items():
        entry = drawn.get(name)
        if name in integrated(results) or (entry and entry["how"] not in ("relative", "shift")):
            continue
        variable = schema.PARAMETERS.get(name)
        meaning, unit = (variable.long_name, variable.units) if variable else (name, "")
        source = "the study" if name in own else f"preset {preset}" if known else ""
        role = "nominal value of the input above" if entry else "fixed"
        if name in results.coords and not results[name].ndim:
            value, role, source = float(results[name]), "swept; the value of the headline", "the study"
        if not entry and name in own:
            role = "fixed, changed from the preset"
        text = value_text(name, value)
        size = np.size(value)
        rows.append([name, meaning, text, unit, f"{size} elements, {role}" if size > 1 else role, source])
    return Table(
        "Nominal and fixed values", ["parameter", "meaning", "value", "unit", "role", "source"], rows
    )


def limits(reading: Reading) -> Block:
    """Return what the model cannot tell, as it says itself.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
        Empty where the model is not one of hipuq's.
    """
    results = reading.results
    if results is None:
        results = next(
            (one for groups in reading.found.values() for one in groups.values() if "of" in one.attrs), None
        )
    model = None if results is None else preset_of(results)
    return Block("limits", LIMITS_TITLE, items=[] if model is None else list(model.limits))


def repeat(reading: Reading) -> Block:
    """Return versions, seeds, options and the command that gives the same again.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
    """
    attrs = reading.tree.attrs
    study = str(attrs["study"])
    command = str(attrs.get("command") or f"hipuq run {study} --seed {attrs['seed']}")
    versions = {"hipuq": str(attrs["hipuq_version"])} | json.loads(attrs.get("versions") or "{}")
    rows = [
        ["command", command],
        ["seed of the study", str(attrs["seed"])],
        ["versions", ", ".join(f"{name} {version}" for name, version in versions.items())],
    ]
    if reading.results is not None:
        results = reading.results
        rows.append([f"seed of {reading.analysis}", str(results.attrs.get("seed", ""))])
        for stage, given in json.loads(results.attrs.get("options") or "{}").items():
            if isinstance(given, dict) and stage not in ("model", "over"):
                rows.append([f"{stage} of {reading.analysis}", _options(given)])
        kept = ("preset", "growth_threshold", "certify", "oscillators")
        chosen = {key: value for key, value in model_options(results).items() if key in kept}
        if chosen:
            rows.append([f"model of {reading.analysis}", _options(chosen)])
    line = f"Save the study file at the end of this page as {study}/study.toml and run the command"
    return Block(
        "repeat", REPEAT_TITLE, [line], text=[Table("Versions, seeds and options", ["what", "value"], rows)]
    )


def _options(given: dict[str, Any]) -> str:
    return ", ".join(
        f"{key} = {value if isinstance(value, str) else json.dumps(value)}" for key, value in given.items()
    )
