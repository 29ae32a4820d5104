"""Methods beside each other on one problem with a known answer: error, coverage and cost."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hipuq.errors import check_name
from hipuq.plots.captions import UNDEFINED, level, over, put_title, say, wrapped
from hipuq.plots.contenders import (
    DIMS,
    STYLES,
    WAY_OUT,
    add_legend,
    at_budgets,
    baseline_of,
    chosen,
    cost_of,
    curve,
    exact_errors,
    in_lines,
    method_label,
    names_of,
    problem_of,
    reference_error,
    replicates_of,
    side_by_side,
    stated_level,
    upright,
    with_limits,
)
from hipuq.plots.scales import label_decades, set_log_y
from hipuq.plots.style import BLACK, GREY, axis_label, new_axes

Array = NDArray[np.float64]

COSTS = ("evaluations", "seconds")

SLOPES = {"evaluations": {"$n^{-1/2}$": -0.5, "$n^{-1}$": -1.0}, "seconds": {"$t^{-1/2}$": -0.5}}
"""Cost -> theoretical slopes, by what is written on them."""

TOLERANCE = 3.0
"""By how much a coverage may miss the stated level and still be taken for it [%]."""

NEAR_ONE = (0.6, 1 / 0.6)
"""Ratios that an axis of ratios shows at least."""


def error_over_cost(
    race: xr.Dataset, *, ax: Axes | None = None, cost: str = "evaluations", parameter: str | None = None
) -> Axes:
    """Draw the root mean square error of each method over what it cost.

    Parameters
    ----------
    race : Dataset
        Results of `hipuq.compare`: ``rmse`` with its limits, of indices ``rmse_overall``; ``evaluations``
        or ``run_time``; the reference with its limits.
    ax : Axes, optional
        Where to draw; a new figure by default.
    cost : {"evaluations", "seconds"}
        Model evaluations, or the median time of a run.
    parameter : str, optional
        Of indices, the parameter whose error is drawn; by default that over all of them.

    Returns
    -------
    Axes
        Both axes are logarithmic; that of the error is broken where three decades or more hold nothing.
        Over evaluations, points of methods stand side by side, near their number.
        An error of 0, or one that is rounding, has no place on it: the legend names the method and says
        so. Thin dashed lines are theoretical slopes through the first point of the baseline, over time
        through its last one. A dotted line is the standard error of a reference that is not exact: smaller
        errors cannot be told.

    Raises
    ------
    SchemaError
        If something is missing, or the errors are over more than methods and budgets.
    UnknownNameError
        If there is no such cost or parameter.
    """
    check_name("cost", cost, COSTS)
    race, name = chosen(race, "rmse", parameter)
    error, low, high = with_limits(race, name)
    x = cost_of(race, cost)
    own, exact = reference_error(race), exact_errors(race, error)
    drawn = np.isfinite(error) & np.isfinite(x) & ~exact
    ax = _new(ax, race)
    bars = np.concatenate([low[drawn], high[drawn]])
    # Bars may reach down to anything where some resamples have no error; a reference far better than
    # all methods would only take up room.
    least = 0.1 * float(error[drawn].min(initial=np.inf))
    near = [value for value in (*bars, own) if value > least]
    parts = _scales(ax, x[drawn], [*error[drawn], *near], count=cost == "evaluations")
    if cost == "evaluations":
        x = side_by_side(ax, x)
    for i, method in enumerate(names_of(race)):
        text = "error 0 to rounding" if (error[i][exact[i]] > 0).any() else "exact: error 0"
        note = at_budgets(race, text, exact[i], np.isfinite(x[i]))
        label = method_label(race, method, note or ("" if drawn[i].any() else UNDEFINED))
        curve(ax, i, x[i], np.where(drawn[i], error[i], np.nan), label, (low[i], high[i]))
    if drawn.any():
        # A small run takes as long as no run: time goes with n only in the largest.
        i, j = _anchor(race, drawn, last=cost == "seconds")
        _slopes(ax, (float(x[i, j]), float(error[i, j])), SLOPES[cost], parts)
    else:
        say(ax, "every error is 0: none on a logarithmic axis" if exact.any() else UNDEFINED)
    text = in_lines(f"standard error of the reference: {own:.2g}") if own > 0 else ""
    shown = own in near
    if shown:
        ax.axhline(own, color=BLACK, linestyle=":", linewidth=1.0, zorder=1.5, label=text)
    elif text:
        ax.plot([], [], linestyle="none", label=text)
    below = "errors below the dotted line cannot be told" if shown else ""
    text = "median time of a run [s]" if cost == "seconds" else axis_label(race["evaluations"])
    _write(ax, race, name, (text, axis_label(race[name])), f"bars: {level(race)}", below)
    return ax


def coverage(race: xr.Dataset, *, ax: Axes | None = None, parameter: str | None = None) -> Axes:
    """Draw how many of a method's intervals hold the reference, over evaluations.

    Parameters
    ----------
    race : Dataset
        Results of `hipuq.compare`: ``coverage`` with its limits, of indices ``coverage_overall``, and
        ``evaluations``. The level that intervals state is read from the options; it is 95 % unless
        there is another.
    ax : Axes, optional
        Where to draw; a new figure by default.
    parameter : str, optional
        Of indices, the parameter whose intervals are counted; by default those of all.

    Returns
    -------
    Axes
        Points stand side by side, near their evaluations. The line is the stated level, the band reaches
        3 % to either side: above it intervals are conservative, below it too narrow. Methods without
        intervals are named in the legend; one that states another level has a line of its own.

    Raises
    ------
    SchemaError
        If something is missing, or the coverage is over more than methods and budgets.
    UnknownNameError
        If there is no such parameter.
    """
    race, name = chosen(race, "coverage", parameter)
    share, low, high = (100 * part for part in with_limits(race, name))
    x = cost_of(race, "evaluations")
    drawn = np.isfinite(share) & np.isfinite(x)
    stated = [100 * stated_level(race, method) for method in names_of(race)]
    common = max(stated, key=stated.count)
    ends = common - TOLERANCE, min(common + TOLERANCE, 100.0)
    ax = _new(ax, race)
    _set_x(ax, x[drawn], count=True)
    least = min([*low[drawn], *share[drawn], *stated, ends[0] - 2])
    ax.set_ylim(least - 0.04 * (100 - least), 100 + 0.04 * (100 - least))
    band = f"{ends[0]:g} to {ends[1]:g} %"
    ax.axhspan(*ends, facecolor=(GREY, 0.2), linewidth=0, zorder=0.5, label=band)
    ax.axhline(common, color=BLACK, linewidth=0.9, zorder=1.5, label=f"stated level: {common:g} %")
    x = side_by_side(ax, x, step=min(0.012, 0.06 / len(x)))
    for i, method in enumerate(names_of(race)):
        note = "" if drawn[i].any() else "no intervals" if np.isfinite(x[i]).any() else UNDEFINED
        if drawn[i].any() and stated[i] != common:
            note = f"states {stated[i]:g} %"
            style = {key: STYLES[i % len(STYLES)][key] for key in ("color", "linestyle")}
            ax.axhline(stated[i], linewidth=0.9, zorder=1.5, **style)
        label = method_label(race, method, note)
        curve(ax, i, x[i], np.where(drawn[i], share[i], np.nan), label, (low[i], high[i]))
    if not drawn.any():
        say(ax, "no method has intervals" if np.isfinite(x).any() else UNDEFINED)
    labels = (axis_label(race["evaluations"]), axis_label(race[name], "%"))
    beyond = "above the band: conservative, below: too narrow"
    _write(ax, race, name, labels, f"bars: {level(race)}", beyond)
    return ax


def cost_of_accuracy(race: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the time of each method over the time that the baseline needs for the same error.

    Parameters
    ----------
    race : Dataset
        Results of `hipuq.compare`: ``cost_ratio``, ``evaluations``, ``rmse`` and ``reference``; the
        baseline is the attribute ``baseline``.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        Both axes are logarithmic; that of the ratio is broken where three decades or more hold nothing.
        Points of methods stand side by side, near their evaluations. The line at 1 is the baseline: above
        it a method costs more than it saves. A ratio of 0, as of an error of 0, has no place on it: the
        legend names the method and says so.

    Raises
    ------
    SchemaError
        If something is missing.
    """
    ratio = over(race, "cost_ratio", DIMS, WAY_OUT).values.astype(np.float64)
    name = "rmse_overall" if "rmse_overall" in race else "rmse"
    exact = exact_errors(race, over(race, name, DIMS, WAY_OUT).values) & np.isfinite(ratio) | (ratio == 0)
    x = cost_of(race, "evaluations")
    names, baseline = names_of(race), baseline_of(race)
    others = np.array([name != baseline for name in names])
    drawn = np.isfinite(ratio) & ~exact & np.isfinite(x) & others[:, None]
    ax = _new(ax, race)
    _scales(ax, x[np.isfinite(x)], [*ratio[drawn], *NEAR_ONE], count=True)
    if drawn.any() or not others.any():
        ax.axhline(1.0, color=BLACK, linewidth=1.0, zorder=1.5, label=in_lines(f"{baseline} (baseline): 1"))
    else:
        say(ax, "every ratio is 0: none on a logarithmic axis" if exact[others].any() else UNDEFINED)
    x = side_by_side(ax, x)
    for i in np.flatnonzero(others).tolist():
        run = np.isfinite(x[i])
        text = "ratio 0 to rounding" if (ratio[i][exact[i]] > 0).any() else "exact: ratio 0"
        never = at_budgets(race, "infinite", run & np.isposinf(ratio[i]), run)
        note = at_budgets(race, text, exact[i], run) or never or ("" if drawn[i].any() else UNDEFINED)
        curve(ax, i, x[i], np.where(drawn[i], ratio[i], np.nan), method_label(race, names[i], note), None)
    labels = (axis_label(race["evaluations"]), f"time by that of {baseline} for the same error [1]")
    _write(ax, race, name, labels, "", f"above 1: costs more than {baseline}, below: less")
    return ax


