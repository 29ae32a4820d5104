"""Results in words and tables: what `hipuq show` prints and the report holds."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.distributions import described
from hipuq.errors import SchemaError
from hipuq.evidence import LITERATURE
from hipuq.report import sensitivity
from hipuq.report.table import Table, mode_label, number, sentence, share

SAME = 1e-12
"""Bounds of exact results that are this close to the value say no more than the value."""

STUDY_ATTRS = ("title", "description", "study", "seed", "report", "study_file", "hipuq_version")
"""Attributes that the results of a study have."""

COMPARE = "compare"
"""Group of a results tree that holds the comparisons of methods."""


def analyses(tree: xr.DataTree) -> list[str]:
    """Return the names of the analyses in a results tree, in its order.

    Raises
    ------
    SchemaError
        If it is not that of a study.
    """
    missing = [key for key in STUDY_ATTRS if key not in tree.attrs]
    if missing:
        raise SchemaError(f"these are not the results of a study: the attribute {missing[0]!r} is missing")
    return [str(name) for name in tree.children if name not in (COMPARE, LITERATURE)]


def comparisons(tree: xr.DataTree) -> Iterator[tuple[str, xr.Dataset]]:
    """Give the comparisons of methods: the name of the problem and its Dataset."""
    for problem, node in tree[COMPARE].children.items() if COMPARE in tree.children else ():
        yield str(problem), node.to_dataset(inherit=False)


def estimates(groups: Mapping[str, xr.Dataset]) -> Iterator[tuple[str, xr.Dataset]]:
    """Give the results of an analysis among its groups: the outcome analysed and its Dataset."""
    for of, results in groups.items():
        if "of" in results.attrs and any(name in results for name in ("probability", "mean", "S1")):
            yield of, schema.check_results(results)


def bounded(results: xr.Dataset, key: str) -> bool:
    """Say whether limits tell more than the value: always if sampled, else only where part is unknown."""
    if not schema.is_exact(results):
        return True
    value = results[key].values
    ends = np.array([np.abs(results[f"{key}_{end}"].values - value) for end in ("low", "high")])
    return not bool((ends <= SAME).all())


def interval(results: xr.Dataset, key: str) -> str:
    """Return estimate and limits of a scalar, such as ``0.4533 (0.4431 to 0.4636)``."""
    text = _text(results, key, 8)
    middle, low, high = (text(float(results[key + end])) for end in ("", "_low", "_high"))
    if not bounded(results, key):
        return middle
    return f"{middle} ({'bounds ' if schema.is_exact(results) else ''}{low} to {high})"


def headline(results: xr.Dataset) -> str:
    """Return the result of an analysis over everything in one line; empty if there is none."""
    if sensitivity.has_indices(results):
        return sensitivity.headline(results)
    quantity = "probability" if "probability" in results else "mean"
    for key in (f"{quantity}_overall", quantity):
        if key in results and results[key].ndim == 0:
            return f"{sentence(str(results[key].attrs['long_name']))}: {interval(results, key)}"
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
    """Return the tables of one result, the most telling one first.

    Parameters
    ----------
    results : Dataset
        Results of one outcome.
    mode_names : dict, optional
        Mode -> its name in a publication.

    Returns
    -------
    list of Table
        By group of levels (a column each where there are modes), or by mode, or none; of Sobol indices
        see `hipuq.report.sensitivity`.
    """
    if sensitivity.has_indices(results):
        return sensitivity.tables(results, mode_names)
    quantity = "probability" if "probability" in results else "mean"
    if f"{quantity}_mean" in results:
        if "mode" in results.dims:
            return _by_mode_and_group(results, quantity, mode_names)
        return [group_table(results, quantity)]
    if "mode" in results.dims:
        return [_by_mode(results, quantity, mode_names)]
    return []


def group_table(results: xr.Dataset, quantity: str) -> Table:
    """Return a row for each group of levels."""
    text = _text(results, quantity, 8)
    group = str(results[f"{quantity}_mean"].dims[0])
    limits = bounded(results, f"{quantity}_mean")
    weighted = not _equal(results[f"{quantity}_weighted"], results[f"{quantity}_mean"])
    rows = []
    for value, size in _groups(results, group):
        part = results.sel({group: value})
        ends = ("mean", "mean_low", "mean_high", "min", "max", "weighted")
        mean, low, high, least, most, by_weight = (text(float(part[f"{quantity}_{end}"])) for end in ends)
        between = [f"{low} to {high}"] if limits else []
        rows.append([str(value), str(size), mean, *between, least, most, *([by_weight] if weighted else [])])
    columns = [
        _heading(results, group),
        levels_word(results),
        "mean",
        *([limits_word(results)] if limits else []),
    ]
    columns += ["minimum", "maximum", *(["weighted mean"] if weighted else [])]
    return Table(f"{_title(results, quantity)}; over the {levels_word(results)} of each group", columns, rows)


def _by_mode_and_group(results: xr.Dataset, quantity: str, names: dict[str, str] | None) -> list[Table]:
    """Return mean, range and the limits of the mean, a row for each mode."""
    text = _text(results, quantity, 6)
    group = next(str(dim) for dim in results[f"{quantity}_mean"].dims if dim != "mode")
    groups = _groups(results, group)
    forms = {
        "mean": ("{0}", ("mean",)),
        "minimum to maximum": ("{0} to {1}", ("min", "max")),
        f"{limits_word(results)} of the mean": ("{0} to {1}", ("mean_low", "mean_high")),
    }
    if not bounded(results, f"{quantity}_mean"):
        forms.popitem()
    made = []
    for title, (form, ends) in forms.items():
        rows = []
        for mode in modes_shown(results, quantity):
            at = results.sel(mode=mode)
            cells = [
                form.format(*(text(float(at[f"{quantity}_{end}"].sel({group: value}))) for end in ends))
                for value, _ in groups
            ]
            rows.append([mode_label(results, mode, names), *cells])
        heading = _heading(results, group).removeprefix("oscillators ")
        columns = ["mode", *(f"{value} {heading}" for value, _ in groups)]
        made.append(
            Table(
                f"{_title(results, quantity)}; {title} over the {levels_word(results)} of each group",
                columns,
                rows,
            )
        )
    return made


def _by_mode(results: xr.Dataset, quantity: str, names: dict[str, str] | None) -> Table:
    """Return a row for each mode."""
    text = _text(results, quantity, 6)
    ends = {"": quantity, "_low": "low", "_high": "high"} if bounded(results, quantity) else {"": quantity}
    rows = [
        [
            mode_label(results, mode, names),
            *(text(float(results[quantity + end].sel(mode=mode))) for end in ends),
        ]
        for mode in modes_shown(results, quantity)
    ]
    return Table(f"{_title(results, quantity)} by mode", ["mode", *ends.values()], rows)


def limits_word(results: xr.Dataset) -> str:
    """Return what the limits of results are called in a heading."""
    return "bounds" if schema.is_exact(results) else "interval"


def levels_word(results: xr.Dataset) -> str:
    """Return what the levels that are summed up by group are called."""
    group = str(results.attrs.get("levels_group", ""))
    return "patterns" if group in results.coords and results[group].dims == ("pattern",) else "levels"


def _heading(results: xr.Dataset, group: str) -> str:
    return str(results[group].attrs.get("long_name", group))


def _equal(one: xr.DataArray, other: xr.DataArray) -> bool:
    return bool(np.allclose(one.values, other.values, rtol=SAME, atol=SAME, equal_nan=True))


def _groups(results: xr.Dataset, group: str) -> list[tuple[int, int]]:
    """Return each value of a group dim and how many levels it sums up."""
    coord = results.attrs.get("levels_group", group)
    return [(int(value), int((results[coord] == value).sum())) for value in results[group].values]


def _text(results: xr.Dataset, quantity: str, digits: int) -> Callable[[float], str]:
    """Return what writes a value: a probability with so many decimals if exact, with four if sampled."""
    if not quantity.startswith("probability"):
        return number
    return partial(share, digits=digits if schema.is_exact(results) else 4)


def inputs_table(results: xr.Dataset, sources: Mapping[str, str] | None = None) -> Table:
    """Return the uncertain inputs of a result as a table, with those integrated out of the model.

    Parameters
    ----------
    results : Dataset
    sources : mapping, optional
        Parameter -> where its distribution is from; a column where any is told.
    """
    told = dict(sources or {})
    rows = []
    for name, entry in json.loads(results.attrs["inputs"]).items():
        if entry["how"] == "contact_patterns":
            counts = ", ".join(map(str, entry["in_contact"]))
            weights = "given weights" if "weights" in entry else "each number equally likely"
            drawn = f"all choices of {counts} of {entry['oscillators']}, {weights}"
            how = "every pattern once" if schema.is_exact(results) else "pattern"
        else:
            drawn = distribution_text(entry["distribution"])
            how = {"absolute": "value", "relative": "nominal * (1 + draw)", "shift": "nominal + draw"}[
                entry["how"]
            ]
            how += f", one draw for each {entry['dims'][0]}" if entry["each"] else ""
        rows.append([name, *_meaning(name), how, drawn, told.get(name, "")])
    for name, source in integrated(results).items():
        row = [name, *_meaning(name), "integrated, not sampled", distribution_text(source)]
        rows.insert(0, [*row, told.get(name, "")])
    columns = ["parameter", "meaning", "unit", "applied as", "distribution", "source"]
    if not any(row[-1] for row in rows):
        columns, rows = columns[:-1], [row[:-1] for row in rows]
    return Table("Uncertain inputs", columns, rows)


def integrated(results: xr.Dataset) -> Mapping[str, Mapping[str, Any]]:
    """Return the parameters that the model integrates, with the description of their distribution."""
    model = json.loads(results.attrs.get("options") or "{}").get("model")
    return model.get("integrated", {}) if isinstance(model, dict) else {}


def friction_words(results: xr.Dataset) -> str:
    """Return the distribution of friction, sampled or integrated, in a few words; may be empty."""
    source = integrated(results).get("friction")
    if source is None:
        entry = json.loads(results.attrs.get("inputs") or "{}").get("friction", {})
        source = entry.get("distribution")
    return f"friction {distribution_text(source)}" if source else ""


def _meaning(name: str) -> tuple[str, str]:
    """Return what a parameter means, and its unit."""
    known = schema.PARAMETERS.get(name)
    return (known.long_name, known.units) if known else (name, "")


def distribution_text(source: Mapping[str, Any]) -> str:
    """Return a distribution as text, such as ``Uniform(lower=0.0, upper=0.1)``."""
    return described(source)


def _title(results: xr.Dataset, quantity: str) -> str:
    return str(results[quantity].attrs["long_name"]).capitalize()


def modes_shown(results: xr.Dataset, quantity: str) -> list[int]:
    """Return the modes that are ever unstable or unknown; all of them for other quantities."""
    modes = [int(mode) for mode in results["mode"].values]
    if quantity != "probability":
        return modes
    dims = [d for d in results[quantity].dims if d != "mode"]
    seen = (results[quantity] > 0).any(dims) | results[quantity].isnull().any(dims)
    return [mode for mode, shown in zip(modes, seen.values, strict=True) if shown]
