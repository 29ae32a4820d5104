"""Probability of any unstable mode, by number in contact."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from hipuq.errors import InputError
from hipuq.plots.captions import legend_below, level, over, wrapped
from hipuq.plots.grouping import WAY_OUT
from hipuq.plots.style import (
    BLACK,
    BLUE,
    VERMILLION,
    axis_label,
    check_dataset,
    new_axes,
    percent_top,
)

NEEDED = ("probability_min", "probability_mean", "probability_max")


def by_count(results: xr.Dataset, *, exact: xr.Dataset | None = None, ax: Axes | None = None) -> Axes:
    """Draw the probability of instability for each number in contact: its mean, and its range over patterns.

    Parameters
    ----------
    results : Dataset
        Of a stratified analysis of ``any_unstable`` or ``probability``: ``probability_mean``, ``_min``,
        ``_max`` over ``count``, and if there are any the limits ``probability_mean_low``, ``_high``. The
        mean is over the patterns alike.
    exact : Dataset, optional
        Exact results of the same probability, of the same form as `results` and with the same numbers in
        contact: drawn as bars.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        A question mark stands where the mean is unknown.

    Raises
    ------
    SchemaError
        If the results are not of this kind, or are over more, such as modes or a swept parameter.
    InputError
        If the exact results have other numbers in contact.
    """
    check_dataset(results, "results")
    low, mean, high = (100 * over(results, name, ("count",), WAY_OUT).values for name in NEEDED)
    counts = results["count"].values.tolist()
    place = np.arange(len(counts), dtype=np.float64)
    others = None
    if exact is not None:
        there = over(exact, NEEDED[1], ("count",), WAY_OUT)["count"].values.tolist()
        if sorted(there) != sorted(counts):
            raise InputError(f"count of the exact results is {there}: it must be {counts}, as of the sampled")
        exact = exact.sel(count=counts)
        others = [100 * over(exact, name, ("count",), WAY_OUT).values for name in NEEDED]
    ax = new_axes(ax, 5.6, 4.2)
    spread = high > low
    if spread.any():
        bars: dict[str, Any] = {"color": BLACK, "linewidth": 0.8, "label": "range over the patterns"}
        ax.vlines(place[spread], low[spread], high[spread], **bars)
        end: dict[str, Any] = {"linestyle": "none", "markersize": 7}
        ax.plot(place[spread], high[spread], "^", color=VERMILLION, label="maximum", **end)
        ax.plot(place[spread], low[spread], "v", color=BLUE, label="minimum", **end)
    reach = None
    ends = [f"probability_mean_{end}" for end in ("low", "high")]
    if all(end in results for end in ends):
        limits = [100 * over(results, end, ("count",), WAY_OUT).values for end in ends]
        found = np.clip([mean - limits[0], limits[1] - mean], 0.0, None)
        reach = found if (found > 0).any() else None
    style: dict[str, Any] = {"fmt": "o", "color": BLACK, "markerfacecolor": "white", "markersize": 6}
    text = "mean" if reach is None else f"mean, {level(results)}"
    ax.errorbar(place, mean, reach, capsize=4, elinewidth=2.2, label=text, **style)
    if others is not None:
        bar: dict[str, Any] = {"marker": "_", "markersize": 22, "markeredgewidth": 1.1, "color": BLACK}
        ax.plot(np.tile(place, 3), np.concatenate(others), linestyle="none", label="exact", **bar)
    for x in place[np.isnan(mean)]:
        ax.annotate("?", (x, 0.02), xycoords=("data", "axes fraction"), ha="center", va="bottom")
    ax.set_xticks(place, [_tick(results, int(count)) for count in counts])
    ax.set_xlim(-0.6, len(counts) - 0.4)
    top = percent_top(high, mean if reach is None else mean + reach[1], *(others or []))
    ax.set_ylim(-top / 26, top)
    ax.grid(axis="y", linewidth=0.4, alpha=0.5)
    ax.set_xlabel(
        "oscillators in contact (patterns)" if "in_contact" in results.coords else "oscillators in contact"
    )
    ax.set_ylabel(wrapped(ax, axis_label(results.get("probability", results[NEEDED[1]]), "%"), upright=True))
    legend_below(ax, width=1.7)
    return ax


def _tick(results: xr.Dataset, count: int) -> str:
    """Return the number in contact, and beneath how many patterns have it."""
    if "in_contact" not in results.coords:
        return str(count)
    return f"{count}\n({int((results['in_contact'].values == count).sum())})"
