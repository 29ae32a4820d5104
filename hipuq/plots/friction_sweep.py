"""Frequencies and growth rates over friction: mode coupling and the dispersion diagram.

Figure 5 of Oberst et al., INTER-NOISE 2016, p. 5539. All take the outcomes of a friction sweep,
``evaluate(model, model.nominal(friction=np.linspace(0, 0.1, 1001)))``; modes are followed over
friction and numbered as where most are unstable first, see `hipuq.plots.follow_modes`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from numpy.typing import NDArray

from hipuq.errors import InputError
from hipuq.plots.style import BLACK, BORDER, GREY, LINES, UNDECIDED, axis_label, new_axes, new_panels
from hipuq.plots.tracking import bracket, check_modes, follow_modes, growth_threshold

CLOSE = 0.005
"""Share of the frequency range: modes nearer than that to the next one form a cluster."""

MARKERS = 8
"""Markers at most for the undecided samples of a mode, which may be hundreds."""


def frequency_over_friction(outcomes: xr.Dataset, modes: Sequence[int], *, ax: Axes | None = None) -> Axes:
    """Draw the frequencies of modes over friction, with their lock-in.

    Parameters
    ----------
    outcomes : Dataset
        A friction sweep: ``friction`` over sample, ``frequency`` [Hz], ``growth_rate`` [1/s] and
        ``unstable`` over (sample, mode). Where a verdict is unknown, rounding may have moved the
        frequency too: such points are open and grey, on a grey band.
    modes : sequence of int
        Numbers of the modes, as in `hipuq.plots.follow_modes`.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        The one given, or that of the new figure.

    Raises
    ------
    SchemaError, InputError
        If the outcomes are no friction sweep, or a mode is not in them.
    """
    return _over_friction(outcomes, "frequency", modes, ax)


def growth_over_friction(outcomes: xr.Dataset, modes: Sequence[int], *, ax: Axes | None = None) -> Axes:
    """Draw the growth rates of modes over friction, with their lock-in.

    Parameters
    ----------
    outcomes : Dataset
        As for `frequency_over_friction`. Where a verdict is unknown no growth rate is drawn.
    modes : sequence of int
        Numbers of the modes, as in `hipuq.plots.follow_modes`.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        The one given, or that of the new figure.

    Raises
    ------
    SchemaError, InputError
        If the outcomes are no friction sweep, or a mode is not in them.
    """
    return _over_friction(outcomes, "growth_rate", modes, ax)


def lock_in(
    outcomes: xr.Dataset,
    pairs: Sequence[Sequence[int]] = ((15, 16), (17, 18)),
    *,
    figure: FigureBase | None = None,
) -> NDArray[Any]:
    """Draw how pairs of modes couple: frequencies above growth rates, a column for each pair.

    Parameters
    ----------
    outcomes : Dataset
        As for `frequency_over_friction`.
    pairs : sequence of sequences of int
        Numbers of the modes of each pair, as in `hipuq.plots.follow_modes`.
    figure : Figure or SubFigure, optional
        Where to draw; a new figure by default.

    Returns
    -------
    (2, pairs) array of Axes
        Frequencies in the first row, growth rates in the second, a column for each pair.

    Raises
    ------
    SchemaError, InputError
        If the outcomes are no friction sweep, or a mode is not in them.
    """
    if not len(pairs):
        raise InputError("pairs are empty: name at least one, such as (17, 18)")
    sweep = follow_modes(outcomes)
    for pair in pairs:
        check_modes(sweep, list(pair))
    axes = new_panels(figure, 2, len(pairs), (4.8 * len(pairs), 6.4), sharex=True)
    for i, pair in enumerate(pairs):
        for ax, name in zip(axes[:, i], ("frequency", "growth_rate"), strict=True):
            _draw(ax, sweep, name, pair)
        axes[0, i].set_title(f"({chr(ord('a') + i)}) modes {' and '.join(str(mode) for mode in pair)}")
        axes[0, i].set_xlabel("")
        _legend_below(axes[1, i], sweep)
    return axes


def dispersion(outcomes: xr.Dataset, *, axes: Sequence[Axes] | NDArray[Any] | None = None) -> NDArray[Any]:
    """Draw real and imaginary parts of all eigenvalues over friction.

    Parameters
    ----------
    outcomes : Dataset
        As for `frequency_over_friction`. Growth rates of undecided modes are left out.
    axes : sequence or (2,) or (3,) array of Axes, optional
        For growth rates, for frequencies, and for the frequencies of the closest cluster of modes,
        which cannot be told apart beside the others. A new figure has the third if there is one.

    Returns
    -------
    (2,) or (3,) array of Axes
        Those given, or those of the new figure.

    Raises
    ------
    SchemaError, InputError
        If the outcomes are no friction sweep, or there are neither two nor three axes.
    """
    sweep = follow_modes(outcomes)
    frequency = sweep["frequency"].values
    close = cluster(frequency[0]) | cluster(frequency[-1])
    if axes is None:
        panels = 3 if close.any() else 2
        axes = new_panels(None, panels, 1, (6.4, 2.6 * panels + 0.6), sharex=True)[:, 0]
    axes = np.asarray(axes, dtype=object)
    if axes.shape not in ((2,), (3,)):
        raise InputError(f"axes has the shape {axes.shape}: dispersion needs two or three Axes")
    friction = sweep["friction"].values
    ever = (sweep["unstable"].values == 1).any(axis=0)
    growth = sweep["growth_rate"].where(sweep["unstable"].notnull()).values
    styles = _styles(ever)
    for j, mode in enumerate(sweep["mode"].values):
        label = f"mode {mode}" if ever[j] else None
        axes[0].plot(friction, growth[:, j], label=label, **styles[j])
        axes[1].plot(friction, frequency[:, j], **styles[j])
        if axes.size == 3 and close[j]:
            axes[2].plot(friction, frequency[:, j], **styles[j])
    axes[0].set_ylabel(axis_label(sweep["growth_rate"]))
    axes[1].set_ylabel(axis_label(sweep["frequency"]))
    if axes.size == 3:
        axes[2].set_ylabel(axis_label(sweep["frequency"]))
        if close.any():
            numbers = sweep["mode"].values[close]
            axes[2].set_title(f"modes {numbers[0]} to {numbers[-1]} enlarged", fontsize="medium")
    axes[-1].set_xlabel(axis_label(sweep["friction"]))
    axes[0].axhline(growth_threshold(sweep), zorder=0.5, **BORDER)
    if (~ever).any():
        axes[0].plot([], [], color=GREY, linewidth=0.8, label="never unstable")
    for ax in axes:
        _shade(ax, friction, np.isnan(sweep["unstable"].values).any(axis=1))
    handles, labels = axes[0].get_legend_handles_labels()
    _legend_below(axes[-1], sweep, handles, labels)
    return axes


def cluster(frequency: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Say which modes belong to the largest cluster of frequencies.

    Parameters
    ----------
    frequency : (modes,) array
        [Hz]

    Returns
    -------
    (modes,) array of bool
        None where no three modes lie so close, or no other mode lies outside.
    """
    order = np.argsort(frequency, kind="stable")
    spread = np.ptp(frequency)
    group = np.concatenate([[0], np.cumsum(np.diff(frequency[order]) > CLOSE * spread)])
    # Rigid mechanisms share the frequency 0; that is no cluster worth a look.
    sizes = np.bincount(group, weights=frequency[order] > 0)
    inside = np.zeros(len(frequency), bool)
    if sizes.max() >= 3 and sizes.max() < len(frequency):
        inside[order[group == sizes.argmax()]] = True
    return inside


