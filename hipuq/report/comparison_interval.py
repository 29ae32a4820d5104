"""Whether the intervals of contenders hold what they state: a table, and what is said of it."""

from __future__ import annotations

import numpy as np
import xarray as xr
from scipy.special import bdtr, ndtr

from hipuq.report.compared import (
    FEWEST,
    SIGMAS,
    Flags,
    at_budgets,
    budgets_of,
    level_of,
    names_of,
    span,
    values,
)
from hipuq.report.table import MISSING, Table, listed, percent

NARROW = 1.6
"""Shares of misses, over the stated one, above which intervals are called too narrow: 8 % for 5 %."""

WIDE = 0.4
"""Shares of misses, over the stated one, below which intervals are called conservative: 2 % for 5 %."""

WHOLE = 1e-9
"""Hits by which a share times its trials may miss a whole number."""


def interval_table(race: xr.Dataset) -> Table:
    """Return how many intervals hold the reference, with limits; no rows where no contender has any."""
    share, low, high = (values(race, "coverage", end) for end in ("", "_low", "_high"))
    n, part = values(race, "intervals"), _in_part(race)
    levels = {level_of(race, name) for name in names_of(race)}
    rows = []
    for i, name in enumerate(names_of(race)):
        cells = []
        for j in range(race.sizes["budget"]):
            lines = [percent(share[i, j])]
            if lines != [MISSING]:
                lines.append(f"{100 * low[i, j]:.1f} to {100 * high[i, j]:.1f}")
            if part[i, j] and n[i, j] > 0:
                lines.append(f"of {n[i, j]:,.0f}")
            cells.append("\n".join(lines))
        label = name if len(levels) == 1 else f"{name} ({100 * level_of(race, name):g}\u00a0%)"
        rows.append([label, *cells])
    stated = f" (stated: {100 * levels.pop():g} %)" if len(levels) == 1 else " (stated: in brackets)"
    title = f"Intervals: share that holds the reference{stated}, by budget of evaluations"
    notes = ["of so many: the other runs give no interval"] if (part & (n > 0)).any() else []
    if not _judged(race).any():
        notes.append(f"with fewer than {FEWEST} intervals none are called too narrow or conservative")
    columns = ["contender", *(f"{budget:,}" for budget in budgets_of(race))]
    return Table(title, columns, rows if np.isfinite(share).any() else [], "; ".join(notes))


def interval_words(race: xr.Dataset) -> str:
    """Return whose intervals are too narrow, whose conservative, who gives none, where it is no accident."""
    share, part = values(race, "coverage"), _in_part(race)
    told, ran = np.isfinite(share), values(race, "evaluations") > 0
    if not told.any():
        return "Intervals: no contender gives any"
    said: dict[str, list[str]] = {}
    for text, flags in zip(("too narrow", "conservative"), _off(race), strict=True):
        for i in np.flatnonzero(flags.any(axis=1)):
            name = names_of(race)[i]
            found = span([f"{100 * value:.0f}" for value in sorted(share[i, flags[i]])])
            where = at_budgets(race, flags[i], told[i])
            stated = f"stated {100 * level_of(race, name):g} %"
            said.setdefault(text, []).append(f"{name} {where} ({found} %, {stated})")
    parts = [f"{text}: {', '.join(who)}" for text, who in said.items()]
    if not parts:
        parts = [
            "are not seen to be too narrow or conservative"
            if _judged(race).any()
            else f"are not judged from fewer than {FEWEST} runs"
        ]
    none = [name for i, name in enumerate(names_of(race)) if ran[i].any() and not told[i].any()]
    if none:
        parts.append(f"{listed(none)} {'gives' if len(none) == 1 else 'give'} none")
    if part.any():
        some = [_some(race, int(i), part[i], told[i]) for i in np.flatnonzero(part.any(axis=1))]
        parts.append(f"only part of the runs give one: {', '.join(some)}")
    return f"Intervals {'; '.join(parts)}"


def _in_part(race: xr.Dataset) -> Flags:
    """Return where some runs give an interval and others do not, (m, b)."""
    some = np.isfinite(values(race, "coverage"))
    return np.asarray(some & (values(race, "intervals") < values(race, "replicates")), bool)


def _some(race: xr.Dataset, i: int, flags: Flags, told: Flags) -> str:
    """Return in how many runs a contender gives an interval, and at which budgets not in all."""
    counts = sorted(values(race, "intervals")[i, flags])
    runs = sorted(values(race, "replicates")[i, flags])
    found = f"{span([f'{n:,.0f}' for n in counts])} of {span([f'{n:,.0f}' for n in runs])}"
    return f"{names_of(race)[i]} {at_budgets(race, flags, told)} ({found})"


def _judged(race: xr.Dataset) -> Flags:
    """Return which intervals are judged, (m, b)."""
    told = np.isfinite(values(race, "coverage"))
    return np.asarray(told & (values(race, "intervals") >= FEWEST), bool)


def _off(race: xr.Dataset) -> tuple[Flags, Flags]:
    """Return which intervals are too narrow, and which conservative, (m, b).

    So many hits, or so few, must be as improbable as `SIGMAS` for a normal number, over all that are
    judged, and the share must be off by `NARROW` or `WIDE`. Results of one run hang together: a run is
    one trial.
    """
    judged = _judged(race)
    level = np.array([[level_of(race, name)] for name in names_of(race)])
    share = np.where(judged, values(race, "coverage"), level)
    n = np.where(judged, values(race, "intervals"), 1.0).astype(np.int64)
    bar = ndtr(-SIGMAS) / max(int(judged.sum()), 1)
    few = bdtr(np.ceil(share * n - WHOLE), n, level) < bar
    many = bdtr(np.ceil((1 - share) * n - WHOLE), n, 1 - level) < bar
    narrow = judged & few & (1 - share > NARROW * (1 - level))
    wide = judged & many & (1 - share < WIDE * (1 - level))
    return narrow, wide
