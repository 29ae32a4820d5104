"""Probability of instability over a parameter that was swept, such as the damping ratio."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hipuq.errors import InputError, SchemaError, check_name
from hipuq.plots.captions import distrust, legend_below, level, put_title, selected, wrapped
from hipuq.plots.measured import incidence_band
from hipuq.plots.scales import label_decades
from hipuq.plots.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    axis_label,
    check_dataset,
    new_axes,
    percent_top,
    plain,
    scaled,
)
from hipuq.sweeping import swept

Array = NDArray[np.float64]

SCALES = ("linear", "log")

CURVES: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "linestyle": "-", "linewidth": 1.4, "marker": "o"},
    {"color": ORANGE, "linestyle": (0, (4, 1.5)), "linewidth": 2.6, "marker": "^"},
    {"color": GREEN, "linestyle": "-.", "linewidth": 1.2, "marker": "s"},
    {"color": PURPLE, "linestyle": (0, (1, 1)), "linewidth": 2.6, "marker": "D"},
    {"color": VERMILLION, "linestyle": (0, (8, 2)), "linewidth": 1.2, "marker": "v"},
    {"color": SKY, "linestyle": (0, (6, 1, 1, 1)), "linewidth": 2.6, "marker": "P"},
)
"""Styles of curves, taken in turn: thin, dark and open, or thick, light and filled."""

MARKS: tuple[dict[str, Any], ...] = (
    {"markersize": 4.5, "markerfacecolor": "white", "zorder": 2.2},
    {"markersize": 7.0, "markeredgecolor": BLACK, "markeredgewidth": 0.6, "zorder": 2.1},
)
"""Markers by turns; open ones are smaller and lie above, so that both are seen where they meet."""


@dataclass(frozen=True)
class Curve:
    """A probability over a parameter, by ascending values of it.

    Attributes
    ----------
    x, probability, low, high : (values,) array
        Probabilities [%], NaN where unknown; without limits both are the probability itself.
    dim, x_label, y_label : str
        The parameter and the labels of the axes.
    limits : str
        What the limits are; empty where they say nothing.
    where : tuple of str
        What else the results were selected at, and what to know of them.
    """

    x: Array
    probability: Array
    low: Array
    high: Array
    dim: str
    x_label: str
    y_label: str
    limits: str
    where: tuple[str, ...]


def probability_over(
    results: xr.Dataset | Mapping[str, xr.Dataset],
    *,
    dim: str | None = None,
    literature: xr.Dataset | None = None,
    scale: str = "linear",
    ax: Axes | None = None,
) -> Axes:
    """Draw the probability of instability over a swept parameter, with its interval.

    Parameters
    ----------
    results : Dataset or mapping
        As from `hipuq.sweep`: ``probability_overall`` of stratified results, else ``probability``, over one
        parameter, and if there are any its limits ``_low`` and ``_high``. A mapping draws several, label in
        the legend -> results. Damping ratios are drawn in per cent.
    dim : str, optional
        The parameter on the x axis; by default the only one of the results.
    literature : Dataset, optional
        As from ``hipuq.literature("incidence")``: drawn as a band from the lowest to the highest incidence
        reported. That is another quantity, as the legend says.
    scale : {"linear", "log"}
        Of the probability. On the logarithmic one a probability of 0 has no place: an arrow points down
        from its upper limit.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        Where the probability is unknown the line has a gap, with a question mark on the x axis.

    Raises
    ------
    SchemaError
        If the results have no probability, have it over more than one parameter, or differ in it.
    InputError
        If the mapping is empty.
    UnknownNameError
        If there is no such scale.
    """
    check_name("scale", scale, SCALES)
    if not isinstance(results, xr.Dataset | Mapping):
        raise SchemaError(f"results must be a Dataset, or a dict of them, not {type(results).__name__}")
    given = {"": results} if isinstance(results, xr.Dataset) else dict(results)
    if not given:
        raise InputError("results are empty: give at least one")
    for label, part in given.items():
        check_dataset(part, f"results {label!r}" if label else "results")
    curves = {label: _curve(part, dim) for label, part in given.items()}
    dims = sorted({curve.dim for curve in curves.values()})
    if len(dims) > 1:
        raise SchemaError(f"the results are over {' and '.join(dims)}: curves need the same parameter")
    first = next(iter(curves.values()))
    ax = new_axes(ax)
    band = None if literature is None else incidence_band(ax, literature)
    bottom, top = _limits(ax, list(curves.values()), band, scale)
    said = {curve.limits for curve in curves.values()}
    shared = next(iter(said)) if len(said) == 1 and len(curves) > 1 else ""
    for label, curve in curves.items():
        _draw(ax, curve, plain(str(label)), "" if shared else curve.limits, scale, bottom)
    if shared:
        ax.fill_between([], [], [], facecolor=(GREY, 0.2), edgecolor=GREY, label=f"bands: {shared}")
    if scale == "log":
        ax.set_yscale("log")
    ax.set_ylim(bottom, top)
    if scale == "log":
        label_decades(ax.yaxis)
    ax.grid(axis="y", linewidth=0.4, alpha=0.5)
    ax.set_xlabel(first.x_label)
    ax.set_ylabel(wrapped(ax, first.y_label, upright=True))
    if len(curves) == 1:
        put_title(ax, *first.where)
    legend_below(ax, width=5.2)
    return ax


def _curve(results: xr.Dataset, dim: str | None) -> Curve:
    """Return the probability of results over one parameter."""
    if not isinstance(results, xr.Dataset):
        raise SchemaError(f"results must be a Dataset or a mapping of them, not {type(results).__name__}")
    name = next((name for name in ("probability_overall", "probability") if name in results), None)
    if name is None:
        raise SchemaError("the figure needs 'probability' over a parameter: results of hipuq.sweep")
    whole = results[name]
    dims = [str(own) for own in whole.dims]
    if dim is None:
        # Of results over modes too, the parameter is the one that was swept.
        over = [own for own in swept(results) if own in dims] or dims
        if len(over) > 1:
            raise SchemaError(
                f"{name} is over {' and '.join(over)}: name one as dim and select the others, such as "
                f"hipuq.sweeping.at(results, {over[-1]}={results[over[-1]].values[-1]!s})"
            )
        dim = over[0] if over else None
    if dim is None or dim not in dims or dim not in results.coords or not results.sizes[dim]:
        here = f"over {' and '.join(dims)}" if dims else "a single number"
        raise SchemaError(
            f"{name} is {here}: the figure needs it over {dim or 'a parameter, as hipuq.sweep'}"
        )
    more = [own for own in dims if own != dim]
    if more:
        value = results[more[0]].values[-1]
        raise SchemaError(f"{name} is over {more[0]} too: select one, such as results.sel({more[0]}={value})")
    if not np.isfinite(results[dim].values).all():
        raise SchemaError(f"a value of the coord {dim!r} is not finite")
    results = results.sortby(dim)
    x, label = scaled(results[dim])
    values = 100 * results[name].values.astype(np.float64)
    low, high = (
        100 * results[key].values.astype(np.float64) if (key := f"{name}_{end}") in results else values
        for end in ("low", "high")
    )
    limits = level(results) if (high > low).any() else ""
    # The estimate by level has the shorter name.
    said = axis_label(results.get("probability", whole), "%")
    return Curve(x, values, low, high, dim, label, said, limits, (selected(whole), distrust(results)))


def _limits(
    ax: Axes, curves: list[Curve], band: tuple[float, float] | None, scale: str
) -> tuple[float, float]:
    """Return the ends of the y axis [%], which hold what was drawn before too."""
    old = ax.get_ylim() if ax.lines else None
    parts = [values for curve in curves for values in (curve.probability, curve.high)]
    known = np.concatenate([*parts, band or ()])
    if scale == "log":
        least = known[known > 0]
        bottom = 10.0 ** np.floor(np.log10(least.min() / 1.5)) if least.size else 1e-3
        return min(bottom, old[0]) if old else float(bottom), 130.0
    top = percent_top(known)
    top = max(top, old[1]) if old else top
    return -0.04 * top, top


def _draw(ax: Axes, curve: Curve, label: str, limits: str, scale: str, bottom: float) -> None:
    """Draw one curve with its band, and mark what it cannot show; the legend has its label and limits."""
    # Curves are the only lines on the Axes: each takes the next style.
    rank = len(ax.lines)
    style = CURVES[rank % len(CURVES)] | MARKS[rank % len(MARKS)]
    colour = style["color"]
    x, values = curve.x, curve.probability
    if curve.limits:
        # The edges have the style of the line, so that bands are told apart in grey.
        edge = {"edgecolor": (colour, 0.7), "linestyle": style["linestyle"], "linewidth": 0.7}
        low = np.maximum(curve.low, bottom) if scale == "log" else curve.low
        ax.fill_between(x, low, curve.high, facecolor=(colour, 0.15), **edge)
    none = (values == 0) & (scale == "log")
    text = ", ".join(filter(None, [label or "probability", limits]))
    shown = np.where(none, np.nan, values)
    ax.plot(x, shown, label=text, **style)
    if none.any():
        at = np.where(curve.high[none] > 0, curve.high[none], 1.3 * bottom)
        down: dict[str, Any] = {"marker": "$\\downarrow$", "color": colour, "s": 70, "zorder": 3}
        text = "0 %: arrow down from the upper limit" if curve.limits else "0 %: arrow down"
        ax.scatter(x[none], at, label=f"{label}, {text}" if label else text, **down)
    for place in x[np.isnan(values)]:
        mark: dict[str, Any] = {"ha": "center", "va": "bottom", "color": colour, "weight": "bold"}
        ax.annotate("?", (place, 0.02 + 0.05 * rank), xycoords=("data", "axes fraction"), **mark)
