"""One configuration over friction, in words and tables: what `hipuq onset` prints."""

from __future__ import annotations

import xarray as xr
from rich.console import Console
from rich.markup import escape

from hipuq.report.printing import printed
from hipuq.report.table import Table
from hipuq.report.text import screen_for

DIGITS = 13
"""Significant digits of a friction coefficient."""


def show_onset(found: xr.Dataset, console: Console | None = None) -> None:
    """Print boundaries and unstable intervals.

    Parameters
    ----------
    found : Dataset
        As from `hipuq.unstable_friction`.
    console : rich Console, optional
        Where to print; by default standard output.
    """
    screen = screen_for(console)
    lower, upper = found.attrs["lower"], found.attrs["upper"]
    screen.print(f"[bold]{escape(found.attrs['model'])}[/bold], friction {lower:g} to {upper:g}")
    if found.sizes["boundary"] == 0:
        always = found.sizes["interval"] > 0
        screen.print("unstable throughout" if always else "stable throughout")
    for table in (_intervals(found), _boundaries(found), _by_mode(found)):
        if table.rows:
            screen.print(printed(table, screen.width))
    if float(found["unknown"]) > 0:
        screen.print(f"not decided: friction of length {float(found['unknown']):.3g} in all")


def _number(value: float) -> str:
    return f"{value:.{DIGITS}g}"


def _intervals(found: xr.Dataset) -> Table:
    """Return the intervals with any unstable mode; an end of the range is no boundary."""
    lower, upper = found.attrs["lower"], found.attrs["upper"]
    rows = [
        [
            _number(start) + (" (start of the range)" if start == lower else ""),
            _number(end) + (" (end of the range)" if end == upper else ""),
        ]
        for start, end in zip(found["start"].values, found["end"].values, strict=True)
    ]
    return Table("Unstable friction, any mode", ["from", "to"], rows)


def _boundaries(found: xr.Dataset) -> Table:
    """Return the boundaries with what changes there."""
    rows = []
    for i in range(found.sizes["boundary"]):
        one = found.isel(boundary=i)
        rows.append(
            [
                _number(float(one["friction"])),
                f"{int(one['change']):+d}",
                f"{int(one['unstable_above'])}",
                str(int(one["mode"])),
                f"{float(one['frequency']):.3f}",
                "yes" if bool(one["certified"]) else "no",
            ]
        )
    columns = ["friction [1]", "change", "unstable above", "mode", "frequency [Hz]", "certified"]
    return Table("Boundaries: where the number of unstable modes changes", columns, rows)


def _by_mode(found: xr.Dataset) -> Table:
    """Return the intervals of each mode; modes are numbered by frequency at each friction."""
    rows = [
        [str(int(mode)), _number(start), _number(end)]
        for mode, start, end in zip(
            *(found[f"mode_{name}"].values for name in ("number", "start", "end")), strict=True
        )
    ]
    return Table("Unstable friction by mode", ["mode", "from", "to"], rows)
