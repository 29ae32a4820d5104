"""The probability of squeak by number in contact and by mode, with the frequencies of each mode."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr

from hipuq.friction import OF_ANY_MODE
from hipuq.report import chance
from hipuq.report.block import Block, turned
from hipuq.report.damping import at_damping
from hipuq.report.frequency import between, decimals, unit_of, written
from hipuq.report.over_damping import cell
from hipuq.report.partners import summed_up
from hipuq.report.reading import Reading
from hipuq.report.summary import group_table, limits_word, modes_shown
from hipuq.report.table import MISSING, Table, plain

BY_MODE = ("unstable", "probability_by_mode")
"""Outcomes whose probability is that of each mode: sampled, and with friction integrated."""

FREQUENCIES = ("frequency_low", "frequency_median", "frequency_high")

MOST = 6
"""Modes that a screen has room for, the most probable ones."""

COUNT_TITLE, MODE_TITLE = "P(squeak) by number in contact", "P by mode, and its frequency"


def origin(reading: Reading, analysis: str, results: xr.Dataset) -> list[str]:
    """Return in a sentence which analysis something is from; nothing if it is that of the headline."""
    if analysis == reading.analysis:
        return []
    where = f", {words}" if (words := at_damping(results)) else ""
    return [f"From the analysis {analysis!r}: {results.attrs['model']}{where}"]


def counted(reading: Reading) -> tuple[str, xr.Dataset] | None:
    """Return the analysis that tells the probability by number in contact, and its results; None without."""
    for name in reading.ranked:
        for of in OF_ANY_MODE:
            results = reading.found[name].get(of)
            if summed_up(results, {"count"}):
                return name, results
    return None


def by_count(reading: Reading) -> Block:
    """Return the probability for each number in contact.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
        Without a stratified analysis a sentence that says what would give it.
    """
    found = counted(reading)
    if found is None:
        if reading.results is None or not _has_contact(reading.results):
            return Block("count", COUNT_TITLE)
        line = (
            'No analysis is stratified by contact: options = { stratify = "contact" } would tell each number'
        )
        return Block("count", COUNT_TITLE, [line])
    analysis, results = found
    table = replace(
        group_table(results, "probability"),
        title="P(squeak) over the contact patterns of each number in contact",
    )
    lines = first = origin(reading, analysis, results)
    lines = [*first, *_told(results)]
    found_apart = chance.tested(results)
    if words := chance.in_words(found_apart):
        lines.append(words)
    short = [said] if (said := chance.in_short(found_apart)) else []
    return Block("count", COUNT_TITLE, lines, [table], brief=[_turned(table), *short, *first])


def _told(results: xr.Dataset) -> list[str]:
    """Return the mean with the fewest and with the most in contact, in a sentence."""
    ends = [float(results["probability_mean"][i]) for i in (0, -1)]
    if results.sizes["count"] < 2 or not np.isfinite(ends).all():
        return []
    few, many = (int(results["count"][i]) for i in (0, -1))
    means = results["probability_mean"].values
    if (means == means[0]).all() and means[0] in (0, 1):
        return [f"P is {means[0]:g} with any number in contact from {few} to {many}"]
    return [f"With {few} in contact P is {plain(ends[0])} on average, with {many} {plain(ends[1])}"]


def _turned(table: Table) -> Table:
    """Return the table for a screen: mean, interval and range over the patterns, a column for each number."""
    wide = turned(table, "")
    cells = {row[0]: row[1:] for row in wide.rows}
    ends = zip(cells["minimum"], cells["maximum"], strict=True)
    cells["range"] = [low if low == high else f"{low} to {high}" for low, high in ends]
    kept = [[name, *cells[name]] for name in ("mean", "interval", "bounds", "range") if name in cells]
    return Table("", ["in contact", *wide.columns[1:]], kept)


def _has_contact(results: xr.Dataset) -> bool:
    return "contact_patterns" in str(results.attrs.get("inputs"))


def by_mode(reading: Reading) -> Block:
    """Return the probability of each mode with the range of its frequency where it is unstable.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
        Without an analysis of modes a sentence that says what would give it.
    """
    found = moded(reading)
    if found is None:
        if reading.results is None:
            return Block("mode", MODE_TITLE)
        return Block("mode", MODE_TITLE, ['No analysis is of "unstable", which would tell each mode'])
    analysis, results, name = found
    ranges = frequencies(reading)
    lines = origin(reading, analysis, results)
    if ranges is None:
        lines.append('No analysis of "unstable" has kept the frequencies of the modes')
    elif ranges[0] != analysis:
        lines.append(f"Frequencies are from the analysis {ranges[0]!r}")
    own = results[[key for key in results.data_vars if str(key).startswith(name)]]
    modes = modes_shown(own.rename({name: "probability"}) if name != "probability" else own, "probability")
    heads = ["mode", "pair", f"P ({limits_word(results)})"]
    if ranges is not None:
        unit, _, _ = scale_of(ranges[1])
        heads += [f"{text} [{unit}]" for text in ("5 % below", "median", "95 % below")]
    if reading.mode_names:
        heads.insert(2, "in the paper")
    rows = [_mode_row(reading, results, name, mode, None if ranges is None else ranges[1]) for mode in modes]
    if not rows:
        lines.append("No mode is ever unstable")
    table = Table("P that a mode is unstable, and its frequency where it is", heads, rows)
    if words := frequency_words(ranges):
        lines.append(words)
    if not rows:
        return Block("mode", MODE_TITLE, lines, brief=list(lines))
    likely = sorted(modes, key=lambda mode: -np.nan_to_num(float(results[name].sel(mode=mode))))[:MOST]
    kept = [row for mode, row in zip(modes, rows, strict=True) if mode in likely]
    rest = len(rows) - len(kept)
    short = [f"and {rest} more, less probable; where unstable they vibrate at {_ends(ranges)}"]
    short = short if rest and words else [f"and {rest} more, less probable"] if rest else [words]
    from_ = [line for line in lines if line != words]
    brief: list[str | Table] = [Table("", table.columns, kept)]
    brief += [line for line in short if line] + from_
    return Block("mode", MODE_TITLE, lines, [table], brief=brief)


def scale_of(ranges: xr.Dataset) -> tuple[str, float, int]:
    """Return unit, its size [Hz] and decimals that all frequencies of a table are told with."""
    values = np.concatenate([ranges[key].values for key in FREQUENCIES])
    unit, size = unit_of(values)
    return unit, size, decimals(values, size, 4)


def moded(reading: Reading) -> tuple[str, xr.Dataset, str] | None:
    """Return the analysis with a probability by mode, its results, and the name of the probability."""
    for analysis in reading.ranked:
        for of in BY_MODE:
            results = reading.found[analysis].get(of)
            for name in ("probability_overall", "probability"):
                if results is not None and name in results and results[name].dims == ("mode",):
                    return analysis, results, name
    return None


def frequencies(reading: Reading) -> tuple[str, xr.Dataset] | None:
    """Return the analysis with frequency ranges by mode, and these; None without."""
    found = moded(reading)
    order = [*([found[0]] if found else []), *reading.ranked]
    name = next((name for name in order if "frequencies" in reading.found[name]), None)
    return None if name is None else (name, reading.found[name]["frequencies"])


def frequency_words(ranges: tuple[str, xr.Dataset] | None) -> str:
    """Return between which frequencies squeak is predicted; empty where none is unstable."""
    ends = _ends(ranges)
    if not ends:
        return ""
    return f"Where modes are unstable they vibrate at {ends} (least 5 % and greatest 95 % quantile of a mode)"


def _ends(ranges: tuple[str, xr.Dataset] | None) -> str:
    """Return the least and the greatest frequency at which a mode is unstable; empty without any."""
    if ranges is None:
        return ""
    low, high = ranges[1]["frequency_low"].values, ranges[1]["frequency_high"].values
    return between(float(np.nanmin(low)), float(np.nanmax(high))) if np.isfinite(low).any() else ""


def _mode_row(
    reading: Reading, results: xr.Dataset, name: str, mode: int, ranges: xr.Dataset | None
) -> list[str]:
    at = results.sel(mode=mode)
    row = [str(mode), str(at["pair"].item()) if "pair" in at.coords else "", cell(at, name)]
    if reading.mode_names:
        row.insert(2, reading.mode_names.get(str(mode), ""))
    if ranges is not None:
        there = mode in ranges["mode"].values
        _, size, places = scale_of(ranges)
        row += [
            written(float(ranges[key].sel(mode=mode)), size, places) if there else MISSING
            for key in FREQUENCIES
        ]
    return row
