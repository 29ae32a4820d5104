"""Figures of the first part of a report, each by the block that it stands in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import xarray as xr

from hipuq import plots
from hipuq.report import chance, method_figures
from hipuq.report.bench import published
from hipuq.report.damping import at_damping
from hipuq.report.drivers import driving
from hipuq.report.friction import curve, group
from hipuq.report.over_damping import besides
from hipuq.report.partners import exact_of, summed_up
from hipuq.report.parts import BY_MODE, counted, frequencies, moded
from hipuq.report.picture import Picture, figure_of
from hipuq.report.reading import DAMPING, Reading

PATTERNS = 2
"""Contact patterns from which on a map of them says something."""


def first_pictures(reading: Reading) -> Iterator[Picture]:
    """Give the figures of the first part, as far as there are the data.

    Parameters
    ----------
    reading : Reading

    Yields
    ------
    Picture
    """
    yield from _damping(reading)
    yield from _counts(reading)
    yield from _modes(reading)
    yield from _friction(reading)
    if (found := driving(reading)) is not None:
        analysis, of, results = found
        if (picture := method_figures.drawn(analysis, of, results, "indices")) is not None:
            yield replace(picture, block="drivers")
    if reading.results is not None and reading.analysis is not None:
        of = str(reading.results.attrs["of"])
        if (picture := method_figures.settling(reading.analysis, of, reading.results)) is not None:
            yield replace(picture, block="trust")


def _damping(reading: Reading) -> Iterator[Picture]:
    """Give the probability over the damping ratio, of all analyses that are swept over it."""
    curves = reading.swept_over(DAMPING)
    if not curves:
        return
    incidence = published(reading, "incidence")
    ax = plots.probability_over(curves, literature=incidence)
    caption = "P(squeak) over the modal damping ratio, with its interval."
    if beside := besides(reading):
        caption += f" {beside}."
    if incidence is not None:
        caption += (
            " Band: the incidence of squeak reported in patients. It is another quantity, so that the two "
            "need not "
            "meet."
        )
    yield Picture(next(iter(curves)), "probability_over_damping", caption, figure_of(ax), "damping")


def _counts(reading: Reading) -> Iterator[Picture]:
    """Give the probability by number in contact, over the patterns of each, and pattern by pattern."""
    found = counted(reading)
    if found is not None:
        analysis, results = found
        other = exact_of(results, reading.found)
        exact = None if other is None else reading.found[other]["probability"]
        caption = "P(squeak) for each number in contact: mean and range over its contact patterns."
        if exact is not None:
            caption += f" Bars: the same without sampling ({other})."
        else:
            caption += chance.caption(chance.tested(results))
        figure = figure_of(plots.by_count(results, exact=exact))
        yield Picture(analysis, "by_count", caption, figure, "count")
        if results.sizes.get("pattern", 0) >= PATTERNS and "contact" in results.coords:
            yield _map(reading, analysis, results, other)
    for analysis in reading.ranked:
        results_of = (reading.found[analysis].get(of) for of in BY_MODE)
        by_pattern = next((one for one in results_of if one is not None and _by_pattern(one)), None)
        if by_pattern is not None:
            other = exact_of(by_pattern, reading.found) if summed_up(by_pattern, {"count", "mode"}) else None
            if other is not None and _by_pattern(one := reading.found[other][BY_MODE[1]]):
                analysis, by_pattern = other, one
            names = {int(mode): name for mode, name in reading.mode_names.items()}
            caption = (
                f"P of each mode over the contact patterns ({analysis}): box from the first to the third "
                "quartile, with the median; whiskers to the least and the greatest."
            ) + chance.caption(chance.tested(by_pattern))
            figure = figure_of(plots.boxplots(by_pattern, names=names or None))
            yield Picture(analysis, "boxplots", caption, figure, "count")
            return


def _map(reading: Reading, analysis: str, results: xr.Dataset, exact: str | None) -> Picture:
    """Return the map of the patterns, from exact results of the same where there are some."""
    caption = "Each column is a contact pattern: its oscillators in contact, by its P(squeak)"
    if exact is not None and "contact" in (one := reading.found[exact]["probability"]).coords:
        caption += f", without sampling ({exact})."
        return Picture(exact, "pattern_map", caption, figure_of(plots.pattern_map(one)), "count")
    caption += f" ({analysis}).{chance.caption(chance.tested(results))}"
    return Picture(analysis, "pattern_map", caption, figure_of(plots.pattern_map(results)), "count")


def _by_pattern(results: xr.Dataset) -> bool:
    """Say whether there are probabilities by contact pattern and mode, of several patterns."""
    return (
        "probability" in results
        and set(results["probability"].dims) == {"pattern", "mode"}
        and "in_contact" in results.coords
        and results.sizes["pattern"] >= PATTERNS
    )


def _modes(reading: Reading) -> Iterator[Picture]:
    """Give the frequencies at which modes are unstable, beside those of squeak."""
    found, with_modes = frequencies(reading), moded(reading)
    if found is None or not np.isfinite(found[1]["frequency_median"].values).any():
        return
    analysis, ranges = found
    results = None
    if with_modes is not None and set(ranges["mode"].values) <= set(with_modes[1]["mode"].values):
        results = with_modes[1]
    measured = published(reading, "squeak_frequency")
    ax = plots.mode_frequencies(ranges, results, measured=measured)
    caption = "Modes at the frequencies at which they are unstable, and how probable that is."
    if measured is not None:
        caption += " Bands: the frequencies of squeak measured on the bench."
    yield Picture(analysis, "mode_frequencies", caption, figure_of(ax), "mode")


def _friction(reading: Reading) -> Iterator[Picture]:
    """Give the fragility curve and the distribution of onsets."""
    critical = published(reading, "critical_friction")
    found = curve(reading)
    if found is not None and found[1].sizes["friction"] > 1:
        analysis, fragility = found
        where = f", {words}" if (words := at_damping(fragility)) else ""
        caption = f"Fragility curve: P(squeak) at each friction coefficient ({analysis}{where})."
        if critical is not None:
            caption += " Marks: the friction at which squeak set in on the bench."
        figure = figure_of(plots.fragility(fragility, critical=critical))
        yield Picture(analysis, "fragility", caption, figure, "fragility")
    onsets = group(reading, "onsets")
    if onsets is not None:
        analysis, own = onsets
        limits = reading.found[analysis].get("friction_limit")
        caption = f"Share of the configurations with an onset up to a friction coefficient ({analysis})."
        if limits is not None:
            caption += " Points: the friction limits of the targets."
        yield Picture(
            analysis, "onsets", caption, figure_of(plots.onset_distribution(own, limits=limits)), "fragility"
        )
