"""What contenders cost: time against evaluations saved, where one would pay, and what is said of it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from hipuq.report.compared import (
    Array,
    Flags,
    at_budgets,
    baseline_of,
    budgets_of,
    evaluation_seconds,
    names_of,
    other_model,
    span,
    values,
)
from hipuq.report.comparison_winner import NOTHING
from hipuq.report.table import (
    BEYOND,
    MISSING,
    NEVER,
    Table,
    count,
    duration,
    factor,
    sentence,
)

ALIKE = 1.25
"""Ratio of times up to which they are about the same, as they are where the limits of the ratio hold 1."""

UNTOLD, FROM_NONE = "not told apart", "from saving none"
"""What is said where replicates do not tell whether any evaluations are saved."""

PLAIN = -0.5
"""Slope of log error over log evaluations that the baseline's errors are taken to have."""


def cost_table(race: xr.Dataset) -> Table:
    """Return time, the baseline's evaluations for the same error, and where a contender would pay."""
    baseline = baseline_of(race)
    spent, model = values(race, "run_time"), values(race, "model_time")
    one = evaluation_seconds(race)
    ratio, used = values(race, "cost_ratio"), values(race, "evaluations")
    rows = []
    for i, name in enumerate(names_of(race)):
        for j in np.flatnonzero(used[i] > 0):
            against = [NOTHING] * 3
            if name != baseline:
                against = [_needed(race, i, int(j)), factor(ratio[i, j]), _pays(race, i, int(j))]
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
        "pays where one evaluation takes longer than",
    ]
    note = (
        f"Times are medians over the replicates. {sentence(baseline)} is taken to have the same error with "
        f"so many evaluations as its error falls as n^-1/2: {_law(race)}. Below 1 a contender takes less "
        "time than that. One evaluation is that of the largest run"
    )
    return Table("What it costs", columns, rows, note)


def _law(race: xr.Dataset) -> str:
    """Return whether the errors of the baseline fall as they are taken to."""
    own = race.isel(method=names_of(race).index(baseline_of(race)))
    rate, low, high = (float(own[f"rate{end}"]) for end in ("", "_low", "_high"))
    if np.isnan(rate):
        return "that law is not checked here"
    said = f"its own errors fall as n^{rate:.2f} ({low:.2f} to {high:.2f})"
    return said if low <= PLAIN <= high else f"{said}, so that evaluations for the same error are only rough"


def _needed(race: xr.Dataset, i: int, j: int) -> str:
    """Return the evaluations that the baseline would need, with limits."""
    same, low, high = (values(race, f"baseline_evaluations{end}")[i, j] for end in ("", "_low", "_high"))
    if not low < high or low > BEYOND:
        return count(same)
    return f"{count(same)}\n{count(low)} {f'to {count(high)}' if np.isfinite(high) else 'or more'}"


def _saving(race: xr.Dataset) -> tuple[Flags, Flags]:
    """Return which contenders surely save evaluations, and which surely save none, (m, b)."""
    used = values(race, "evaluations")
    same, low, high = (values(race, f"baseline_evaluations{end}") for end in ("", "_low", "_high"))
    return (low > used) & (same > used), (high < used) & (same < used)


def _pays(race: xr.Dataset, i: int, j: int) -> str:
    """Return the time of one evaluation from which on a contender pays, where it surely does from some."""
    value = values(race, "break_even")[i, j]
    if np.isnan(value):
        return "other model" if other_model(race, i) else MISSING
    saves, never = (flags[i, j] for flags in _saving(race))
    if never:
        return NEVER
    if not saves:
        return f"{UNTOLD}\n{FROM_NONE}"
    return "always" if value <= 0 else duration(value)


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
    """Give each contender but the baseline: its ratios of time, where they are surely less, surely more."""
    parts = (values(race, "cost_ratio", end) for end in ("", "_low", "_high"))
    for name, ratio, low, high in zip(names_of(race), *parts, strict=True):
        if name != baseline_of(race) and np.isfinite(ratio).any():
            less, more = (ratio < 1 / ALIKE) & (high < 1), (ratio > ALIKE) & (low > 1)
            alike = np.isfinite(ratio) & ~less & ~more
            yield (
                name,
                ratio,
                {"less time": less, "about as much": alike, "more time": more},
            )


def _ratios(found: Array) -> str:
    """Return ratios of time, such as ``3 to 40 times``."""
    return f"{span([factor(value) for value in sorted(found)])} times"


def _remedy(race: xr.Dataset, i: int, among: Flags) -> str:
    """Return how slow a model would make it pay; empty where that is not known."""
    even = np.where(among, values(race, "break_even")[i], np.nan)
    if np.isnan(even).all():
        return ": it evaluates another model" if other_model(race, i) else ""
    saves, never = (flags[i] & ~np.isnan(even) for flags in _saving(race))
    if never.sum() == (~np.isnan(even)).sum():
        return ", and would with any model: it saves no evaluations"
    if not saves.any():
        return f": what it saves of evaluations is {UNTOLD} from none"
    j, least = _least(even, saves)
    if least <= 0:
        return ""
    here = duration(evaluation_seconds(race)[i, j])
    at = f"at {budgets_of(race)[j]:,} evaluations " if among.sum() > 1 else ""
    return f": it would pay {at}where one evaluation takes longer than {duration(least)} (here {here})"


def _least(even: Array, saves: Flags) -> tuple[int, float]:
    """Return the budget by number at which a contender pays the soonest, and from which time on."""
    j = int(np.where(saves, even, np.inf).argmin())
    return j, float(even[j])


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
            slow = _slow(race, names_of(race).index(name), more)
            said["more than"].append(f"{name}{slow}")
    parts = [f"{text} {baseline_of(race)}: {', '.join(who)}" for text, who in said.items() if who]
    return f"Time for the same error: {'; '.join(parts)}" if parts else ""


def _slow(race: xr.Dataset, i: int, among: Flags) -> str:
    """Return in brackets whether a slower model would make it pay; empty where that is not known."""
    even = np.where(among, values(race, "break_even")[i], np.nan)
    known = ~np.isnan(even)
    saves, never = (flags[i] & known for flags in _saving(race))
    if not known.any():
        return ""
    if saves.any():
        j, least = _least(even, saves)
        at = f"at {budgets_of(race)[j]:,} evaluations " if known.sum() > 1 else ""
        return f" (pays {at}where one evaluation takes longer than {duration(least)})" if least > 0 else ""
    return " (saves no evaluations)" if never.sum() == known.sum() else f" ({UNTOLD} {FROM_NONE})"
