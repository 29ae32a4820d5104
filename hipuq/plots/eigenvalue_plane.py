"""Eigenvalues in the plane: root locus over friction, damping ratio over frequency.

Both are usual pictures of a complex eigenvalue analysis. Modes of one frequency range crowd
together, so the closest cluster is shown enlarged in an inset.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from numpy.typing import NDArray

from hipuq.cea import damping_ratio
from hipuq.errors import InputError
from hipuq.plots.friction_sweep import cluster
from hipuq.plots.grouping import ranges
from hipuq.plots.style import BORDER, GREY, SHADES, SKY, STABLE, UNSTABLE, axis_label, new_axes
from hipuq.plots.tracking import growth_threshold, sorted_sweep

Array = NDArray[np.float64]

UNKNOWN: dict[str, Any] = {"color": GREY, "linewidth": 0.8, "linestyle": ":"}
"""Line at the frequency of an undecided mode."""

NEAR = (0.05, 0.06)
"""Points nearer than this share one label (shares of the width and height of the axes)."""


def root_locus(outcomes: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw growth rate over frequency of all modes, coloured by friction: the higher the darker.

    Parameters
    ----------
    outcomes : Dataset
        A friction sweep: ``friction`` over sample, ``frequency`` [Hz], ``growth_rate`` [1/s] and
        ``unstable`` over (sample, mode). Undecided modes are left out, and the title says how many.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        The closest cluster of modes is enlarged in an inset, ``ax.child_axes[0]``.

    Raises
    ------
    SchemaError, InputError
        If the outcomes are no friction sweep.
    """
    sweep = sorted_sweep(outcomes)
    frequency, growth = sweep["frequency"].values, sweep["growth_rate"].values
    friction = np.broadcast_to(sweep["friction"].values[:, None], frequency.shape)
    known = ~np.isnan(sweep["unstable"].values)
    close = cluster(frequency[0]) | cluster(frequency[-1])
    ax = new_axes(ax, 7.2, 4.8)
    limits: dict[str, Any] = {"vmin": friction.min(), "vmax": friction.max(), "cmap": SHADES}

    def draw(view: Axes, shown: NDArray[np.bool_]) -> PathCollection:
        view.axhline(growth_threshold(sweep), zorder=0.5, **BORDER)
        return view.scatter(frequency[shown], growth[shown], c=friction[shown], s=7, linewidths=0, **limits)

    points = draw(ax, known)
    bar = ax.figure.colorbar(points, ax=ax)
    bar.set_label(axis_label(sweep["friction"]))
    if close.any():
        inset, _ = _inset(ax, growth[known & ~close])
        draw(inset, known & close)
        _frame(ax, inset, sweep["mode"].values[close])
    undecided = int((~known).sum())
    ax.set_title(f"{undecided} undecided of {known.size} not drawn" if undecided else "")
    ax.set_xlabel(axis_label(sweep["frequency"]))
    ax.set_ylabel(axis_label(sweep["growth_rate"]))
    return ax


