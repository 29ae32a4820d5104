"""Tables of text, and numbers as their cells show them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

BEYOND = 1e12
"""Counts above it, and ratios below its inverse, are told as such: no more is to be read from them."""

MISSING = "n/a"
"""What stands for a number that does not exist."""

NEVER = "never"
"""What stands for a number that cannot be reached."""

UNITS_OF_TIME = (("h", 3600.0), ("min", 60.0), ("s", 1.0), ("ms", 1e-3), ("µs", 1e-6))
"""Units of time, from the longest -> seconds."""


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes
    ----------
    title : str
    columns : list of str
        Headings, with units.
    rows : list of list of str
        Cells as they are shown; a line break in one stays.
    note : str
        What its marks mean; may be empty.
    keep : tuple of int
        Columns that stay where there is too little room for all; empty where none may go.
    """

    title: str
    columns: list[str]
    rows: list[list[str]]
    note: str = ""
    keep: tuple[int, ...] = ()


def number(value: float, digits: int = 4) -> str:
    """Return a number as text."""
    return MISSING if np.isnan(value) else f"{value:.{digits}g}"


def share(value: float, digits: int = 4) -> str:
    """Return a probability, or another share, as text with fixed decimals."""
    # Adding 0 takes the sign from a rounded 0.
    return MISSING if np.isnan(value) else f"{round(value, digits) + 0.0:.{digits}f}"


def plain(value: float) -> str:
    """Return a probability for a sentence: 0 and 1 as such, others with four decimals."""
    return f"{value:g}" if value in (0, 1) else share(value)


def significant(value: float, digits: int = 3) -> str:
    """Return a number as text with so many digits, zeros at the end included."""
    if not np.isfinite(value):
        return MISSING
    return f"{value:#.{digits}g}".rstrip(".") if value else "0"


def count(value: float) -> str:
    """Return a count, or an estimate of one, as text: in full up to a million."""
    if np.isnan(value):
        return MISSING
    if np.isinf(value):
        return NEVER
    if value > BEYOND:
        return f"over {BEYOND:.0e}"
    return f"{value:,.0f}" if value < 1e6 else f"{value:.2e}"


def factor(value: float) -> str:
    """Return a ratio as text with two digits."""
    if not np.isfinite(value):
        return MISSING
    if 0 < value < 1 / BEYOND:
        return f"under {1 / BEYOND:.0e}"
    return f"{float(f'{value:.2g}'):,.0f}" if value >= 100 else significant(value, 2)


def percent(value: float) -> str:
    """Return a share in per cent, with one decimal."""
    return MISSING if np.isnan(value) else f"{100 * value:.1f} %"


def duration(seconds: float) -> str:
    """Return a time in the unit that it is read in, from µs to h."""
    if not np.isfinite(seconds):
        return MISSING
    # What rounds up to the next unit is told in that.
    unit, size = next(
        ((unit, size) for unit, size in UNITS_OF_TIME if float(f"{seconds:.3g}") >= size), UNITS_OF_TIME[-1]
    )
    value = seconds / size
    return f"{value:.3g} {unit}" if value < 999.5 else f"{value:,.0f} {unit}"


def listed(parts: Iterable[str]) -> str:
    """Return words as a list, such as ``a, b and c``; empty of none."""
    *first, last = [*parts] or [""]
    return f"{', '.join(first)} and {last}" if first else last


def fitting(value: float, low: float, high: float) -> str:
    """Return a probability with as many decimals as its limits leave, such as ``0.790 (0.781 to 0.799)``."""
    if np.isnan([value, low, high]).any():
        return with_ends([share(one) for one in (value, low, high)])
    width = high - low
    digits = int(np.clip(1 - np.floor(np.log10(width)), 2, 8)) if width > 0 else 8
    return with_ends([share(one, digits) for one in (value, low, high)])


def with_ends(texts: Sequence[str]) -> str:
    """Return value, lower and upper limit as one text; limits that are unknown are left out."""
    middle, *ends = texts
    return middle if MISSING in ends else f"{middle} ({ends[0]} to {ends[1]})"


def sentence(text: str) -> str:
    """Return a text with its first letter as a capital."""
    return text[:1].upper() + text[1:]


def mode_label(results: xr.Dataset, mode: int, names: dict[str, str] | None = None) -> str:
    """Return a mode's number with its pair and its name in a publication."""
    pair = str(results["pair"].sel(mode=mode).item()) if "pair" in results.coords else ""
    published = (names or {}).get(str(mode))
    label = f"{mode} (pair {pair})" if "-" in pair else str(mode)
    return f"{label}, paper {published}" if published else label


def with_limits(results: xr.Dataset, name: str, decimals: int | None = None) -> str:
    """Return a scalar with its limits, where it has some, such as ``0.470 (0.441 to 0.502)``.

    Parameters
    ----------
    results : Dataset
    name : str
        The variable; its limits end in ``_low`` and ``_high``.
    decimals : int, optional
        Fixed decimals; four significant digits by default.
    """
    ends = [f"{name}_{end}" for end in ("low", "high")]
    keys = [name, *(ends if all(end in results for end in ends) else [])]
    values = [float(results[key]) for key in keys]
    middle, *limits = (number(value) if decimals is None else share(value, decimals) for value in values)
    known = bool(limits) and not np.isnan(values[1:]).any()
    return f"{middle} ({limits[0]} to {limits[1]})" if known else middle


def with_unit(text: str, values: xr.DataArray) -> str:
    """Return a text with the unit of a variable in brackets; pure numbers have none."""
    units = str(values.attrs.get("units", "1"))
    return text if units in ("", "1", "(1)^2") else f"{text} [{units}]"
