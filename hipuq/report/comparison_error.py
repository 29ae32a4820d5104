"""How far contenders are from the answer: tables of error and bias, and what is said of them."""

from __future__ import annotations

import numpy as np
import xarray as xr
from scipy.special import ndtr, stdtrit

from hipuq.plots.captions import parameter_label
from hipuq.report.compared import (
    BEST,
    FEWEST,
    NOT_TOLD_APART,
    SIGMAS,
    Array,
    Flags,
    another_model,
    at_budgets,
    budgets_of,
    extras_of,
    marks,
    names_of,
    other_models,
    parts_of,
    rounding_of,
    span,
    undefined,
    values,
)
from hipuq.report.table import MISSING, Table, significant, with_unit


def error_table(race: xr.Dataset, *, brief: bool = False) -> Table:
    """Return the root mean square errors, a row for each contender, a column for each budget.

    Parameters
    ----------
    race : Dataset
        As from `hipuq.compare`.
    brief : bool, default False
        Whether to leave out limits and evaluations.

    Returns
    -------
    Table
        With the rate at which errors fall, where any is known.
    """
    rmse, low, high = (values(race, "rmse", end) for end in ("", "_low", "_high"))
    used, open_, marked = values(race, "evaluations"), undefined(race), marks(race)
    rates = np.isfinite(race["rate"].values).any()
    rows = []
    for i, name in enumerate(names_of(race)):
        cells = []
        for j, budget in enumerate(budgets_of(race)):
            lines = [f"{significant(rmse[i, j])} {marked[i][j]}".strip()]
            if not brief and low[i, j] < high[i, j]:
                lines.append(f"{significant(low[i, j], 2)} to {significant(high[i, j], 2)}")
            if np.isnan(rmse[i, j]) and open_[i, j]:
                lines.append(_open(race, i, j, int(open_[i, j]), brief=brief))
            if not brief and used[i, j] not in (0, budget):
                lines.append(f"{used[i, j]:,.0f} evaluations")
            cells.append("\n".join(lines))
        rows.append([name, *cells, *([_rate(race, i, brief=brief)] if rates else [])])
    columns = ["contender", *(f"{budget:,}" for budget in budgets_of(race)), *(["falls as"] if rates else [])]
    return Table(f"Error: {_errors(race)}, by budget of evaluations", columns, rows, _legend(race, marked))


def _errors(race: xr.Dataset) -> str:
    """Return what errors are, with their unit."""
    text = "root mean square error"
    if parts := parts_of(race):
        text += f" over the {parts}"
    return with_unit(text, race["rmse"])


def _open(race: xr.Dataset, i: int, j: int, count: int, *, brief: bool) -> str:
    """Say in how many replicates there is no estimate."""
    return "undefined" if brief else f"undefined in {count} of {int(race['replicates'][i, j])}"


def _rate(race: xr.Dataset, i: int, *, brief: bool) -> str:
    """Return how the error of a contender falls with evaluations."""
    rate, low, high = (float(race[f"rate{end}"][i]) for end in ("", "_low", "_high"))
    if not np.isfinite(rate):
        return MISSING
    limits = f"\n{low:.2f} to {high:.2f}" if np.isfinite([low, high]).all() and not brief else ""
    return f"n^{rate:.2f}{limits}"


def _legend(race: xr.Dataset, marked: list[list[str]]) -> str:
    """Return what the marks in a table mean, and whose evaluations are not those of the others."""
    seen = {mark for row in marked for mark in row}
    said = {BEST: "the lowest error of a budget", NOT_TOLD_APART: "not told apart from it"}
    parts = [f"{mark} {text}" for mark, text in said.items() if mark in seen]
    others = other_models(race)[:, None] & (values(race, "evaluations") > 0)
    if others.any():
        parts.append(another_model(race, others))
    return "; ".join(parts)


