"""Results by contact pattern: which patterns have how many oscillators in contact."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.errors import InputError, SchemaError
from hipuq.plots.style import check_dataset

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
    if isinstance(wanted, str) or not isinstance(wanted, Iterable):
        raise InputError(f"{what} is {wanted!r}: it must be a list, such as {list(here)[:2]}")
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
    check_dataset(results, "results")
    if "in_contact" not in results.variables or results["in_contact"].dims != ("pattern",):
        raise SchemaError(f"the figure needs the coord 'in_contact' over (pattern): {WAY_OUT}")
    number: NDArray[Any] = results["in_contact"].values
    here = np.unique(number).astype(int).tolist()
    chosen = here if counts is None else check_values("number in contact", counts, here)
    return {count: np.flatnonzero(number == count) for count in chosen}


def ranges(numbers: Sequence[int]) -> str:
    """Return ``"1-3, 5, 6"`` for 1, 2, 3, 5, 6: ``"5-6"`` would read like a pair of modes."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(
        f"{run[0]}-{run[-1]}" if len(run) > 2 else ", ".join(str(number) for number in run) for run in runs
    )


def left_out(modes: NDArray[Any], ever: NDArray[np.bool_], shown: NDArray[Any]) -> str:
    """Return which modes are not shown, such as ``"not shown: 1-9 (never unstable)"``; empty if none.

    Parameters
    ----------
    modes : (modes,) array of int
        Numbers of all modes.
    ever : (modes,) array of bool
        Whether a mode is unstable, or not known to be stable, in what is shown.
    shown : array of int
        Numbers of those that are shown.

    Returns
    -------
    str
    """
    gone = ~np.isin(modes, shown)
    said = (("never unstable", gone & ~ever), ("unstable too", gone & ever))
    parts = [f"{ranges(modes[which].tolist())} ({what})" for what, which in said if which.any()]
    return f"not shown: {'; '.join(parts)}" if parts else ""


def patterns(number: int) -> str:
    """Return such as ``"84 patterns"``."""
    return f"{number} pattern{'' if number == 1 else 's'}"
