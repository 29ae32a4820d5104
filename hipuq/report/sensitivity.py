"""Sobol indices in words and tables, of a Sobol design as of a polynomial chaos."""

from __future__ import annotations

from collections.abc import Hashable, Mapping

import numpy as np
import xarray as xr

from hipuq.plots.captions import outcome_of, parameter_label
from hipuq.report import surrogate
from hipuq.report.table import (
    MISSING,
    Table,
    listed,
    mode_label,
    number,
    sentence,
    share,
    with_limits,
    with_unit,
)

DECIMALS = 3
"""Decimals of an index."""

PAIRS = 10
"""Pairs of parameters told, those with the largest second-order indices."""

WIDE = 0.3
"""Width of the interval of a total-order index above which it says nothing in words."""

RIVALS = 3
"""Parameters named that cannot be told from the first."""

SMALL = 0.005
"""A share of the variance below this is none in words."""

SAMPLES = ("base_samples", "dropped", "events", "non_events", "mean", "variance")
"""What is told of the samples of a Sobol design."""

NOTES = {
    "sobol": "Intervals are {confidence} percentile limits of a bootstrap over base points; a failed or "
    "unknown sample drops the whole base point that it belongs to.",
    "chaos": "Intervals are {confidence} limits from true evaluations that the expansion was not fitted "
    "to; what the surrogate says alone, indices and quantiles included, has none.",
}
"""What intervals mean, by method."""


def has_indices(results: xr.Dataset) -> bool:
    """Say whether there are Sobol indices of parameters."""
    return "S1" in results and "ST" in results and "parameter" in results["ST"].dims


def note(results: xr.Dataset) -> str:
    """Return what the intervals of a method with indices mean; empty for others."""
    text = NOTES.get(str(results.attrs.get("method")), "") if has_indices(results) else ""
    return text.format(confidence=f"{float(results.attrs.get('confidence', np.nan)):.0%}")


def headline(results: xr.Dataset) -> str:
    """Return the corrected estimate of a surrogate, else the indices in words; empty if there is neither."""
    return surrogate.headline(results) or in_words(results)


def in_words(results: xr.Dataset) -> str:
    """Return in one line which parameter explains most of the variance, as far as limits tell.

    Parameters
    ----------
    results : Dataset
        Indices over the parameters alone; there are no words for others.

    Returns
    -------
    str
        Empty where all indices are undefined, or those of a surrogate that is not to be trusted: its
        variance is not that of the outcome. Where the interval of the largest total-order index is wider
        than `WIDE` it says that instead; where others overlap it, they are named.
    """
    first, total = results["S1"], results["ST"]
    if total.ndim != 1 or bool((first.isnull() | total.isnull()).all()) or surrogate.distrust(results):
        return ""
    top = int(total.where(first.notnull()).argmax("parameter"))
    one = results.isel(parameter=top)
    name = parameter_label(str(one["parameter"].item()))
    text = f"{sentence(_subject(results))}: "
    if "ST_low" in results and float(one["ST_high"] - one["ST_low"]) > WIDE:
        ends = " and ".join(share(float(one[f"ST_{end}"]), 2) for end in ("low", "high"))
        text += f"the indices are not resolved: the total-order index of {name} lies between {ends}; "
        return text + "more samples are needed"
    negative = (results["S1_high"] < 0).values if "S1_high" in results else np.zeros(total.size, bool)
    if negative[top]:
        text += f"{name} explains {_percent(one, 'ST')} of the variance with its interactions"
    else:
        text += f"{name} explains {_percent(one, 'S1')} of the variance alone, "
        text += f"{_percent(one, 'ST')} with its interactions"
    text += _rivals(results, top)
    # Shares cannot be negative, nor less together than one of them: such estimates are too rough to add up.
    if total.size > 1 and float(first.sum(skipna=False)) >= float(first.max()) and not negative.any():
        together = results[["S1"]].sum("parameter")
        text += f"; the {total.size} parameters alone explain {_percent(together, 'S1')} together"
    return text


