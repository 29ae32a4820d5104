"""What figures of compared methods share: their variables, their styles, the words about them.

Markers and line styles of the methods are the same in all figures of a comparison.
"""

from __future__ import annotations

import json
import textwrap
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import SchemaError, check_name
from hipuq.plots.captions import inches, legend_below, over, parameter_label
from hipuq.plots.scales import HEIGHT_LEFT
from hipuq.plots.style import BLACK, GREY, LINES

Array = NDArray[np.float64]

DIMS = ("method", "budget")

WAY_OUT = "results of hipuq.compare"

STYLES: tuple[dict[str, Any], ...] = tuple(
    style | {"marker": marker, "markersize": size}
    for style, (marker, size) in zip(
        (*LINES, {"color": BLACK, "linestyle": (0, (1, 1))}, {"color": GREY, "linestyle": (0, (4, 1, 1, 1))}),
        {"o": 6, "^": 6, "s": 5.5, "D": 5.5, "v": 6, "P": 7, "X": 7, "*": 9}.items(),
        strict=True,
    )
)
"""Styles of the methods in their order, taken in turn; the second time with open markers."""

ROUNDING = 1e-15
"""Error by the size of the reference up to which it is rounding of an exact result."""

STANDARD = 1.959964
"""Standard errors in half the width of the reference's limits, which are at 95 %."""

STATED = 0.95
"""Level of a method's own intervals, unless its options say otherwise."""

LETTERS = 23
"""Longest line of the legend: two columns have room in a figure of 5 inch."""


def names_of(race: xr.Dataset) -> list[str]:
    """Return the names of the methods."""
    return [str(name) for name in over(race, "evaluations", DIMS, WAY_OUT)["method"].values]


def baseline_of(race: xr.Dataset) -> str:
    """Return the name of the method that others are held against."""
    return str(race.attrs.get("baseline") or names_of(race)[0])


def chosen(race: xr.Dataset, name: str, parameter: str | None) -> tuple[xr.Dataset, str]:
    """Return the comparison, of one parameter if it is asked for, and the variable to draw.

    Parameters
    ----------
    race : Dataset
    name : str
        ``"rmse"`` or ``"coverage"``; with other dims than methods and budgets the one over all is drawn.
    parameter : str or None

    Returns
    -------
    race : Dataset
    variable : str

    Raises
    ------
    SchemaError
        If the variable is not over parameters.
    UnknownNameError
        If there is no such parameter.
    """
    dims = set(race[name].dims) if name in race else set()
    if parameter is not None and name in race:
        if "parameter" not in dims:
            raise SchemaError(f"{name} is not over parameter: leave out parameter={parameter!r}")
        here = [str(one) for one in race["parameter"].values]
        return race.sel(parameter=check_name("parameter", parameter, here)), name
    overall = f"{name}_overall"
    return race, overall if overall in race and dims > set(DIMS) else name


def with_limits(race: xr.Dataset, name: str) -> list[Array]:
    """Return a variable and its limits, each (method, budget)."""
    parts = (over(race, f"{name}{end}", DIMS, WAY_OUT) for end in ("", "_low", "_high"))
    return [part.values.astype(np.float64) for part in parts]


def cost_of(race: xr.Dataset, cost: str) -> Array:
    """Return what runs cost, (method, budget); NaN where there were none.

    Parameters
    ----------
    race : Dataset
    cost : {"evaluations", "seconds"}
        Evaluations [1], or the median over the replicates of the time of a run [s].
    """
    evaluations = over(race, "evaluations", DIMS, WAY_OUT).values.astype(np.float64)
    if cost == "evaluations":
        return np.where(evaluations > 0, evaluations, np.nan)
    seconds = over(race, "run_time", DIMS, WAY_OUT).values
    return np.where((evaluations > 0) & (seconds > 0), seconds, np.nan)


def reference_error(race: xr.Dataset) -> float:
    """Return the standard error of the reference, over all of it; 0 of an exact one."""
    low, high = (_reference(race, end) for end in ("_low", "_high"))
    error = float(np.sqrt(np.mean(np.square((high - low) / 2 / STANDARD))))
    return error if error > ROUNDING * _size(race) else 0.0


def exact_errors(race: xr.Dataset, error: Array) -> NDArray[np.bool_]:
    """Return which errors are 0, or so small beside the reference that they are rounding."""
    return np.asarray(error <= ROUNDING * _size(race))


def _reference(race: xr.Dataset, end: str = "") -> Array:
    name = f"reference{end}"
    if name not in race:
        raise SchemaError(f"the figure needs {name!r}: {WAY_OUT}")
    return np.asarray(race[name].values, dtype=np.float64)


def _size(race: xr.Dataset) -> float:
    return float(np.abs(_reference(race)).max()) or 1.0


def stated_level(race: xr.Dataset, name: str) -> float:
    """Return the level that the intervals of a method state, from its options."""
    options: Any = json.loads(race.attrs.get("options") or "{}")
    for key in ("compare", "contenders", name, "estimate"):
        options = options.get(key) or {}
    return float(options.get("confidence", STATED))


