"""At which frequencies modes are unstable, beside the frequencies of squeak that were measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from hipuq.errors import SchemaError
from hipuq.plots.captions import inches, legend_below, level, over, wrapped
from hipuq.plots.measured import frequency_bands, published
from hipuq.plots.scales import HEIGHT_LEFT
from hipuq.plots.style import (
    BLACK,
    BLUE,
    GREY,
    axis_label,
    check_dataset,
    new_axes,
    percent_top,
)

Array = NDArray[np.float64]

WAY_OUT = "as from hipuq.frequency_ranges"

NARROW = 0.1
"""Share of the x axis below which the ranges of all modes together are enlarged in an inset."""

BENEATH = 0.36
"""Share of the height that is left to what was measured, beneath an inset."""

INSET = (0.1, BENEATH + 0.12, 0.8, 0.43)
"""Left, bottom, width and height of an inset by those of the Axes."""

KILO = 100.0
"""Frequency [Hz] from which on frequencies are drawn in kHz."""

LINE = 10.0
"""Height of a number beside the Axes [pt]."""

NEEDED = ("frequency_low", "frequency_median", "frequency_high")


@dataclass(frozen=True)
class Modes:
    """Modes that are drawn, by ascending number.

    Attributes
    ----------
    numbers : (modes,) array of int
    low, median, high : (modes,) array
        Range of the frequency [Hz].
    place : (modes,) array
        Where they stand on the y axis.
    least, most : (modes,) array
        Limits of that place, itself where there are none.
    bottom, top : float
        Ends of the y axis.
    stacked : bool
        Whether they stand one above the other, else at their probabilities.
    """

    numbers: NDArray[Any]
    low: Array
    median: Array
    high: Array
    place: Array
    least: Array
    most: Array
    bottom: float
    top: float
    stacked: bool


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
        In kHz, below 100 Hz in Hz. Modes that are never unstable are not drawn; the legend says how many.
        Where all ranges are narrow beside what was measured they are enlarged in an inset above,
        ``ax.child_axes[0]``.

    Raises
    ------
    SchemaError
        If the frequencies or results are not of this kind, or have other modes.
    """
    check_dataset(frequencies, "frequencies")
    ends = [over(frequencies, name, ("mode",), WAY_OUT).values.astype(np.float64) for name in NEEDED]
    ever = np.isfinite(ends[1])
    modes = _modes(frequencies["mode"].values[ever], [end[ever] for end in ends], frequencies, results)
    narrow = measured is not None and len(modes.numbers) > 0 and _narrow(modes, measured)
    ax = new_axes(ax, 6.8, 6.6 if narrow else 4.6)
    unit = "kHz" if measured is not None else _unit(modes)
    if measured is not None:
        frequency_bands(ax, measured, BENEATH if narrow else 1.0)
    limits = "" if results is None else f"probability, {level(results)}"
    _draw(ax, modes, unit, _levels(frequencies), limits)
    never = int((~ever).sum())
    if never:
        ax.plot([], [], linestyle="none", label=f"{_never(frequencies)}: {never} of {len(ever)} modes")
    view = ax
    if narrow:
        view = inset = ax.inset_axes(INSET)
        _draw(inset, modes, _unit(modes), "", "")
        inset.margins(x=0.05)
        inset.tick_params(labelsize="small")
        inset.set_title(f"enlarged [{_unit(modes)}]", fontsize="small")
        ax.set_ylim(modes.bottom, modes.bottom + (modes.top - modes.bottom) / BENEATH)
        # Modes one above the other have their numbers in the inset alone: here is no room for them.
        ticks = [] if results is None else MaxNLocator(4).tick_values(0.0, modes.top)
        ax.set_yticks([tick for tick in ticks if 0 <= tick <= modes.top])
    if results is None:
        ax.set_ylabel("mode, by ascending frequency")
    else:
        _number(view, modes, _unit(modes) if narrow else unit)
        said = axis_label(results["probability" if "probability" in results else "probability_overall"], "%")
        ax.set_ylabel(wrapped(ax, said, upright=True))
    label = frequencies[NEEDED[1]].assign_attrs(long_name="frequency where unstable")
    ax.set_xlabel(axis_label(label, unit))
    legend_below(ax, width=3.2)
    return ax


