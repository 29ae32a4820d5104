"""Predictions of a surrogate against the true model, on samples that it was not fitted to."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from hipuq.plots.captions import legend_below, level, over, put_title, say, selected, wrapped
from hipuq.plots.style import BLACK, BLUE, BORDER, GREY, VERMILLION, axis_label, new_axes

Array = NDArray[np.float64]

SPREAD = 0.2
"""Width over which points of one verdict are spread."""

WAY_OUT = "results of the method 'chaos'"


def predicted_against_true(results: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the outcome of the surrogate over that of the model, for each held-out sample.

    Parameters
    ----------
    results : Dataset
        Results of the method ``"chaos"``: ``true(held_out)`` and ``predicted(held_out)`` in the unit of
        the outcome, ``q2`` [1], and if the outcome has a limit state its value as the attribute
        ``limit_state`` of ``true`` and the share ``misclassified`` [1] with its limits.
    ax : Axes, optional
        Where to draw; a new figure by default.

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
    """
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
        ends = _ends(np.concatenate([x[known], y[known], [] if limit is None else [limit]]))
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
        ax.set_xlim(*ends)
        ax.set_ylim(*ends)
    else:
        say(ax, "no held-out sample is known")
        ax.set_xticks([])
        ax.set_yticks([])
    ax.locator_params(nbins=6)
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


def _ends(values: Array) -> tuple[float, float]:
    """Return limits of both axes."""
    least, most = float(values.min()), float(values.max())
    margin = 0.04 * (most - least) or 0.5 * abs(most) or 1.0
    return least - margin, most + margin


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
    """Return where the points are of, how good the surrogate is and whether it is to be trusted."""
    lines = [where]
    if "q2" in results and not results["q2"].ndim:
        q2 = float(results["q2"])
        value = "undefined" if np.isnan(q2) else f"{q2:.3f}"
        lines.append(f"Q2 = {value} on {int(known.sum()):,} held-out samples")
    if "trusted" in results and not results["trusted"].ndim and int(results["trusted"]) == 0:
        why = str(results["trusted"].attrs.get("reasons", ""))
        lines.append(f"not to be trusted{': ' if why else ''}{why}")
    return lines
