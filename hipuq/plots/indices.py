"""Sobol indices of parameters: which of them the variance of an outcome comes from.

The first-order index of a parameter is the share of the variance that it explains alone, the
total-order index that with all its interactions (Saltelli et al., Global Sensitivity Analysis, 2008).
An estimate of an index near 0 may be negative; it is drawn as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from hipuq.errors import InputError, check_name
from hipuq.plots.captions import (
    UNDEFINED,
    distrust,
    inches,
    legend_below,
    level,
    over,
    parameter_label,
    put_title,
    reason,
    say,
    subject,
)
from hipuq.plots.style import BLACK, BLUE, GREY, ORANGE, new_axes

Array = NDArray[np.float64]

ORDERS: dict[str, tuple[str, dict[str, Any]]] = {
    "S1": ("first order (alone)", {"color": BLUE}),
    "ST": ("total order (with interactions)", {"facecolor": ORANGE, "hatch": "////", "edgecolor": "white"}),
}
"""Indices of parameters -> their name in the legend, and the style of their bars."""

WAY_OUT = "results of the method 'sobol' or 'chaos'"

THICK = 0.36
"""Thickness of a bar; two of them stand in the unit of a parameter."""

COLOURS = colormaps["Blues"]
"""Colours of the heat map: no interaction is white."""

ROOM_FOR_INTERVAL = 40
"""Size of a cell of the heat map from which it holds its interval too [pt]."""


def index_bars(
    results: xr.Dataset, *, ax: Axes | None = None, parameters: Sequence[str] | None = None
) -> Axes:
    """Draw first- and total-order indices of the parameters as bars.

    Parameters
    ----------
    results : Dataset
        Results of the method ``"sobol"`` or ``"chaos"``: ``S1(parameter)`` and ``ST(parameter)`` [1],
        and if there are any their limits ``S1_low`` to ``ST_high``. An index that is undefined (NaN)
        has no bar but says so; the title has the reason, cut to two lines.
    ax : Axes, optional
        Where to draw; by default a new figure, higher the more parameters there are.
    parameters : sequence of str, optional
        Parameters to show, from top to bottom. By default all, the largest total index first.

    Returns
    -------
    Axes
        The one given, or that of the new figure.

    Raises
    ------
    SchemaError
        If the results have no indices, or have them over more than the parameters, such as modes:
        then one has to be selected, as by ``results.sel(mode=18)``.
    UnknownNameError
        If a parameter is not in the results.
    InputError
        If `parameters` is empty.
    """
    indices = {name: over(results, name, ("parameter",), WAY_OUT) for name in ORDERS}
    here = [str(name) for name in indices["ST"]["parameter"].values]
    names = _largest_first(indices) if parameters is None else list(parameters)
    for name in names:
        check_name("parameter", name, here)
    if not names:
        raise InputError(f"parameters is empty: it must name at least one of {here}")
    ax = new_axes(ax, 6.8, max(2.4, 1.5 + 0.42 * min(len(names), 8) + 0.26 * max(len(names) - 8, 0)))
    size = min(10.0, 0.8 * 72 * inches(ax)[1] / len(names))
    place = np.arange(len(names), dtype=np.float64)
    values = {name: index.sel(parameter=names).values.astype(np.float64) for name, index in indices.items()}
    none = np.isnan(values["S1"]) & np.isnan(values["ST"])
    for side, (name, (label, style)) in zip((-1, 1), ORDERS.items(), strict=True):
        y = place + side * THICK / 2
        known = np.isfinite(values[name])
        if known.any():
            ax.barh(y[known], values[name][known], THICK, label=label, zorder=2, **style)
        if f"{name}_low" in results:
            _whiskers(ax, results, name, names, y, level(results) if name == "ST" else "_")
        _say_undefined(ax, y[~known & ~none], min(7.5, size))
    _say_undefined(ax, place[none], min(9.0, size))
    ax.axvline(0.0, color=BLACK, linewidth=0.8, zorder=2.5)
    if none.all():
        ax.set_xlim(0.0, 1.0)
    ax.set_yticks(place, [parameter_label(name) for name in names], fontsize=size, parse_math=False)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.grid(axis="x", linewidth=0.4, alpha=0.5)
    ax.set_xlabel("Sobol index: share of the variance [1]")
    why = reason(indices["ST"]) or reason(indices["S1"])
    undefined = f"{UNDEFINED}: {why}" if why else ""
    put_title(ax, subject(indices["ST"]), distrust(results), undefined)
    if not none.all():
        legend_below(ax, width=2.1)
    return ax


def second_order(results: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw second-order indices of the pairs of parameters as a heat map with numbers.

    Parameters
    ----------
    results : Dataset
        Results of the method ``"sobol"`` or ``"chaos"`` with ``S2(parameter, parameter_2)`` [1], and
        if there are any its limits. Each pair is shown once, as is its interval where it has one and
        there is room; a pair whose interval holds 0 is hatched. An undefined one is grey, or says so where
        there is room.
    ax : Axes, optional
        Where to draw; by default a new figure, larger the more parameters there are.

    Returns
    -------
    Axes
        The one given, or that of the new figure.

    Raises
    ------
    SchemaError
        If there are no such indices, or are over more than the parameters.
    """
    way_out = f"{WAY_OUT} with second order"
    table = over(results, "S2", ("parameter", "parameter_2"), way_out)
    names = [parameter_label(str(name)) for name in table["parameter"].values]
    cells = len(names) - 1
    cell = 0.85 if cells < 16 else 0.36
    ax = new_axes(ax, max(5.0, cell * cells + 2.8), max(4.2, cell * cells + 1.8))
    if cells == 0:
        say(ax, f"no pairs: {names[0]} is the only parameter")
        ax.set_axis_off()
        return ax
    # Rows 2 to last, columns first to last but one: each pair once, below the diagonal.
    values = table.values[1:, :-1].astype(np.float64)
    pairs = np.tril(np.ones(values.shape, dtype=bool))
    known = pairs & np.isfinite(values)
    top = float(values[known].max()) if known.any() else 0.0
    top = top if top > 0 else 1.0
    limits = _intervals(results)
    roomy = 72 * min(inches(ax)) / cells > ROOM_FOR_INTERVAL
    none = known & (limits[0] <= 0) & (limits[1] >= 0) if limits else np.zeros_like(known)
    _cells(ax, values, pairs, limits if roomy else [], none, top)
    below = "min" if (values[known] < 0).any() else "neither"
    bar = ax.figure.colorbar(
        ScalarMappable(Normalize(0.0, top), COLOURS), ax=ax, extend=below, fraction=0.06, aspect=30
    )
    bar.set_label("second-order index [1]")
    size = min(10.0, 0.62 * 72 * min(inches(ax)) / cells)
    ax.set_xticks(
        np.arange(cells), names[:-1], rotation=45, ha="right", rotation_mode="anchor", fontsize=size
    )
    ax.set_yticks(np.arange(cells), names[1:], fontsize=size)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    ax.set_xlim(-0.52, cells - 0.48)
    ax.set_ylim(cells - 0.48, -0.52)
    why = table.attrs.get("undefined", "") if not known.sum() == pairs.sum() else ""
    beneath = f"beneath: {level(results)}" if limits and roomy and known.any() else ""
    hatched = f"hatched: {level(results)} holds 0" if none.any() else ""
    undefined = f"{UNDEFINED}: {why}" if why else ""
    put_title(ax, subject(table), distrust(results), "; ".join(filter(None, [beneath, hatched])), undefined)
    return ax


