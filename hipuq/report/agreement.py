"""Exact beside sampled, and friction integrated beside sampled: whether the same probability comes out."""

from __future__ import annotations

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.report.block import Block
from hipuq.report.damping import damping_words
from hipuq.report.over_damping import cell
from hipuq.report.partners import comparison, pairs_of
from hipuq.report.reading import Reading, probability_name
from hipuq.report.table import Table

TITLE = "The same probability in two ways"


def agreement(reading: Reading) -> Block:
    """Return the probabilities that are told with friction sampled and integrated, and whether they agree.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
        Empty where none is told twice.
    """
    rows, agree = [], 0
    for sampled, other, one, two in pairs_of(reading.found):
        if not all(np.isfinite(float(own[probability_name(own)])) for own in (one, two)):
            # What is not known agrees with everything: no evidence.
            continue
        first, second = (cell(own, probability_name(own)) for own in (one, two))
        yes = _meet(one, two)
        agree += yes
        said = f"intervals {'' if yes else 'do not '}overlap"
        if schema.is_exact(two):
            said = f"exact value {'in' if yes else 'outside'} the interval"
        rows.append([damping_words(one), sampled, first, other, second, said])
    lines = [
        f"{name}: {text}"
        for name, groups in reading.found.items()
        if (text := comparison(name, reading.found)) and "The same by sampling" not in text
    ]
    if not rows:
        return Block("agreement", TITLE, lines, brief=list(lines))
    told = (
        f"{agree} of {len(rows)} pairs agree: the interval holds the exact value, or both intervals "
        "overlap. Of 95 % "
        "intervals, one in twenty misses even where all is right"
    )
    columns = ["damping", "friction sampled", "P(squeak), sampled", "friction integrated"]
    columns += ["P(squeak), integrated", "agreement"]
    if not any(row[0] for row in rows):
        columns, rows = columns[1:], [row[1:] for row in rows]
    table = Table("Friction sampled and integrated, of the same model and inputs", columns, rows)
    return Block("agreement", TITLE, [told, *lines], [table], brief=[told.split(":")[0]])


def _meet(one: xr.Dataset, two: xr.Dataset) -> bool:
    """Say whether the intervals of two probabilities overlap."""
    ends = [[float(own[f"{probability_name(own)}_{end}"]) for end in ("low", "high")] for own in (one, two)]
    return ends[0][0] <= ends[1][1] and ends[1][0] <= ends[0][1]
