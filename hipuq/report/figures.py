"""Which figures a results tree has the data for."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hipuq import plots
from hipuq.report.compared import baseline_of
from hipuq.report.partners import exact_of, groups_of, summed_up
from hipuq.report.summary import COMPARE, comparisons
from hipuq.schema import is_exact

SETTLING = ("probability_overall", "probability", "mean_overall", "mean", "S1", "ST")
"""Estimates whose convergence is shown."""

DRAWN: dict[tuple[str, tuple[str, ...], tuple[str, ...]], tuple[Callable[[xr.Dataset], Axes], str]] = {
    ("indices", ("S1", "ST"), ("parameter",)): (
        plots.index_bars,
        "Sobol indices: the share of the variance that each parameter explains alone (first order) and "
        "with its interactions (total order).",
    ),
    ("second_order", ("S2",), ("parameter", "parameter_2")): (
        plots.second_order,
        "Second-order Sobol indices: the share of the variance that the interaction of each pair explains.",
    ),
    ("surrogate", ("true", "predicted"), ("held_out",)): (
        plots.predicted_against_true,
        "The surrogate against the model, on samples that it was not fitted to.",
    ),
}
"""Name of a figure, the variables that it needs and their dims -> what draws it, its caption."""


@dataclass(frozen=True)
class Picture:
    """A figure of a report.

    Attributes
    ----------
    analysis : str
        The analysis that it belongs to, or ``compare/<problem>``.
    name : str
        Name of its file.
    caption : str
        What it shows, in a sentence or two.
    figure : Figure
    """

    analysis: str
    name: str
    caption: str
    figure: Figure


def pictures(tree: xr.DataTree) -> Iterator[Picture]:
    """Give the figures of a results tree, one after the other.

    Parameters
    ----------
    tree : DataTree
        As from `hipuq.load_results`.

    Yields
    ------
    Picture
    """
    options = json.loads(tree.attrs.get("report", "{}"))
    names = {int(mode): name for mode, name in options.get("mode_names", {}).items()}
    found = groups_of(tree)
    by_mode = {"count", "mode"}
    sampled = {
        name: groups["unstable"]
        for name, groups in found.items()
        if summed_up(groups.get("unstable"), by_mode)
    }
    exact = {name: exact_of(results, found) for name, results in sampled.items()}
    for analysis, groups in found.items():
        if analysis in sampled:
            other = exact[analysis]
            beside = None if other is None else found[other]["probability_by_mode"]
            yield _occurrence(analysis, sampled[analysis], names, other, beside)
        elif summed_up(groups.get("probability_by_mode"), by_mode) and analysis not in exact.values():
            yield _occurrence(analysis, groups["probability_by_mode"], names)
        if "mode_shapes" in groups:
            yield _mode_shapes(analysis, groups["mode_shapes"], options, names)
        if "friction_sweep" in groups:
            yield from _sweep(analysis, groups["friction_sweep"], options)
        for of, results in groups.items():
            yield from _by_method(analysis, of, results)
    for problem, race in comparisons(tree):
        yield from _comparison(f"{COMPARE}/{problem}", race)


def _occurrence(
    analysis: str,
    results: xr.Dataset,
    names: dict[int, str],
    exact_analysis: str | None = None,
    exact: xr.Dataset | None = None,
) -> Picture:
    figure = Figure(figsize=(10, 7), layout="constrained")
    plots.occurrence_panels(results, exact=exact, figure=figure, names=names or None)
    caption = (
        "Frequency of occurrence of instability by mode: minimum, mean and maximum over the contact "
        "patterns of each number in contact."
    )
    if not is_exact(results):
        caption += (
            " Samples without a known verdict are left out here and counted in the limits of the table."
        )
    if exact is not None:
        caption += (
            f" Bars: the same three without sampling, from the analysis {exact_analysis!r}, which "
            "integrates friction exactly."
        )
    return Picture(analysis, "occurrence", caption, figure)


def _mode_shapes(
    analysis: str, shapes: xr.Dataset, options: dict[str, list[int]], names: dict[int, str]
) -> Picture:
    modes = options["mode_shapes"]
    figure = Figure(figsize=(6 * len(modes), 4.2), layout="constrained")
    for mode, ax in zip(modes, figure.subplots(1, len(modes), squeeze=False)[0], strict=True):
        plots.mode_shape(shapes, mode, ax=ax)
    called = [f"mode {mode} is published as mode {names[mode]}" for mode in modes if mode in names]
    friction = options["shape_friction"]
    caption = f"Mode shapes over the undeformed ring, all oscillators in contact, friction {friction}."
    return Picture(
        analysis, "mode_shapes", caption + (f" Here {'; '.join(called)}." if called else ""), figure
    )


def _sweep(analysis: str, sweep: xr.Dataset, options: dict[str, list[tuple[int, int]]]) -> Iterator[Picture]:
    at = "at nominal values over the friction coefficient"
    pairs = [(int(a), int(b)) for a, b in options["pairs"]]
    if pairs:
        figure = Figure(figsize=(5.5 * len(pairs), 7), layout="constrained")
        plots.lock_in(sweep, pairs, figure=figure)
        yield Picture(
            analysis, "lock_in", f"Mode coupling: frequency and growth rate {at}, with the lock-in.", figure
        )
    figure = Figure(figsize=(10, 10), layout="constrained")
    plots.dispersion(sweep, axes=figure.subplots(3, 1, sharex=True))
    yield Picture(
        analysis,
        "dispersion",
        f"Dispersion diagram: imaginary and real part of all eigenvalues {at}.",
        figure,
    )
    figure = Figure(figsize=(8, 6), layout="constrained")
    plots.root_locus(sweep, ax=figure.subplots())
    yield Picture(analysis, "root_locus", f"Root locus: growth rate against frequency {at}.", figure)
    figure = Figure(figsize=(8, 6), layout="constrained")
    plots.damping_over_frequency(sweep, ax=figure.subplots())
    yield Picture(
        analysis,
        "damping_ratio",
        "Damping ratio of each mode against its frequency at the largest friction of the sweep; a "
        "negative one belongs to a growing mode.",
        figure,
    )


def _by_method(analysis: str, of: str, results: xr.Dataset) -> Iterator[Picture]:
    """Give indices, surrogate against model and convergence of a scalar outcome, as far as there are any."""
    dims = {str(name): set(values.dims) for name, values in results.data_vars.items()}
    for (name, needed, over), (draw, caption) in DRAWN.items():
        # Pairs take two parameters.
        enough = all(results.sizes.get(dim, 0) >= len(over) for dim in over)
        if enough and all(dims.get(key) == set(over) for key in needed):
            figure = draw(results).figure
            assert isinstance(figure, Figure)
            yield Picture(analysis, f"{name}_{of}", caption, figure)
    settling = [
        name for name in SETTLING if dims.get(f"{name}_by_budget") in ({"budget"}, {"budget", "parameter"})
    ]
    if settling:
        figure = Figure(figsize=(6.4 * len(settling), 4.4), layout="constrained")
        for quantity, ax in zip(settling, figure.subplots(1, len(settling), squeeze=False)[0], strict=True):
            plots.convergence(results, ax=ax, quantity=quantity)
        caption = "Convergence: the estimate from the first evaluations alone, over their number."
        yield Picture(analysis, f"convergence_{of}", caption, figure)


def _comparison(group: str, race: xr.Dataset) -> Iterator[Picture]:
    """Give error over cost, coverage and the cost of accuracy, as far as there are any."""
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
