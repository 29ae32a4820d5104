"""Words of figures of results: names of parameters, what a selection is of, reasons, legends.

Results over more than a figure can show have to be selected from first, by whoever draws; what was
selected is then said in the title.
"""

from __future__ import annotations

import re
import textwrap
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.transforms import ScaledTranslation

from hipuq import schema
from hipuq.errors import SchemaError
from hipuq.plots.style import PERCENT

UNDEFINED = "undefined"
"""What stands where a value does not exist."""

ELEMENT = re.compile(r"(.+)\[(\d+)\]")
"""Name of an element of a parameter, such as ``spring_stiffness[3]``."""

LINES_OF_PART = 2
"""Lines of each part of a title or a text in place of a drawing; what is cut off ends in an ellipsis."""

SHARE_OF_ROOM = 0.95
"""Length of a line of text by the size of the Axes without its labels."""


def over(results: xr.Dataset, name: str, dims: tuple[str, ...], way_out: str) -> xr.DataArray:
    """Return a variable over these dims alone.

    Parameters
    ----------
    results : Dataset
        Results of an analysis.
    name : str
        The variable.
    dims : tuple of str
        Its dims as the figure needs them.
    way_out : str
        What gives the variable, for the error.

    Returns
    -------
    DataArray
        Transposed to `dims`.

    Raises
    ------
    SchemaError
        If it is missing, or over other dims.
    """
    if name not in results or not set(dims) <= set(results[name].dims):
        raise SchemaError(f"the figure needs {name!r} over ({', '.join(dims)}): {way_out}")
    found = results[name]
    more = [str(dim) for dim in found.dims if dim not in dims]
    if more:
        value = found[more[0]].values[-1]
        shown = repr(value.item() if hasattr(value, "item") else value)
        raise SchemaError(
            f"{name} is over {', '.join(more)} too: select one, such as results.sel({more[0]}={shown})"
        )
    return found.transpose(*dims)


def parameter_label(name: str) -> str:
    """Return the name of a parameter or of one of its elements as words.

    Parameters
    ----------
    name : str
        As in the coord ``parameter``, such as ``"spring_stiffness[3]"``.

    Returns
    -------
    str
        ``"spring stiffness 3"``; a name that the schema does not know stays as it is.
    """
    element = ELEMENT.fullmatch(name)
    bare, number = element.groups() if element else (name, "")
    if bare not in schema.PARAMETERS:
        return name
    return f"{bare.replace('_', ' ')} {number}".strip()


def selected(variable: xr.DataArray) -> str:
    """Return what a variable was selected at, such as ``"mode 16"``; empty if nothing was."""
    return ", ".join(
        f"{parameter_label(str(name))} {_value(str(name), coord.item())}"
        for name, coord in variable.coords.items()
        if coord.ndim == 0
    )


def _value(name: str, value: object) -> str:
    """Return the value of a coordinate, damping ratios in per cent."""
    return f"{100 * value:.6g} %" if name in PERCENT and isinstance(value, float) else str(value)


def level(results: xr.Dataset) -> str:
    """Return what limits are, such as ``"95 % interval"``; those of exact results bound what is unknown."""
    confidence = results.attrs.get("confidence")
    if schema.is_exact(results):
        return "limits of the unknown"
    return "interval" if confidence is None else f"{100 * float(confidence):g} % interval"


def outcome_of(index: xr.DataArray) -> str:
    """Return the outcome that an index is of, from its long name."""
    return str(index.attrs.get("long_name", "")).partition(" index of ")[2]


def subject(index: xr.DataArray) -> str:
    """Return the outcome of an index and what it was selected at, such as ``"frequency, mode 16"``."""
    return ", ".join(filter(None, [outcome_of(index), selected(index)]))


def reason(variable: xr.DataArray) -> str:
    """Return why values of a variable are undefined; empty if none is or nothing is said."""
    said = str(variable.attrs.get("undefined", ""))
    return said if bool(variable.isnull().any()) else ""


def distrust(results: xr.Dataset) -> str:
    """Say in a few words that results are those of a surrogate that is not to be trusted; empty of others.

    Parameters
    ----------
    results : Dataset
        The reasons are the attribute ``reasons`` of its ``trusted``.

    Returns
    -------
    str
        ``"surrogate not to be trusted: Q2 0.32"``.
    """
    if "trusted" not in results or results["trusted"].ndim or int(results["trusted"]):
        return ""
    q2 = float(results["q2"]) if "q2" in results else np.nan
    return "surrogate not to be trusted" + (f": Q2 {q2:.2f}" if np.isfinite(q2) else "")


def wrapped(ax: Axes, text: str, *, upright: bool = False, lines: int | None = None) -> str:
    """Return a text in lines that are no longer than the Axes are wide.

    Parameters
    ----------
    ax : Axes
    text : str
    upright : bool, default False
        Whether it is written along the height of the Axes.
    lines : int, optional
        Most lines; what is cut off ends in an ellipsis.

    Returns
    -------
    str
    """
    room = SHARE_OF_ROOM * inches(ax)[upright] * 72
    # A letter is a little wider than half its size, which is 10 pt.
    width = max(20, int(room / 5.5))
    return "\n".join(textwrap.wrap(text, width, break_on_hyphens=False, max_lines=lines, placeholder=" …"))


def put_title(ax: Axes, *parts: str) -> None:
    """Write the title of a figure, each part from a new line and cut to two; empty ones are left out."""
    lines = [wrapped(ax, part, lines=LINES_OF_PART) for part in parts if part]
    ax.set_title("\n".join(lines), fontsize="medium", parse_math=False)


def inches(ax: Axes) -> tuple[float, float]:
    """Return width and height of the Axes [inch], before labels take their share."""
    box = ax.get_window_extent().transformed(ax.figure.dpi_scale_trans.inverted())
    return float(box.width), float(box.height)


def say(ax: Axes, text: str) -> None:
    """Write a text, cut to two lines, in the middle of Axes that have nothing to draw."""
    style: dict[str, Any] = {"ha": "center", "va": "center", "parse_math": False}
    ax.text(0.5, 0.5, wrapped(ax, text, lines=LINES_OF_PART), transform=ax.transAxes, **style)


def legend_below(ax: Axes, width: float = 1.9, **options: Any) -> None:
    """Put the legend under the label of the x axis, however high the Axes are.

    Label and ticks are there already; each of their lines takes its room.

    Parameters
    ----------
    ax : Axes
    width : float
        Width of an entry [inch]: as many stand side by side as the Axes have room for, three at most.
    **options
        To ``ax.legend``, such as ``handles``.
    """
    ticks = max((tick.get_text().count("\n") for tick in ax.get_xticklabels()), default=0)
    down = 32 + 12 * (ax.get_xlabel().count("\n") + ticks)
    points = ScaledTranslation(0, -down / 72, ax.figure.dpi_scale_trans)
    columns = int(np.clip(inches(ax)[0] / width, 1, 3))
    style: dict[str, Any] = {"frameon": False, "fontsize": "small", "loc": "upper center"}
    ax.legend(
        ncols=columns, bbox_to_anchor=(0.5, 0.0), bbox_transform=ax.transAxes + points, **style, **options
    )
