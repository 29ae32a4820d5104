"""Analyses that are swept over parameters: their estimate at each value, and where the rest is read."""

from __future__ import annotations

import itertools

import xarray as xr

from hipuq.report.damping import percent_of
from hipuq.report.over_damping import cell
from hipuq.report.reading import DAMPING, Reading
from hipuq.report.table import Table, count, number, sentence, share, with_limits
from hipuq.sweeping import at, swept

PLANE = 2
"""Parameters of a sweep that is told as a square."""


def value_of(parameter: str, value: float) -> str:
    """Return the value of a swept parameter as text; damping ratios in per cent."""
    return percent_of(value) if parameter == DAMPING else f"{value:.6g}"


def assumed_words(reading: Reading, analysis: str) -> str:
    """Return at which values of its parameters a sweep is shown; empty for an ordinary analysis."""
    told = [
        f"{name.replace('_', ' ')} {value_of(name, one.value)} ({one.why})"
        for name, one in reading.assumed[analysis].items()
    ]
    return f"Tables, figures and sentences below are at {', '.join(told)}" if told else ""


def sweep_table(reading: Reading, analysis: str, of: str) -> Table | None:
    """Return the estimate of an outcome at each value of the parameters swept.

    Parameters
    ----------
    reading : Reading
    analysis, of : str

    Returns
    -------
    Table or None
        None of an ordinary analysis, or where there is no single estimate. Of two parameters the one with
        more values goes down and the other across, estimates alone.
    """
    whole = reading.whole[analysis][of]
    parameters = swept(whole)
    if not parameters:
        return None
    if len(parameters) == PLANE:
        return _plane(whole)
    rows, title = [], ""
    for values in itertools.product(*(whole[name].values.tolist() for name in parameters)):
        one = at(whole, **dict(zip(parameters, values, strict=True)))
        name = _estimate(one)
        if not name:
            return None
        title = str(one[name].attrs.get("long_name", name))
        text = cell(one, name) if name.startswith("probability") else with_limits(one, name)
        told = [value_of(name, value) for name, value in zip(parameters, values, strict=True)]
        rows.append([*told, text, *(count(int(one[key])) for key in ("evaluations", "undecided", "failed"))])
    heads = [name.replace("_", " ") for name in parameters]
    columns = [*heads, "estimate (interval)", "evaluations", "undecided", "failed"]
    return Table(f"{sentence(title)}; over {' and '.join(heads)}", columns, rows)


def _plane(whole: xr.Dataset) -> Table | None:
    """Return the estimates over two parameters as a square."""
    down, across = sorted(swept(whole), key=lambda name: -whole.sizes[name])
    corner = at(whole, **{name: float(whole[name][0]) for name in (down, across)})
    name = _estimate(corner)
    if not name:
        return None
    values = whole[name].transpose(down, across).values
    rows = [
        [value_of(down, float(place)), *map(share if name.startswith("probability") else number, row)]
        for place, row in zip(whole[down].values, values, strict=True)
    ]
    heads = [down.replace("_", " "), across.replace("_", " ")]
    title = sentence(str(corner[name].attrs.get("long_name", name)))
    columns = [heads[0], *(value_of(across, float(place)) for place in whole[across].values)]
    return Table(f"{title}; over {heads[0]} (down) and {heads[1]} (across)", columns, rows)


def _estimate(results: xr.Dataset) -> str:
    """Return the name of the one estimate of results; empty without."""
    names = ("probability_overall", "probability", "mean_corrected", "mean_overall", "mean")
    return next((name for name in names if name in results and not results[name].ndim), "")
