"""How often each mode is unstable, over the contact patterns of a number in contact.

Figure 3 of Oberst et al., INTER-NOISE 2016, p. 5539.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from numpy.typing import NDArray

from hipuq.errors import InputError, SchemaError
from hipuq.plots.captions import level
from hipuq.plots.grouping import check_values, left_out, patterns
from hipuq.plots.style import (
    BLACK,
    BLUE,
    VERMILLION,
    axis_label,
    new_axes,
    new_panels,
    plain,
)

NEEDED = ("probability_min", "probability_mean", "probability_max")
LAST = 8
"""Modes shown by default: the last ones, among which flutter occurs."""


def occurrence(
    results: xr.Dataset,
    count: int,
    *,
    exact: xr.Dataset | None = None,
    ax: Axes | None = None,
    modes: Sequence[int] | None = None,
    names: Mapping[int, str] | None = None,
) -> Axes:
    """Draw minimum, mean and maximum over patterns of the probability that a mode is unstable.

    Parameters
    ----------
    results : Dataset
        Of a stratified analysis of ``unstable`` or an exact one of ``probability_by_mode``:
        ``probability_min``, ``_mean``, ``_max`` over (count, mode), and if there are any the limits
        ``probability_mean_low``, ``_high``. Where all patterns agree, as a single one does, the mean
        stands alone.
    count : int
        Number of oscillators in contact.
    exact : Dataset, optional
        Exact results of the same probabilities, of the same form as `results` and with the same counts and
        modes: drawn beside the sampled ones as bars, without their limits.
    ax : Axes, optional
        Where to draw; a new figure by default.
    modes : sequence of int, optional
        Modes to show; the last eight by default, and the label of the x axis then says which are left
        out. A growing mode takes the upper number of its pair,
        but which pairs coalesce depends on the pattern, so odd and even modes both occur.
    names : mapping, optional
        Mode number -> name that the source gives it, shown beneath.

    Returns
    -------
    Axes
        The one given, or that of the new figure.

    Raises
    ------
    SchemaError
        If the results are not of this kind.
    InputError
        If the count or a mode is not in them, or the exact ones have others.
    """
    chosen = _chosen(results, [count], modes)
    beside = None if exact is None else _exact(exact, results, chosen)
    ax = new_axes(ax)
    _draw(ax, chosen, count, names or {}, _mean_label(results), beside)
    ax.set_title(_title(results, count))
    ax.set_xlabel(_label(results, chosen, names, [count], modes))
    ax.set_ylabel(_probability_label(results))
    # Room for the legend above 100 %, where no data can be.
    ax.set_ylim(-4, 120)
    ax.set_yticks(range(0, 101, 20))
    ax.legend(loc="upper center", ncols=4, fontsize="small")
    return ax


def occurrence_panels(
    results: xr.Dataset,
    *,
    exact: xr.Dataset | None = None,
    figure: FigureBase | None = None,
    counts: Sequence[int] | None = None,
    modes: Sequence[int] | None = None,
    names: Mapping[int, str] | None = None,
) -> NDArray[Any]:
    """Draw `occurrence` for every number in contact, axes shared.

    Parameters
    ----------
    results : Dataset
        As for `occurrence`.
    exact : Dataset, optional
        As for `occurrence`.
    figure : Figure or SubFigure, optional
        Where to draw; a new figure by default.
    counts : sequence of int, optional
        Numbers in contact; all by default.
    modes : sequence of int, optional
        Modes to show, as for `occurrence`.
    names : mapping, optional
        Mode number -> name that the source gives it, as for `occurrence`.

    Returns
    -------
    (rows, 2) array of Axes
        One row and one column for a single count. A place left over is an Axes that is not visible.

    Raises
    ------
    SchemaError, InputError
        As for `occurrence`.
    """
    if counts is None:
        counts = [int(value) for value in _checked(results)["count"].values]
    chosen = _chosen(results, counts, modes)
    beside = None if exact is None else _exact(exact, results, chosen)
    columns = min(2, len(counts))
    rows = -(-len(counts) // columns)
    size = (4.8 * columns, 2.9 * rows + 0.5)
    axes = new_panels(figure, rows, columns, size, sharex=True, sharey=True)
    for i, (ax, count) in enumerate(zip(axes.flat, counts, strict=False)):
        _draw(ax, chosen, count, names or {}, _mean_label(results), beside)
        ax.set_title(f"({chr(ord('a') + i)}) {_title(results, count)}")
    for ax in axes.flat[len(counts) :]:
        ax.set_visible(False)
    parent = axes[0, 0].figure
    parent.supxlabel(_label(results, chosen, names, counts, modes), fontsize="medium")
    parent.supylabel(_probability_label(results), fontsize="medium")
    legend: dict[str, Any] = {}
    for ax in axes.flat[: len(counts)]:
        handles, labels = ax.get_legend_handles_labels()
        legend |= {
            label: handle for handle, label in zip(handles, labels, strict=True) if label not in legend
        }
    parent.legend(legend.values(), legend.keys(), loc="outside upper center", ncols=4, frameon=False)
    return axes


def _checked(results: xr.Dataset) -> xr.Dataset:
    """Return the results if they are summed up by count and mode."""
    for name in NEEDED:
        if name not in results or set(results[name].dims) != {"count", "mode"}:
            raise SchemaError(
                f"the figure needs {name!r} over (count, mode): a stratified analysis of 'unstable', or "
                "an exact one of 'probability_by_mode'"
            )
    return results


def _exact(exact: xr.Dataset, results: xr.Dataset, chosen: xr.Dataset) -> xr.Dataset:
    """Return the exact results of the modes to draw, once they are known to be of the same kind."""
    exact = _checked(exact)
    for what in ("count", "mode"):
        here, there = (sorted(data[what].values.tolist()) for data in (results, exact))
        if here != there:
            raise InputError(f"{what} of the exact results is {there}: it must be {here}, as of the sampled")
    return exact.sel(mode=chosen["mode"].values)


def _chosen(results: xr.Dataset, counts: Sequence[int], modes: Sequence[int] | None) -> xr.Dataset:
    """Return the results of the modes to draw, once counts and modes are known to be there."""
    results = _checked(results)
    here = results["mode"].values.tolist()
    check_values("count", counts, results["count"].values.tolist())
    return results.sel(mode=check_values("mode", here[-LAST:] if modes is None else modes, here))


def _draw(
    ax: Axes,
    chosen: xr.Dataset,
    count: int,
    names: Mapping[int, str],
    mean_label: str,
    exact: xr.Dataset | None,
) -> None:
    """Draw one panel on places 0, 1, ... without its labels."""
    part = {key: 100 * chosen[key].sel(count=count).values for key in NEEDED}
    low, mean, high = part.values()
    place = np.arange(len(mean))
    spread = high > low
    if spread.any():
        ax.vlines(place[spread], low[spread], high[spread], color=BLACK, linewidth=0.8)
        style: dict[str, Any] = {"linestyle": "none", "markersize": 7}
        ax.plot(place[spread], high[spread], "^", color=VERMILLION, label="maximum", **style)
        ax.plot(place[spread], low[spread], "v", color=BLUE, label="minimum", **style)
    error = None
    if "probability_mean_low" in chosen and "probability_mean_high" in chosen:
        limits = [100 * chosen[f"probability_mean_{end}"].sel(count=count).values for end in ("low", "high")]
        reach = np.clip([mean - limits[0], limits[1] - mean], 0.0, None)
        # Exact means have limits too, which are themselves unless something is unknown.
        error = reach if (reach != 0).any() else None
    ax.errorbar(
        place,
        mean,
        error,
        fmt="o",
        color=BLACK,
        markerfacecolor="white",
        markersize=5,
        capsize=3,
        elinewidth=2,
        label=mean_label if error is not None else "mean",
    )
    if exact is not None:
        _draw_exact(ax, exact.sel(count=count))
    unknown = np.isnan(mean)
    for x in place[unknown]:
        ax.annotate("?", (x, 0.02), xycoords=("data", "axes fraction"), ha="center", va="bottom")
    ax.set_xticks(place, [mode_tick(chosen, i, names) for i in range(len(place))])
    ax.tick_params(axis="x", labelsize="small")
    ax.set_xlim(-0.6, len(place) - 0.4)
    ax.set_ylim(-4, 104)
    ax.grid(axis="y", linewidth=0.4, alpha=0.5)


def _draw_exact(ax: Axes, part: xr.Dataset) -> None:
    """Draw exact minimum, mean and maximum as bars, wider than the markers that they lie on."""
    values = np.concatenate([100 * part[key].values for key in NEEDED])
    place = np.tile(np.arange(part.sizes["mode"]), len(NEEDED))
    bar: dict[str, Any] = {"marker": "_", "markersize": 17, "markeredgewidth": 1.1, "color": BLACK}
    ax.plot(place, values, linestyle="none", zorder=3, label="exact", **bar)


def mode_tick(chosen: xr.Dataset | xr.DataArray, place: int, names: Mapping[int, str]) -> str:
    """Return the tick label of a mode: its pair, or its number, and the name in the source.

    Parameters
    ----------
    chosen : Dataset or DataArray
        With the coord ``mode`` and perhaps ``pair``.
    place : int
        Place of the mode in it.
    names : mapping
        Mode number -> name.

    Returns
    -------
    str
    """
    mode = int(chosen["mode"].values[place])
    label = str(chosen["pair"].values[place]) if "pair" in chosen.coords else str(mode)
    return f"{label}\n({plain(names[mode])})" if mode in names else label


def mode_label(chosen: xr.Dataset | xr.DataArray, names: Mapping[int, str] | None) -> str:
    """Return the label of an axis of modes, see `mode_tick`."""
    label = (
        "pair of modes, by ascending frequency" if "pair" in chosen.coords else "mode, by ascending frequency"
    )
    return f"{label} (name in the paper)" if names else label


def _label(
    results: xr.Dataset,
    chosen: xr.Dataset,
    names: Mapping[int, str] | None,
    counts: Sequence[int],
    modes: Sequence[int] | None,
) -> str:
    """Return the label of the x axis; of modes that were not asked for it says which are left out."""
    label = mode_label(chosen, names)
    if modes is not None:
        return label
    most = results["probability_max"].transpose("mode", "count").sel(count=list(counts)).values
    gone = left_out(results["mode"].values, ~(most == 0).all(axis=1), chosen["mode"].values)
    return "\n".join(filter(None, [label, gone]))


def _probability_label(results: xr.Dataset) -> str:
    source = results["probability"] if "probability" in results else results["probability_mean"]
    return axis_label(source, "%")


def _mean_label(results: xr.Dataset) -> str:
    """Return the legend of a mean with limits: what they are, where that is known."""
    return f"mean, {level(results)}" if "confidence" in results.attrs else "mean"


def _title(results: xr.Dataset, count: int) -> str:
    title = f"{count} in contact"
    if "in_contact" in results.coords:
        title += f", {patterns(int((results['in_contact'].values == count).sum()))}"
    return title
