"""Which probability a study tells first, and how it depends on damping, which decides it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from hipuq.errors import InputError, check_name
from hipuq.friction import FRICTION, OF_ANY_MODE
from hipuq.study.file import StudyFile
from hipuq.study.tables import AnalysisTable

if TYPE_CHECKING:
    from hipuq.study.plan import Analysis

DAMPING = "damping_ratio"

DAMPING_SWEEP = "damping_sweep"
"""Name of the analysis over the damping ratio that a study adds by itself."""


WITH_PROBABILITY = ("monte_carlo", "chaos")
"""Methods that estimate one."""


def headline_of(table: StudyFile, analyses: Sequence[Analysis]) -> Analysis | None:
    """Return the analysis whose probability is told first: the one named, else the first that has one.

    Parameters
    ----------
    table : StudyFile
    analyses : sequence of Analysis

    Returns
    -------
    Analysis or None
        None where no analysis has one, or each has many, such as one over friction.
    """
    named = table.report.headline
    for one in analyses:
        if one.name == named or (named is None and _tells(one) and set(one.over) <= {DAMPING}):
            return one
    return None


def _tells(analysis: Analysis) -> bool:
    """Say whether an analysis estimates a probability of instability."""
    return analysis.method in WITH_PROBABILITY and any(of in OF_ANY_MODE for of in analysis.of)


def check_headline(table: StudyFile, analyses: Sequence[Analysis]) -> None:
    """Check what the report says of its headline.

    Parameters
    ----------
    table : StudyFile
    analyses : sequence of Analysis

    Raises
    ------
    InputError
        If there is no such analysis, it tells no probability, or is not over the damping ratio.
    """
    report = table.report
    if report.headline is not None:
        check_name("analysis in headline", report.headline, [one.name for one in analyses])
    found = headline_of(table, analyses)
    if report.headline is not None and found is not None and not _tells(found):
        raise InputError(
            f"headline {found.name!r} tells no probability of instability: it needs the method "
            f"{' or '.join(WITH_PROBABILITY)} with {' or '.join(OF_ANY_MODE)} in of"
        )
    if report.headline is not None and found is not None and not set(found.over) <= {DAMPING}:
        raise InputError(
            f"headline {found.name!r} is over {' and '.join(found.over)}, so it has no one probability: "
            f"name an analysis over {DAMPING} alone, or over nothing"
        )
    if report.damping_ratio is None:
        return
    values = () if found is None else found.over.get(DAMPING, ())
    if report.damping_ratio not in values:
        name = "" if found is None else f" {found.name!r}"
        raise InputError(
            f"{DAMPING} is {report.damping_ratio}, which the headline's analysis{name} is not over: it must "
            f"be one of its over = {{ {DAMPING} = [...] }}, {list(values) or 'which it has not'}"
        )


def damping_sweep(table: StudyFile, analyses: Sequence[Analysis]) -> tuple[AnalysisTable, str] | None:
    """Return the analysis over the damping ratio that a study needs and does not have.

    Parameters
    ----------
    table : StudyFile
    analyses : sequence of Analysis

    Returns
    -------
    table : AnalysisTable
        Of the model and inputs of the headline, or of the first analysis, friction sampled; with its design
        where that is no larger than asked. The nominal damping ratio is among its values.
    like : str
        The analysis whose model and inputs it has. None of both where an analysis is over the damping ratio
        or draws it, the model has none, friction has no distribution, or the report asks for none.
    """
    found = headline_of(table, analyses) or next(iter(analyses), None)
    if found is None or not table.report.damping_samples or DAMPING not in found.model.parameters:
        return None
    told = (set(one.over) == {DAMPING} and _tells(one) for one in analyses)
    if any(told) or any(one.name == DAMPING_SWEEP or DAMPING in one.inputs for one in analyses):
        return None
    entry = next(one for one in table.analysis if one.name == found.name)
    if not (entry.integrate_friction or FRICTION in found.inputs) or found.over:
        return None
    samples = table.report.damping_samples
    same = found.method == "monte_carlo" and not entry.integrate_friction and found.evaluations <= samples
    nominal = float(found.model.parameters[DAMPING].nominal)
    ratios = sorted({*table.report.damping_ratios, nominal})
    update: dict[str, Any] = {
        "name": DAMPING_SWEEP,
        "method": "monte_carlo",
        "n": entry.n if same else samples,
        "integrate_friction": False,
        "of": ["any_unstable"],
        "options": entry.options if same else {},
        "over": {DAMPING: ratios},
    }
    return entry.model_copy(update=update), found.name
