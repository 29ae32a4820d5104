"""The probability of squeak over the modal damping ratio, in a table and in words."""

from __future__ import annotations

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.report.block import Block
from hipuq.report.damping import changed_words, damping_words, percent_of
from hipuq.report.reading import DAMPING, Reading, nominal_of, probability_name
from hipuq.report.summary import friction_words, interval
from hipuq.report.table import Table, fitting, plain, share
from hipuq.sweeping import at

TITLE = "P(squeak) over the modal damping ratio"

SMALL = 0.001
"""Probabilities below it are told with more decimals."""

Curves = dict[str, xr.Dataset]


def over_damping(reading: Reading) -> Block:
    """Return what damping does to the probability.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
        A row for each damping ratio and a column for each analysis swept over it; without one a sentence
        that says what would give them.
    """
    curves = reading.swept_over(DAMPING)
    if not curves:
        line = (
            "No analysis is swept over the damping ratio: over = { damping_ratio = [0.0, 0.01] } in an "
            "analysis of any_unstable would show what damping does"
        )
        asked = reading.results is not None and DAMPING in nominal_of(reading.results)
        return Block("damping", TITLE, [line] if asked else [])
    first = next(iter(curves))
    lines = [f"{in_words(curves[first])} ({first})"]
    if reading.analysis is not None and reading.analysis not in curves:
        lines.append(
            f"The headline's analysis, {reading.analysis!r}, is not swept over damping; {first!r} is the "
            "nearest to it"
        )
    beside = besides(reading)
    brief: list[str | Table] = [_across(curves, reading.assumed[first][DAMPING].value)]
    if beside:
        lines.append(beside)
        brief.append(beside)
    return Block("damping", TITLE, lines, [_table(curves)], [_described(curves)], brief=brief)


def besides(reading: Reading) -> str:
    """Return in a sentence that the headline's damping is none of those of the sweep; empty where it is."""
    curves = reading.swept_over(DAMPING)
    if reading.results is None or not curves or not all(map(reading.apart, curves)):
        return ""
    own = damping_words(reading.results) or "none is told"
    return f"The headline's damping ({own}) is none of these values"


def ends(curve: xr.Dataset) -> str:
    """Return the first and the last probability over damping, such as ``0.6908 to 0.2385``."""
    values = curve[_name(curve)].values.astype(np.float64)
    return f"{plain(float(values[0]))} to {plain(float(values[-1]))}"


def in_words(curve: xr.Dataset) -> str:
    """Return how a probability changes over the damping ratio, in a sentence.

    Parameters
    ----------
    curve : Dataset
        Results over ``damping_ratio`` alone.
    """
    name = _name(curve)
    values, ratios = curve[name].values.astype(np.float64), curve[DAMPING].values
    known = np.flatnonzero(np.isfinite(values))
    if not known.size:
        return "P(squeak) is not known at any damping ratio"
    first, last = (_cell(curve, float(ratios[i])) for i in (known[0], known[-1]))
    told = f"{first} at {percent_of(ratios[known[0]])} to {last} at {percent_of(ratios[known[-1]])}"
    if known.size == 1:
        where = percent_of(ratios[known[0]])
        return f"P(squeak) is {first} at {where} modal damping, the one value with a verdict"
    steps = np.diff(values[known])
    if not steps.any():
        where = "every damping ratio" if known.size == values.size else "every damping ratio with a verdict"
        between = f"{percent_of(ratios[0])} to {percent_of(ratios[-1])}"
        return f"P(squeak) is {plain(float(values[known[0]]))} at {where}, {between}"
    if (steps <= 0).all():
        return f"P(squeak) falls from {told} modal damping"
    low, high = share(float(np.nanmin(values))), share(float(np.nanmax(values)))
    return (
        f"P(squeak) goes from {told} modal damping, not falling throughout: it lies between {low} and {high}"
    )


def _name(curve: xr.Dataset) -> str:
    return "probability_overall" if "probability_overall" in curve else "probability"


def _cell(curve: xr.Dataset, ratio: float) -> str:
    """Return the probability at a damping ratio with its limits; nothing where it is not in the sweep."""
    if not np.isclose(curve[DAMPING].values, ratio, rtol=1e-9, atol=1e-15).any():
        return ""
    one = at(curve, damping_ratio=ratio)
    return cell(one, probability_name(one))


def cell(results: xr.Dataset, name: str) -> str:
    """Return a scalar probability with its limits: four decimals, more of small ones, eight if exact."""
    high = float(results[f"{name}_high"])
    if schema.is_exact(results) or not high < SMALL:
        return interval(results, name)
    return fitting(*(float(results[name + end]) for end in ("", "_low", "_high")))


def _ratios(curves: Curves) -> list[float]:
    """Return the damping ratios of all curves, ascending, each once."""
    found: list[float] = []
    for ratio in sorted(float(one) for curve in curves.values() for one in curve[DAMPING].values):
        if not found or not np.isclose(found[-1], ratio, rtol=1e-9, atol=1e-15):
            found.append(ratio)
    return found


def _table(curves: Curves) -> Table:
    """Return a row for each damping ratio and a column for each analysis."""
    rows = [[percent_of(ratio), *(_cell(one, ratio) for one in curves.values())] for ratio in _ratios(curves)]
    return Table("P(squeak) with its interval", ["damping ratio", *curves], rows)


def _described(curves: Curves) -> Table:
    """Return what tells the analyses apart: model, what is changed in it, friction."""
    rows = []
    for name, one in curves.items():
        model = ", ".join(filter(None, [str(one.attrs["model"]), changed_words(one)]))
        rows.append([name, model, friction_words(one).removeprefix("friction ")])
    return Table("What these analyses are of", ["analysis", "model", "friction"], rows)


def _value(curve: xr.Dataset, ratio: float) -> str:
    """Return the probability at a damping ratio alone; one that is above 0 is never 0."""
    if not _cell(curve, ratio):
        return ""
    one = at(curve, damping_ratio=ratio)
    value = float(one[probability_name(one)])
    return f"{value:.0e}" if 0 < value < 0.00005 else share(value)


def _across(curves: Curves, chosen: float) -> Table:
    """Return a column for each damping ratio, that of the headline to be kept, with the values alone."""
    kept = _ratios(curves)
    rows = []
    for name, one in curves.items():
        cells = []
        for ratio in kept:
            cells.append(_value(one, ratio))
        rows.append([name, *cells])
    at = int(np.argmin(np.abs(np.array(kept) - chosen)))
    return Table("", ["damping", *map(percent_of, kept)], rows, keep=tuple(sorted({0, 1, at + 1, len(kept)})))
