"""How the onsets of configurations are distributed over friction, and the friction that a target allows."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import SchemaError
from hipuq.fragility_curve import weights_of
from hipuq.friction_limits import rounded_down
from hipuq.plots.captions import level
from hipuq.plots.fragility_curves import finish
from hipuq.plots.style import (
    BLACK,
    GREY,
    LINES,
    VERMILLION,
    axis_label,
    check_dataset,
    new_axes,
)

LIMITS = ("friction_limit", "friction_limit_low", "friction_limit_high")

LIMIT_MARKERS = "sDvP^X"
"""Markers of targets, taken in turn."""


def onset_distribution(
    outcomes: xr.Dataset, *, ax: Axes | None = None, limits: xr.Dataset | None = None
) -> Axes:
    """Draw the share of configurations with an onset at or below a friction coefficient.

    Parameters
    ----------
    outcomes : Dataset
        ``onset(sample)`` [1]: the least friction coefficient with an unstable mode, +inf for a
        configuration that is never unstable and NaN where it is unknown. The drawing covers the range
        of friction that was swept, its attribute ``range`` or that of `limits`; without one it ends at the
        last onset. Samples of a stratified design count by their coord ``weight``.
    ax : Axes, optional
        Where to draw; a new figure by default.
    limits : Dataset, optional
        As from `hipuq.friction_limit`: ``friction_limit`` with ``_low`` and ``_high`` over ``target`` [1],
        each drawn with its interval at the share that it keeps to. The legend tells of targets that are
        kept to up to the end of the range (inf) or not even at its start (NaN).

    Returns
    -------
    Axes
        The share is that among the known; a grey band holds it whatever the unknown ones are.

    Raises
    ------
    SchemaError, UnknownNameError
        If there is no such outcome, an onset is -inf, or the limits are not of this kind.
    """
    check_dataset(outcomes, "outcomes")
    values = schema.check_outcomes(outcomes, "onset")
    onset = values.values.astype(np.float64)
    if onset.ndim != 1:
        raise SchemaError(f"the figure needs 'onset' over sample alone, it has {values.dims}")
    if np.isneginf(onset).any():
        raise SchemaError(
            f"onset is -inf in sample {int(np.isneginf(onset).argmax())}: no friction is so low"
        )
    weight = weights_of(outcomes)
    unknown, never = np.isnan(onset), np.isposinf(onset)
    swept = _swept(values, limits)
    friction, below = _steps(onset, weight, swept)
    known = float(weight[~unknown].sum())
    ax = new_axes(ax)
    if unknown.any():
        text = f"unknown: {unknown.sum()} of {len(onset)}"
        ends = 100 * below, 100 * (below + weight[unknown].sum())
        ax.fill_between(friction, *ends, step="post", color=GREY, alpha=0.25, linewidth=0, label=text)
    if known > 0:
        share = 100 * below / known
        ax.plot(friction, share, drawstyle="steps-post", label="onset at or below", **LINES[0])
        rest = 100 * float(weight[never].sum()) / known
        text = f"never unstable: {rest:.3g} % ({never.sum()} of {(~unknown).sum()})"
        ax.vlines(friction[-1], share[-1], 100, color=BLACK, linestyle=":", linewidth=2, label=text)
    if limits is not None:
        _draw_limits(ax, limits, friction[-1])
    label = axis_label(values.assign_attrs(long_name="friction coefficient at the onset"))
    if swept is None and not np.isfinite(onset).any():
        ax.set_xticks([])
        label += ": none, and the range is not known"
    ax.set_xlabel(label)
    weighted = " (weighted)" if np.ptp(weight) > 1e-12 * weight.max() else ""
    ax.set_ylabel(f"share of configurations{weighted} [%]")
    finish(ax)
    return ax


def _draw_limits(ax: Axes, limits: xr.Dataset, end: float) -> None:
    """Mark friction limits at their targets, with intervals; `end` is where the drawing of onsets ends."""
    for name in LIMITS:
        if name not in limits or limits[name].dims != ("target",):
            raise SchemaError(f"limits need {name!r} over (target): as from hipuq.friction_limit")
    first, last = map(float, limits[LIMITS[0]].attrs.get("range", (0.0, end)))
    found = (limits[name].values.astype(np.float64) for name in LIMITS)
    for i, (target, at, low, high) in enumerate(zip(limits["target"].values, *found, strict=True)):
        percent = f"{100 * float(target):.4g} %"
        if np.isnan(at) or np.isneginf(at):
            text = f"{percent}: {'not known' if np.isnan(at) else 'exceeded from the start of the range'}"
            ax.scatter([], [], facecolors="none", edgecolors="none", label=text)
            continue
        if np.isinf(at):
            text = f"{percent}: not exceeded up to friction {last:.4g}"
            ax.scatter([], [], facecolors="none", edgecolors="none", label=text)
            continue
        text = f"{percent}: not exceeded up to friction {_down(at)}"
        if low < high:
            ends = "start" if np.isneginf(low) else _down(low), "end" if np.isinf(high) else _down(high)
            text += f" ({level(limits)}: {ends[0]} to {ends[1]})"
        start, stop = max(low, first), min(high, max(end, last))
        line: dict[str, Any] = {"color": VERMILLION, "zorder": 3}
        ax.hlines(100 * target, start, stop, linewidth=2.0, **line)
        ax.vlines(at, 0, 100 * target, linewidth=1.0, linestyle=":", **line)
        style: dict[str, Any] = {"facecolors": "white", "edgecolors": VERMILLION, "linewidths": 1.2}
        marker = LIMIT_MARKERS[i % len(LIMIT_MARKERS)]
        ax.scatter(at, 100 * target, s=30, marker=marker, zorder=3.1, label=text, **style)


def _down(value: float) -> str:
    """Return a friction limit with four digits, never rounded up."""
    return f"{rounded_down(value):.4g}"


def _swept(onset: xr.DataArray, limits: xr.Dataset | None) -> tuple[float, float] | None:
    """Return the range of friction that was swept; None where nothing says so."""
    attrs = onset.attrs
    if "range" not in attrs and limits is not None and LIMITS[0] in limits:
        attrs = limits[LIMITS[0]].attrs
    if "range" not in attrs:
        return None
    lower, upper = map(float, attrs["range"])
    return lower, upper


def _steps(
    onset: NDArray[np.float64], weight: NDArray[np.float64], swept: tuple[float, float] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where the distribution function steps, and the weight at or below, over the range swept."""
    finite = np.isfinite(onset)
    at, place = np.unique(onset[finite], return_inverse=True)
    below = np.cumsum(np.bincount(place, weights=weight[finite], minlength=len(at)))
    # Without a range nothing is known beyond the last onset.
    start, end = swept or (0.0, at[-1] if len(at) else 1.0)
    start, end = min([start, *at[:1]]), max([end, *at[-1:]])
    last = below[-1] if len(at) else 0.0
    return np.concatenate([[start], at, [end]]), np.concatenate([[0.0], below, [last]])