def damping_over_frequency(
    outcomes: xr.Dataset, friction: float | None = None, *, ax: Axes | None = None
) -> Axes:
    """Draw the damping ratio over frequency of all modes at one friction.

    Parameters
    ----------
    outcomes : Dataset
        As for `root_locus`. Of an undecided mode only the frequency is drawn; a rigid mechanism, of
        frequency 0, has no damping ratio.
    friction : float, optional
        Friction [1]; the nearest one of the sweep is taken. The largest by default.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        The closest cluster of modes is enlarged in an inset, ``ax.child_axes[0]``.

    Raises
    ------
    SchemaError, InputError
        If the outcomes are no friction sweep, or the friction is not a number.
    """
    if friction is not None and not np.isfinite(friction):
        raise InputError(f"friction is {friction}: it must be a finite number")
    sweep = sorted_sweep(outcomes)
    values = sweep["friction"].values
    row = -1 if friction is None else int(np.abs(values - friction).argmin())
    here = sweep.isel(sample=row)
    frequency, unstable = here["frequency"].values, here["unstable"].values
    ratio = damping_ratio(frequency, here["growth_rate"].values)
    numbers = here["mode"].values
    drawn = np.isfinite(ratio) & ~np.isnan(unstable)
    close = cluster(frequency)
    unknown = np.isnan(unstable)
    ax = new_axes(ax, 7.2, 4.8)
    _damping(ax, frequency, ratio, unstable, drawn)
    ax.set_xlim(0.0, None)
    ax.margins(y=0.12)
    corner: Literal["lower left", "upper left"] = "lower left"
    if close.any():
        inset, upper = _inset(ax, ratio[drawn & ~close])
        corner = "lower left" if upper else "upper left"
        _damping(inset, frequency, ratio, unstable, drawn & close)
        for x in frequency[unknown & close]:
            inset.axvline(x, **UNKNOWN)
        inset.margins(0.12, 0.3)
        _frame(ax, inset, numbers[close])
        label_modes(
            inset, numbers[drawn & close], frequency[drawn & close], ratio[drawn & close], beside=True
        )
    label_modes(ax, numbers[drawn & ~close], frequency[drawn & ~close], ratio[drawn & ~close])
    for x in frequency[unknown]:
        ax.axvline(x, **UNKNOWN)
    if unknown.any():
        ax.plot([], [], label=f"undecided ({unknown.sum()})", **UNKNOWN)
    rigid = int(((frequency == 0) & ~unknown).sum())
    if rigid:
        ax.plot(
            [], [], linestyle="none", label=f"no damping ratio: {rigid} rigid mechanism{'s' * (rigid > 1)}"
        )
    ax.set_title(f"{axis_label(sweep['friction'], '')} {values[row]:.4g}")
    ax.set_xlabel(axis_label(sweep["frequency"]))
    ax.set_ylabel("damping ratio [1]")
    ax.legend(loc=corner, fontsize="small")
    return ax


def _inset(ax: Axes, outside: Array) -> tuple[Axes, bool]:
    """Return an inset above or below the heights `outside` and 0, where there is more room.

    And whether it is the upper one.
    """
    bottom, top = ax.get_ylim()
    heights = (np.append(outside, 0.0) - bottom) / (top - bottom)
    room = 1 - heights.max(), heights.min()
    upper = bool(room[0] >= room[1] - 1e-9)
    height = float(np.clip(max(room) - 0.18, 0.15, 0.34))
    return ax.inset_axes((0.12, 0.93 - height if upper else 0.09, 0.66, height)), upper


def _damping(ax: Axes, frequency: Array, ratio: Array, unstable: Array, shown: NDArray[np.bool_]) -> None:
    """Draw damping ratios by verdict."""
    ax.axhline(0.0, zorder=0.5, **BORDER)
    for verdict, style, label in ((0, STABLE, "stable"), (1, UNSTABLE, "unstable")):
        part = shown & (unstable == verdict)
        if part.any():
            ax.plot(frequency[part], ratio[part], markersize=5, label=label, **style)


def label_modes(ax: Axes, numbers: NDArray[Any], x: Array, y: Array, *, beside: bool = False) -> None:
    """Write mode numbers above points, or beside them; points that lie on each other share a label.

    Parameters
    ----------
    ax : Axes
        Its limits are set.
    numbers, x, y : (modes,) array
        Numbers of the modes, and where their points are.
    beside : bool, default False
        Whether to write to the right of a point.
    """
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    u, v = (x - left) / (right - left), (y - bottom) / (top - bottom)
    groups: list[list[int]] = []
    for i in range(len(numbers)):
        for group in groups:
            j = group[0]
            if abs(u[i] - u[j]) < NEAR[0] and abs(v[i] - v[j]) < NEAR[1]:
                group.append(i)
                break
        else:
            groups.append([i])
    for group in groups:
        text = ranges([int(numbers[i]) for i in group])
        centre = (float(np.mean(x[group])), float(np.mean(y[group])))
        style: dict[str, Any] = {"ha": "left", "va": "center"} if beside else {"ha": "center", "va": "bottom"}
        offset = (5, 0) if beside else (0, 5)
        style["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 0.3}
        ax.annotate(text, centre, offset, textcoords="offset points", fontsize="small", zorder=1.8, **style)


def _frame(ax: Axes, inset: Axes, numbers: NDArray[np.int64]) -> None:
    """Say what an inset enlarges, and shade that in the axes."""
    inset.tick_params(labelsize="x-small")
    inset.ticklabel_format(useOffset=False)
    inset.locator_params(axis="x", nbins=5)
    inset.set_title(f"modes {ranges(numbers.tolist())} enlarged", fontsize="small")
    ax.axvspan(*inset.get_xlim(), color=SKY, alpha=0.3, linewidth=0, zorder=0.3)