def _modes(
    numbers: NDArray[Any], ends: list[Array], frequencies: xr.Dataset, results: xr.Dataset | None
) -> Modes:
    """Return the modes to draw: at their probabilities [%], else one above the other."""
    low, median, high = ends
    if results is None:
        place = np.arange(len(numbers), dtype=np.float64)
        return Modes(numbers, low, median, high, place, place, place, -0.8, max(len(place), 1) - 0.2, True)
    name = "probability_overall" if "probability_overall" in results else "probability"
    found = over(results, name, ("mode",), "results of 'unstable'")
    every = frequencies["mode"].values
    if not np.isin(every, found["mode"].values).all():
        raise SchemaError(f"the results are of modes {found['mode'].values.tolist()}, not {every.tolist()}")
    drawn = results.sel(mode=numbers)
    place, least, most = (
        100 * over(drawn, key if key in drawn else name, ("mode",), "").values.astype(np.float64)
        for key in (name, f"{name}_low", f"{name}_high")
    )
    top = percent_top(place, most)
    return Modes(numbers, low, median, high, place, least, most, -top / 26, top, False)


def _narrow(modes: Modes, measured: xr.Dataset) -> bool:
    """Say whether all ranges together are too narrow to be seen beside what was measured."""
    found = published(measured, "measured", "squeak_frequency")
    least, most = float(modes.low.min()), float(modes.high.max())
    whole = max(most, float(found.high.max())) - min(least, float(found.low.min()))
    return most - least <= NARROW * whole


def _unit(modes: Modes) -> str:
    """Return the unit that the frequencies are drawn in."""
    return "kHz" if modes.high.max(initial=0.0) >= KILO or not len(modes.high) else "Hz"


def _draw(ax: Axes, modes: Modes, unit: str, label: str, limits: str) -> None:
    """Draw the ranges of modes; without a label the legend has none of them."""
    factor = 1e-3 if unit == "kHz" else 1.0
    median = factor * modes.median
    ax.hlines(modes.place, factor * modes.low, factor * modes.high, color=BLUE, linewidth=2.4, label=label)
    marker: dict[str, Any] = {"color": BLACK, "markerfacecolor": "white", "markersize": 5}
    ax.plot(median, modes.place, "o", label="median" if label else "", **marker)
    wide = modes.most > modes.least
    if wide.any():
        style: dict[str, Any] = {"color": BLACK, "linewidth": 0.9}
        ax.vlines(median[wide], modes.least[wide], modes.most[wide], label=limits, **style)
    if modes.stacked:
        ax.set_yticks(modes.place, modes.numbers)
    ax.set_ylim(modes.bottom, modes.top)
    ax.ticklabel_format(axis="x", useOffset=False)
    ax.locator_params(axis="x", nbins=5)
    ax.grid(axis="y", linewidth=0.4, alpha=0.5)


def _number(ax: Axes, modes: Modes, unit: str) -> None:
    """Write the numbers of modes beside the Axes, apart from each other and tied to their ranges."""
    if not len(modes.numbers):
        return
    factor = 1e-3 if unit == "kHz" else 1.0
    # Titles and legends will leave the Axes lower than they are yet.
    gap = LINE / 72 / (HEIGHT_LEFT * inches(ax)[1]) * (modes.top - modes.bottom)
    order = np.argsort(np.nan_to_num(modes.place), kind="stable")
    place = np.nan_to_num(modes.place)[order]
    gap = min(gap, (modes.top - modes.bottom) / len(place))
    steps = gap * np.arange(len(place))
    # A line apart: halfway between what shifting up alone and shifting down alone would do.
    free = place - steps
    place = (np.maximum.accumulate(free) + np.minimum.accumulate(free[::-1])[::-1]) / 2 + steps
    place = np.maximum(np.minimum(place, modes.top - steps[::-1]), modes.bottom + steps)
    line: dict[str, Any] = {"arrowstyle": "-", "color": GREY, "linewidth": 0.6, "shrinkA": 1, "shrinkB": 0}
    for i, height in sorted(zip(order, place, strict=True)):
        ax.annotate(
            str(modes.numbers[i]),
            (factor * modes.high[i], modes.place[i]),
            (1.03, height),
            textcoords=ax.get_yaxis_transform(),
            fontsize="small",
            va="center",
            arrowprops=line,
        )


def _never(frequencies: xr.Dataset) -> str:
    """Return why modes are not drawn: they are stable, or for some of them nothing is known."""
    open_ = "known_samples" in frequencies and bool((frequencies["known_samples"] == 0).any())
    return f"never {'known to be ' * open_}unstable, not drawn"


def _levels(frequencies: xr.Dataset) -> str:
    """Return the legend of the ranges: between which quantiles they lie."""
    levels = np.atleast_1d(frequencies.attrs.get("levels", []))
    if len(levels) < 2:
        return "range where unstable"
    return f"{100 * levels[0]:g} to {100 * levels[-1]:g} % of the samples where unstable"