def _largest_first(indices: dict[str, xr.DataArray]) -> list[str]:
    """Return the parameters by descending total index, undefined ones last."""
    total, first = (indices[name].values.astype(np.float64) for name in ("ST", "S1"))
    order = np.lexsort([np.nan_to_num(-first, nan=np.inf), np.nan_to_num(-total, nan=np.inf)])
    return [str(indices["ST"]["parameter"].values[i]) for i in order]


def _whiskers(ax: Axes, results: xr.Dataset, name: str, names: list[str], y: Array, label: str) -> None:
    """Draw limits as they are: a percentile interval need not hold the estimate.

    A label that begins with an underscore is not in the legend.
    """
    low, high = (
        over(results, f"{name}_{end}", ("parameter",), WAY_OUT).sel(parameter=names).values
        for end in ("low", "high")
    )
    known = np.isfinite(low) & np.isfinite(high)
    if known.any():
        width = 1.2 if len(names) < 16 else 0.7
        reach = np.array([low[known], high[known]])
        ax.hlines(y[known], *reach, color=BLACK, linewidth=width, zorder=3, label=label)
        ax.plot(reach, np.tile(y[known], (2, 1)), "|", color=BLACK, markersize=4 * width, zorder=3)


def _say_undefined(ax: Axes, y: Array, size: float) -> None:
    """Write at these heights, where a bar would begin, that there is none."""
    style: dict[str, Any] = {"textcoords": "offset points", "va": "center", "style": "italic"}
    for height in y:
        ax.annotate(UNDEFINED, (0, height), (4, 0), fontsize=size, **style)


def _intervals(results: xr.Dataset) -> list[Array]:
    """Return the limits of the second-order indices if there are any."""
    names = [f"S2_{end}" for end in ("low", "high")]
    if not all(name in results for name in names):
        return []
    dims = ("parameter", "parameter_2")
    return [over(results, name, dims, WAY_OUT).values[1:, :-1] for name in names]


def _cells(
    ax: Axes,
    values: Array,
    pairs: NDArray[np.bool_],
    limits: list[Array],
    none: NDArray[np.bool_],
    top: float,
) -> None:
    """Draw a cell for each pair with its number, and its interval beneath; `top` has the darkest.

    Cells of `none` are hatched.
    """
    room = 72 * min(inches(ax)) / len(values)
    roomy = room > ROOM_FOR_INTERVAL
    size = min(9.0, room / 6.5) if roomy else min(8.0, 0.34 * room)
    decimals = 3 if roomy and top < 0.095 else 2
    for i, j in np.argwhere(pairs):
        value = float(values[i, j])
        known = np.isfinite(value)
        text = _fixed(value, decimals) if known else UNDEFINED if roomy else ""
        if known and limits:
            low, high = (_fixed(end[i, j], decimals) for end in limits)
            text += f"\n{low} to\n{high}"
        lightness = float(np.clip(value / top, 0.0, 1.0)) if known else 0.0
        fill: dict[str, Any] = {"facecolor": COLOURS(lightness), "edgecolor": GREY}
        if none[i, j]:
            line = ("white", 0.7) if lightness > 0.35 else (GREY, 0.6)
            fill |= {"hatch": "///" if roomy else "//////", "edgecolor": line}
        if not known:
            fill = {"facecolor": (GREY, 0.25), "edgecolor": GREY, "hatch": "" if roomy else "xx"}
        ax.add_patch(Rectangle((j - 0.5, i - 0.5), 1, 1, linewidth=0.5, clip_on=False, **fill))
        colour, behind = ("white", COLOURS(lightness)) if lightness > 0.6 else (BLACK, "white")
        style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": size, "color": colour}
        shown = ax.text(j, i, text, **style)
        if none[i, j]:
            shown.set_path_effects([withStroke(linewidth=2.5, foreground=behind)])


def _fixed(value: float, decimals: int) -> str:
    # Adding 0 takes the sign from a rounded 0.
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}"
