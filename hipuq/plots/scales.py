"""Logarithmic axes: plain numbers, as many as there is room for, and breaks where nothing is to be seen."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike, NDArray

from hipuq.plots.captions import inches
from hipuq.plots.style import BLACK

Array = NDArray[np.float64]

SUBDIVISIONS = ((1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0), (1.0, 2.0, 5.0), (1.0, 3.0), (1.0,))
"""Labels within a decade, the closest first."""

ROOM = (0.75, 0.25)
"""Room that a label takes along the x and the y axis [inch]."""

EMPTY = 3
"""Whole decades without a value from which an axis is broken."""

BREAK = 0.12
"""Height of a break by that of all that is drawn, at least; its ends need room for their labels too."""

HEIGHT_LEFT = 0.6
"""Share of the height that is left to the Axes by a title and a legend below."""

FAR = 200.0
"""Decades beyond which nothing is drawn."""

MARGIN = 1.3
"""Factor between the outermost value and the end of the axis."""


def label_decades(axis: Axis, *, count: bool = False) -> None:
    """Label a logarithmic axis, whose limits are set, by plain numbers, as many as there is room for.

    Parameters
    ----------
    axis : Axis
    count : bool, default False
        Whether it counts, as evaluations: thousands are then set apart. Else numbers are powers of ten
        where the axis reaches below 0.0001 or above 100,000.
    """
    left, right = sorted(axis.get_view_interval())
    most = _most(axis)
    exponents = np.arange(np.floor(np.log10(left)), np.ceil(np.log10(right)))
    for subs in SUBDIVISIONS:
        ticks = np.outer(10.0**exponents, subs)
        if ((ticks >= left) & (ticks <= right)).sum() <= most:
            break
    plain = left > 5e-5 and right < 2e5
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(
        FuncFormatter(lambda x, _: f"{x:,.0f}" if count else f"{x:g}" if plain else _power(x))
    )
    axis.set_minor_formatter(NullFormatter())


def set_log_y(ax: Axes, values: ArrayLike) -> list[tuple[float, float]]:
    """Make the y axis logarithmic about these values, broken where three decades or more hold none.

    Parameters
    ----------
    ax : Axes
    values : array
        Above 0; at least one.

    Returns
    -------
    list of tuple of float
        Ends of the parts of the axis, from below; a single one where it is not broken.
    """
    logs = np.sort(np.log10(np.asarray(values, dtype=np.float64)))
    margin = float(np.log10(MARGIN))
    ends = np.array([np.ceil(logs[:-1] + margin), np.floor(logs[1:] - margin)]).T
    gaps = ends[np.diff(ends)[:, 0] >= EMPTY]
    bottom, top = float(logs[0] - margin), float(logs[-1] + margin)
    if not len(gaps):
        ax.set_yscale("log")
        ax.set_ylim(10.0**bottom, 10.0**top)
        label_decades(ax.yaxis)
        return [(10.0**bottom, 10.0**top)]
    # The outermost parts reach to a power of ten as the inner ends do, so that each has labels.
    bottom, top = min(bottom, gaps[0, 0] - 1), max(top, gaps[-1, 1] + 1)
    parts = [(float(low), float(high)) for low, high in np.array([bottom, *gaps.ravel(), top]).reshape(-1, 2)]
    _break(ax, parts)
    return [(10.0**low, 10.0**high) for low, high in parts]


def _break(ax: Axes, parts: list[tuple[float, float]]) -> None:
    """Give the y axis a scale on which the decades between parts, given as exponents, take little room."""
    share = max(BREAK, 0.9 * ROOM[1] / (HEIGHT_LEFT * inches(ax)[1]))
    height = share * sum(high - low for low, high in parts)
    knots = np.array([-FAR, *np.ravel(parts), FAR])
    steps = np.diff(knots)
    steps[2:-1:2] = height
    places = np.concatenate([[-FAR], -FAR + np.cumsum(steps)])

    def forward(values: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            found: Array = np.interp(np.log10(values), knots, places)
        return found

    def inverse(values: Array) -> Array:
        found: Array = 10.0 ** np.interp(values, places, knots)
        return found

    ax.set_yscale("function", functions=(forward, inverse))
    ax.set_ylim(10.0 ** parts[0][0], 10.0 ** parts[-1][1])
    _label_parts(ax.yaxis, parts)
    for (_, low), (high, _) in pairwise(parts):
        # What leads across a break is not to scale: the break hides it, and the ends of the axis too.
        ax.add_patch(
            Rectangle(
                (-0.01, 10.0**low),
                1.02,
                10.0**high - 10.0**low,
                transform=ax.get_yaxis_transform(),
                facecolor=ax.get_facecolor(),
                edgecolor="none",
                zorder=2.6,
                clip_on=False,
            )
        )
        ax.plot(
            [0, 1, 0, 1],
            10.0 ** np.array([low, low, high, high]),
            linestyle="none",
            marker=[(-1, -0.5), (1, 0.5)],
            markersize=8,
            color=BLACK,
            markeredgewidth=0.8,
            transform=ax.get_yaxis_transform(),
            zorder=2.7,
            clip_on=False,
        )


def _label_parts(axis: Axis, parts: list[tuple[float, float]]) -> None:
    """Label powers of ten in each part, as many as there is room for."""
    exponents = [np.arange(np.ceil(low), np.floor(high) + 1) for low, high in parts]
    step = max(1, int(np.ceil(sum(map(len, exponents)) / _most(axis))))
    # Counted from a break, so that at least one of its ends is labelled.
    shown = np.concatenate([exponents[0][::-step], *(part[::step] for part in exponents[1:])])
    axis.set_major_locator(FixedLocator(np.sort(10.0**shown).tolist()))
    axis.set_major_formatter(FuncFormatter(lambda x, _: _power(x)))
    minor = np.concatenate([np.outer(10.0 ** part[:-1], np.arange(2, 10)).ravel() for part in exponents])
    axis.set_minor_locator(FixedLocator(minor.tolist() if step == 1 else []))
    axis.set_minor_formatter(NullFormatter())


def _most(axis: Axis) -> int:
    """Return how many labels an axis has room for."""
    upright = axis is axis.axes.yaxis
    left = HEIGHT_LEFT if upright else 1.0
    return max(2, int(left * inches(axis.axes)[upright] / ROOM[upright]))


def _power(x: float) -> str:
    """Return a number as a digit times a power of ten."""
    exponent = int(np.floor(np.log10(x) + 1e-9))
    digit = x / 10.0**exponent
    return f"$10^{{{exponent}}}$" if abs(digit - 1) < 1e-6 else rf"${digit:g}\times10^{{{exponent}}}$"