def _over_friction(outcomes: xr.Dataset, name: str, modes: Sequence[int], ax: Axes | None) -> Axes:
    sweep = follow_modes(outcomes)
    check_modes(sweep, list(modes))
    ax = new_axes(ax)
    _draw(ax, sweep, name, modes)
    _legend_below(ax, sweep)
    return ax


def _draw(ax: Axes, sweep: xr.Dataset, name: str, modes: Sequence[int]) -> None:
    """Draw one quantity of followed modes over friction."""
    friction = sweep["friction"].values
    chosen = sweep.sel(mode=list(modes))
    unknown = np.isnan(chosen["unstable"].values)
    values = np.where(unknown, np.nan, chosen[name].values)
    for j, mode in enumerate(modes):
        ax.plot(friction, values[:, j], label=f"mode {mode}", **LINES[j % len(LINES)])
    if unknown.any():
        _shade(ax, friction, unknown.any(axis=1))
        if name == "frequency":
            for j in range(len(modes)):
                few = np.flatnonzero(unknown[:, j])
                few = few[:: -(-len(few) // MARKERS) or 1]
                points = chosen[name].values[few, j]
                ax.plot(friction[few], points, markersize=4, markeredgewidth=0.8, **UNDECIDED)
    if name == "growth_rate":
        ax.axhline(growth_threshold(sweep), zorder=0.5, **BORDER)
    marked = [_mark_lock_in(ax, sweep, mode) for mode in modes]
    if not any(marked):
        known = " where known" if unknown.any() else ""
        text = f"never unstable{known}: no lock-in up to friction {friction[-1]:.4g}"
        ax.fill_between([], [], [], alpha=0.0, label=text)
    ax.set_xlabel(axis_label(sweep["friction"]))
    ax.set_ylabel(axis_label(sweep[name]))


def _mark_lock_in(ax: Axes, sweep: xr.Dataset, mode: int) -> bool:
    """Mark the friction at which a mode locks in, or becomes unstable despite damping, if it does."""
    low, high = bracket(sweep, mode)
    if np.isnan(high):
        return False
    start, label = high, f"mode {mode}: unstable from {high:.4g}"
    if low < high:
        before = sweep["growth_rate"].sel(mode=mode).values[sweep["friction"].values == low]
        what = "lock-in" if (before == 0).all() else "onset"
        digits = max(4, math.ceil(-math.log10(high - low) - 1e-6))
        start, label = low, f"mode {mode}: {what} between {low:.{digits}f} and {high:.{digits}f}"
    ax.axvspan(start, high, facecolor="none", edgecolor=BLACK, linewidth=0.8, zorder=0.6, label=label)
    return True


def _legend_below(ax: Axes, sweep: xr.Dataset, *entries: Any) -> None:
    """Put the legend under the label of the x axis, where it hides nothing.

    Its title says where modes have their numbers: elsewhere mode n is the n-th by frequency.
    """
    where = f"modes numbered by frequency at friction {float(sweep['reference_friction']):.4g}"
    style: dict[str, Any] = {"frameon": False, "fontsize": "small", "title_fontsize": "small"}
    ax.legend(*entries, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2, title=where, **style)


def _shade(ax: Axes, friction: NDArray[np.float64], where: NDArray[np.bool_]) -> None:
    """Put a grey band behind the samples of which something is unknown."""
    if not where.any():
        return
    middle = (friction[1:] + friction[:-1]) / 2
    left, right = np.concatenate([friction[:1], middle]), np.concatenate([middle, friction[-1:]])
    edges = np.diff(np.concatenate([[False], where, [False]]).astype(np.int8))
    label: str | None = "undecided"
    for start, stop in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1, strict=True):
        ax.axvspan(left[start], right[stop], color=GREY, alpha=0.25, linewidth=0, zorder=0.4, label=label)
        label = None


def _styles(ever: NDArray[np.bool_]) -> list[dict[str, Any]]:
    """Return line styles: grey for modes never unstable, each other one its own."""
    styles: list[dict[str, Any]] = [{"color": GREY, "linewidth": 0.8} for _ in ever]
    for i, j in enumerate(np.flatnonzero(ever)):
        styles[j] = LINES[i % len(LINES)]
    return styles
