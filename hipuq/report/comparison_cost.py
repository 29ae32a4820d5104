"""Which contender wins and what it costs: tables over budgets and over time, and what is said of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from hipuq.report.compared import (
    NOT_TOLD_APART,
    Array,
    Flags,
    at_budgets,
    baseline_of,
    budgets_of,
    entries,
    evaluation_seconds,
    listed,
    lowest,
    marks,
    names_of,
    span,
    values,
)
from hipuq.report.table import (
    MISSING,
    NEVER,
    Table,
    count,
    duration,
    factor,
    sentence,
    significant,
    with_unit,
)

ALIKE = 1.25
"""Ratio of times up to which they are about the same: errors are not known better."""

NOTHING = "-"
"""What stands where there is nothing to tell."""


def winner_table(race: xr.Dataset) -> Table:
    """Return which contender has the lowest error of each budget; no rows for one contender."""
    rmse = values(race, "rmse")
    columns = ["evaluations", "lowest error", with_unit("error", race["rmse"]), "not told apart from it"]
    rows = []
    for j, budget in enumerate(budgets_of(race)):
        first, near = winners(race, j)
        if first:
            error = significant(float(np.nanmin(rmse[:, j])))
            rows.append([f"{budget:,}", listed(first), error, listed(near) if near else NOTHING])
    return Table("Which wins within so many evaluations", columns, rows)


def winners(race: xr.Dataset, j: int) -> tuple[list[str], list[str]]:
    """Return who has the lowest error of a budget, and who is not told apart from it."""
    named = list(zip(names_of(race), lowest(race)[:, j], marks(race), strict=True))
    first = [name for name, best, _ in named if best]
    return first, [name for name, _, marked in named if marked[j] == NOT_TOLD_APART]


def winner_words(race: xr.Dataset) -> str:
    """Return the winner of each budget in one line, with who may be the one; empty for one contender."""
    parts = []
    for j, budget in enumerate(budgets_of(race)):
        first, near = winners(race, j)
        if first:
            others = near if len(near) < 2 else [f"{len(near)} others"]
            parts.append((f"{budget:,}", " or ".join([listed(first), *others])))
    if not parts:
        return ""
    who = [text for _, text in parts]
    if len(parts) == len(budgets_of(race)) > 1 and len(set(who)) == 1:
        return f"Lowest error: {who[0]} at every budget"
    return f"Lowest error: {'; '.join(f'{text} at {budget}' for budget, text in parts)} evaluations"


def time_table(race: xr.Dataset) -> Table:
    """Return which contender has the lowest error within a time, by powers of 10 in the range there is."""
    rmse, spent = values(race, "rmse"), values(race, "run_time")
    known = np.isfinite(rmse) & np.isfinite(spent) & (spent > 0)
    columns = ["time", "lowest error", "evaluations", "time of a run", with_unit("error", race["rmse"])]
    title = "Which wins within a time: runs whose median takes no longer"
    if race.sizes["method"] == 1 or not known.any():
        return Table(title, columns, [])
    first, last = (int(np.ceil(np.log10(end))) for end in (spent[known].min(), spent[known].max()))
    rows = []
    for power in range(first, last + 1):
        allowed = np.where(known & (spent <= 10.0**power), rmse, np.inf)
        i, j = np.unravel_index(int(allowed.argmin()), allowed.shape)
        used = f"{values(race, 'evaluations')[i, j]:,.0f}"
        cells = [names_of(race)[i], used, duration(spent[i, j]), significant(rmse[i, j])]
        rows.append([duration(10.0**power), *cells])
    return Table(title, columns, rows)


def cost_table(race: xr.Dataset) -> Table:
    """Return time, the baseline's evaluations for the same error, and where a contender would pay."""
    baseline = baseline_of(race)
    spent, model = values(race, "run_time"), values(race, "model_time")
    one = evaluation_seconds(race)
    same, ratio = values(race, "baseline_evaluations"), values(race, "cost_ratio")
    used = values(race, "evaluations")
    rows = []
    for i, name in enumerate(names_of(race)):
        for j in np.flatnonzero(used[i] > 0):
            against = [NOTHING] * 3
            if name != baseline:
                against = [count(same[i, j]), factor(ratio[i, j]), _pays(race, i, int(j))]
            times = [duration(spent[i, j]), duration(spent[i, j] - model[i, j]), duration(one[i, j])]
            rows.append([name, f"{used[i, j]:,.0f}", *times, *against])
    columns = [
        "contender",
        "evaluations",
        "time of a run",
        "of it beside the model",
        "one evaluation",
        f"{baseline}: evaluations for the same error",
        f"time over that of {baseline}",
        "pays where one evaluation takes more than",
    ]
    note = (
        f"Times are medians over the replicates. {sentence(baseline)} is taken to have the same error with "
        "so many evaluations as its error falls as n^-1/2; below 1 a contender takes less time than that"
    )
    return Table("What it costs", columns, rows, note)