def _rivals(results: xr.Dataset, top: int) -> str:
    """Return which parameters may have a larger total-order index than that of `top`."""
    if "ST_low" not in results:
        return ""
    overlap = (results["ST_high"] >= results["ST_low"][top]).values
    overlap[top] = False
    names = [parameter_label(str(name)) for name in results["parameter"].values[overlap]]
    if not names:
        return ""
    told = names if len(names) <= RIVALS else [*names[: RIVALS - 1], f"{len(names) - RIVALS + 1} others"]
    are = "that" if len(names) == 1 else "those"
    return f", which is not certain to be the most: the interval overlaps {are} of {listed(told)}"


def _subject(results: xr.Dataset) -> str:
    """Return what indices are of."""
    outcome = outcome_of(results["ST"])
    return f"the surrogate of {outcome}" if surrogate.is_surrogate(results) else outcome


def remarks(results: xr.Dataset) -> list[str]:
    """Return what else has to be said of indices: words, what is undefined, not trusted, left out.

    Parameters
    ----------
    results : Dataset
        Results of any method.

    Returns
    -------
    list of str
        A line each; none without indices.
    """
    if not has_indices(results):
        return []
    lines = [in_words(results)] if surrogate.headline(results) else []
    for what, names in (
        ("indices", ("S1", "ST", "S2")),
        ("limits of indices", ("S1_low", "ST_low", "S2_low")),
    ):
        reasons = dict.fromkeys(results[name].attrs.get("undefined") for name in names if name in results)
        said = [f"Undefined {what}: {reason}" for reason in reasons if reason]
        lines += [line for line in said if line.partition(": ")[2] not in "\n".join(lines)]
    lines += surrogate.distrust(results)
    if "dropped" in results and int(results["dropped"].max()) > 0:
        most = int(results["dropped"].max())
        whole = int((results["dropped"] + results["base_samples"]).max())
        upto = "up to " if results["dropped"].ndim else ""
        lines.append(f"Dropped for a failed or unknown sample: {upto}{most:,} of {whole:,} base points")
    return [line for line in lines if line]


def tables(results: xr.Dataset, mode_names: dict[str, str] | None = None) -> list[Table]:
    """Return the tables of results with indices, the most telling one first.

    Parameters
    ----------
    results : Dataset
        Results of the method ``"sobol"`` or ``"chaos"``.
    mode_names : dict, optional
        Mode -> its name in a publication.

    Returns
    -------
    list of Table
        Indices by parameter, and for an outcome of more dims a row for each element that has some; the
        fit of a surrogate; pairs of parameters; samples.
    """
    dims = "/".join(str(dim) for dim in results["ST"].dims if dim != "parameter")
    places = [(_label(at, results, mode_names), results.sel(at)) for at in _places(results)]
    made = _by_element(dims, places) if dims else [_by_parameter(results)]
    made += surrogate.tables(results, dims, places)
    if not dims and "S2" in results and results.sizes["parameter"] > 1:
        made.append(_pairs(results))
    if "base_samples" in results:
        made.append(_samples(results, dims, places))
    return [table for table in made if table.rows]


def _places(results: xr.Dataset) -> list[dict[Hashable, object]]:
    """Return where each element of the outcome is, such as ``{"mode": 1}``; one empty place of a scalar."""
    dims = [dim for dim in results["ST"].dims if dim != "parameter"]
    return [
        {dim: results[dim].values[i].item() for dim, i in zip(dims, at, strict=True)}
        for at in np.ndindex(*(results.sizes[dim] for dim in dims))
    ]


def _label(at: Mapping[Hashable, object], results: xr.Dataset, names: dict[str, str] | None) -> str:
    """Return the heading of the row of an element."""
    return "/".join(
        mode_label(results, int(str(value)), names) if dim == "mode" else str(value)
        for dim, value in at.items()
    )


