"""What all figures share: colours, markers, new Axes, labels of axes.

Nothing here touches pyplot or rcParams: figures are made as objects, and belong to the caller.
Colours are those of Okabe and Ito, told apart by the colour-blind; a marker or a line style always
says the same again, for print in grey.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure, FigureBase
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import SchemaError

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

MARKERS = "o^sDvP"
"""Markers by line style: they stand where estimates were made."""

FILLS: tuple[dict[str, Any], ...] = (
    {"facecolor": SKY, "hatch": ""},
    {"facecolor": ORANGE, "hatch": "//////"},
    {"facecolor": GREEN, "hatch": "......"},
    {"facecolor": PURPLE, "hatch": "xxxxxx"},
    {"facecolor": "white", "hatch": "------"},
    {"facecolor": VERMILLION, "hatch": "||||||"},
)
"""Fillings of boxes, taken in turn."""

UNKNOWN: dict[str, Any] = {"facecolor": "#DDDDDD", "edgecolor": GREY, "hatch": "xxxxx", "linewidth": 0.0}
"""Filling of areas of which nothing is known."""

STABLE: dict[str, Any] = {"color": BLUE, "marker": "o", "linestyle": "none"}
UNSTABLE: dict[str, Any] = {"color": VERMILLION, "marker": "^", "linestyle": "none"}
UNDECIDED: dict[str, Any] = {"color": GREY, "marker": "o", "linestyle": "none", "markerfacecolor": "none"}
"""Markers of modes by verdict."""

BORDER: dict[str, Any] = {"color": BLACK, "linewidth": 0.8, "linestyle": "--"}
"""Line between stable and unstable."""

SHADES = LinearSegmentedColormap.from_list(
    "shades", colormaps["cividis"].reversed()(np.linspace(0.12, 1.0, 256))
)
"""Colours of a continuous variable: lightness falls all along, from one that still differs from paper."""

HALF = 50.0
"""Probability [%] from which on an axis reaches to 100 %."""

PERCENT = ("damping_ratio", "damping_1", "damping_2")
"""Parameters that are drawn in per cent."""


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


def plain(text: str) -> str:
    """Return a text of the user's for a label, where a dollar sign must not begin mathematics."""
    return text.replace("$", r"\$")


def check_dataset(value: object, name: str) -> None:
    """Raise a SchemaError unless a value is a Dataset.

    Parameters
    ----------
    value : object
    name : str
        What it was given as.
    """
    if not isinstance(value, xr.Dataset):
        raise SchemaError(f"{name} must be an xarray Dataset, not {type(value).__name__}")


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


def scaled(variable: xr.DataArray) -> tuple[NDArray[np.float64], str]:
    """Return values of a parameter as they are drawn, damping ratios in per cent, and the label of the axis.

    Parameters
    ----------
    variable : DataArray
        The parameter, by its name.

    Returns
    -------
    values : array
    label : str
        ``"modal damping ratio of the frictionless modes [%]"``.
    """
    values = variable.values.astype(np.float64)
    if variable.name in PERCENT:
        return 100 * values, axis_label(variable, "%")
    return values, axis_label(variable)


def percent_top(*values: NDArray[np.float64]) -> float:
    """Return the upper end of an axis of probabilities [%]: a little above 100, or above what is small.

    Parameters
    ----------
    *values : array
        What is drawn [%]; NaN where unknown.

    Returns
    -------
    float
        Up to a half the axis ends above the largest, else small ones could not be told apart.
    """
    most = max((float(np.nanmax(own, initial=0.0)) for own in values), default=0.0)
    return 104.0 if most > HALF or most == 0 else 1.1 * most


def shades_of(probability: NDArray[np.float64], *, close: bool = False) -> Normalize:
    """Return the scale of colours of probabilities [%]: 0 to 100, or less where all of them are small.

    Parameters
    ----------
    probability : array
        [%]; NaN where unknown.
    close : bool, default False
        Whether to take no more than the tens that hold them, to tell them apart; ten points at least, so
        that scatter of the estimates does not look like a difference.

    Returns
    -------
    Normalize
    """
    most = float(np.nanmax(probability, initial=0.0))
    if close and most > 0:
        least, most = 10 * np.floor(np.nanmin(probability) / 10), 10 * np.ceil(most / 10)
        return Normalize(float(max(min(least, most - 10), 0.0)), float(most))
    if most == 0 or most > HALF:
        return Normalize(0.0, 100.0)
    power = 10.0 ** np.floor(np.log10(most))
    return Normalize(0.0, float(next(step * power for step in (1, 2, 3, 5, 7.5, 10) if most <= step * power)))
