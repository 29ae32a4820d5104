"""Lines of the file of a comparison, checked: whoever wrote them, what is taken from them can be used."""

from __future__ import annotations

import json
import math
from collections.abc import Container, Sequence
from typing import Any

import numpy as np

KINDS = ("definition", "labels", "run")
"""Kinds of lines."""

LABELS: dict[str, type] = {
    "name": str,
    "contender": str,
    "long_name": str,
    "units": str,
    "dims": list,
    "coords": dict,
}
"""What labels say, and as what."""

TAKEN = frozenset({"method", "budget", "replicate"})
"""Dims that all runs together have."""

COUNTS = {"budget": 1, "replicate": 0, "n": 1, "evaluations": 1, "jobs": 1}
"""Integers of a run -> the least they may be."""

SECONDS = ("seconds", "model_seconds")

NUMBERS = ("estimate", "low", "high")
"""What has the shape of the labels; NaN where there is none."""

DEEPEST = 50
"""Levels of lists and mappings in a line, at most: far more than a definition has."""


def read_line(line: str) -> tuple[str, Any]:
    """Return the kind of a line and what it says.

    Raises
    ------
    ValueError
        If it is none of `KINDS`; a JSONDecodeError if it is not even JSON.
    RecursionError
        If it is too deep to be read.
    """
    content = json.loads(line)
    if not isinstance(content, dict) or len(content) != 1 or not content.keys() <= set(KINDS):
        raise ValueError(f"it is none of {', '.join(KINDS)}")
    ((kind, found),) = content.items()
    _check_depth(found)
    return kind, found


def checked_contenders(definition: Any) -> dict[str, dict[str, Any]]:
    """Return the contenders of a definition.

    Raises
    ------
    ValueError
        If it has none.
    """
    found = definition.get("contenders") if isinstance(definition, dict) else None
    if not isinstance(found, dict) or not all(isinstance(one, dict) for one in found.values()):
        raise ValueError("it defines no contenders")
    return found


def checked_labels(found: Any, contenders: Container[str]) -> dict[str, Any]:
    """Return labels.

    Raises
    ------
    ValueError
        If they are none, or of another contender; the message says why.
    """
    if not isinstance(found, dict):
        raise ValueError("labels are no mapping")
    for name, kind in LABELS.items():
        if not isinstance(found.get(name), kind):
            raise ValueError(f"{name} of the labels is {short(found.get(name))}")
    dims, coords = found["dims"], found["coords"]
    if not all(isinstance(dim, str) for dim in dims) or sorted(dims) != sorted(coords):
        raise ValueError("dims and coords of the labels differ")
    if not TAKEN.isdisjoint(dims):
        raise ValueError(f"dims of the labels are {short(dims)}")
    for dim in dims:
        values = coords[dim]
        kinds = {type(value) for value in values} if isinstance(values, list) else set()
        if kinds not in ({str}, {int}, {float}) or len(set(values)) != len(values):
            raise ValueError(f"coords of the labels do not tell the places along {dim}")
        if kinds == {int} and not all(-(2**63) <= value < 2**63 for value in values):
            raise ValueError(f"coords of the labels have too large a number along {dim}")
    if found["contender"] not in contenders:
        raise ValueError(f"the definition has no contender {short(found['contender'])}")
    return found


def checked_run(
    found: Any, names: Sequence[str], shape: tuple[int, ...], contenders: Container[str]
) -> dict[str, Any]:
    """Return what a run says.

    Parameters
    ----------
    found : object
        As `json.loads` gives it.
    names : sequence of str
        What a run has.
    shape : tuple of int
        Of estimate and limits.
    contenders : container of str
        Those that are defined.

    Raises
    ------
    ValueError, OverflowError
        If it is none; the message says why.
    """
    if not isinstance(found, dict) or found.keys() != set(names):
        raise ValueError(f"a run has {', '.join(names)}")
    if not isinstance(found["contender"], str) or found["contender"] not in contenders:
        raise ValueError(f"the definition has no contender {short(found['contender'])}")
    for name, least in COUNTS.items():
        value = found[name]
        if type(value) is not int or not least <= value < 2**63:
            raise ValueError(f"{name} is {short(value)}, not an integer from {least} on")
    for name in SECONDS:
        value = found[name]
        if type(value) not in (int, float) or not 0 <= float(value) < math.inf:
            raise ValueError(f"{name} is {short(value)}, not a time")
    if not found["seconds"] > 0:
        raise ValueError("seconds is 0: no run takes no time")
    for name in NUMBERS:
        if _shape(found[name]) != shape:
            wanted = f"numbers of shape {shape}" if shape else "a number"
            raise ValueError(f"{name} is {short(found[name])}, not {wanted}")
        # An integer may be too large for a float.
        np.asarray(found[name], np.float64)
    return found


def short(value: Any) -> str:
    """Return a value as text that fits into a line."""
    text = repr(value)
    return text if len(text) <= 120 else text[:117] + "..."


def _shape(value: Any) -> tuple[int, ...] | None:
    """Return the shape of numbers in nested lists, () of one number, None if they are no array of numbers."""
    if not isinstance(value, list):
        return () if type(value) in (int, float) else None
    inner = {_shape(part) for part in value}
    (first,) = inner if len(inner) == 1 else (None,)
    return None if first is None else (len(value), *first)


def _check_depth(value: Any, left: int = DEEPEST) -> None:
    """Raise a ValueError for what could not be written again."""
    if not left:
        raise ValueError("it is too deep")
    for part in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        _check_depth(part, left - 1)
