"""Which contender wins: within so many evaluations, within a time, and in words."""

from __future__ import annotations

import numpy as np
import xarray as xr

from hipuq.report.compared import (
    NOT_TOLD_APART,
    Flags,
    another_model,
    baseline_of,
    budgets_of,
    longer,
    lowest,
    marks,
    names_of,
    other_models,
    rounding_of,
    values,
)
from hipuq.report.table import Table, duration, listed, significant, with_unit

NOTHING = "-"
"""What stands where there is nothing to tell."""


def winner_table(race: xr.Dataset) -> Table:
    """Return which contender has the lowest error of each budget; no rows for one contender.

    Budgets are not alike for contenders whose model is another than the baseline's: they are told with
    the time of their evaluations, and next to the best of those with its model.
    """
    rmse, others = values(race, "rmse"), other_models(race)
    columns = ["evaluations", "lowest error", with_unit("error", race["rmse"]), "not told apart from it"]
    if others.any():
        columns.append(f"lowest with the model of {baseline_of(race)}")
    rows = []
    for j, budget in enumerate(budgets_of(race)):
        first, near = winners(race, j)
        if not first.any():
            continue
        who = [listed(_marked(race, found, j)) if found.any() else NOTHING for found in (first, near)]
        row = [f"{budget:,}", who[0], significant(float(np.nanmin(rmse[:, j]))), who[1]]
        if others.any():
            own, close = _with_the_model(race, j)
            least = significant(float(np.nanmin(rmse[own, j], initial=np.inf)))
            told = f"{_either(race, own, close)}\n{least}" if own.any() else NOTHING
            row.append("the same" if (first & ~others).any() else told)
        rows.append(row)
    return Table("Which wins within so many evaluations", columns, rows)


def _marked(race: xr.Dataset, who: Flags, j: int) -> list[str]:
    """Return names, those of another model with the time of their evaluations."""
    others, found = other_models(race), []
    for i in np.flatnonzero(who):
        name = names_of(race)[i]
        if others[i]:
            here = np.zeros(values(race, "rmse").shape, bool)
            here[i, j] = True
            told = longer(race, here).replace(" takes ", " takes\n")
            name += f"\n(another model,\n{told})" if told else "\n(another model)"
        found.append(name)
    return found


def winners(race: xr.Dataset, j: int) -> tuple[Flags, Flags]:
    """Return who has the lowest error of a budget, and who is not told apart from it, (m,)."""
    near = [marked[j] == NOT_TOLD_APART for marked in marks(race)]
    return lowest(race)[:, j], np.array(near, bool)


def _with_the_model(race: xr.Dataset, j: int) -> tuple[Flags, Flags]:
    """Return the same among those who evaluate the model of the baseline."""
    first, near = winners(race, j)
    others = other_models(race)
    if (first & ~others).any():
        return first & ~others, near & ~others
    rmse = values(race, "rmse")[:, j]
    known = np.isfinite(rmse) & ~others
    if not known.any():
        return known, known
    best = int(np.where(known, rmse, np.inf).argmin())
    first = known & (rmse <= max(rmse[best], rounding_of(race)))
    close = [not first[i] and _close(race, (i, j), (best, j)) for i in range(len(rmse))]
    return first, known & np.array(close, bool)


def _close(race: xr.Dataset, one: tuple[int, int], best: tuple[int, int]) -> bool:
    """Say whether the error of a cell is not told apart from a lower one, from the limits of either."""
    rmse, low, high = (values(race, "rmse", end) for end in ("", "_low", "_high"))
    if not rmse[best] > 0 or not low[one] > 0:
        return bool(rmse[one] <= rounding_of(race))
    reach = np.hypot(np.log(rmse[one] / low[one]), np.log(high[best] / rmse[best]))
    return bool(np.log(rmse[one] / rmse[best]) <= reach)


def _either(race: xr.Dataset, first: Flags, near: Flags) -> str:
    """Return who wins, and who may be the one."""
    close = [name for name, here in zip(names_of(race), near, strict=True) if here]
    others = close if len(close) < 2 else [f"{len(close)} others"]
    best = [name for name, here in zip(names_of(race), first, strict=True) if here]
    return " or ".join([listed(best), *others])


def winner_words(race: xr.Dataset) -> str:
    """Return the winner of each budget in one line, with who may be the one; empty for one contender.

    Those who evaluate another model than the baseline are named, with the best of those who do not.
    """
    others = other_models(race)
    found = {j: winners(race, j) for j in range(race.sizes["budget"])}
    found = {j: (first, near) for j, (first, near) in found.items() if first.any()}
    if not found:
        return ""
    parts = [f"Lowest error: {_by_budget(race, found)}"]
    told = np.zeros(values(race, "rmse").shape, bool)
    for j, (first, near) in found.items():
        told[:, j] = (first | near if near.sum() < 2 else first) & others
    if told.any():
        parts.append(another_model(race, told))
    beaten = {j: _with_the_model(race, j) for j, (first, _) in found.items() if (first & others).any()}
    beaten = {j: (first, near) for j, (first, near) in beaten.items() if first.any()}
    if beaten:
        parts.append(f"lowest with the model of {baseline_of(race)}: {_by_budget(race, beaten)}")
    return "; ".join(parts)


def _by_budget(race: xr.Dataset, found: dict[int, tuple[Flags, Flags]]) -> str:
    """Return who wins where, budgets with the same winners as one."""
    where: dict[str, list[str]] = {}
    for j, (first, near) in found.items():
        where.setdefault(_either(race, first, near), []).append(f"{budgets_of(race)[j]:,}")
    if len(where) == 1 and len(found) == race.sizes["budget"] > 1:
        return f"{next(iter(where))} at every budget"
    return f"{', '.join(f'{who} at {listed(at)}' for who, at in where.items())} evaluations"


def time_table(race: xr.Dataset) -> Table:
    """Return which contender has the lowest error within a time, by powers of 10 in the range there is."""
    rmse, spent = values(race, "rmse"), values(race, "run_time")
    known = np.isfinite(rmse) & np.isfinite(spent) & (spent > 0)
    columns = ["time", "lowest error", "evaluations", "time of a run", with_unit("error", race["rmse"])]
    columns.append("not told apart from it")
    title = "Which wins within a time: runs whose median takes no longer"
    if race.sizes["method"] == 1 or not known.any():
        return Table(title, columns, [])
    first, last = (int(np.ceil(np.log10(end))) for end in (spent[known].min(), spent[known].max()))
    rows = []
    for power in range(first, last + 1):
        allowed = np.where(known & (spent <= 10.0**power), rmse, np.inf)
        i, j = np.unravel_index(int(allowed.argmin()), allowed.shape)
        used = f"{values(race, 'evaluations')[i, j]:,.0f}"
        best = int(i), int(j)
        cells = [(k, m) for k, m in np.argwhere(np.isfinite(allowed)).tolist() if k != i]
        near = {k for k, m in cells if _close(race, (k, m), best)}
        close = [name for k, name in enumerate(names_of(race)) if k in near]
        row = [names_of(race)[i], used, duration(spent[i, j]), significant(rmse[i, j])]
        rows.append([duration(10.0**power), *row, listed(close) if close else NOTHING])
    return Table(title, columns, rows)
