"""Results in words and tables: what `hipuq show` prints and the report holds."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from hipuq import schema

MISSING = "n/a"
"""What stands for a number that does not exist."""


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes
    ----------
    title : str
    columns : list of str
        Headings, with units.
    rows : list of list of str
        Cells as they are shown.
    """

    title: str
    columns: list[str]
    rows: list[list[str]]


def analyses(tree: xr.DataTree) -> list[str]:
    """Return the names of the analyses in a results tree, in its order."""
    return [str(name) for name in tree.children]


def estimates(tree: xr.DataTree, analysis: str) -> Iterator[tuple[str, xr.Dataset]]:
    """Give the results of an analysis: the outcome analysed and its Dataset."""
    for of, node in tree[analysis].children.items():
        if "of" in node.attrs:
            yield str(of), schema.check_results(node.to_dataset(inherit=False))


def number(value: float, digits: int = 4) -> str:
    """Return a number as text."""
    return MISSING if np.isnan(value) else f"{value:.{digits}g}"


def share(value: float) -> str:
    """Return a probability as text with four decimals."""
    return MISSING if np.isnan(value) else f"{value:.4f}"


def interval(results: xr.Dataset, key: str) -> str:
    """Return estimate and interval of a scalar, such as ``0.4533 (0.4431 to 0.4636)``."""
    text = share if key.startswith("probability") else number
    middle, low, high = (text(float(results[key + end])) for end in ("", "_low", "_high"))
    return f"{middle} ({low} to {high})"


def headline(results: xr.Dataset) -> str:
    """Return the result of an analysis over everything in one line; empty if there is none."""
    quantity = "probability" if "probability" in results else "mean"
    for key in (f"{quantity}_overall", quantity):
        if key in results and results[key].ndim == 0:
            return f"{results[key].attrs['long_name']}: {interval(results, key)}"
    return ""


def trust(results: xr.Dataset) -> str:
    """Return how many evaluations there were and how many gave no verdict."""
    count = {key: int(results[key]) for key in ("evaluations", "undecided", "failed")}
    share_open = count["undecided"] / count["evaluations"]
    return (
        f"{count['evaluations']:,} evaluations in {number(float(results['seconds']), 3)} s, "
        f"{count['undecided']:,} undecided ({share_open:.2%}), {count['failed']:,} failed"
    )


def tables(results: xr.Dataset, mode_names: dict[str, str] | None = None) -> list[Table]:
    """Return the tables of one result: by group of levels, by mode, or by both.

    Parameters
    ----------
    results : Dataset
        Results of one outcome.
    mode_names : dict, optional
        Mode -> its name in a publication.

    Returns
    -------
    list of Table
    """
    quantity = "probability" if "probability" in results else "mean"
    text = share if quantity == "probability" else number
    per_mode = "mode" in results.dims
    modes: list[int | None] = [*_modes_shown(results, quantity)] if per_mode else [None]
    made = []
    if f"{quantity}_mean" in results:
        group = next(str(d) for d in results[f"{quantity}_mean"].dims if d != "mode")
        heading = results[group].attrs.get("long_name", group)
        columns = [heading, "levels", "mean", "interval of the mean", "minimum", "maximum", "weighted mean"]
        rows = []
        for mode in modes:
            part = results if mode is None else results.sel(mode=mode)
            for value in results[group].values:
                at = part.sel({group: value})
                cells = [
                    f"{quantity}_{end}" for end in ("mean", "mean_low", "mean_high", "min", "max", "weighted")
                ]
                mean, low, high, least, most, weighted = (text(float(at[key])) for key in cells)
                label = [] if mode is None else [mode_label(results, mode, mode_names)]
                size = int((results[_group_coord(results, group)] == value).sum())
                rows.append([*label, str(value), str(size), mean, f"{low} to {high}", least, most, weighted])
        made.append(
            Table(f"{_title(results, quantity)} by {heading}", (["mode"] if per_mode else []) + columns, rows)
        )
    elif per_mode:
        rows = [
            [
                mode_label(results, mode, mode_names),
                *(text(float(results.sel(mode=mode)[quantity + end])) for end in ("", "_low", "_high")),
            ]
            for mode in _modes_shown(results, quantity)
        ]
        made.append(Table(f"{_title(results, quantity)} by mode", ["mode", quantity, "low", "high"], rows))
    return made


def mode_label(results: xr.Dataset, mode: int, names: dict[str, str] | None = None) -> str:
    """Return a mode's number with its pair and its name in a publication."""
    pair = str(results["pair"].sel(mode=mode).item()) if "pair" in results.coords else ""
    published = (names or {}).get(str(mode))
    extra = [f"pair {pair}"] if "-" in pair else []
    extra += [f"published as {published}"] if published else []
    return f"{mode} ({', '.join(extra)})" if extra else str(mode)


def inputs_table(results: xr.Dataset) -> Table:
    """Return the uncertain inputs of a result as a table."""
    rows = []
    for name, entry in json.loads(results.attrs["inputs"]).items():
        known = schema.PARAMETERS.get(name)
        unit = known.units if known else ""
        meaning = known.long_name if known else name
        if entry["how"] == "contact_patterns":
            counts = ", ".join(map(str, entry["in_contact"]))
            weights = "given weights" if "weights" in entry else "each number equally likely"
            drawn = f"all choices of {counts} of {entry['oscillators']}, {weights}"
            how = "pattern"
        else:
            source = entry["distribution"]
            arguments = [*map(str, source.get("args", ()))]
            arguments += [f"{key}={value}" for key, value in source.get("kwargs", {}).items()]
            drawn = source.get("text") or f"{source['name']}({', '.join(arguments)})"
            how = {"absolute": "value", "relative": "nominal * (1 + draw)", "shift": "nominal + draw"}[
                entry["how"]
            ]
            how += f", one draw for each {entry['dims'][0]}" if entry["each"] else ""
        rows.append([name, meaning, unit, how, drawn])
    return Table("Uncertain inputs", ["parameter", "meaning", "unit", "applied as", "distribution"], rows)


def _title(results: xr.Dataset, quantity: str) -> str:
    return str(results[quantity].attrs["long_name"]).capitalize()


def _group_coord(results: xr.Dataset, group: str) -> str:
    """Return the coord over the levels that the group dim sums up."""
    values = set(results[group].values.tolist())
    for name, coord in results.coords.items():
        if coord.ndim == 1 and name not in results.dims and set(np.unique(coord.values).tolist()) == values:
            return str(name)
    return group


def _modes_shown(results: xr.Dataset, quantity: str) -> list[int]:
    """Return the modes that are ever unstable or unknown; all of them for other quantities."""
    modes = [int(mode) for mode in results["mode"].values]
    if quantity != "probability":
        return modes
    dims = [d for d in results[quantity].dims if d != "mode"]
    seen = (results[quantity] > 0).any(dims) | results[quantity].isnull().any(dims)
    return [mode for mode, shown in zip(modes, seen.values, strict=True) if shown]
