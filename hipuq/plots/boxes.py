"""How much the probability that a mode is unstable differs between contact patterns: boxplots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from hipuq.plots.captions import legend_below, over, wrapped
from hipuq.plots.grouping import WAY_OUT, by_number, check_values, left_out, patterns
from hipuq.plots.occurrences import LAST, mode_label, mode_tick
from hipuq.plots.style import (
    BLACK,
    FILLS,
    axis_label,
    check_dataset,
    new_axes,
    percent_top,
)

Array = NDArray[np.float64]

ROOM = 0.84
"""Share of the place of a mode that its boxes fill."""

MOST = 12
"""Modes shown by default at most."""


def boxplots(
    results: xr.Dataset,
    *,
    counts: Sequence[int] | None = None,
    modes: Sequence[int] | None = None,
    names: Mapping[int, str] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw, for each mode and number in contact, a box of the probabilities of the contact patterns.

    A box reaches from the first to the third quartile over the patterns, with a line at the median and a
    diamond at the mean; whiskers reach to the least and the greatest. Patterns count alike. A pattern whose
    probability is unknown is in no box: a question mark stands beneath, with their number.

    Parameters
    ----------
    results : Dataset
        Of a stratified analysis of ``unstable`` or an exact one of ``probability_by_mode``:
        ``probability(pattern, mode)`` and the coord ``in_contact(pattern)``.
    counts : sequence of int, optional
        Numbers in contact; all by default.
    modes : sequence of int, optional
        Modes to show; by default those that are not stable in every pattern shown, the last twelve if
        there are more. The label of the x axis then says which are left out.
    names : mapping, optional
        Mode number -> name that the source gives it, shown beneath.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        The one given, or that of the new figure.

    Raises
    ------
    SchemaError
        If the results are not of this kind, or are over more, such as a swept parameter.
    InputError
        If a number in contact or a mode is not in them.
    """
    check_dataset(results, "results")
    probability = over(results, "probability", ("pattern", "mode"), WAY_OUT)
    groups = by_number(results, counts)
    ever = _ever(probability, groups)
    chosen = probability.sel(mode=_modes(probability, ever, modes))
    values = 100 * chosen.values.astype(np.float64)
    ax = new_axes(ax, 8.0, 4.6)
    wide = ROOM / len(groups)
    place = np.arange(values.shape[1], dtype=np.float64)
    for i, (count, rows) in enumerate(groups.items()):
        at = place + (i - (len(groups) - 1) / 2) * wide
        label = f"{count} in contact ({patterns(len(rows))})"
        _boxes(ax, at, values[rows], 0.86 * wide, label, FILLS[i % len(FILLS)])
    handles = [*ax.get_legend_handles_labels()[0], *_key(any(text.get_text() for text in ax.texts))]
    for left in place[1:]:
        ax.axvline(left - 0.5, color=BLACK, linewidth=0.3, alpha=0.4, zorder=0.4)
    ax.set_xticks(place, [mode_tick(chosen, i, names or {}) for i in range(len(place))])
    ax.tick_params(axis="x", labelsize="small", length=0)
    ax.set_xlim(-0.5, len(place) - 0.5)
    top = percent_top(values)
    ax.set_ylim(-top / 26, top)
    ax.grid(axis="y", linewidth=0.4, alpha=0.5)
    ax.set_axisbelow(True)
    gone = "" if modes is not None else left_out(probability["mode"].values, ever, chosen["mode"].values)
    ax.set_xlabel("\n".join(wrapped(ax, part) for part in (mode_label(chosen, names), gone) if part))
    ax.set_ylabel(wrapped(ax, axis_label(probability, "%"), upright=True))
    legend_below(ax, width=2.4, handles=handles)
    return ax


def _ever(probability: xr.DataArray, groups: Mapping[int, NDArray[np.intp]]) -> NDArray[np.bool_]:
    """Say which modes are not stable in all patterns shown; what is unknown is not known to be stable."""
    shown = probability.values[np.concatenate(list(groups.values()))]
    return np.asarray(~(shown == 0).all(axis=0))


def _modes(probability: xr.DataArray, ever: NDArray[np.bool_], modes: Sequence[int] | None) -> list[int]:
    """Return the modes to draw."""
    here = probability["mode"].values
    if modes is not None:
        return check_values("mode", modes, here.tolist())
    found = here[ever] if ever.any() else here[-LAST:]
    return [int(mode) for mode in found[-MOST:]]


def _boxes(ax: Axes, at: Array, values: Array, wide: float, label: str, fill: dict[str, Any]) -> None:
    """Draw the boxes of one number in contact, (patterns, modes), beside each other."""
    known = ~np.isnan(values)
    drawn = known.any(axis=0)
    low, first, median, third, high = (
        np.array(
            [
                np.quantile(column[here], q)
                for column, here in zip(values.T, known.T, strict=True)
                if here.any()
            ]
        )
        for q in (0.0, 0.25, 0.5, 0.75, 1.0)
    )
    x = at[drawn]
    ax.bar(
        x, third - first, wide, bottom=first, edgecolor=BLACK, linewidth=0.7, label=label, zorder=2, **fill
    )
    line: dict[str, Any] = {"color": BLACK, "zorder": 2.1}
    ax.vlines(np.tile(x, 2), np.append(low, third), np.append(first, high), linewidth=0.8, **line)
    ends = np.append(low, high)
    ax.hlines(ends, np.tile(x - wide / 4, 2), np.tile(x + wide / 4, 2), linewidth=0.8, **line)
    ax.hlines(median, x - wide / 2, x + wide / 2, linewidth=1.8, **line)
    mean = np.array(
        [column[here].mean() for column, here in zip(values.T, known.T, strict=True) if here.any()]
    )
    ax.plot(
        x, mean, "D", color=BLACK, markerfacecolor="white", markersize=3.6, markeredgewidth=0.8, zorder=2.2
    )
    for i in np.flatnonzero(~known.all(axis=0)):
        text = f"?\n{int((~known[:, i]).sum())}"
        style: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": "x-small"}
        ax.annotate(text, (at[i], 0.01), xycoords=("data", "axes fraction"), **style)


def _key(unknown: bool) -> list[Line2D]:
    """Return handles of the legend that say what the parts of a box are."""
    diamond: dict[str, Any] = {"marker": "D", "markerfacecolor": "white", "markersize": 3.6}
    parts = [
        Line2D([], [], color=BLACK, linewidth=1.8, label="median (box: quartiles)"),
        Line2D([], [], color=BLACK, linewidth=0.8, label="whiskers: minimum, maximum"),
        Line2D([], [], color=BLACK, linestyle="none", label="mean", **diamond),
    ]
    if unknown:
        mark: dict[str, Any] = {"marker": "$?$", "linestyle": "none", "color": BLACK}
        parts.append(Line2D([], [], label="patterns unknown, their number", **mark))
    return parts
