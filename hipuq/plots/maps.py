"""Stability over two parameters: a map with the border between stable and unstable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from hipuq.errors import InputError, SchemaError, check_name
from hipuq.plots.captions import legend_below, over, put_title, selected, wrapped
from hipuq.plots.style import (
    BLACK,
    SHADES,
    UNKNOWN,
    VERMILLION,
    axis_label,
    check_dataset,
    new_axes,
    scaled,
    shades_of,
)
from hipuq.plots.tracking import check_constant, growth_threshold

Array = NDArray[np.float64]

QUANTITIES = ("probability", "any_unstable", "margin", "growth_rate")
"""What a map can be of."""

STABLE: dict[str, Any] = {"facecolor": "#DCEBF5"}
UNSTABLE: dict[str, Any] = {"facecolor": VERMILLION, "edgecolor": BLACK, "hatch": "////", "linewidth": 0.0}
"""Fillings by verdict."""

HALF = 50.0
"""Probability of the contour line [%]."""


@dataclass(frozen=True)
class Grid:
    """Values over two parameters.

    Attributes
    ----------
    x, y : array
        Values of the parameters as they are drawn, ascending.
    x_label, y_label, label : str
        Of the axes and of the colours.
    values : (y, x) array
        NaN where unknown.
    of : str
        What they are, one of `QUANTITIES`.
    border : float
        Value on the border between stable and unstable.
    """

    x: Array
    y: Array
    x_label: str
    y_label: str
    label: str
    values: Array
    of: str
    border: float


def stability_map(data: xr.Dataset, x: str, y: str, *, of: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw where a system is stable or how probable its instability is, over two parameters.

    Parameters
    ----------
    data : Dataset
        Results of a sweep over both parameters, as from `hipuq.sweep`, with ``probability_overall`` of
        stratified ones, else ``probability``; or outcomes, in whose samples the two parameters make a full
        grid and nothing else differs.
    x, y : str
        The parameters on the axes; damping ratios are drawn in per cent.
    of : {"probability", "any_unstable", "margin", "growth_rate"}, optional
        What to draw of outcomes; by default the first of these that there is. ``"any_unstable"`` is drawn
        in three classes, ``"growth_rate"`` is the largest of all modes, unknown where a mode is undecided.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        A cell reaches halfway to its neighbours, and ends at the outermost values. With the contour of a
        probability of 50 %, or the border of stability where it is crossed. What is unknown is grey and
        hatched.

    Raises
    ------
    SchemaError
        If a parameter or the quantity is missing, or the samples make no full grid.
    UnknownNameError
        If `of` is none of these.
    InputError
        If a parameter has a single value, another one differs between samples, or `of` is given for results
        of something else.
    """
    check_dataset(data, "data")
    if of is not None:
        check_name("of", of, QUANTITIES)
    if x == y:
        raise InputError(f"x and y are both {x!r}: a map needs two parameters")
    grid, where = _of_samples(data, x, y, of) if "sample" in data.dims else _of_results(data, x, y, of)
    ax = new_axes(ax, 6.8, 5.4)
    handles = _classes(ax, grid) if grid.of == "any_unstable" else _colours(ax, grid)
    unknown = np.isnan(grid.values)
    if unknown.any():
        ax.add_collection(PolyCollection(_runs(grid, unknown), **UNKNOWN), autolim=False)
        handles.append(Patch(**UNKNOWN, label=f"unknown ({unknown.sum()} of {unknown.size})"))
    ax.set_xlim(*_edges(grid.x)[[0, -1]])
    ax.set_ylim(*_edges(grid.y)[[0, -1]])
    ax.set_xlabel(wrapped(ax, grid.x_label))
    ax.set_ylabel(wrapped(ax, grid.y_label, upright=True))
    put_title(ax, where)
    if handles:
        legend_below(ax, width=1.6, handles=handles)
    return ax


