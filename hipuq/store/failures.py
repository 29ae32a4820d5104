"""The table of failed samples: where they are, and what went wrong."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import NDArray

FAILURES = ("failed_sample", "failure_message")
"""Variables of the table of failures, over ``failure``."""


MOST = 10_000
"""Messages that are kept, those of the first samples; the status tells the rest."""


def failure_table(failures: Mapping[int, str]) -> xr.Dataset:
    """Return the messages of failed samples.

    Parameters
    ----------
    failures : mapping
        Row -> message, by ascending row.

    Returns
    -------
    Dataset
        ``failure_message(failure)`` with the coord ``failed_sample``.
    """
    number, text = FAILURES
    kept = dict(itertools.islice(failures.items(), MOST))
    rows = np.array(list(kept), np.int64)
    messages = np.array(list(kept.values()), dtype=object).astype(str)
    attrs = {"long_name": "message of a failed sample", "units": "1"}
    place = {"long_name": "place of a failed sample among all, from 0", "units": "1"}
    return xr.Dataset({text: ("failure", messages, attrs)}, {number: ("failure", rows, place)})


def part_of(outcomes: xr.Dataset, places: slice | NDArray[np.int64]) -> xr.Dataset:
    """Return some samples of outcomes with their part of the table of failures, numbered anew.

    Parameters
    ----------
    outcomes : Dataset
    places : slice or array of int
        Ascending.

    Returns
    -------
    Dataset
    """
    part = outcomes.isel(sample=places)
    number, text = FAILURES
    if text not in outcomes:
        return part
    rows = np.arange(outcomes.sizes["sample"])[places]
    failed = outcomes[number].values
    where = np.flatnonzero(np.isin(failed, rows))
    if not where.size:
        return part.drop_vars(FAILURES)
    part = part.isel(failure=where)
    renumbered = part[number].copy(data=np.searchsorted(rows, failed[where]))
    return part.assign_coords({number: renumbered})
