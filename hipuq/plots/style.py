"""What all figures share: colours, markers, new Axes, labels of axes.

Nothing here touches pyplot or rcParams: figures are made as objects, and belong to the caller.
Colours are those of Okabe and Ito, told apart by the colour-blind; a marker or a line style always
says the same again, for print in grey.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from numpy.typing import NDArray

from hipuq import schema

BLUE, ORANGE, GREEN, VERMILLION, PURPLE, SKY = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#D55E00",
    "#CC79A7",
    "#56B4E9",
)
BLACK, GREY = "#000000", "#7F7F7F"

LINES: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "linestyle": "-"},
    {"color": VERMILLION, "linestyle": "--"},
    {"color": GREEN, "linestyle": "-."},
    {"color": PURPLE, "linestyle": ":"},
    {"color": ORANGE, "linestyle": (0, (5, 1, 1, 1, 1, 1))},
    {"color": SKY, "linestyle": (0, (8, 2))},
)
"""Styles of lines, taken in turn."""

STABLE: dict[str, Any] = {"color": BLUE, "marker": "o", "linestyle": "none"}
UNSTABLE: dict[str, Any] = {"color": VERMILLION, "marker": "^", "linestyle": "none"}
UNDECIDED: dict[str, Any] = {"color": GREY, "marker": "o", "linestyle": "none", "markerfacecolor": "none"}
"""Markers of modes by verdict."""

BORDER: dict[str, Any] = {"color": BLACK, "linewidth": 0.8, "linestyle": "--"}
"""Line between stable and unstable."""

COLOUR_MAP = "cividis"
"""Colours of a continuous variable: lightness rises all along."""


def new_axes(ax: Axes | None, width: float = 6.4, height: float = 4.4) -> Axes:
    """Return `ax`, or without one the Axes of a new figure, which pyplot does not know.

    Parameters
    ----------
    ax : Axes or None
        Axes to draw on.
    width, height : float
        Size of the new figure [inch].

    Returns
    -------
    Axes
    """
    if ax is not None:
        return ax
    return Figure(figsize=(width, height), layout="constrained").subplots()


def new_panels(
    figure: FigureBase | None, rows: int, columns: int, size: tuple[float, float], **options: Any
) -> NDArray[Any]:
    """Return a grid of Axes in `figure`, or in a new one.

    Parameters
    ----------
    figure : Figure, SubFigure or None
        Where to draw.
    rows, columns : int
        Shape of the grid.
    size : tuple of float
        Width and height of the new figure [inch].
    **options
        To ``figure.subplots``, such as ``sharex``.

    Returns
    -------
    (rows, columns) array of Axes
    """
    if figure is None:
        figure = Figure(figsize=size, layout="constrained")
    return np.asarray(figure.subplots(rows, columns, squeeze=False, **options), dtype=object)


def axis_label(variable: xr.DataArray, units: str | None = None) -> str:
    """Return the label of an axis: long name and unit of a variable.

    Parameters
    ----------
    variable : DataArray
        With attributes ``long_name`` and ``units``; what is missing is looked up by its name in the
        schema.
    units : str, optional
        Another unit, if the values are drawn in it.

    Returns
    -------
    str
        ``"frequency [Hz]"``.
    """
    name = str(variable.name)
    table = schema.PARAMETERS | schema.OUTCOMES | schema.COORDINATES
    known = table[name].attrs if name in table else {}
    attrs = {"long_name": name} | known | variable.attrs
    unit = units if units is not None else attrs.get("units")
    return f"{attrs['long_name']} [{unit}]" if unit else str(attrs["long_name"])
