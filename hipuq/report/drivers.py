"""What drives the probability of squeak: Sobol indices of the first analysis that has some, in words."""

from __future__ import annotations

import xarray as xr

from hipuq.friction import OF_ANY_MODE
from hipuq.report import surrogate
from hipuq.report.block import Block
from hipuq.report.damping import at_damping
from hipuq.report.reading import Reading
from hipuq.report.sensitivity import has_indices, in_words, note, tables
from hipuq.report.summary import integrated

OUTCOMES = (*OF_ANY_MODE, "margin")
"""Outcomes whose indices are told, the most telling first."""

TITLE = "What drives it"


def driving(reading: Reading) -> tuple[str, str, xr.Dataset] | None:
    """Return analysis, outcome and results with indices over parameters alone; None without.

    Those of a surrogate that is not to be trusted come last: its variance is not that of the model.
    """
    found = []
    for name in reading.ranked:
        for rank, of in enumerate(OUTCOMES):
            results = reading.found[name].get(of)
            if results is None or not has_indices(results) or results["ST"].dims != ("parameter",):
                continue
            open_ = bool((results["S1"].isnull() | results["ST"].isnull()).all())
            found.append(
                (bool(surrogate.distrust(results)) or open_, rank // len(OF_ANY_MODE), name, of, results)
            )
    if not found:
        return None
    _, _, name, of, results = min(found, key=lambda one: one[:2])
    return name, of, results


def drivers(reading: Reading) -> Block:
    """Return the indices of the parameters, grouped, with intervals and in words.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
        Without indices a sentence that says what would give them.
    """
    found = driving(reading)
    if found is None:
        line = 'No analysis has Sobol indices: the method "sobol" or "chaos" would tell what drives it'
        return Block("drivers", TITLE, [line] if reading.results is not None else [])
    name, of, results = found
    words = in_words(results)
    where = f", {text}" if (text := at_damping(results)) else ""
    method = str(results.attrs["method"])
    lines = [words or _why(results)]
    lines.append(f"From the analysis {name!r} of {of}, by {method}{where}: {results.attrs['model']}")
    if integrated(results):
        lines.append(
            "Friction is integrated there: it has no index, the others are of the probability over friction"
        )
    if of not in OF_ANY_MODE:
        lines.append(
            "They are those of the margin, not of the verdict: what moves it most need not decide most often"
        )
    lines += surrogate.distrust(results)
    if text := note(results):
        lines.append(text)
    # The method and the model are told with the headline, or in full.
    brief = [lines[0], f"From the analysis {name!r} of {of}{where}"]
    return Block("drivers", TITLE, lines, tables(results)[:1], brief=brief)


def _why(results: xr.Dataset) -> str:
    """Return why there are no words for indices."""
    if surrogate.distrust(results):
        return "The indices are those of a surrogate that is not to be trusted"
    reasons = (str(results[key].attrs.get("undefined", "")) for key in ("S1", "ST"))
    reason = next(filter(None, reasons), "")
    return f"The indices are undefined: {reason}" if reason else "The indices are undefined"
