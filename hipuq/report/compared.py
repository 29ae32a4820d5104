"""What all tables of a comparison need: its numbers over contender and budget, marks, lists in words."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.comparison.statistics import ROUNDING
from hipuq.report.table import factor, listed

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEVEL = 0.95
"""Level of the intervals of a contender that names none: the default of all methods."""

SIGMAS = 3.0
"""Standard errors beyond which what is seen is no accident: in one of 740 cases, one-sided."""

FEWEST = 10
"""Replicates from which on contenders are accused: with fewer their scatter itself is hardly known."""

BEST, NOT_TOLD_APART = "*", "="
"""Marks of the lowest error of a budget, and of those that cannot be told from it."""


def names_of(race: xr.Dataset) -> list[str]:
    """Return the names of the contenders."""
    return [str(name) for name in race["method"].values]


def budgets_of(race: xr.Dataset) -> list[int]:
    """Return the budgets of evaluations."""
    return [int(budget) for budget in race["budget"].values]


def extras_of(race: xr.Dataset) -> tuple[str, ...]:
    """Return the dims that the quantity has beyond those of all comparisons; none for one number."""
    return tuple(str(dim) for dim in race["reference"].dims)


def parts_of(race: xr.Dataset) -> str:
    """Return how many numbers the quantity is, such as ``6 parameters``; empty for one."""
    extras = extras_of(race)
    return f"{race['reference'].size} {'/'.join(extras)}s" if extras else ""


def rounding_of(race: xr.Dataset) -> float:
    """Return the error up to which an exact method has none."""
    return ROUNDING * (float(np.abs(race["reference"]).max()) or 1.0)


def values(race: xr.Dataset, name: str, end: str = "") -> Array:
    """Return a number of each contender and budget, that over everything where there are several.

    Parameters
    ----------
    race : Dataset
    name : str
        Such as ``"rmse"``.
    end : str
        Such as ``"_low"``.

    Returns
    -------
    (m, b) array
    """
    whole = f"{name}_overall{end}"
    found = race[whole if whole in race else name + end]
    return found.transpose("method", "budget").values.astype(np.float64)


def evaluation_seconds(race: xr.Dataset) -> Array:
    """Return the time of one evaluation of the model [s], (m, b); NaN where there was none.

    It is that of a contender's largest run: small ones take as long as handing over a batch.
    """
    used, spent = values(race, "evaluations"), values(race, "model_time")
    last = np.where(used > 0, np.arange(used.shape[1]), -1).argmax(axis=1)[:, None]
    count, time = (np.take_along_axis(part, last, axis=1) for part in (used, spent))
    one = np.divide(time, count, out=np.full_like(time, np.nan), where=count > 0)
    return np.where(used > 0, one, np.nan)


def undefined(race: xr.Dataset) -> NDArray[np.int64]:
    """Return in how many replicates the estimate, or a part of it, is undefined; (m, b)."""
    open_ = race["estimate"].isnull().any(extras_of(race))
    # The first replicates are those that were run.
    ran = race["replicate"] - race["replicate"][0] < race["replicates"]
    found = (open_ & ran).sum("replicate").transpose("method", "budget").values
    return np.asarray(found, np.int64)


def lowest(race: xr.Dataset, rmse: Array | None = None) -> Flags:
    """Return which contenders have the lowest error of a column; none where there is no rival.

    Parameters
    ----------
    race : Dataset
    rmse : (m, k) array, optional
        Errors; those of the budgets by default. What is rounding is no difference.
    """
    found = values(race, "rmse") if rmse is None else rmse
    known = np.isfinite(found)
    least = np.maximum(np.where(known, found, np.inf).min(axis=0), rounding_of(race))
    flags: Flags = known & (found <= least) & (known.sum(axis=0) > 1)
    return flags


def marks(race: xr.Dataset) -> list[list[str]]:
    """Return `BEST`, `NOT_TOLD_APART` or nothing of each contender and budget."""
    best = lowest(race)
    near = (values(race, "rmse_ratio", "_low") <= 1) & best.any(axis=0) & ~best
    return [
        [BEST if first else NOT_TOLD_APART if close else "" for first, close in zip(*row, strict=True)]
        for row in zip(best, near, strict=True)
    ]


def entries(race: xr.Dataset) -> Mapping[str, Mapping[str, Any]]:
    """Return what is said of each contender: method, model, outcome, options by stage."""
    compared = json.loads(race.attrs.get("options") or "{}").get("compare", {})
    found: Mapping[str, Mapping[str, Any]] = compared.get("contenders", {})
    return found


def level_of(race: xr.Dataset, name: str) -> float:
    """Return the level that the intervals of a contender are stated with."""
    return float(entries(race).get(name, {}).get("estimate", {}).get("confidence", LEVEL))


def baseline_of(race: xr.Dataset) -> str:
    """Return the name of the contender that costs are held against."""
    return str(race.attrs.get("baseline") or names_of(race)[0])


def other_model(race: xr.Dataset, i: int) -> bool:
    """Say whether a contender evaluates another model than the baseline."""
    said = entries(race)
    models = [said.get(name, {}).get("model") for name in (names_of(race)[i], baseline_of(race))]
    return models[0] != models[1]


def other_models(race: xr.Dataset) -> Flags:
    """Return which contenders evaluate another model than the baseline, (m,)."""
    return np.array([other_model(race, i) for i in range(race.sizes["method"])], bool)


def longer(race: xr.Dataset, where: Flags) -> str:
    """Return how much longer an evaluation takes than one of the baseline at the same budget.

    Parameters
    ----------
    race : Dataset
    where : (m, b) array of bool
        Contenders and budgets.

    Returns
    -------
    str
        Such as ``one evaluation takes 14 to 55 times as long``; empty where it is not known.
    """
    one = evaluation_seconds(race)
    own = np.broadcast_to(one[names_of(race).index(baseline_of(race))], one.shape)
    ratio = np.divide(one, own, out=np.full_like(one, np.nan), where=own > 0)[where]
    found = ratio[np.isfinite(ratio)]
    if not found.size:
        return ""
    ends = span([factor(value) for value in (found.min(), found.max())])
    return f"one evaluation takes {ends} times as long"


def another_model(race: xr.Dataset, where: Flags) -> str:
    """Return who evaluates another model than the baseline, and how much longer that takes.

    Parameters
    ----------
    race : Dataset
    where : (m, b) array of bool
        Contenders with another model, one at least, and their budgets.
    """
    who = [name for name, here in zip(names_of(race), where, strict=True) if here.any()]
    said = f"{listed(who)} {'evaluates' if len(who) == 1 else 'evaluate'} another model"
    return ", ".join(filter(None, [said, longer(race, where)]))


def at_budgets(race: xr.Dataset, flags: Flags, among: Flags) -> str:
    """Return at which budgets something holds, such as ``from 256 evaluations on``.

    Parameters
    ----------
    race : Dataset
    flags, among : (b,) array of bool
        Where it holds, one at least, and where it could.
    """
    here, could = np.flatnonzero(flags), np.flatnonzero(among)
    budgets = [f"{budgets_of(race)[j]:,}" for j in here]
    if len(here) > 1 and len(here) == len(could):
        return "at every budget"
    if len(here) > 1 and np.array_equal(here, could[-len(here) :]):
        return f"from {budgets[0]} evaluations on"
    if len(here) > 1 and np.array_equal(here, could[: len(here)]):
        return f"up to {budgets[-1]} evaluations"
    return f"at {listed(budgets)} evaluations"


def span(texts: Sequence[str]) -> str:
    """Return texts in order as their ends, such as ``60 to 75``."""
    return texts[0] if texts[0] == texts[-1] else f"{texts[0]} to {texts[-1]}"
