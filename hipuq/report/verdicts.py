"""How far numbers are to be trusted: what is open or failed, what decided, how far it converged."""

from __future__ import annotations

import numpy as np
import xarray as xr

from hipuq.report.block import Block
from hipuq.report.damping import damping_words
from hipuq.report.over_damping import cell, ends
from hipuq.report.reading import DAMPING, Groups, Reading, probability_name
from hipuq.report.table import MISSING, Table, count, listed, number

TITLE = "Numerical trust"

DECIDERS = ("double", "structured", "certificate")

LEGEND = (
    "Undecided: the verdict cannot be told from rounding; it counts as stable in the lower limit and as "
    "unstable in "
    "the upper one. Decided by double precision, by the structured solver, or by a certificate in exact "
    "arithmetic"
)


def verdicts(reading: Reading) -> Block:
    """Return what all evaluations gave, and how far the headline has converged.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
    """
    rows, total = [], np.zeros(3)
    for name, groups in reading.whole.items():
        results = [one for one in groups.values() if "of" in one.attrs and "evaluations" in one]
        if not results:
            continue
        counts = [int(results[0][key].sum()) for key in ("evaluations", "undecided", "failed")]
        total += counts
        of = _shown(reading, name, results[0])
        if reading.apart(name):
            of = groups.get(str(of.attrs["of"]), of)
        told = [damping_words(of), _probability(reading, name)]
        rows.append([name, *map(count, counts), *_decided(groups), *told])
    if not rows:
        return Block("trust", TITLE)
    heads = ["analysis", "evaluations", "undecided", "failed", *(f"by {who}" for who in DECIDERS)]
    table = Table("Evaluations and verdicts", [*heads, "damping", "P(squeak)"], rows, LEGEND)
    if all(row[4:7] == [MISSING] * 3 for row in rows):
        table = Table(
            table.title, [*heads[:4], "damping", "P(squeak)"], [row[:4] + row[7:] for row in rows], LEGEND
        )
    lines = [
        f"{count(total[0])} evaluations in all: {count(total[1])} undecided, {count(total[2])} failed"
        + _shares(reading)
    ]
    lines += settled_words(reading.results) if reading.results is not None else []
    shortest = [line.partition(";")[0] for line in lines]
    brief = "; ".join([shortest[0], *(f"{line[0].lower()}{line[1:]}" for line in shortest[1:])])
    return Block("trust", TITLE, lines, [table], brief=[brief])


def _shown(reading: Reading, name: str, other: xr.Dataset) -> xr.Dataset:
    """Return the results of an analysis with a probability of squeak, else the others."""
    found = reading.squeak(name)
    return other if found is None else found


def _decided(groups: Groups) -> list[str]:
    """Return how many samples each of `DECIDERS` decided."""
    if "verdicts" not in groups or "decided" not in groups["verdicts"]:
        return [MISSING] * len(DECIDERS)
    decided = groups["verdicts"]["decided"]
    names = [str(name) for name in decided["decided_by"].values]
    return [count(int(decided.sel(decided_by=who).sum())) if who in names else MISSING for who in DECIDERS]


def _shares(reading: Reading) -> str:
    """Return who decided the verdicts of all analyses together; empty where it is not told."""
    parts = [
        groups["verdicts"]["decided"]
        for groups in reading.whole.values()
        if "verdicts" in groups and "decided" in groups["verdicts"]
    ]
    sums = {
        who: sum(int(one.sel(decided_by=who).sum()) for one in parts if who in one["decided_by"].values)
        for who in DECIDERS
    }
    called = dict(zip(DECIDERS, ("double precision", "the structured solver", "certificate"), strict=True))
    told = [f"{count(sums[who])} by {called[who]}" for who in DECIDERS if sums[who]]
    return "" if not told else f"; decided {listed(told)}"


def _probability(reading: Reading, name: str) -> str:
    """Return the probability of an analysis with its limits; nothing where it has none, or many."""
    if parameter := reading.at_one(name):
        return f"over {parameter.replace('_', ' ')}"
    one = reading.squeak(name)
    if one is not None and reading.apart(name):
        return ends(reading.swept_over(DAMPING)[name])
    return "" if one is None else cell(one, probability_name(one))


def settled_words(results: xr.Dataset) -> list[str]:
    """Return how wide the interval of the headline is, and what its last evaluations changed."""
    name = probability_name(results)
    low, high = (float(results[f"{name}_{end}"]) for end in ("low", "high"))
    if not np.isfinite([low, high]).all() or high <= low:
        return []
    text = f"The headline's interval is {number(high - low, 2)} wide"
    key = f"{name}_by_budget"
    if key in results and results[key].dims == ("budget",) and results.sizes["budget"] > 1:
        values, budgets = results[key].values, results["budget"].values
        if np.isfinite(values[-2:]).all():
            text += (
                f"; from {count(budgets[-2])} to {count(budgets[-1])} evaluations the estimate changed by "
                f"{number(abs(float(values[-1] - values[-2])), 2)}"
            )
    return [text]
