"""Which oscillators are in contact, and how probable instability then is: a map of the patterns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch
from numpy.typing import NDArray

from hipuq.errors import SchemaError
from hipuq.plots.captions import inches, legend_below, over, wrapped
from hipuq.plots.grouping import WAY_OUT, by_number
from hipuq.plots.style import (
    GREY,
    SHADES,
    UNKNOWN,
    axis_label,
    check_dataset,
    new_axes,
    shades_of,
)

Array = NDArray[np.float64]

FEWEST = 8
"""Columns that the x axis has room for at least, so that a single pattern is no wide bar."""

PALE = "#B8B8B8"
"""Colour of the sides of cells."""

GAP = 0.012
"""Gap between groups by the width of all columns, at least a column."""


def pattern_map(results: xr.Dataset, *, counts: Sequence[int] | None = None, ax: Axes | None = None) -> Axes:
    """Draw each contact pattern as a column, its oscillators in contact coloured by the probability.

    Patterns are grouped by their number in contact, and ascend by probability within a group; one whose
    probability is unknown comes last and is hatched. An oscillator that is not in contact is white.

    Parameters
    ----------
    results : Dataset
        Of a stratified analysis of ``any_unstable`` or ``probability``: ``probability(pattern)``, and the
        coords ``contact(pattern, oscillator)`` and ``in_contact(pattern)``.
    counts : sequence of int, optional
        Numbers in contact; all by default.
    ax : Axes, optional
        Where to draw; by default a new figure, wider the more patterns there are.

    Returns
    -------
    Axes
        With one mesh for each number in contact.

    Raises
    ------
    SchemaError
        If the results are not of this kind, or are over more, such as modes or a swept parameter.
    InputError
        If there are no patterns of a number in contact.
    """
    check_dataset(results, "results")
    probability = over(results, "probability", ("pattern",), WAY_OUT)
    if "contact" not in results.variables or set(results["contact"].dims) != {"pattern", "oscillator"}:
        raise SchemaError(f"the figure needs the coord 'contact' over (pattern, oscillator): {WAY_OUT}")
    groups = by_number(results, counts)
    contact = results["contact"].transpose("oscillator", "pattern").values.astype(bool)
    values = 100 * probability.values.astype(np.float64)
    columns = sum(map(len, groups.values()))
    ax = new_axes(ax, float(np.clip(2.6 + 0.24 * columns, 4.6, 10.0)), 4.0)
    norm = shades_of(values[np.concatenate(list(groups.values()))], close=True)
    colours = SHADES.with_extremes(bad="white")
    thick = float(np.clip(72 * inches(ax)[0] / max(columns, FEWEST) / 14, 0.25, 0.8))
    left, gap, centres = 0.0, max(1.0, GAP * columns), []
    for rows in groups.values():
        rows = rows[np.argsort(np.nan_to_num(values[rows], nan=np.inf), kind="stable")]
        touching = contact[:, rows]
        shown = np.where(touching, values[rows], np.nan)
        edges = left + np.arange(len(rows) + 1.0)
        sides = np.arange(len(contact) + 1.0) + 0.5
        style: dict[str, Any] = {"edgecolors": PALE, "linewidth": thick, "norm": norm, "cmap": colours}
        ax.pcolormesh(edges, sides, np.ma.masked_invalid(shown), **style)
        _hatch(ax, left, touching & np.isnan(values[rows]))
        centres.append(left + len(rows) / 2)
        left += len(rows) + gap
    width = left - gap
    margin = max(0.5, (FEWEST - width) / 2)
    ax.set_xlim(-margin, width + margin)
    ax.set_ylim(len(contact) + 0.6, 0.4)
    ax.set_xticks(centres, [f"{count}\n({len(rows)})" for count, rows in groups.items()])
    ax.set_yticks(np.arange(1, len(contact) + 1), results["oscillator"].values)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    ax.set_xlabel(wrapped(ax, "oscillators in contact (patterns), within each by ascending probability"))
    ax.set_ylabel("oscillator")
    bar = ax.figure.colorbar(ScalarMappable(norm, colours), ax=ax, fraction=0.05, pad=0.02, aspect=24)
    bar.set_label(wrapped(ax, axis_label(probability, "%"), upright=True))
    handles = [Patch(facecolor="white", edgecolor=GREY, linewidth=0.8, label="not in contact")]
    if np.isnan(values[np.concatenate(list(groups.values()))]).any():
        handles.append(Patch(**UNKNOWN, label="in contact, probability unknown"))
    legend_below(ax, width=2.4, handles=handles)
    return ax


def _hatch(ax: Axes, left: float, where: NDArray[np.bool_]) -> None:
    """Hatch cells, (oscillators, columns), whose colour is unknown."""
    if not where.any():
        return
    corners = np.array([(left, 0.5), (left + 1, 0.5), (left + 1, 1.5), (left, 1.5)])
    cells = [corners + place for place in np.argwhere(where)[:, ::-1]]
    ax.add_collection(PolyCollection(cells, **UNKNOWN), autolim=False)
