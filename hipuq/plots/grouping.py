"""Results by contact pattern: which patterns have how many oscillators in contact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.errors import InputError, SchemaError

WAY_OUT = "an analysis stratified over contact patterns, stratify='contact'"


def check_values(what: str, wanted: Sequence[int], here: Sequence[int]) -> list[int]:
    """Return the wanted values, once all of them are known to be there.

    Parameters
    ----------
    what : str
        What they are, such as ``"mode"``.
    wanted, here : sequence of int

    Returns
    -------
    list of int

    Raises
    ------
    InputError
        If there is none, or one is not there.
    """
    if not len(wanted):
        raise InputError(f"no {what} to draw: name at least one of {list(here)}")
    for value in wanted:
        if value not in here:
            raise InputError(f"{what} {value} is not in the results: it must be one of {list(here)}")
    return [int(value) for value in wanted]


def by_number(results: xr.Dataset, counts: Sequence[int] | None) -> dict[int, NDArray[np.intp]]:
    """Return the patterns of each number in contact.

    Parameters
    ----------
    results : Dataset
        With the coord ``in_contact(pattern)``.
    counts : sequence of int or None
        Numbers in contact, in the order to draw; None for all.

    Returns
    -------
    dict
        Number in contact -> places along ``pattern``.

    Raises
    ------
    SchemaError
        If there is no such coord.
    InputError
        If there are no patterns of a number.
    """
    if "in_contact" not in results.variables or results["in_contact"].dims != ("pattern",):
        raise SchemaError(f"the figure needs the coord 'in_contact' over (pattern): {WAY_OUT}")
    number: NDArray[Any] = results["in_contact"].values
    here = np.unique(number).astype(int).tolist()
    chosen = here if counts is None else check_values("number in contact", counts, here)
    return {count: np.flatnonzero(number == count) for count in chosen}


def patterns(number: int) -> str:
    """Return such as ``"84 patterns"``."""
    return f"{number} pattern{'' if number == 1 else 's'}"