def bias_table(race: xr.Dataset) -> Table:
    """Return mean errors in their standard errors; of several parts that which is the farthest off."""
    far, where, flags, open_ = _standardised(race)
    rows = []
    for i, name in enumerate(names_of(race)):
        cells = []
        for j in range(race.sizes["budget"]):
            text = MISSING if np.isnan(far[i, j]) else f"{far[i, j] + 0.0:+.1f}"
            if np.isinf(far[i, j]):
                text = "each time off"
            if not np.isnan(far[i, j]) and extras_of(race):
                text += f"\n{_label(race, int(where[i, j]))}"
            if flags[i, j]:
                text += "\nbiased?" if open_[i, j] else "\nbiased"
            cells.append(text)
        rows.append([name, *cells])
    title = "Bias: mean error over its standard error, by budget of evaluations"
    if parts := parts_of(race):
        title += f"; of the {parts} that which is farthest off"
    note = f"biased: beyond {_bar(race)} standard errors" if flags.any() else ""
    if (values(race, "replicates").max() < FEWEST) and not note:
        note = f"with fewer than {FEWEST} replicates nobody is called biased"
    if (flags & open_).any():
        note += "; biased?: the limits of the reference hold the mean estimate"
    return Table(title, _columns(race), rows, note)


def bias_words(race: xr.Dataset) -> str:
    """Return who is biased, and where; empty where nobody is seen to be."""
    far, _, flags, open_ = _standardised(race)
    told = np.isfinite(far) | flags
    found = [
        f"{name} {at_budgets(race, sure, told[i])}"
        for i, (name, sure) in enumerate(zip(names_of(race), flags & ~open_, strict=True))
        if sure.any()
    ]
    return f"Biased, as far as the replicates tell: {'; '.join(found)}" if found else ""


def _standardised(race: xr.Dataset) -> tuple[Array, np.ndarray, Flags, Flags]:
    """Return mean error over standard error, the part it is of, whether biased, whether that is open."""
    shape = (race.sizes["method"], race.sizes["budget"], -1)
    extras = extras_of(race)
    bias, error = (
        race[name].transpose("method", "budget", *extras).values.reshape(shape)
        for name in ("bias", "bias_error")
    )
    rounding = rounding_of(race)
    # The same answer each time has no scatter: it is right, or off by more than chance.
    always = np.where(np.isnan(bias), np.nan, np.copysign(np.inf, bias))
    over = np.divide(bias, error, out=always, where=~(error <= rounding))
    over = np.where(np.abs(bias) <= rounding, 0.0, over)
    where = np.where(np.isnan(over), -1.0, np.abs(over)).argmax(axis=2)
    far, off = (np.take_along_axis(part, where[..., None], 2)[..., 0] for part in (over, bias))
    truth, low, high = (race[f"reference{end}"].values.ravel()[where] for end in ("", "_low", "_high"))
    open_ = (low < high) & (low <= truth + off) & (truth + off <= high)
    # The same few events each time are chance, as long as an interval of its own holds the answer.
    chance = np.isinf(far) & np.take_along_axis(_holding(race), where[..., None], 2)[..., 0]
    judged = (values(race, "replicates") >= FEWEST) & ~chance
    return far, where, (np.abs(far) > _bars(race)) & judged, open_


def _holding(race: xr.Dataset) -> Flags:
    """Return whether any interval of a contender holds the reference, (m, b, parts)."""
    runs = (race.sizes["method"], race.sizes["budget"], -1, race.sizes["replicate"])
    low, high = (
        race[end].transpose("method", "budget", *extras_of(race), "replicate").values.reshape(runs)
        for end in ("low", "high")
    )
    answer = race["reference"].values.reshape(-1, 1)
    return np.asarray(((low <= answer) & (answer <= high)).any(axis=3), bool)


def _bars(race: xr.Dataset) -> Array:
    """Return the standard errors beyond which chance does not reach, (m, b).

    As improbable as `SIGMAS` for a normal number, where replicates are few or the farthest of several
    parts is taken.
    """
    freedom = np.maximum(values(race, "replicates") - 1.0, 1.0)
    return np.asarray(-stdtrit(freedom, ndtr(-SIGMAS) / race["reference"].size), np.float64)


def _bar(race: xr.Dataset) -> str:
    """Return the standard errors from which on a mean error is called biased."""
    ran = values(race, "replicates") > 0
    return span([f"{bar:.1f}" for bar in sorted(_bars(race)[ran])])


def _label(race: xr.Dataset, part: int) -> str:
    """Return the name of one of the numbers that the quantity is."""
    extras = extras_of(race)
    places = np.unravel_index(part, [race.sizes[dim] for dim in extras])
    named = {dim: str(race[dim].values[i]) for dim, i in zip(extras, places, strict=True)}
    return ", ".join(
        parameter_label(value) if dim == "parameter" else f"{dim} {value}" for dim, value in named.items()
    )


def _columns(race: xr.Dataset) -> list[str]:
    return ["contender", *(f"{budget:,}" for budget in budgets_of(race))]
