"""How a design fails over friction: its fragility curve.

A fragility curve gives the probability of failure for a given load; here the load is the friction
coefficient, and failure is an unstable mode.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hipuq.errors import InputError, SchemaError
from hipuq.plots.captions import legend_below, level, wrapped
from hipuq.plots.measured import critical_marks
from hipuq.plots.style import (
    BORDER,
    LINES,
    axis_label,
    check_dataset,
    new_axes,
    plain,
)

NEEDED = ("probability", "probability_low", "probability_high")


def fragility(
    results: xr.Dataset | Mapping[str, xr.Dataset],
    *,
    ax: Axes | None = None,
    limit: float | None = None,
    label: str | None = None,
    critical: xr.Dataset | None = None,
) -> Axes:
    """Draw the fragility curve of a design: the probability of instability over friction.

    Parameters
    ----------
    results : Dataset or mapping
        As from `hipuq.fragility`: coord ``friction`` [1], ``probability(friction)``, and
        ``probability_low``, ``_high``, between which it lies at the attribute ``confidence`` and
        whatever the unknown samples are. The line has a gap where the probability is NaN. A mapping
        draws several curves, label in the legend -> results.
    ax : Axes, optional
        Where to draw, such as beside other curves; a new figure by default.
    limit : float, optional
        A tolerated probability [1], above 0 and below 1. It is drawn, with the neighbours in friction
        between which the curve first reaches it.
    label : str, optional
        Name of a single curve in the legend.
    critical : Dataset, optional
        As from ``hipuq.literature("critical_friction")``: marks where squeak set in on the bench, in or
        near the range of friction; the legend tells of those beyond.

    Returns
    -------
    Axes
        The one given, or that of the new figure.

    Raises
    ------
    SchemaError
        If the results are not of this kind.
    InputError
        If the limit is no probability between 0 and 1, a mapping is empty or has a `label` beside it.
    """
    if limit is not None and not (isinstance(limit, int | float) and 0 < limit < 1):
        raise InputError(f"limit is {limit!r}: it must be a probability above 0 and below 1")
    curves: dict[str | None, xr.Dataset]
    if not isinstance(results, Mapping):
        check_dataset(results, "results")
    if isinstance(results, xr.Dataset):
        curves = {label: _over_friction(results)}
    else:
        curves = {name: _over_friction(curve) for name, curve in results.items()}
        if not curves or label is not None:
            raise InputError(
                "results are a mapping: it must hold a curve or more, and names them itself, no label"
            )
    ax = new_axes(ax)
    for name, curve in curves.items():
        _draw(ax, curve, name, limit)
    if critical is not None:
        ends = [curve["friction"].values[[0, -1]] for curve in curves.values()]
        critical_marks(ax, critical, float(np.min(ends)), float(np.max(ends)))
    first = next(iter(curves.values()))
    ax.set_xlabel(axis_label(first["friction"]))
    ax.set_ylabel(wrapped(ax, axis_label(first["probability"], "%"), upright=True))
    finish(ax)
    return ax


def _draw(ax: Axes, results: xr.Dataset, label: str | None, limit: float | None) -> None:
    """Draw one curve with its interval, and where it reaches a limit."""
    friction = results["friction"].values
    probability, low, high = (100 * results[name].values for name in NEEDED)
    # Curves are the only lines on the Axes: each takes the next style.
    style = LINES[len(ax.lines) % len(LINES)]
    name = plain(label) if label is not None else "probability"
    if "confidence" in results.attrs and (high > low).any():
        name += f", {level(results)}"
    # The edges have the style of the line, so that bands are told apart in grey.
    colour = style["color"]
    edge = {"edgecolor": (colour, 0.7), "linestyle": style["linestyle"], "linewidth": 0.7}
    ax.fill_between(friction, low, high, facecolor=(colour, 0.15), **edge)
    ax.plot(friction, probability, label=name, **style)
    # A point between two gaps makes no line.
    gap = np.concatenate([[True], np.isnan(probability), [True]])
    alone = ~gap[1:-1] & gap[:-2] & gap[2:]
    ax.scatter(friction[alone], probability[alone], s=16, color=colour)
    if limit is not None:
        ax.hlines(100 * limit, friction[0], friction[-1], zorder=0.5, **BORDER)
        ends, text = _reached(friction, probability, 100 * limit)
        text = text if label is None else f"{plain(label)}: {text}"
        dropped = {"color": colour, "linewidth": 1.2, "linestyle": ":"}
        ax.vlines(ends, 0, 100 * limit, zorder=0.6, label=text, **dropped)


def _over_friction(results: xr.Dataset) -> xr.Dataset:
    """Return the results by ascending friction if they are a fragility curve."""
    for name in NEEDED:
        if name not in results or results[name].dims != ("friction",):
            raise SchemaError(f"the figure needs {name!r} over (friction): results of hipuq.fragility")
    if "friction" not in results.coords or not results.sizes["friction"]:
        raise SchemaError("the figure needs the coord 'friction' with at least one value")
    if not np.isfinite(results["friction"].values).all():
        raise SchemaError("a value of the coord 'friction' is not finite")
    return results.sortby("friction")


def _reached(
    friction: NDArray[np.float64], probability: NDArray[np.float64], limit: float
) -> tuple[list[float], str]:
    """Return the neighbours between which a limit [%] is first reached, and say so.

    No value in between is given: a curve that is a step has none.
    """
    known = ~np.isnan(probability)
    friction, reached = friction[known], probability[known] >= limit
    if not reached.any():
        return [], f"{limit:g} % not reached"
    first = int(reached.argmax())
    high = float(friction[first])
    if first == 0:
        return [high], f"{limit:g} % reached from {high:.4g}"
    low = float(friction[first - 1])
    digits = max(4, math.ceil(-math.log10(high - low) - 1e-6))
    return [low, high], f"{limit:g} % reached between {low:.{digits}f} and {high:.{digits}f}"


def finish(ax: Axes) -> None:
    """Set what figures of a share [%] over friction have in common."""
    ax.margins(x=0.02)
    ax.set_ylim(-4, 104)
    ax.set_yticks(range(0, 101, 20))
    ax.grid(axis="y", linewidth=0.4, alpha=0.5)
    legend_below(ax, width=9.9)