def _percent(results: xr.Dataset, name: str) -> str:
    """Return a share of the variance with its limits, where it has some, such as ``42 % (39 to 45 %)``."""
    value, *limits = (float(results[key]) for key in (name, f"{name}_low", f"{name}_high") if key in results)
    text = "none" if value < SMALL else f"{share(100 * value, 0)} %"
    if not limits or np.isnan(limits).any():
        return text
    low, high = (share(100 * end, 0) for end in limits)
    return f"{text} ({low} to {high} %)"


def _title(results: xr.Dataset, name: str) -> str:
    text = sentence(str(results[name].attrs.get("long_name", name)))
    outcome = outcome_of(results[name])
    return f"{text.removesuffix(outcome)}{_subject(results)}" if outcome else text


def _heading(results: xr.Dataset, name: str) -> str:
    return f"{name} (interval)" if f"{name}_low" in results else name


def _by_parameter(results: xr.Dataset) -> Table:
    """Return a row for each parameter, the largest total index first."""
    total = results["ST"].values
    rows = [
        [str(one["parameter"].item()), *(with_limits(one, name, DECIMALS) for name in ("S1", "ST"))]
        for one in (results.isel(parameter=i) for i in np.argsort(-total, kind="stable"))
    ]
    title = f"Sobol indices of {_subject(results)}: alone (S1) and with interactions (ST)"
    return Table(title, ["parameter", *(_heading(results, name) for name in ("S1", "ST"))], rows)


def _by_element(dims: str, places: list[tuple[str, xr.Dataset]]) -> list[Table]:
    """Return indices and then their intervals: a row for each element that has some, a column a parameter."""
    first = places[0][1]
    columns = [dims, *(parameter_label(str(name)) for name in first["parameter"].values)]
    some = [(label, one) for label, one in places if not bool(one["ST"].isnull().all())]
    made = []
    for name in ("ST", "S1"):
        rows = [[label, *(share(float(v), DECIMALS) for v in one[name].values)] for label, one in some]
        made.append(Table(_title(first, name), columns, rows))
    for name in ("ST", "S1") if "ST_low" in first else ():
        rows = []
        for label, one in some:
            ends = (
                [share(float(v), DECIMALS) for v in one[f"{name}_{end}"].values] for end in ("low", "high")
            )
            rows.append([label, *(f"{low} to {high}" for low, high in zip(*ends, strict=True))])
        made.append(Table(f"{_title(first, name)}, interval", columns, rows))
    return made


def _pairs(results: xr.Dataset) -> Table:
    """Return the pairs with the largest second-order indices."""
    names, table = results["parameter"].values, results["S2"].values
    i, j = np.triu_indices(len(names), 1)
    order = np.argsort(-table[i, j], kind="stable")
    rows = []
    for a, b in zip(i[order][:PAIRS], j[order][:PAIRS], strict=True):
        cell = with_limits(results.isel(parameter=a, parameter_2=b), "S2", DECIMALS)
        rows.append([str(names[a]), str(names[b]), cell])
    more = f", the {PAIRS} largest of {len(i)}" if len(i) > PAIRS else ""
    if all(row[-1] == MISSING for row in rows):
        rows = []
    return Table(f"{_title(results, 'S2')}{more}", ["parameter", "with", _heading(results, "S2")], rows)


def _samples(results: xr.Dataset, dims: str, places: list[tuple[str, xr.Dataset]]) -> Table:
    """Return what the indices were estimated from: a row for each thing, or for each element."""
    names = [name for name in SAMPLES if name in results]
    said = {name: with_unit(str(results[name].attrs.get("long_name", name)), results[name]) for name in names}
    if not dims:
        rows = [[text, number(float(results[name]), 6)] for name, text in said.items()]
        return Table("Samples", ["quantity", "value"], rows)
    rows = [[label, *(number(float(one[name]), 6) for name in names)] for label, one in places]
    return Table("Samples", [dims, *said.values()], rows)
