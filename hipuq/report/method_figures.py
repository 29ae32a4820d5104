"""Figures of what methods give: indices, a surrogate against the model, convergence, comparisons."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hipuq import plots
from hipuq.report.compared import baseline_of
from hipuq.report.picture import Picture, figure_of

SETTLING = ("probability_overall", "probability", "mean_overall", "mean", "S1", "ST")
"""Estimates whose convergence is shown."""

CONVERGENCE = "convergence"

DRAWN: dict[str, tuple[tuple[str, ...], tuple[str, ...], Callable[[xr.Dataset], Axes], str]] = {
    "indices": (
        ("S1", "ST"),
        ("parameter",),
        plots.index_bars,
        "Sobol indices: the share of the variance that each parameter explains alone (first order) and "
        "with its interactions (total order).",
    ),
    "second_order": (
        ("S2",),
        ("parameter", "parameter_2"),
        plots.second_order,
        "Second-order Sobol indices: the share of the variance that the interaction of each pair explains.",
    ),
    "surrogate": (
        ("true", "predicted"),
        ("held_out",),
        plots.predicted_against_true,
        "The surrogate against the model, on samples that it was not fitted to.",
    ),
}
"""Name of a figure -> the variables that it needs, their dims, what draws it, its caption."""


def by_method(analysis: str, of: str, results: xr.Dataset, but: Container[str] = ()) -> Iterator[Picture]:
    """Give indices, surrogate against model and convergence of a scalar outcome, as far as there are any.

    Parameters
    ----------
    analysis, of : str
        For the names of the files.
    results : Dataset
        Results of any method, not over swept parameters.
    but : container of str
        Names of the figures that are not wanted.
    """
    for name in (*DRAWN, CONVERGENCE):
        if f"{name}_{of}" not in but:
            found = (
                settling(analysis, of, results) if name == CONVERGENCE else drawn(analysis, of, results, name)
            )
            if found is not None:
                yield found


def drawn(analysis: str, of: str, results: xr.Dataset, name: str) -> Picture | None:
    """Return the figure of `DRAWN` with this name; None where the results have not what it needs."""
    needed, over, draw, caption = DRAWN[name]
    # Pairs take two parameters.
    enough = all(results.sizes.get(dim, 0) >= len(over) for dim in over)
    if not enough or not all(key in results and set(results[key].dims) == set(over) for key in needed):
        return None
    return Picture(analysis, f"{name}_{of}", caption, figure_of(draw(results)))


def settling(analysis: str, of: str, results: xr.Dataset) -> Picture | None:
    """Return the figure of convergence; None where there are no estimates by budget."""
    dims = {str(name): set(values.dims) for name, values in results.data_vars.items()}
    shown = [
        name for name in SETTLING if dims.get(f"{name}_by_budget") in ({"budget"}, {"budget", "parameter"})
    ]
    if not shown:
        return None
    figure = Figure(figsize=(6.4 * len(shown), 4.4), layout="constrained")
    for quantity, ax in zip(shown, figure.subplots(1, len(shown), squeeze=False)[0], strict=True):
        plots.convergence(results, ax=ax, quantity=quantity)
    caption = "Convergence: the estimate from the first evaluations alone, over their number."
    return Picture(analysis, f"{CONVERGENCE}_{of}", caption, figure)


def compared(group: str, race: xr.Dataset) -> Iterator[Picture]:
    """Give error over cost, coverage and the cost of accuracy, as far as there are any.

    Parameters
    ----------
    group : str
        ``compare/<problem>``.
    race : Dataset
        As from `hipuq.compare`.
    """
    if np.isfinite(race["rmse"]).any():
        figure = Figure(figsize=(12, 5.2), layout="constrained")
        for cost, ax in zip(("evaluations", "seconds"), figure.subplots(1, 2), strict=True):
            plots.error_over_cost(race, ax=ax, cost=cost)
        caption = "Error of each contender over its evaluations and over the time of a run."
        yield Picture(group, "error", caption, figure)
    if np.isfinite(race["coverage"]).any():
        figure = Figure(figsize=(8, 5), layout="constrained")
        plots.coverage(race, ax=figure.subplots())
        caption = "Share of the intervals that hold the reference, over evaluations."
        yield Picture(group, "coverage", caption, figure)
    others = race["method"] != baseline_of(race)
    if np.isfinite(race["cost_ratio"].where(others)).any():
        figure = Figure(figsize=(8, 5), layout="constrained")
        plots.cost_of_accuracy(race, ax=figure.subplots())
        caption = (
            "What accuracy costs: the time of each contender over that which the baseline, "
            f"{baseline_of(race)!r}, takes for the same error."
        )
        yield Picture(group, "cost", caption, figure)
