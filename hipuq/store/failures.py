"""The table of failed samples: where they are, and what went wrong."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

FAILURES = ("failed_sample", "failure_message")
"""Variables of the table of failures, over ``failure``."""


def failure_table(failures: Mapping[int, str]) -> xr.Dataset:
    """Return the messages of failed samples.

    Parameters
    ----------
    failures : mapping
        Row -> message.

    Returns
    -------
    Dataset
        ``failure_message(failure)`` with the coord ``failed_sample``.
    """
    number, text = FAILURES
    rows = np.array(list(failures), np.int64)
    messages = np.array(list(failures.values()), dtype=object).astype(str)
    attrs = {"long_name": "message of a failed sample", "units": "1"}
    place = {"long_name": "place of a failed sample among all, from 0", "units": "1"}
    return xr.Dataset({text: ("failure", messages, attrs)}, {number: ("failure", rows, place)})
