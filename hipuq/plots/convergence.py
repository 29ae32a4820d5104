"""How estimates settle as evaluations are added."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hipuq.errors import SchemaError, check_name
from hipuq.plots.captions import (
    UNDEFINED,
    legend_below,
    level,
    over,
    parameter_label,
    put_title,
    say,
    selected,
    wrapped,
)
from hipuq.plots.scales import label_decades
from hipuq.plots.style import BLACK, GREY, LINES, MARKERS, axis_label, new_axes

Array = NDArray[np.float64]

END = "_by_budget"

FIRST = ("probability_overall", "probability", "mean_overall", "mean", "ST", "S1")
"""Which quantity is drawn by default: the first of these that there is."""

WAY_OUT = "results of the method 'monte_carlo' or 'sobol'"


def convergence(
    results: xr.Dataset, *, ax: Axes | None = None, quantity: str | None = None, label: str | None = None
) -> Axes:
    """Draw an estimate and its interval over the number of evaluations that it was made from.

    Parameters
    ----------
    results : Dataset
        With ``<quantity>_by_budget`` over the coord ``budget`` [1], for indices over ``parameter`` too,
        and if there are any its limits, ``<quantity>_by_budget_low`` and ``_high``. A line has a gap
        where the estimate is undefined.
    ax : Axes, optional
        Where to draw, such as beside other designs; a new figure by default.
    quantity : str, optional
        Such as ``"probability"``, ``"mean"``, ``"ST"`` or ``"S1"``; by default the first of these that
        there is. Of more parameters than there are line styles, those with the largest indices are
        told apart, and the others are grey.
    label : str, optional
        Name of the results in the legend, where there is one curve.

    Returns
    -------
    Axes
        The one given, or that of the new figure.

    Raises
    ------
    SchemaError
        If there is no such estimate, or it is over more than budget and parameter, such as modes: then
        one has to be selected, as by ``results.sel(mode=18)``.
    UnknownNameError
        If the quantity is not in the results.
    """
    quantity = _quantity(results, quantity)
    key = quantity + END
    by_parameter = "parameter" in results[key].dims
    dims = ("budget", "parameter") if by_parameter else ("budget",)
    limits = [end for end in ("_low", "_high") if key + end in results]
    whole, *ends = (over(results, key + end, dims, WAY_OUT) for end in ("", *limits))
    budget = whole["budget"].values
    if not budget.size or not (budget > 0).all():
        raise SchemaError(f"the coord 'budget' is {budget.tolist()}: it needs numbers above 0")
    percent = quantity.startswith("probability")
    values, *bands = (
        (100 if percent else 1) * part.values.astype(np.float64).reshape(len(budget), -1)
        for part in (whole, *ends)
    )
    ax = new_axes(ax)
    ax.set_xscale("log")
    ax.set_xlim(*_reach(ax, budget))
    known = bool(np.isfinite(values).any())
    if not known:
        why = whole.attrs.get("undefined") or results.get(quantity, whole).attrs.get("undefined")
        say(ax, f"{UNDEFINED}: {why}" if why else UNDEFINED)
        ax.set_yticks([])
    elif by_parameter:
        names = [parameter_label(str(name)) for name in whole["parameter"].values]
        _by_parameter(ax, budget, values, bands, names, _largest(results, values))
        ax.axhline(0.0, color=BLACK, linewidth=0.6, zorder=0.5)
    else:
        text = label if label is not None else quantity.removesuffix("_overall")
        text += f", {level(results)}" if bands else ""
        _band(ax, budget, values[:, 0], [band[:, 0] for band in bands], text)
    label_decades(ax.xaxis, count=True)
    ax.grid(axis="y", linewidth=0.4, alpha=0.5)
    ax.set_xlabel(axis_label(whole["budget"]))
    # The estimate itself has the shorter name.
    text = axis_label(results.get(quantity, whole), "%" if percent else None)
    ax.set_ylabel(wrapped(ax, text, upright=True))
    bars = f"bars: {level(results)}" if by_parameter and bands and known else ""
    put_title(ax, selected(whole), bars, _not_yet(budget, values) if known else "")
    if known:
        legend_below(ax, width=1.7 if by_parameter else 3.5)
    return ax


def _quantity(results: xr.Dataset, asked: str | None) -> str:
    """Return the quantity to draw."""
    here = [str(name).removesuffix(END) for name in results.data_vars if str(name).endswith(END)]
    if not here:
        raise SchemaError(f"the figure needs a variable that ends in {END!r}: {WAY_OUT}")
    if asked is not None:
        return check_name("quantity", asked, here)
    return next((name for name in FIRST if name in here), here[0])


def _largest(results: xr.Dataset, values: Array) -> NDArray[np.intp]:
    """Return the places of the parameters to tell apart, largest first, alike for S1 and ST."""
    total = results.get(f"ST{END}")
    by = values if total is None else total.transpose("budget", "parameter").values
    with_last = np.where(np.isnan(by[-1]), -np.inf, by[-1])
    return np.argsort(-with_last, kind="stable")[: len(LINES)]


def _not_yet(budget: Array, values: Array) -> str:
    """Say from how many evaluations on there is any estimate, if not from the first."""
    first = int(np.isfinite(values).any(axis=1).argmax())
    return f"{UNDEFINED} below {budget[first]:,} evaluations" if first else ""


def _style(rank: int) -> dict[str, Any]:
    return LINES[rank % len(LINES)] | {"marker": MARKERS[rank % len(MARKERS)], "markersize": 4}


def _band(ax: Axes, budget: Array, values: Array, limits: list[Array], label: str) -> None:
    """Draw one estimate and the band of its interval."""
    # Curves are the only lines on the Axes: each takes the next style.
    style = _style(len(ax.lines))
    if len(limits) == 2:
        # The edges have the style of the line, so that bands are told apart in grey.
        colour = style["color"]
        edge = {"edgecolor": (colour, 0.7), "linestyle": style["linestyle"], "linewidth": 0.7}
        low, high = limits
        ax.fill_between(budget, low, high, facecolor=(colour, 0.15), **edge)
    ax.plot(budget, values, label=label, **style)


def _by_parameter(
    ax: Axes, budget: Array, values: Array, limits: list[Array], names: list[str], told: NDArray[np.intp]
) -> None:
    """Draw a curve for each parameter with bars, side by side, so that close ones can be read."""
    step = 0.008 * np.log(np.divide(*ax.get_xlim()[::-1]))
    for rank, i in enumerate(told):
        style = _style(rank)
        x = budget * np.exp(step * (rank - (len(told) - 1) / 2))
        if len(limits) == 2:
            ax.vlines(x, limits[0][:, i], limits[1][:, i], color=style["color"], linewidth=1.2)
        unknown = np.isnan(values[:, i]).all()
        ax.plot(x, values[:, i], label=f"{names[i]}: {UNDEFINED}" if unknown else names[i], **style)
    rest = np.setdiff1d(np.arange(len(names)), told)
    if rest.size:
        # One line with gaps, since the others are not told apart.
        gaps = np.full((1, rest.size), np.nan)
        x, y = (
            np.tile(np.append(budget, np.nan), rest.size),
            np.concatenate([values[:, rest], gaps]).T.ravel(),
        )
        text = f"{rest.size} other{'s' * (rest.size > 1)}"
        ax.plot(x, y, color=GREY, linewidth=0.7, zorder=1.5, label=text)


def _reach(ax: Axes, budget: Array) -> tuple[float, float]:
    """Return limits of the axis that hold these budgets and those drawn before."""
    least, most = float(budget.min()) / 1.25, float(budget.max()) * 1.25
    if ax.lines:
        left, right = ax.get_xlim()
        least, most = min(least, left), max(most, right)
    return least, most
