"""Which figures a results tree has the data for."""

from __future__ import annotations

from collections.abc import Iterator

import xarray as xr
from matplotlib.figure import Figure

from hipuq import plots
from hipuq.report.damping import at_damping
from hipuq.report.method_figures import by_method, compared
from hipuq.report.partners import exact_of, summed_up
from hipuq.report.picture import Picture, figure_of
from hipuq.report.reading import DAMPING, Reading
from hipuq.report.squeak_figures import first_pictures
from hipuq.report.summary import COMPARE, comparisons
from hipuq.schema import is_exact

BY_MODE = {"count", "mode"}
"""Dims of what is summed up by number in contact and mode."""


NUMBERED = (
    "Modes are followed through the sweep and keep their number at its start; elsewhere mode n is the n-th "
    "by frequency of each sample."
)
"""How modes are named in figures of a sweep over friction."""


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
    reading = Reading(tree)
    drawn = set()
    for picture in first_pictures(reading):
        drawn.add((picture.analysis, picture.name))
        yield picture
    found = reading.found
    exact = {
        name: exact_of(groups["unstable"], found)
        for name, groups in found.items()
        if summed_up(groups.get("unstable"), BY_MODE)
    }
    for analysis, groups in found.items():
        yield from _swept(reading, analysis)
        yield from _by_mode(reading, analysis, exact)
        if "mode_shapes" in groups and reading.alike(analysis, "mode_shapes") is None:
            yield _mode_shapes(analysis, groups["mode_shapes"], reading)
        if "friction_sweep" in groups and reading.alike(analysis, "friction_sweep") is None:
            yield from _sweep(analysis, groups["friction_sweep"], reading.report.get("pairs", []))
        for of, results in groups.items():
            yield from by_method(analysis, of, results, [name for own, name in drawn if own == analysis])
    for problem, race in comparisons(tree):
        yield from compared(f"{COMPARE}/{problem}", race)


def _swept(reading: Reading, analysis: str) -> Iterator[Picture]:
    """Give the probability over one or two swept parameters; that over damping is in the first part."""
    results = reading.squeak(analysis)
    parameters = list(reading.assumed[analysis])
    if results is None or parameters == [DAMPING] or len(parameters) not in (1, 2):
        return
    whole = reading.whole[analysis][str(results.attrs["of"])]
    said = " and ".join(name.replace("_", " ") for name in parameters)
    if len(parameters) == 1:
        name, ax = "probability_over", plots.probability_over(whole)
    else:
        name, ax = "stability_map", plots.stability_map(whole, *parameters)
    yield Picture(analysis, name, f"Probability of instability over {said}.", figure_of(ax))


def _by_mode(reading: Reading, analysis: str, exact: dict[str, str | None]) -> Iterator[Picture]:
    """Give how often each mode is unstable; exact results stand beside sampled ones where there are both."""
    groups = reading.found[analysis]
    names = {int(mode): name for mode, name in reading.mode_names.items()}
    if analysis in exact:
        other = exact[analysis]
        beside = None if other is None else reading.found[other]["probability_by_mode"]
        yield _occurrence(analysis, groups["unstable"], names, other, beside)
    elif summed_up(results := groups.get("probability_by_mode"), BY_MODE) and analysis not in exact.values():
        yield _occurrence(analysis, results, names)


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


def _mode_shapes(analysis: str, shapes: xr.Dataset, reading: Reading) -> Picture:
    modes, names = reading.report["mode_shapes"], reading.mode_names
    figure = Figure(figsize=(6 * len(modes), 4.2), layout="constrained")
    for mode, ax in zip(modes, figure.subplots(1, len(modes), squeeze=False)[0], strict=True):
        plots.mode_shape(shapes, mode, ax=ax)
    called = [f"mode {mode} is published as mode {names[str(mode)]}" for mode in modes if str(mode) in names]
    friction = reading.report["shape_friction"]
    where = f", {words}" if (words := at_damping(shapes)) else ""
    caption = f"Mode shapes over the undeformed ring, all oscillators in contact, friction {friction}{where}."
    return Picture(
        analysis, "mode_shapes", caption + (f" Here {'; '.join(called)}." if called else ""), figure
    )


def _sweep(analysis: str, sweep: xr.Dataset, chosen: list[list[int]]) -> Iterator[Picture]:
    where = f", {words}" if (words := at_damping(sweep)) else ""
    at = f"at nominal values{where} over the friction coefficient"
    pairs = [(int(a), int(b)) for a, b in chosen]
    if pairs:
        figure = Figure(figsize=(5.5 * len(pairs), 7), layout="constrained")
        plots.lock_in(sweep, pairs, figure=figure)
        yield Picture(
            analysis,
            "lock_in",
            f"Mode coupling: frequency and growth rate {at}, with the lock-in. {NUMBERED}",
            figure,
        )
    figure = Figure(figsize=(10, 10), layout="constrained")
    plots.dispersion(sweep, axes=figure.subplots(3, 1, sharex=True))
    yield Picture(
        analysis,
        "dispersion",
        f"Dispersion diagram: imaginary and real part of all eigenvalues {at}. {NUMBERED}",
        figure,
    )
    figure = Figure(figsize=(8, 6), layout="constrained")
    plots.root_locus(sweep, ax=figure.subplots())
    yield Picture(
        analysis, "root_locus", f"Root locus: growth rate against frequency {at}. {NUMBERED}", figure
    )
    figure = Figure(figsize=(8, 6), layout="constrained")
    plots.damping_over_frequency(sweep, ax=figure.subplots())
    yield Picture(
        analysis,
        "damping_ratio",
        f"Damping ratio of each mode against its frequency at nominal values{where}, at the largest friction "
        f"of the sweep; a negative one belongs to a growing mode. {NUMBERED}",
        figure,
    )
