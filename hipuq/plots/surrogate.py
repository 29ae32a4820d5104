"""Predictions of a surrogate against the true model, on samples that it was not fitted to."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from matplotlib.scale import SymmetricalLogTransform
from matplotlib.ticker import FixedLocator, NullLocator
from numpy.typing import NDArray

from hipuq.errors import check_name
from hipuq.plots.captions import distrust, legend_below, level, over, put_title, say, selected, wrapped
from hipuq.plots.style import BLACK, BLUE, BORDER, GREY, VERMILLION, axis_label, new_axes

Array = NDArray[np.float64]

SPREAD = 0.2
"""Width over which points of one verdict are spread."""

WAY_OUT = "results of the method 'chaos'"

SCALES = ("auto", "linear", "symlog")

PILED = 0.2
"""Share of the range below which the inner 80 % of the true values lie too close for a linear scale."""

DECADES = 3
"""Most decades on either side of 0 on a symmetric logarithmic scale."""

MOST_LABELS = 9
"""Labels of a symmetric logarithmic axis above which powers of ten are left out."""


def predicted_against_true(results: xr.Dataset, *, ax: Axes | None = None, scale: str = "auto") -> Axes:
    """Draw the outcome of the surrogate over that of the model, for each held-out sample.

    Parameters
    ----------
    results : Dataset
        Results of the method ``"chaos"``: ``true(held_out)`` and ``predicted(held_out)`` in the unit of
        the outcome, ``q2`` [1], and if the outcome has a limit state its value as the attribute
        ``limit_state`` of ``true`` and the share ``misclassified`` [1] with its limits.
    ax : Axes, optional
        Where to draw; a new figure by default.
    scale : {"auto", "linear", "symlog"}
        Of both axes; ``"symlog"`` is linear about 0 and logarithmic farther out. ``"auto"`` takes it where
        the inner 80 % of the true values fill less than a fifth of their range and it draws them apart.

    Returns
    -------
    Axes
        The diagonal is a perfect surrogate. With a limit state the two quadrants are shaded in which
        surrogate and model disagree on the event, and their points are triangles. Samples without a
        true value are left out, and the legend says how many. Points of a verdict, which is 0 or 1, are
        spread sideways.

    Raises
    ------
    SchemaError
        If there are no such points, or they are over more than the samples, such as modes: then one
        has to be selected, as by ``results.sel(mode=18)``.
    UnknownNameError
        If there is no such scale.
    """
    check_name("scale", scale, SCALES)
    true, predicted = (over(results, name, ("held_out",), WAY_OUT) for name in ("true", "predicted"))
    x, y = (part.values.astype(np.float64) for part in (true, predicted))
    known = np.isfinite(x) & np.isfinite(y)
    ax = new_axes(ax, 5.6, 5.8)
    limit = limit_of(results)
    spread = ""
    if limit is not None and _is_verdict(true):
        # Points of one verdict would lie on each other; multiples of the golden ratio spread evenly.
        spread = ", spread sideways"
        x = x + SPREAD * ((np.arange(len(x)) * 0.6180339887) % 1 - 0.5)
    if known.any():
        stretch = _stretch(x[known], scale)
        ends = _ends(np.concatenate([x[known], y[known], [] if limit is None else [limit]]), stretch)
        ax.plot(ends, ends, color=BLACK, linewidth=0.9, zorder=1.6, label="predicted = true")
        wrong = np.zeros_like(known) if limit is None else (x < limit) != (y < limit)
        right: dict[str, Any] = {"color": BLUE, "marker": "o", "facecolors": "none", "linewidths": 0.6}
        _points(
            ax, x, y, known & ~wrong, "held-out samples" if limit is None else "same side of the limit", right
        )
        if limit is not None:
            units = str(true.attrs.get("units", "1"))
            _quadrants(ax, ends, limit, f"limit state: {limit:g}{'' if units == '1' else f' {units}'}")
            text = _share(results, int((known & wrong).sum()), int(known.sum()))
            _points(ax, x, y, known & wrong, text, {"color": VERMILLION, "marker": "^", "linewidths": 0.0})
        if not known.all():
            ax.plot([], [], linestyle="none", label=f"unknown, not drawn: {(~known).sum()} of {known.size}")
        _set_scales(ax, ends, stretch)
    else:
        say(ax, "no held-out sample is known")
        ax.set_xticks([])
        ax.set_yticks([])
    ax.set_aspect("equal", adjustable="box")
    name = str(true.attrs.get("long_name", "value")).removesuffix(", true")
    for what, axis in (("true", ax.xaxis), ("predicted", ax.yaxis)):
        more = spread if what == "true" else ""
        text = axis_label(true.assign_attrs(long_name=f"{what} {name}{more}"))
        axis.set_label_text(wrapped(ax, text, upright=what == "predicted"))
    put_title(ax, *_title(results, known, selected(true)))
    if known.any():
        legend_below(ax, width=2.0)
    return ax


def limit_of(results: xr.Dataset) -> float | None:
    """Return the value of the outcome at its limit state; None if it has none.

    Parameters
    ----------
    results : Dataset
        As for `predicted_against_true`.

    Returns
    -------
    float or None
        Of a verdict, which is 0 or 1, a half.
    """
    true = results["true"]
    if "limit_state" in true.attrs:
        return float(true.attrs["limit_state"])
    return 0.5 if "misclassified" in results and _is_verdict(true) else None


def _is_verdict(true: xr.DataArray) -> bool:
    """Say whether an outcome is nothing but 0 and 1."""
    known = true.values[~np.isnan(true.values)]
    return known.size > 0 and bool(np.isin(known, (0.0, 1.0)).all())


def _stretch(true: Array, scale: str) -> SymmetricalLogTransform | None:
    """Return the symmetric logarithmic scale for these values; None where it is to be the linear one."""
    size = np.abs(true)
    if scale == "linear" or size.max() == 0:
        return None
    # The linear part ends at a power of ten: below the smallest quarter, or decades below the largest.
    least = max(float(np.quantile(size, 0.25)), 10.0**-DECADES * float(size.max()))
    stretch = SymmetricalLogTransform(10.0, 10.0 ** np.floor(np.log10(least)), 1.0)
    if scale == "symlog":
        return stretch
    plain = _inner_share(true)
    return stretch if plain < PILED and plain < _inner_share(stretch.transform(true)) else None


def _inner_share(values: Array) -> float:
    """Return the share of the range that the inner 80 % of values fill."""
    least, low, high, most = np.quantile(values, [0.0, 0.1, 0.9, 1.0])
    return float((high - low) / (most - least)) if most > least else 1.0


def _ends(values: Array, stretch: SymmetricalLogTransform | None) -> tuple[float, float]:
    """Return limits of both axes."""
    if stretch is not None:
        values = stretch.transform(values)
    least, most = float(values.min()), float(values.max())
    margin = 0.04 * (most - least) or 0.5 * abs(most) or 1.0
    ends = np.array([least - margin, most + margin])
    low, high = ends if stretch is None else stretch.inverted().transform(ends)
    return float(low), float(high)


def _set_scales(ax: Axes, ends: tuple[float, float], stretch: SymmetricalLogTransform | None) -> None:
    """Give both axes the same scale, limits and ticks."""
    if stretch is None:
        ax.set(xlim=ends, ylim=ends)
        ax.locator_params(nbins=6)
        return
    ax.set_xscale("symlog", linthresh=stretch.linthresh, linscale=stretch.linscale)
    ax.set_yscale("symlog", linthresh=stretch.linthresh, linscale=stretch.linscale)
    ax.set(xlim=ends, ylim=ends)
    count = np.floor(np.log10(np.abs(ends).max() / stretch.linthresh)) + 1
    powers = stretch.linthresh * 10.0 ** np.arange(count)
    ticks = np.array([0.0, *powers, *-powers])
    step = 1 + int(((ticks >= ends[0]) & (ticks <= ends[1])).sum()) // MOST_LABELS
    ticks = np.array([0.0, *powers[::-step], *-powers[::-step]])
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(FixedLocator(ticks.tolist()))
        axis.set_minor_locator(NullLocator())


def _points(
    ax: Axes, x: Array, y: Array, shown: NDArray[np.bool_], label: str, style: dict[str, Any]
) -> None:
    """Draw points, the smaller and paler the more there are."""
    few = float(np.clip(np.sqrt(600 / max(len(x), 1)), 0.3, 1.0))
    ax.scatter(x[shown], y[shown], s=18 * few, alpha=max(few, 0.5), label=label, zorder=2, **style)


def _quadrants(ax: Axes, ends: tuple[float, float], limit: float, label: str) -> None:
    """Shade where surrogate and model disagree on the event."""
    shade: dict[str, Any] = {
        "facecolor": (GREY, 0.18),
        "edgecolor": (GREY, 0.5),
        "hatch": "....",
        "linewidth": 0,
    }
    below, above = limit - ends[0], ends[1] - limit
    ax.add_patch(Rectangle((ends[0], limit), below, above, zorder=0.4, **shade))
    ax.add_patch(Rectangle((limit, ends[0]), above, below, zorder=0.4, **shade))
    border = BORDER | {"zorder": 1.5}
    ax.axvline(limit, **border)
    ax.axhline(limit, **border, label=label)


def _share(results: xr.Dataset, count: int, known: int) -> str:
    """Return the legend of misclassified points, with the limits of their share if there are any."""
    if "misclassified" not in results or results["misclassified"].ndim or np.isnan(results["misclassified"]):
        return f"misclassified: {count} of {known}"
    text = f"misclassified: {100 * float(results['misclassified']):.3g} %"
    ends = [f"misclassified_{end}" for end in ("low", "high")]
    if all(end in results for end in ends):
        low, high = (f"{100 * float(results[end]):.3g}" for end in ends)
        text += f"\n({level(results)}: {low} to {high} %)"
    return text


def _title(results: xr.Dataset, known: NDArray[np.bool_], where: str) -> list[str]:
    """Return where the points are of, and how good the surrogate is or that it is not to be trusted."""
    # Of very many held-out samples not all are kept to be drawn.
    count = f"{int(results['checked']) if 'checked' in results else int(known.sum()):,}"
    if warning := distrust(results):
        return [where, f"{warning} ({count} held out)"]
    if "q2" not in results or results["q2"].ndim:
        return [where]
    q2 = float(results["q2"])
    return [where, f"Q2 {'undefined' if np.isnan(q2) else f'{q2:.3f}'} on {count} held-out samples"]
