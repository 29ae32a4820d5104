"""Mode shapes of the ring: deformed over undeformed.

Figure 4 of Oberst et al., INTER-NOISE 2016, p. 5539.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from hipuq.errors import InputError, SchemaError
from hipuq.plots.captions import put_title
from hipuq.plots.style import BLACK, BLUE, GREY, VERMILLION, new_axes

SOCKET = 1.05
"""Radius at which the socket is drawn, a little outside the masses [radii]."""


def mode_shape(shapes: xr.Dataset, mode: int, *, ax: Axes | None = None, scale: float = 0.25) -> Axes:
    """Draw a mode shape of the ring over the undeformed ring.

    Shown is the real part: the phase at which the largest entry of the shape is at its greatest.

    Parameters
    ----------
    shapes : Dataset
        From ``mode_shapes`` of a ring: ``displacement_real`` over (mode, oscillator, axis),
        ``position`` over (oscillator, axis) in radii, ``frequency`` [Hz] and ``growth_rate`` [1/s]
        over mode. If there are any, single values ``friction`` and ``damping_ratio``, as variables or
        attributes, are told in the title.
    mode : int
        Number of the mode.
    ax : Axes, optional
        Where to draw; a new figure by default.
    scale : float, default 0.25
        Length of the largest displacement in the drawing [radii]; a mode shape has no size.

    Returns
    -------
    Axes
        The one given, or that of the new figure.

    Raises
    ------
    SchemaError
        If the Dataset is not of this kind.
    InputError
        If there is no such mode, or the scale is not a positive number.
    """
    for name in ("displacement_real", "position", "frequency", "growth_rate"):
        if name not in shapes:
            raise SchemaError(f"the figure needs {name!r}: the mode shapes of a ring")
    modes = shapes["mode"].values.tolist()
    if mode not in modes:
        raise InputError(f"mode {mode} is not in the mode shapes: it must be one of {modes}")
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(f"scale is {scale}: it must be a positive number of radii")
    chosen = shapes.sel(mode=mode)
    start = chosen["position"].transpose("oscillator", "axis").values
    moved = chosen["displacement_real"].transpose("oscillator", "axis").values
    largest = np.hypot(*moved.T).max()
    moved = moved * (scale / largest) if largest > 0 else moved
    end = start + moved

    ax = new_axes(ax, 6.4, 4.4)
    turn = np.unwrap(np.arctan2(start[:, 1], start[:, 0]))
    arc = np.linspace(turn[0], turn[-1], 181)
    ax.plot(SOCKET * np.cos(arc), SOCKET * np.sin(arc), color=BLACK, linewidth=0.8, label="socket")
    ax.plot(*start.T, "o--", color=GREY, markerfacecolor="white", linewidth=0.8, label="undeformed")
    label = f"deformed (largest: {scale:g} radii)"
    ax.plot(*end.T, "s-", color=VERMILLION, markersize=5, label=label)
    ax.quiver(
        *start.T,
        *moved.T,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        color=BLUE,
        width=0.004,
    )
    # A number stands on the side of the socket that its mass does not move to.
    outwards = (start * moved).sum(axis=1) > 0.02
    radius = np.where(outwards, 0.87, SOCKET + 0.09)
    for number, (x, y) in zip(chosen["oscillator"].values, start * radius[:, None], strict=True):
        ax.text(x, y, str(number), ha="center", va="center", fontsize="small", color=BLACK)
    ax.set_aspect("equal")
    reach = np.concatenate([start * (SOCKET + 0.09), end])
    (left, bottom), (right, top) = reach.min(axis=0) - 0.08, reach.max(axis=0) + 0.08
    ax.set_xlim(left, right)
    ax.set_ylim(bottom, top)
    frequency, growth = float(chosen["frequency"]), float(chosen["growth_rate"])
    fate = " (growing)" if growth > 0 else " (decaying)" if growth < 0 else ""
    put_title(
        ax, f"mode {mode}: {frequency:.1f} Hz, growth rate {growth + 0.0:.3g} 1/s{fate}", _where(shapes)
    )
    ax.set_xlabel("x [radii]")
    ax.set_ylabel("y [radii]")
    # Inside the ring, where nothing is drawn.
    ax.legend(loc="center", bbox_to_anchor=(0.5, 0.66), frameon=False, fontsize="small")
    return ax


def _where(shapes: xr.Dataset) -> str:
    """Return at which friction and damping the shapes are, as far as the Dataset tells."""
    told = []
    for name, factor, unit in (("friction", 1.0, ""), ("damping_ratio", 100.0, " %")):
        value = np.asarray(shapes[name] if name in shapes.variables else shapes.attrs.get(name, np.nan))
        if value.size == 1 and np.isfinite(value.item()):
            told.append(f"{name.replace('_', ' ')} {factor * value.item():.4g}{unit}")
    return ", ".join(told)
