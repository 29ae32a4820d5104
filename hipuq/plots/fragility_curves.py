"""How a design fails over friction: its fragility curve, and the onsets of its configurations.

A fragility curve gives the probability of failure for a given load; here the load is the friction
coefficient, and failure is an unstable mode.
"""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import InputError, SchemaError
from hipuq.plots.style import BLACK, BORDER, GREY, LINES, axis_label, new_axes

NEEDED = ("probability", "probability_low", "probability_high")


def fragility(
    results: xr.Dataset, *, ax: Axes | None = None, limit: float | None = None, label: str | None = None
) -> Axes:
    """Draw the fragility curve of a design: the probability of instability over friction.

    Parameters
    ----------
    results : Dataset
        As from `hipuq.fragility`: coord ``friction`` [1], ``probability(friction)``, and
        ``probability_low``, ``_high``, between which it lies at the attribute ``confidence`` and
        whatever the unknown samples are. The line has a gap where the probability is NaN.
    ax : Axes, optional
        Where to draw, such as beside other curves; a new figure by default.
    limit : float, optional
        A tolerated probability, above 0 and below 1. It is drawn, with the neighbours in friction
        between which the curve first reaches it.
    label : str, optional
        Name of the curve in the legend.

    Returns
    -------
    Axes

    Raises
    ------
    SchemaError
        If the results are not of this kind.
    InputError
        If the limit is no probability between 0 and 1.
    """
    if limit is not None and not 0 < limit < 1:
        raise InputError(f"limit is {limit}: it must be a probability above 0 and below 1")
    results = _over_friction(results)
    friction = results["friction"].values
    probability, low, high = (100 * results[name].values for name in NEEDED)
    ax = new_axes(ax)
    # Curves are the only lines on the Axes: each takes the next style.
    style = LINES[len(ax.lines) % len(LINES)]
    name = label if label is not None else "probability"
    confidence = results.attrs.get("confidence")
    if confidence is not None and (high > low).any():
        name += f", {100 * float(confidence):g} % interval"
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
        text = text if label is None else f"{label}: {text}"
        dropped = {"color": colour, "linewidth": 1.2, "linestyle": ":"}
        ax.vlines(ends, 0, 100 * limit, zorder=0.6, label=text, **dropped)
    ax.set_xlabel(axis_label(results["friction"]))
    ax.set_ylabel(axis_label(results["probability"], "%"))
    _finish(ax)
    return ax


def onset_distribution(outcomes: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the share of configurations with an onset at or below a friction coefficient.

    Parameters
    ----------
    outcomes : Dataset
        ``onset(sample)`` [1]: the least friction coefficient with an unstable mode, +inf for a
        configuration that is never unstable and NaN where it is unknown. Samples of a stratified
        design count by their coord ``weight``.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        The share is that among the known; a grey band holds it whatever the unknown ones are.

    Raises
    ------
    SchemaError, UnknownNameError
        If there is no such outcome, or an onset is -inf.
    """
    values = schema.check_outcomes(outcomes, "onset")
    onset = values.values.astype(np.float64)
    if onset.ndim != 1:
        raise SchemaError(f"the figure needs 'onset' over sample alone, it has {values.dims}")
    if np.isneginf(onset).any():
        raise SchemaError(
            f"onset is -inf in sample {int(np.isneginf(onset).argmax())}: no friction is so low"
        )
    weight = _weights(outcomes)
    unknown, never = np.isnan(onset), np.isposinf(onset)
    friction, below = _steps(onset, weight)
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
    ax.set_xlabel(axis_label(values.assign_attrs(long_name="friction coefficient at the onset")))
    weighted = " (weighted)" if np.ptp(weight) > 1e-12 * weight.max() else ""
    ax.set_ylabel(f"share of configurations{weighted} [%]")
    _finish(ax)
    return ax


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


def _weights(outcomes: xr.Dataset) -> NDArray[np.float64]:
    """Return the weight of each sample; all together 1."""
    size = outcomes.sizes["sample"]
    if "weight" not in outcomes.coords:
        return np.full(size, 1 / size)
    # Strata of equal size: that of its level is the weight of a sample up to a common factor.
    weight = outcomes["weight"].values.astype(np.float64)
    return np.asarray(weight / weight.sum())


def _steps(
    onset: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where the distribution function steps, and the weight at or below, from 0 to a flat end."""
    finite = np.isfinite(onset)
    at, place = np.unique(onset[finite], return_inverse=True)
    below = np.cumsum(np.bincount(place, weights=weight[finite], minlength=len(at)))
    start = min(0.0, at[0]) if len(at) else 0.0
    end = at[-1] if len(at) else 0.0
    # Without any onset nothing says how far friction goes.
    flat = end + (0.08 * (end - start) or 1.0)
    last = below[-1] if len(at) else 0.0
    return np.concatenate([[start], at, [flat]]), np.concatenate([[0.0], below, [last]])


def _finish(ax: Axes) -> None:
    """Set what both figures share."""
    ax.margins(x=0.02)
    ax.set_ylim(-4, 104)
    ax.set_yticks(range(0, 101, 20))
    ax.grid(axis="y", linewidth=0.4, alpha=0.5)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=1, frameon=False, fontsize="small")