def _of_results(results: xr.Dataset, x: str, y: str, of: str | None) -> tuple[Grid, str]:
    """Return the probability of a sweep, and what else it was selected at."""
    if of not in (None, "probability"):
        raise InputError(f"of is {of!r}: results of a sweep have 'probability', only outcomes have others")
    way_out = f"hipuq.sweep over {x} and {y}, or outcomes over sample"
    name = "probability_overall" if "probability_overall" in results else "probability"
    found = over(results, name, (y, x), way_out).sortby([x, y])
    for key in (x, y):
        _check_axis(key, found[key].values)
    (xs, x_label), (ys, y_label) = scaled(found[x]), scaled(found[y])
    label = axis_label(results["probability"] if "probability" in results else found, "%")
    values = 100 * found.values.astype(np.float64)
    return Grid(xs, ys, x_label, y_label, label, values, "probability", HALF), selected(found)


def _of_samples(outcomes: xr.Dataset, x: str, y: str, of: str | None) -> tuple[Grid, str]:
    """Return a quantity of outcomes on a grid."""
    for name in (x, y):
        if name not in outcomes.variables or outcomes[name].dims != ("sample",):
            raise SchemaError(f"the figure needs {name!r} over sample alone in the outcomes")
    check_constant(outcomes, [x, y], f"in a map only {x} and {y} may")
    if of is None:
        of = next((name for name in QUANTITIES if name in outcomes), None)
    if of is None or of not in outcomes:
        raise SchemaError(f"the figure needs {of or ' or '.join(QUANTITIES)!r}: keep it in evaluate")
    values, label, border = _quantity(outcomes, of)
    (xs, i), (ys, j) = (np.unique(outcomes[name].values, return_inverse=True) for name in (x, y))
    for name, own in ((x, xs), (y, ys)):
        _check_axis(name, own)
    times = np.zeros((len(ys), len(xs)), int)
    np.add.at(times, (j, i), 1)
    if (times != 1).any():
        row, column = np.argwhere(times != 1)[0]
        what = "is missing" if times[row, column] == 0 else f"comes {times[row, column]} times"
        raise SchemaError(
            f"the samples make no full grid of {len(xs)} {x} by {len(ys)} {y}: {x} {xs[column]:g} with {y} "
            f"{ys[row]:g} {what}; {(times != 1).sum()} of {times.size} places are not there once"
        )
    table = np.full(times.shape, np.nan)
    table[j, i] = values
    shown = [
        scaled(xr.DataArray(own, name=name, attrs=outcomes[name].attrs)) for name, own in ((x, xs), (y, ys))
    ]
    return Grid(shown[0][0], shown[1][0], shown[0][1], shown[1][1], label, table, of, border), ""


def _quantity(outcomes: xr.Dataset, of: str) -> tuple[Array, str, float]:
    """Return values by sample, the label of their colours, and the value on the border of stability."""
    dims = ("sample", "mode") if of == "growth_rate" else ("sample",)
    if set(outcomes[of].dims) != set(dims):
        raise SchemaError(f"the figure needs {of!r} over ({', '.join(dims)}), it has {outcomes[of].dims}")
    values = outcomes[of].transpose(*dims).values.astype(np.float64)
    if of == "probability":
        return 100 * values, axis_label(outcomes[of], "%"), HALF
    if of != "growth_rate":
        return np.where(np.isfinite(values), values, np.nan), axis_label(outcomes[of]), 0.0
    if "unstable" in outcomes:
        values = np.where(np.isnan(outcomes["unstable"].transpose(*dims).values), np.nan, values)
    label = axis_label(outcomes[of].assign_attrs(long_name="largest growth rate"))
    return values.max(axis=1), label, growth_threshold(outcomes)


def _check_axis(name: str, values: NDArray[Any]) -> None:
    """Raise an InputError if a parameter has no two finite values."""
    if len(values) < 2 or not np.isfinite(values).all():
        raise InputError(f"{name} has the values {values.tolist()}: a map needs two or more, all finite")