def _pays(race: xr.Dataset, i: int, j: int) -> str:
    """Return the time of one evaluation from which on a contender pays."""
    value = values(race, "break_even")[i, j]
    if np.isnan(value):
        return "other model" if _other_model(race, i) else MISSING
    return NEVER if np.isinf(value) else "always" if value <= 0 else duration(value)


def _other_model(race: xr.Dataset, i: int) -> bool:
    """Say whether a contender evaluates another model than the baseline."""
    said = entries(race)
    models = [said.get(name, {}).get("model") for name in (names_of(race)[i], baseline_of(race))]
    return models[0] != models[1]


def cost_words(race: xr.Dataset) -> list[str]:
    """Return a sentence for each contender but the baseline: whether it takes less time for the same error.

    Returns
    -------
    list of str
        Without those of whom it is not known.
    """
    lines = []
    for name, ratio, sides in _sides(race):
        known = np.isfinite(ratio)
        if not ratio[known].any():
            lines.append(f"No number of {baseline_of(race)} evaluations reaches the error of {name}")
            continue
        parts = [
            f"{text} {at_budgets(race, flags, known)} ({_ratios(ratio[flags])})"
            for text, flags in sides.items()
            if flags.any()
        ]
        line = f"To reach the same error as {baseline_of(race)}, {name} takes {', '.join(parts)}"
        if sides["more time"].sum() == known.sum():
            line += _remedy(race, names_of(race).index(name), known)
        lines.append(line)
    return lines


def _sides(race: xr.Dataset) -> Iterator[tuple[str, Array, dict[str, Flags]]]:
    """Give each contender but the baseline: its ratios of time, and where they are less, the same, more."""
    for name, ratio in zip(names_of(race), values(race, "cost_ratio"), strict=True):
        if name != baseline_of(race) and np.isfinite(ratio).any():
            less, more = ratio < 1 / ALIKE, np.isfinite(ratio) & (ratio > ALIKE)
            alike = np.isfinite(ratio) & ~less & ~more
            yield name, ratio, {"less time": less, "about as much": alike, "more time": more}


def _ratios(found: Array) -> str:
    """Return ratios of time, such as ``3 to 40 times``."""
    return f"{span([factor(value) for value in sorted(found)])} times"


def _remedy(race: xr.Dataset, i: int, among: Flags) -> str:
    """Return how slow a model would make it pay; empty where that is not known."""
    pays = np.where(among, values(race, "break_even")[i], np.nan)
    if np.isnan(pays).all():
        return ": it evaluates another model" if _other_model(race, i) else ""
    j = int(np.nanargmin(pays))
    if np.isinf(pays[j]):
        return ", and would with any model: it saves no evaluations"
    if pays[j] <= 0:
        return ""
    here = duration(evaluation_seconds(race)[i, j])
    at = f"at {budgets_of(race)[j]:,} evaluations " if among.sum() > 1 else ""
    return f": it would pay {at}where one evaluation takes longer than {duration(pays[j])} (here {here})"


def cost_summary(race: xr.Dataset) -> str:
    """Return in one line who takes less time than the baseline for the same error; empty if unknown."""
    said: dict[str, list[str]] = {"less than": [], "about that of": [], "more than": []}
    for name, ratio, sides in _sides(race):
        less, alike, more = sides.values()
        known = np.isfinite(ratio)
        if less.any():
            said["less than"].append(f"{name} {at_budgets(race, less, known)}")
        elif alike.any():
            said["about that of"].append(f"{name} {at_budgets(race, alike, known)}")
        else:
            pays = np.where(more, values(race, "break_even")[names_of(race).index(name)], np.nan)
            least = float(np.nanmin(pays, initial=np.inf))
            slow = f" (pays from {duration(least)} an evaluation)" if 0 < least < np.inf else ""
            said["more than"].append(f"{name}{slow}")
    parts = [f"{text} {baseline_of(race)}: {', '.join(who)}" for text, who in said.items() if who]
    return f"Time for the same error: {'; '.join(parts)}" if parts else ""
