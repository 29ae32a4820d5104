"""At which frequencies modes are unstable, beside the frequencies of squeak that were measured."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from hipuq.errors import SchemaError
from hipuq.plots.captions import legend_below, level, over, wrapped
from hipuq.plots.eigenvalue_plane import label_modes
from hipuq.plots.measured import frequency_bands
from hipuq.plots.style import BLACK, BLUE, axis_label, new_axes

Array = NDArray[np.float64]

WAY_OUT = "as from hipuq.frequency_ranges"

NARROW = 0.1
"""Share of the x axis below which the ranges of all modes together are enlarged in an inset."""

NEEDED = ("frequency_low", "frequency_median", "frequency_high")


def mode_frequencies(
    frequencies: xr.Dataset,
    results: xr.Dataset | None = None,
    *,
    measured: xr.Dataset | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the range of frequencies of each mode where it is unstable.

    Parameters
    ----------
    frequencies : Dataset
        As from `hipuq.frequency_ranges`: ``frequency_low``, ``_median``, ``_high`` over ``mode`` [Hz], NaN
        for a mode that is never unstable; the attribute ``levels`` says which quantiles they are.
    results : Dataset, optional
        Results of ``unstable``: the modes then stand at their probabilities, ``probability_overall(mode)``
        or ``probability(mode)`` with its limits, else one above the other.
    measured : Dataset, optional
        As from ``hipuq.literature("squeak_frequency")``: each source is a band.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        Modes that are never unstable are not drawn; the legend says how many. Where all ranges are narrow
        beside what was measured they are enlarged in an inset, ``ax.child_axes[0]``.

    Raises
    ------
    SchemaError
        If the frequencies or results are not of this kind, or have other modes.
    """
    low, median, high = (over(frequencies, name, ("mode",), WAY_OUT).values / 1000 for name in NEEDED)
    numbers = frequencies["mode"].values
    ever = np.isfinite(median)
    place = np.cumsum(ever) - 1.0
    ax = new_axes(ax, 6.8, 4.6)
    if measured is not None:
        frequency_bands(ax, measured)
    place, low, median, high = (values[ever] for values in (place, low, median, high))
    if results is None:
        ax.set_yticks(place, numbers[ever])
        ax.set_ylim(-0.8, max(len(place), 1) - 0.2)
        ax.set_ylabel("mode, by ascending frequency")
    else:
        place = _at_probabilities(ax, results, numbers, ever, median)
    _draw(ax, place, (low, median, high), _levels(frequencies))
    never = int((~ever).sum())
    if never:
        ax.plot([], [], linestyle="none", label=f"never unstable, not drawn: {never} of {len(ever)} modes")
    view = _enlarged(ax, place, (low, median, high)) or ax
    if results is not None:
        label_modes(view, numbers[ever], high, place, beside=True)
    label = frequencies[NEEDED[1]].assign_attrs(long_name="frequency where unstable")
    ax.set_xlabel(axis_label(label, "kHz"))
    ax.grid(axis="y", linewidth=0.4, alpha=0.5)
    legend_below(ax, width=3.2)
    return ax


def _draw(ax: Axes, place: Array, ends: tuple[Array, Array, Array], label: str) -> None:
    """Draw the ranges of modes at these heights."""
    low, median, high = ends
    ax.hlines(place, low, high, color=BLUE, linewidth=2.4, label=label)
    ax.plot(median, place, "o", color=BLACK, markerfacecolor="white", markersize=5, label="median")


def _enlarged(ax: Axes, place: Array, ends: tuple[Array, Array, Array]) -> Axes | None:
    """Draw the ranges once more in an inset where they are too narrow to be seen beside what was measured."""
    if not len(place):
        return None
    left, right = ax.get_xlim()
    least, most = float(ends[0].min()), float(ends[2].max())
    if most - least > NARROW * (right - left):
        return None
    # On the side where there is more room.
    start = 0.34 if (least + most) / 2 < (left + right) / 2 else 0.07
    back: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "zorder": 1}
    ax.add_patch(Rectangle((start, 0.03), 0.64, 0.94, transform=ax.transAxes, **back))
    inset = ax.inset_axes((start + 0.06, 0.14, 0.55, 0.72))
    _draw(inset, place, ends, "")
    inset.set_yticks(ax.get_yticks(), [text.get_text() for text in ax.get_yticklabels()])
    inset.set_ylim(ax.get_ylim())
    inset.margins(x=0.12)
    inset.tick_params(labelsize="x-small")
    inset.ticklabel_format(axis="x", useOffset=False)
    inset.locator_params(axis="x", nbins=4)
    inset.grid(axis="y", linewidth=0.4, alpha=0.5)
    inset.set_title("enlarged [kHz]", fontsize="small")
    return inset


def _at_probabilities(
    ax: Axes, results: xr.Dataset, numbers: NDArray[Any], ever: NDArray[np.bool_], median: Array
) -> Array:
    """Set up the y axis for probabilities, draw their limits, and return those of the modes to draw [%]."""
    name = "probability_overall" if "probability_overall" in results else "probability"
    found = over(results, name, ("mode",), "results of 'unstable'")
    if not np.isin(numbers, found["mode"].values).all():
        raise SchemaError(f"the results are of modes {found['mode'].values.tolist()}, not {numbers.tolist()}")
    drawn = results.sel(mode=numbers[ever])
    values = 100 * drawn[name].values.astype(np.float64)
    most = values
    if f"{name}_low" in results and f"{name}_high" in results:
        low, most = (100 * over(drawn, f"{name}_{end}", ("mode",), "").values for end in ("low", "high"))
        style: dict[str, Any] = {"color": BLACK, "linewidth": 0.9}
        ax.vlines(median, low, most, label=f"probability, {level(results)}", **style)
    top = float(np.nanmax(most, initial=0.0))
    top = 104.0 if top > 50 or top == 0 else 1.15 * top
    ax.set_ylim(-0.04 * top, top)
    ax.set_ylabel(wrapped(ax, axis_label(results.get("probability", found), "%"), upright=True))
    return values


def _levels(frequencies: xr.Dataset) -> str:
    """Return the legend of the ranges: between which quantiles they lie."""
    levels = np.atleast_1d(frequencies.attrs.get("levels", []))
    if len(levels) < 2:
        return "range where unstable"
    return f"{100 * levels[0]:g} to {100 * levels[-1]:g} % of the samples where unstable"
