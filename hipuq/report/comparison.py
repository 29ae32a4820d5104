"""A comparison of methods in words and tables: what is compared, who wins, at what cost."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from hipuq.methods.base import STAGES
from hipuq.report import comparison_cost as cost
from hipuq.report import comparison_error as error
from hipuq.report import comparison_interval as interval
from hipuq.report import comparison_winner as winner
from hipuq.report.compared import (
    BEST,
    at_budgets,
    baseline_of,
    budgets_of,
    entries,
    extras_of,
    lowest,
    names_of,
    parts_of,
    undefined,
    values,
)
from hipuq.report.table import Table, listed, significant, with_unit

OPEN = 0.2
"""Half the width of the reference's limits, over the lowest error, from which on it is said."""


def label(race: xr.Dataset) -> str:
    """Return the title of the problem, if it has one, and its model."""
    return ", ".join(filter(None, [str(race.attrs.get("title", "")), str(race.attrs["model"])]))


def facts(race: xr.Dataset) -> list[str]:
    """Return what is compared with what: quantity, reference, replicates, seed, evaluations in all.

    Parameters
    ----------
    race : Dataset
        As from `hipuq.compare`.

    Returns
    -------
    list of str
        Sentences without a full stop.
    """
    what = str(race["estimate"].attrs.get("long_name", race.attrs.get("quantity", "")))
    parts = f", {parts_of(race)}" if extras_of(race) else ""
    lines = [f"Compared: {what} ({race.attrs['quantity']} of {race.attrs['of']}{parts})", _reference(race)]
    counts, used = values(race, "replicates"), values(race, "evaluations")
    total = f"{(counts * used).sum():,.0f} evaluations in all"
    lines.append(f"{int(counts.max()):,} replicates{_fewer(race)}, seed {race.attrs['seed']}, {total}")
    if "," in (jobs := str(race.attrs.get("jobs", ""))):
        lines.append(f"Timed with {listed(jobs.split(', '))} threads: times are not alike")
    return lines


def _fewer(race: xr.Dataset) -> str:
    """Return who has fewer replicates than the others."""
    counts = values(race, "replicates").max(axis=1)
    few = [f"{name} {int(n):,}" for name, n in zip(names_of(race), counts, strict=True) if n < counts.max()]
    return f" ({', '.join(few)})" if few else ""


def _reference(race: xr.Dataset) -> str:
    """Return what errors are held against, and where its own uncertainty is not small."""
    value, low, high = (np.ravel(race[f"reference{end}"].values) for end in ("", "_low", "_high"))
    text = f"Reference: {reference(race) if value.size == 1 else f'{min(value):.4g} to {max(value):.4g}'}"
    text += "" if (low < high).any() else ", taken as exact"
    if source := str(race.attrs.get("reference_source", "")):
        text += f"; {source}"
    half, least = float(np.max(high - low)) / 2, np.nanmin(values(race, "rmse"), initial=np.inf)
    if 0 < least < np.inf and half > OPEN * least:
        text += (
            f". Half the width of its limits is {significant(half, 2)}, the lowest error "
            f"{significant(least, 2)}: errors as small hold that of the reference too"
        )
    return text


def reference(race: xr.Dataset) -> str:
    """Return a reference that is one number with its limits, if it has some."""
    value, low, high = (float(race[f"reference{end}"]) for end in ("", "_low", "_high"))
    return f"{value:.6g} ({low:.6g} to {high:.6g})" if low < high else f"{value:.6g}"


def remarks(race: xr.Dataset) -> list[str]:
    """Return what the tables say in words: who is biased, whose intervals fail, what pays."""
    return [*_said(race), *cost.cost_words(race)]


def summary(race: xr.Dataset) -> list[str]:
    """Return the same with a line for who wins and one for all costs, where there is little room."""
    return [line for line in [winner.winner_words(race), *_said(race), cost.cost_summary(race)] if line]


def _said(race: xr.Dataset) -> list[str]:
    return [*filter(None, [error.bias_words(race), interval.interval_words(race), _undefined(race)])]


def _undefined(race: xr.Dataset) -> str:
    """Return who has no estimate in some replicates; empty where all have."""
    ran, open_ = values(race, "evaluations") > 0, undefined(race) > 0
    found = [
        f"{name} {at_budgets(race, open_[i], ran[i])}"
        for i, name in enumerate(names_of(race))
        if open_[i].any()
    ]
    return f"Estimates are undefined in some replicates: {'; '.join(found)}" if found else ""


def contender_table(race: xr.Dataset) -> Table:
    """Return what each contender is: method, model where it is another one, outcome, options."""
    said = entries(race)
    models = {name: str(entry.get("model", "")) for name, entry in said.items()}
    others = any(model != race.attrs.get("model") for model in models.values())
    rows = []
    for name in names_of(race):
        entry = said.get(name, {})
        role = " (baseline)" if name == baseline_of(race) and race.sizes["method"] > 1 else ""
        model = [models.get(name, "")] if others else []
        method, of = (str(entry.get(key, "")) for key in ("method", "of"))
        own = entry.get("quantity")
        what = f"{own} of {of}" if own and own != race.attrs["quantity"] else of
        rows.append([f"{name}{role}", method, *model, what, _options(entry)])
    columns = ["contender", "method", *(["model"] if others else []), "outcome", "options"]
    return Table("Contenders", columns, rows if said else [])


def _options(entry: Mapping[str, Any]) -> str:
    """Return the options of a contender, each once, although several stages may take it."""
    stages = [stage for key, stage in entry.items() if isinstance(stage, dict) and key in STAGES]
    given = {name: value for stage in stages for name, value in stage.items()}
    shown = (value if isinstance(value, str) else json.dumps(value) for value in given.values())
    return ", ".join(f"{name} = {value}" for name, value in zip(given, shown, strict=True))


def parameter_table(race: xr.Dataset) -> Table:
    """Return the error of each parameter at the largest budget that all take; no rows of other quantities."""
    together = np.flatnonzero((values(race, "evaluations") > 0).all(axis=0))
    place = int(together[-1]) if together.size else race.sizes["budget"] - 1
    title = f"Error by parameter at {budgets_of(race)[place]:,} evaluations"
    columns = ["parameter", "reference", *names_of(race)]
    if extras_of(race) != ("parameter",):
        return Table(title, columns, [])
    rmse = race["rmse"].isel(budget=place).transpose("method", "parameter").values
    starred = np.where(lowest(race, rmse), f" {BEST}", "")
    rows = []
    for i, name in enumerate(race["parameter"].values):
        cells = [f"{significant(one)}{star}" for one, star in zip(rmse[:, i], starred[:, i], strict=True)]
        rows.append([str(name), reference(race.isel(parameter=i)), *cells])
    rivals = f"{BEST} the lowest error of a parameter" if race.sizes["method"] > 1 else ""
    return Table(with_unit(title, race["rmse"]), columns, rows, rivals)


def tables(race: xr.Dataset) -> list[Table]:
    """Return the tables of errors, intervals and costs that have rows."""
    made = [
        error.error_table(race),
        parameter_table(race),
        error.bias_table(race),
        interval.interval_table(race),
        winner.winner_table(race),
        winner.time_table(race),
        cost.cost_table(race),
    ]
    return [table for table in made if table.rows]