def side_by_side(ax: Axes, x: Array, step: float = 0.006) -> Array:
    """Return evaluations, (method, budget), moved a little, so that close points of methods can be read.

    Parameters
    ----------
    ax : Axes
        The limits of its x axis are set.
    x : (m, b) array
    step : float
        Distance from a method to the next one by the width of the Axes.
    """
    rank = np.arange(len(x))[:, None] - (len(x) - 1) / 2
    moved: Array = x * np.exp(step * rank * np.log(np.divide(*ax.get_xlim()[::-1])))
    return moved


def curve(ax: Axes, rank: int, x: Array, y: Array, label: str, limits: tuple[Array, Array] | None) -> None:
    """Draw one method with its bars; one without a value is in the legend alone.

    Parameters
    ----------
    ax : Axes
        Its limits are set.
    rank : int
        Place of the method among all.
    x, y : array
        NaN leaves a gap.
    label : str
    limits : tuple of array or None
        Ends of the bars; what lies below the Axes is cut off.
    """
    style = STYLES[rank % len(STYLES)] | {"linewidth": 1.3}
    if rank < len(STYLES):
        style |= {"markeredgecolor": "white", "markeredgewidth": 0.5}
    else:
        style |= {"markerfacecolor": "white"}
    known = np.isfinite(x) & np.isfinite(y)
    if not known.any():
        ax.plot([], [], linestyle="none", label=label)
        return
    if limits is not None:
        low, high = limits
        barred = known & np.isfinite(low) & np.isfinite(high)
        bottom = np.maximum(low[barred], ax.get_ylim()[0])
        ax.vlines(x[barred], bottom, high[barred], color=style["color"], linewidth=1.2)
    ax.plot(x, y, label=label, **style)


def at_budgets(race: xr.Dataset, what: str, where: NDArray[np.bool_], run: NDArray[np.bool_]) -> str:
    """Say something of some budgets; empty if of none, without the budgets if of all that were run."""
    if not where.any():
        return ""
    budgets = ", ".join(f"{budget:,}" for budget in race["budget"].values[where])
    return what if (where == run).all() else f"{what} at {budgets}"


def method_label(race: xr.Dataset, name: str, note: str) -> str:
    """Return the name of a method in the legend, with a note in brackets."""
    base = "baseline" if name == baseline_of(race) else ""
    notes = ", ".join(filter(None, (base, note)))
    whole = f"{name} ({notes})" if notes else name
    return whole if len(whole) <= LETTERS or not notes else f"{in_lines(name)}\n{in_lines(f'({notes})')}"


def in_lines(text: str) -> str:
    """Return a text in lines that the legend has room for."""
    return "\n".join(textwrap.wrap(text, LETTERS, break_on_hyphens=False))


def upright(ax: Axes, text: str) -> str:
    """Return a label of the y axis in lines of like length, for Axes with a legend below."""
    width = max(16, int(HEIGHT_LEFT * inches(ax)[1] * 72 / 5.5))
    lines = textwrap.wrap(text, width, break_on_hyphens=False)
    while len(narrower := textwrap.wrap(text, width - 1, break_on_hyphens=False)) == len(lines):
        lines, width = narrower, width - 1
    return "\n".join(lines)


def problem_of(race: xr.Dataset, name: str) -> str:
    """Return the problem, what is compared and the model, for the title.

    Parameters
    ----------
    race : Dataset
    name : str
        The variable drawn: of one that ends in ``_overall`` is said what it is over.
    """
    attrs = race.attrs
    table = schema.OUTCOMES | schema.INTEGRATED
    of = str(attrs.get("of", ""))
    problem = str(attrs.get("title") or (table[of].long_name if of in table else of))
    what = str(attrs.get("quantity") or "")
    if name.endswith("_overall"):
        extra = [str(dim) for dim in race[name.removesuffix("_overall")].dims if dim not in DIMS]
        what += f" over every {' and '.join(extra)}" if extra else " over all"
    elif "parameter" in race.coords and race["parameter"].ndim == 0:
        what += f" of {parameter_label(str(race['parameter'].item()))}"
    head = ": ".join(filter(None, (problem, what.strip())))
    return ", ".join(filter(None, (head, str(attrs.get("model", "")))))


def replicates_of(race: xr.Dataset, bars: str = "") -> str:
    """Say how many replicates there are, and what bars are."""
    counts = over(race, "replicates", DIMS, WAY_OUT).values
    least, most = (int(end) for end in (counts[counts > 0].min(initial=np.iinfo(np.int64).max), counts.max()))
    text = f"{most:,} replicates" if least >= most else f"{least:,} to {most:,} replicates"
    return ", ".join(filter(None, (text, bars)))


def add_legend(ax: Axes) -> None:
    """Put the legend below, in as many columns as its longest line allows."""
    lines = [line for text in ax.get_legend_handles_labels()[1] for line in text.split("\n")]
    if lines:
        legend_below(ax, width=0.5 + 0.062 * max(map(len, lines)))