def _classes(ax: Axes, grid: Grid) -> list[Any]:
    """Draw verdicts in classes, with the border between them, and return the handles of the legend."""
    fill = ListedColormap([STABLE["facecolor"], UNSTABLE["facecolor"]])
    edges = _edges(grid.x), _edges(grid.y)
    unstable, stable = grid.values == 1, grid.values == 0
    ax.pcolormesh(*edges, np.ma.masked_invalid(grid.values), cmap=fill, norm=Normalize(0.0, 1.0))
    handles: list[Any] = []
    if stable.any():
        handles.append(Patch(**STABLE, label="stable"))
    if unstable.any():
        hatch = UNSTABLE | {"facecolor": "none"}
        ax.add_collection(PolyCollection(_runs(grid, unstable), **hatch), autolim=False)
        handles.append(Patch(**UNSTABLE, label="unstable"))
    border = _border(*edges, unstable, stable)
    if border:
        ax.add_collection(LineCollection(border, colors=BLACK, linewidths=1.4), autolim=False)
    return handles


def _colours(ax: Axes, grid: Grid) -> list[Any]:
    """Draw values in colours, with the contour of the border, and return the handles of the legend."""
    known = grid.values[~np.isnan(grid.values)]
    # Of a margin the least is the most unstable: the darker the worse, as of all others.
    shades = SHADES.reversed() if grid.of == "margin" else SHADES
    norm = shades_of(known)
    if grid.of != "probability":
        ends = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
        norm = Normalize(*ends) if ends[0] < ends[1] else Normalize(ends[0] - 0.5, ends[0] + 0.5)
    values = np.ma.masked_invalid(grid.values)
    mesh = ax.pcolormesh(_edges(grid.x), _edges(grid.y), values, cmap=shades, norm=norm)
    bar = ax.figure.colorbar(mesh, ax=ax, fraction=0.06, pad=0.03, aspect=24)
    bar.set_label(wrapped(ax, grid.label, upright=True))
    if not ((known > grid.border).any() and (known <= grid.border).any()):
        return []
    style: dict[str, Any] = {
        "colors": BLACK,
        "linewidths": 1.3,
        "linestyles": "--",
        "negative_linestyles": "--",
    }
    lines = ax.contour(grid.x, grid.y, values, levels=[grid.border], **style)
    lines.set_path_effects([withStroke(linewidth=3.0, foreground="white")])
    text = f"probability {grid.border:g} %" if grid.of == "probability" else "border of stability"
    return [Line2D([], [], color=BLACK, linewidth=1.3, linestyle="--", label=text)]


def _edges(values: Array) -> Array:
    """Return the ends of cells about ascending values: halfway to neighbours, none beyond the outermost."""
    return np.concatenate([values[:1], (values[1:] + values[:-1]) / 2, values[-1:]])


def _runs(grid: Grid, where: NDArray[np.bool_]) -> list[Array]:
    """Return rectangles that cover cells, one for each run of neighbours in a row."""
    x, y = _edges(grid.x), _edges(grid.y)
    found = []
    for row in np.flatnonzero(where.any(axis=1)):
        turns = np.flatnonzero(np.diff(np.concatenate([[False], where[row], [False]]).astype(np.int8)))
        for start, stop in zip(turns[::2], turns[1::2], strict=True):
            left, right, bottom, top = x[start], x[stop], y[row], y[row + 1]
            found.append(np.array([(left, bottom), (right, bottom), (right, top), (left, top)]))
    return found


def _border(x: Array, y: Array, unstable: NDArray[np.bool_], stable: NDArray[np.bool_]) -> list[Array]:
    """Return the sides that an unstable cell shares with a stable one."""
    across = (unstable[:, 1:] & stable[:, :-1]) | (stable[:, 1:] & unstable[:, :-1])
    along = (unstable[1:] & stable[:-1]) | (stable[1:] & unstable[:-1])
    upright = [np.array([(x[i + 1], y[j]), (x[i + 1], y[j + 1])]) for j, i in np.argwhere(across)]
    level = [np.array([(x[i], y[j + 1]), (x[i + 1], y[j + 1])]) for j, i in np.argwhere(along)]
    return upright + level
