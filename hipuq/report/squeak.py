"""The headline of a report: the probability of squeak, its interval, its method, what it assumes."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.friction import OF_ANY_MODE
from hipuq.methods import METHODS
from hipuq.report.block import Block
from hipuq.report.damping import NONE, at_damping, damping_words, label, percent_of
from hipuq.report.reading import DAMPING, Reading, model_options, nominal_of, probability_name
from hipuq.report.regimes import rests_on
from hipuq.report.summary import integrated
from hipuq.report.table import fitting, number, share

SAMPLERS = {"latin_hypercube": "latin hypercube", "sobol": "Sobol points"}
"""Samplers of Monte Carlo that are not plain random ones, in words."""

SMALLEST = 1e-8
"""Probabilities below it are told with an exponent."""

SMALL = 0.001
"""Exact probabilities below it are told with more decimals."""

BY_SAMPLING = "The interval is of sampling alone: what the inputs and the model leave open is not in it"

ANALYSIS = "It is the analysis"

MEANS = ("mean_corrected_overall", "mean_corrected", "mean_overall", "mean")
"""Means of a verdict, or of a probability, the most telling first."""


def lead(results: xr.Dataset) -> str:
    """Return the probability of squeak in one line.

    Parameters
    ----------
    results : Dataset
        With one probability of any unstable mode.

    Returns
    -------
    str
        Such as ``"P(squeak) = 0.790 (0.781 to 0.799, 95 % interval) at 1 % modal damping; Monte Carlo,
        8,320 evaluations"``. Where nothing or everything is unstable it says of how many, and the limit.
    """
    where = f" {words}" if (words := at_damping(results)) else ""
    return f"P(squeak) {chance(results)}{where}; {method_words(results)}"


def chance(results: xr.Dataset) -> str:
    """Return a probability with its limits after the sign of equality, such as ``"= 0.5 (0.4 to 0.6)"``."""
    name = probability_name(results)
    value, low, high = (float(results[name + end]) for end in ("", "_low", "_high"))
    exact = schema.is_exact(results)
    level = "" if exact else f", {100 * float(results.attrs['confidence']):g} % interval"
    if np.isnan(value):
        return f"is not known: no evaluation has a verdict (it lies between {low:g} and {high:g})"
    known = _known(results)
    if exact:
        # Limits apart from the value by rounding alone say nothing.
        bounds = f" (bounds {_exact(low)} to {_exact(high)})" if high - low > 1e-12 else ""
        return f"= {_exact(value)}{bounds}"
    if value == 0:
        return f"= 0: none of {known} is unstable; at most {_small(high)}{level}"
    if value == 1:
        return f"= 1: all of {known} are unstable; at least {fitting(low, low, high).split(' (')[0]}{level}"
    text = fitting(value, low, high)
    if value < SMALLEST:
        text = f"{value:.2g} ({low:.2g} to {high:.2g})"
    return f"= {text.removesuffix(')')}{level})" if text.endswith(")") else f"= {text}"


def _exact(value: float) -> str:
    """Return an exact probability: four decimals here, more of small ones; tables have all digits."""
    return share(value, 4) if value == 0 or value >= SMALL else number(value, 3)


def _small(value: float) -> str:
    """Return a small probability with two digits."""
    return number(value, 2) if value < 1e-4 else f"{float(f'{value:.2g}')}"


def _known(results: xr.Dataset) -> str:
    """Return how many evaluations have a verdict, in words."""
    count = int(results["known"].sum()) if "known" in results else int(results["evaluations"])
    return f"{count:,} configurations" if integrated(results) else f"{count:,} evaluations"


def method_words(results: xr.Dataset) -> str:
    """Return how results were made: method, what is integrated or stratified, evaluations."""
    count = f"{int(results['evaluations']):,} evaluations"
    if schema.is_exact(results):
        how = "friction integrated, " if integrated(results) else ""
        return f"exact: {how}every level of the inputs once, {count}"
    method = str(results.attrs["method"])
    design = json.loads(results.attrs.get("options") or "{}").get("design", {})
    words = [METHODS[method].title if method in METHODS else method]
    if method == "chaos":
        words[0] += " corrected by true evaluations"
    if design.get("sampler") in SAMPLERS:
        words.append(SAMPLERS[design["sampler"]])
    if design.get("stratify"):
        words.append(f"stratified by {str(design['stratify']).replace('_', ' ')}")
    if integrated(results):
        words.append("friction integrated")
    return ", ".join([*words, count])


def meaning(results: xr.Dataset) -> str:
    """Return in a sentence what the probability is of."""
    return (
        f"This is the probability that the model {results.attrs['model']} has {_event(results)} under the "
        "inputs below; it is a property of the model, not the share of patients whose hip squeaks"
    )


TITLE = "Probability of squeak"


def short_meaning(results: xr.Dataset) -> str:
    """Return what `meaning` says, where there is little room."""
    model = str(results.attrs["model"]).removesuffix(", friction integrated")
    return f"Of {_event(results)} in {model}, not the share of patients whose hip squeaks"


def _event(results: xr.Dataset) -> str:
    threshold = float(model_options(results).get("growth_threshold") or 0.0)
    return f"a mode that grows faster than {threshold:g} 1/s" if threshold else "an unstable mode"


def headline(reading: Reading) -> Block:
    """Return the lead of the report: the probability, what it is of, what it assumes.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
        Its first line is the lead. Without a probability of any unstable mode it says what would give one.
    """
    results = reading.results
    if results is None or reading.analysis is None:
        none = (
            "No analysis gives a probability of any unstable mode: one of any_unstable, or of probability "
            "with friction integrated, by Monte Carlo or polynomial chaos would"
        )
        lines = mean_of_verdict(reading) or along(reading) or [none]
        return Block("squeak", TITLE, lines, brief=list(lines))
    long, short = rests_on(reading)
    told = assumptions(reading)
    lines = [meaning(results), told[0], *([long] if long else []), *told[1:]]
    where = f" {words}" if (words := at_damping(results)) else ""
    alone = "" if schema.is_exact(results) else "; the interval is of sampling alone"
    brief = [f"P(squeak) {chance(results)}{where}", short_meaning(results), *([short] if short else [])]
    brief.append(f"Analysis {reading.analysis!r}: {method_words(results)}{alone}")
    # Only where it is not the one that was asked for it takes a reason.
    kept = (line for line in told if line != BY_SAMPLING)
    brief += [line for line in kept if not line.startswith(ANALYSIS) or ", since " in line]
    return Block("squeak", TITLE, [lead(results), *lines], brief=brief)


def along(reading: Reading) -> list[str]:
    """Return between which values P(squeak) lies in an analysis over more than damping; nothing without one.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    list of str
    """
    for name in reading.found:
        one, parameter = reading.squeak(name), reading.at_one(name)
        if one is None or not parameter:
            continue
        whole = reading.whole[name][str(one.attrs["of"])]
        values = whole[probability_name(one)].values
        if not np.isfinite(values).any():
            continue
        low, high = share(float(np.nanmin(values)), 3), share(float(np.nanmax(values)), 3)
        called = " and ".join(key.replace("_", " ") for key in reading.assumed[name])
        fixed = parameter.replace("_", " ")
        return [
            f"P(squeak) is {low} to {high} over the {called} of the analysis {name!r}",
            f"Without a distribution of {fixed} there is no one probability: an analysis with it has one",
        ]
    return []


def mean_of_verdict(reading: Reading) -> list[str]:
    """Return the mean of the verdict of an analysis without a probability, such as of Sobol indices.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    list of str
        The mean with its interval, if it has one, and what would give one; nothing without a mean.
    """
    for name, groups in reading.found.items():
        for of in OF_ANY_MODE:
            results = groups.get(of)
            if results is None or reading.at_one(name):
                continue
            key = next((key for key in MEANS if key in results and not results[key].ndim), "")
            if not key or not np.isfinite(float(results[key])):
                continue
            value, ends = float(results[key]), [f"{key}_{end}" for end in ("low", "high")]
            limited = all(end in results and np.isfinite(float(results[end])) for end in ends)
            text = fitting(value, *(float(results[end]) for end in ends)) if limited else share(value, 3)
            where = f" {words}" if (words := at_damping(results)) else ""
            method = str(results.attrs["method"])
            called = METHODS[method].title if method in METHODS else method
            line = (
                f"P(squeak) = {text}{where}, the mean of {of} over the samples of the analysis {name!r}; "
                f"{called}, {int(results['evaluations']):,} evaluations"
            )
            if limited:
                return [line]
            return [
                line,
                "It has no interval: an analysis of any_unstable by Monte Carlo would give one with it",
            ]
    return []


def assumptions(reading: Reading) -> list[str]:
    """Return in sentences which analysis the headline is, at which values, and why."""
    name, results = reading.analysis, reading.results
    assert name is not None and results is not None
    asked = reading.report.get("headline")
    why = "as the study asks" if asked == name else "the first with such a probability"
    if asked and asked != name:
        why = f"since {asked!r}, which the study asks for, gives no such probability"
    lines = [] if schema.is_exact(results) else [BY_SAMPLING]
    lines.append(f"{ANALYSIS} {name!r}, {why}: {label(results)}")
    for parameter, at in reading.assumed[name].items():
        value = percent_of(at.value) if parameter == DAMPING else f"{at.value:g}"
        called = parameter.replace("_", " ")
        lines.append(f"The {called} of {value} is an assumption, {at.why}; others are below")
    words = damping_words(results)
    if words and DAMPING not in reading.assumed[name]:
        given = "No damping is" if words == NONE else f"The damping ({words}) is"
        if reading.swept_over(DAMPING):
            more = "; what damping does is told next"
        elif DAMPING in nominal_of(results):
            more = "; an analysis over the damping ratio would tell what it does"
        else:
            more = ""
        lines.append(f"{given} an assumption{more}")
    if "trusted" in results and not bool((results["trusted"] != 0).all()):
        lines.append("The surrogate behind it is not to be trusted, so its interval is wide, or wrong")
    undecided, failed = int(results["undecided"]), int(results["failed"])
    if undecided or failed:
        lines.append(
            f"{undecided + failed:,} of {int(results['evaluations']):,} evaluations have no verdict "
            f"({undecided:,} undecided, {failed:,} failed): they count as stable in the lower limit and as "
            "unstable in the upper one"
        )
    return lines