def _new(ax: Axes | None, race: xr.Dataset) -> Axes:
    """Return `ax`, or new Axes with room for a legend of all methods."""
    return new_axes(ax, 6.4, 4.4 + 0.17 * max(0, (len(names_of(race)) - 3) // 2))


def _anchor(race: xr.Dataset, drawn: NDArray[np.bool_], *, last: bool) -> tuple[int, int]:
    """Return method and budget of an end point of the baseline; of another method if it has none."""
    names, baseline = names_of(race), baseline_of(race)
    ranked = sorted(range(len(names)), key=lambda i: names[i] != baseline)
    i = next(i for i in ranked if drawn[i].any())
    return i, int(np.flatnonzero(drawn[i])[-1 if last else 0])


def _set_x(ax: Axes, x: Array, *, count: bool) -> None:
    """Make the x axis logarithmic about these values."""
    ax.set_xscale("log")
    if x.size:
        ax.set_xlim(x.min() / 1.25, x.max() * 1.25)
    label_decades(ax.xaxis, count=count)
    ax.grid(axis="y", linewidth=0.4, alpha=0.5)


def _scales(ax: Axes, x: Array, y: list[float], *, count: bool) -> list[tuple[float, float]]:
    """Make both axes logarithmic about these values; return the parts of the y axis."""
    _set_x(ax, x, count=count)
    if y:
        return set_log_y(ax, y)
    ax.set_yticks([])
    return [ax.get_ylim()]


def _slopes(
    ax: Axes, anchor: tuple[float, float], slopes: dict[str, float], parts: list[tuple[float, float]]
) -> None:
    """Draw theoretical slopes through a point, within its part of the axis, and name them on the line."""
    x0, y0 = anchor
    left, right = ax.get_xlim()
    bottom, top = next((low, high) for low, high in parts if low <= y0 <= high)
    for side, (text, slope) in zip(("bottom", "top"), slopes.items(), strict=False):
        first, last = (x0 * (end / y0) ** (1 / slope) for end in (top, bottom))
        x = np.array([max(left, first), min(right, last)])
        y = y0 * (x / x0) ** slope
        ax.plot(x, y, color=GREY, linestyle="--", linewidth=0.7, zorder=1.2)
        # Beside the Axes, or above the end of a line that leaves them at the bottom.
        style: dict[str, Any] = {"va": side if last > right else "bottom", "fontsize": "small", "color": GREY}
        ax.annotate(text, (x[1], y[1]), (4, 0), textcoords="offset points", **style)


def _write(ax: Axes, race: xr.Dataset, name: str, labels: tuple[str, str], bars: str, note: str) -> None:
    """Write labels of the axes, title and legend."""
    ax.set_xlabel(wrapped(ax, labels[0]))
    ax.set_ylabel(upright(ax, labels[1]), parse_math=False)
    put_title(ax, problem_of(race, name), replicates_of(race, bars), note)
    add_legend(ax)
