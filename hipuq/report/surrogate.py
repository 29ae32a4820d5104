"""A polynomial chaos in words and tables: how good it is, and what true evaluations make of it."""

from __future__ import annotations

import xarray as xr

from hipuq.report.table import Table, number, sentence, with_limits, with_unit

OWN = {"probability": "probability_surrogate", "mean_corrected": "mean"}
"""What true evaluations have corrected, the most telling first -> the same by the surrogate alone."""

FIT = ("degree", "terms", "samples_used", "loo", "q2", "misclassified")
"""How good the expansion is."""

GIVES = ("probability_surrogate", "probability", "mean", "mean_corrected", "variance")
"""What it gives."""

BY_ELEMENT = ("degree", "terms", "loo", "q2", "misclassified", "probability_surrogate", "probability")
"""What is told of each element of an outcome of more dims."""

SHORT = {
    "samples_used": "samples fitted",
    "loo": "leave-one-out error (relative)",
    "q2": "Q2 on held-out samples",
    "misclassified": "misclassified held-out samples (share)",
    "probability_surrogate": "probability by the surrogate alone",
    "probability": "probability, corrected by true evaluations",
    "mean": "mean by the surrogate alone",
    "mean_corrected": "mean, corrected by true evaluations",
    "variance": "variance by the surrogate alone",
}
"""Names in tables; the others are as they are."""


def is_surrogate(results: xr.Dataset) -> bool:
    """Say whether results are those of a polynomial chaos."""
    return "loo" in results and "predicted" in results


def headline(results: xr.Dataset) -> str:
    """Return the corrected estimate beside that of the surrogate alone, in one line; empty without one."""
    for corrected, alone in OWN.items() if is_surrogate(results) else ():
        name, own = _overall(results, corrected), _overall(results, alone)
        if name and results[name].ndim == 0:
            text = f"{sentence(str(results[name].attrs['long_name']))}: {_value(results, name)}"
            return f"{text}; by the surrogate alone {_value(results, own)}" if own else text
    return ""


def distrust(results: xr.Dataset) -> list[str]:
    """Return in a line why the surrogate is not to be trusted; none where it is, or there is none."""
    if "trusted" not in results or bool((results["trusted"] != 0).all()):
        return []
    trusted = results["trusted"]
    text = "The surrogate is not to be trusted"
    if trusted.ndim:
        text += f" for {int((trusted == 0).sum())} of {trusted.size} {'/'.join(map(str, trusted.dims))}s"
    reasons = str(trusted.attrs.get("reasons", ""))
    return [f"{text}: {reasons}" if reasons else text]


def tables(results: xr.Dataset, dims: str, places: list[tuple[str, xr.Dataset]]) -> list[Table]:
    """Return how the expansion fits and what it gives; nothing without one.

    Parameters
    ----------
    results : Dataset
        Results of the method ``"chaos"``.
    dims : str
        Dims of the outcome, empty for a scalar.
    places : list of tuple
        Heading of a row and results of each element of the outcome.

    Returns
    -------
    list of Table
        Of a scalar outcome fit, estimates and quantiles; of others a row for each element.
    """
    if not is_surrogate(results):
        return []
    if dims:
        return [_by_element(dims, places)]
    names = [name for base in (*FIT, *GIVES) if (name := _overall(results, base))]
    rows = [[_heading(results, name), _value(results, name)] for name in names]
    rows.append(["to be trusted", _trusted(results)])
    made = [Table("Polynomial chaos: how it fits, and what it gives", ["quantity", "value"], rows)]
    if "quantiles" in results and results["quantiles"].dims == ("quantile",):
        columns = ["below", *(f"{100 * float(level):g} %" for level in results["quantile"].values)]
        row = [number(float(value)) for value in results["quantiles"].values]
        made.append(
            Table(
                "Quantiles by the surrogate alone",
                columns,
                [[with_unit("value", results["quantiles"]), *row]],
            )
        )
    return made


def _overall(results: xr.Dataset, base: str) -> str:
    """Return the name of a quantity over all levels if there is one, else its own; empty without it."""
    return next((name for name in (f"{base}_overall", base) if name in results), "")


def _heading(results: xr.Dataset, name: str) -> str:
    """Return what a row tells, with its unit, and over how many levels it ranges."""
    text = with_unit(SHORT.get(name.removesuffix("_overall"), name), results[name])
    return f"{text}, over {results[name].size} levels" if results[name].size > 1 else text


def _value(results: xr.Dataset, name: str) -> str:
    """Return a scalar with its limits, or the range over levels."""
    if results[name].ndim:
        least, most = float(results[name].min()), float(results[name].max())
        return number(least) if least == most else f"{number(least)} to {number(most)}"
    return with_limits(results, name, 4 if name.startswith(("probability", "misclassified")) else None)


def _trusted(results: xr.Dataset) -> str:
    return "yes" if int(results["trusted"]) else "no"


def _by_element(dims: str, places: list[tuple[str, xr.Dataset]]) -> Table:
    """Return a row for each element of which a surrogate was made."""
    first = places[0][1]
    names = [name for base in BY_ELEMENT if (name := _overall(first, base))]
    columns = [dims, *(SHORT.get(name.removesuffix("_overall"), name) for name in names), "to be trusted"]
    rows = [
        [label, *(_value(one, name) for name in names), _trusted(one)]
        for label, one in places
        if not bool(one["ST"].isnull().all())
    ]
    return Table("Polynomial chaos: how it fits, and what it gives", columns, rows)
