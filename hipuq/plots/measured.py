"""What was measured in patients and on the bench, marked beside a prediction.

None of it is the quantity that is predicted: an incidence is a share of patients over years of use, a
critical friction that of one implant in one test. The legends say so.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hipuq.errors import SchemaError
from hipuq.plots.style import (
    BLACK,
    GREY,
    check_dataset,
)

Array = NDArray[np.float64]

HATCHES = ("////", "\\\\\\\\", "....", "||||")
"""Hatches of bands, taken in turn."""

CRITICAL = ("v", "D", "s", "^", "P", "X")
"""Markers of measured critical frictions, taken in turn."""

NEAR = 0.25
"""Share of the range that a measured value may lie beyond its end to be drawn."""


class Published(NamedTuple):
    """Published figures, each with a range that is the value itself where the source gives none."""

    sources: list[str]
    value: Array
    low: Array
    high: Array


def published(literature: xr.Dataset, name: str, quantity: str) -> Published:
    """Return published figures, those without any number left out.

    Parameters
    ----------
    literature : Dataset
        ``value``, ``low`` and ``high`` over ``source``, NaN where not given.
    name : str
        The argument that it was given as, for the error.
    quantity : str
        What the figures have to be of, as `hipuq.literature` knows it.

    Returns
    -------
    Published
        A value that is not given is the middle of the range.

    Raises
    ------
    SchemaError
        If it is no such Dataset, or holds no number.
    """
    check_dataset(literature, name)
    of = literature.attrs.get("quantity", quantity)
    if of != quantity:
        raise SchemaError(
            f"{name} is of {of!r}: it must be of {quantity!r}, as hipuq.literature({quantity!r})"
        )
    for key in ("value", "low", "high", "source"):
        if key not in literature.variables or literature[key].dims != ("source",):
            raise SchemaError(f"{name} needs {key!r} over (source): as from hipuq.literature")
    value, low, high = (literature[key].values.astype(np.float64) for key in ("value", "low", "high"))
    low, high = np.where(np.isnan(low), value, low), np.where(np.isnan(high), value, high)
    value = np.where(np.isnan(value), (low + high) / 2, value)
    kept = np.isfinite(value) & np.isfinite(low) & np.isfinite(high)
    if not kept.any():
        raise SchemaError(f"{name} has no finite value: nothing to draw")
    sources = [str(source) for source in literature["source"].values[kept]]
    return Published(sources, value[kept], low[kept], high[kept])


def incidence_band(ax: Axes, literature: xr.Dataset) -> tuple[float, float]:
    """Draw the reported incidence as a horizontal band from the lowest to the highest.

    Parameters
    ----------
    ax : Axes
        Its y axis is in per cent.
    literature : Dataset
        As from ``hipuq.literature("incidence")`` [1].

    Returns
    -------
    low, high : float
        Its ends [%].
    """
    found = published(literature, "literature", "incidence")
    low, high = 100 * float(found.low.min()), 100 * float(found.high.max())
    text = f"{low:.3g} %" if low == high else f"{low:.3g} to {high:.3g} %"
    style: dict[str, Any] = {"facecolor": (GREY, 0.12), "edgecolor": (GREY, 0.6), "hatch": HATCHES[0]}
    text = f"incidence reported in patients: {text} (another quantity)"
    ax.axhspan(low, high, linewidth=0.8, zorder=0.3, label=text, **style)
    return low, high


def frequency_bands(ax: Axes, measured: xr.Dataset, top: float = 1.0) -> None:
    """Draw measured frequencies of squeak as vertical bands, one for each source.

    Parameters
    ----------
    ax : Axes
        Its x axis is in kHz.
    measured : Dataset
        As from ``hipuq.literature("squeak_frequency")`` [Hz].
    top : float, default 1
        Where they end by the height of the Axes.
    """
    found = published(measured, "measured", "squeak_frequency")
    for i, (source, low, high) in enumerate(zip(found.sources, found.low, found.high, strict=True)):
        low, high = low / 1000, high / 1000
        style: dict[str, Any] = {"facecolor": (GREY, 0.08), "edgecolor": (GREY, 0.6)}
        text = f"squeak measured, {source}: {low:.3g} to {high:.3g} kHz"
        hatch = HATCHES[i % len(HATCHES)]
        style |= {"hatch": hatch, "linewidth": 0.8, "zorder": 0.3 + 0.01 * i, "ymax": top}
        _span(ax, low, high, label=text, **style)


def critical_marks(ax: Axes, critical: xr.Dataset, start: float, end: float) -> None:
    """Mark measured critical frictions that lie in or near a range; the legend tells those beyond.

    No mark is a line of the Axes, so that curves still take their styles in turn.

    Parameters
    ----------
    ax : Axes
        Its x axis is friction.
    critical : Dataset
        As from ``hipuq.literature("critical_friction")`` [1].
    start, end : float
        Range of friction that is drawn.
    """
    found = published(critical, "critical", "critical_friction")
    reach = NEAR * (end - start)
    inside = (found.value >= start - reach) & (found.value <= end + reach)
    across = ax.get_xaxis_transform()
    for i in np.flatnonzero(inside):
        low, value, high = found.low[i], found.value[i], found.high[i]
        spread = f" ({low:.3g} to {high:.3g})" if low < high else ""
        _span(ax, low, high, facecolor=(GREY, 0.18), linewidth=0, zorder=0.3)
        ax.vlines(value, 0, 1, transform=across, color=BLACK, linewidth=0.8, linestyle="-.", zorder=0.7)
        text = f"squeak set in on the bench, {found.sources[i]}: {value:.3g}{spread}"
        marker: dict[str, Any] = {"marker": CRITICAL[i % len(CRITICAL)], "facecolors": "white"}
        ax.scatter(
            value,
            1.0,
            s=26,
            transform=across,
            clip_on=False,
            zorder=4,
            label=text,
            edgecolors=BLACK,
            linewidths=0.9,
            **marker,
        )
    beyond = found.value[~inside]
    if beyond.size:
        ends = f"{beyond.min():.3g}"
        ends += f" to {beyond.max():.3g}" if beyond.max() > beyond.min() else ""
        text = f"squeak set in on the bench at {ends}: beyond the range"
        ax.scatter([], [], facecolors="none", edgecolors="none", label=text)


def _span(ax: Axes, low: float, high: float, **style: Any) -> None:
    """Draw a vertical band that the limits of the x axis hold; a span alone does not always make them."""
    ax.axvspan(low, high, **style)
    ax.update_datalim([(low, 0.0), (high, 0.0)], updatey=False)
    ax.autoscale_view(scaley=False)
