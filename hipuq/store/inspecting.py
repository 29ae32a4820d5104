"""Results files looked through before any value is read: what is in them, and what it would take.

HDF5 lets a file point to others, store nothing for arrays of any size, and hold groups within themselves.
Results of hipuq do none of it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hipuq.errors import StoreError
from hipuq.store.reporting import check_plain_file, one_line

MAXIMUM_BYTES = 2**30
"""Largest results file, and largest memory that its values may take [byte]."""

MAXIMUM_OBJECTS = 20_000
"""Most groups and variables in a results file."""

MAXIMUM_DEPTH = 8
"""Most groups within each other: those of hipuq are ``<analysis>/<of>``."""

KINDS = "biufcSO"
"""Types of values: truth values, integers, numbers, and text."""

TEXTS = ("hipuq_version", "model", "method", "of", "options", "inputs", "history", "title")
"""Attributes that are text wherever they are."""

JSON_TEXTS = ("options", "inputs", "report", "sources", "versions")
"""Attributes that hold JSON, which may be empty."""


def check_inside(file: Path) -> None:
    """Raise a StoreError unless a file is one of results that can be read; no value is read.

    Parameters
    ----------
    file : Path

    Raises
    ------
    StoreError
        If it is no file, hipuq did not write it, a later hipuq did, it is too large, or it leads anywhere
        outside itself.
    OSError, ValueError, KeyError, RuntimeError
        As h5py raises them for files that are broken.
    """
    import h5py

    check_plain_file(file, MAXIMUM_BYTES)
    with h5py.File(file, "r") as opened:
        size, ours = 0, False
        for number, (name, item) in enumerate(_items(file, opened, "", ())):
            if number >= MAXIMUM_OBJECTS:
                raise StoreError(f"{file} has more than {MAXIMUM_OBJECTS:,} groups and variables")
            if isinstance(item, h5py.Group):
                ours = _check_attrs(file, name, dict(item.attrs)) or ours
                continue
            if not isinstance(item, h5py.Dataset):
                continue  # a type with a name
            _check_variable(file, name, item)
            size += item.size * item.dtype.itemsize
            if size > MAXIMUM_BYTES:
                raise StoreError(
                    f"{file}: {_shown(name)} and what is before it would take {size:,} bytes: "
                    f"at most {MAXIMUM_BYTES:,} are read"
                )
    if not ours:
        raise StoreError(f"{file} is not a results file of hipuq: it has no attribute hipuq_version")


def check_version(path: Path, version: object) -> None:
    """Raise a StoreError if a later hipuq wrote a file: what it means by it cannot be known here.

    Parameters
    ----------
    path : Path
    version : object
        Its attribute ``hipuq_version``.

    Raises
    ------
    StoreError
        If it is a later version, or none. Versions that differ in their third number read each other.
    """
    from hipuq import __version__

    if version == "":
        # It says that it is of hipuq, and not of which.
        return
    found = re.match(r"(\d{1,9})\.(\d{1,9})(?!\d)", version if isinstance(version, str) else "", re.ASCII)
    own = re.match(r"(\d+)\.(\d+)", __version__)
    assert own is not None
    if found is None:
        raise StoreError(f"{path} has the hipuq_version {one_line(repr(version))}, which is none")
    if tuple(map(int, found.groups())) > tuple(map(int, own.groups())):
        raise StoreError(
            f"{path} was written by hipuq {one_line(str(version))}, this is {__version__}: "
            "update hipuq to read it"
        )


def _items(file: Path, group: Any, place: str, above: tuple[Any, ...]) -> Iterator[tuple[str, Any]]:
    """Yield a group and all that is in it, with its place."""
    import h5py

    # What is held by itself, or by a group in itself, would never end.
    if group in above or len(above) > MAXIMUM_DEPTH:
        raise StoreError(f"{file} has more than {MAXIMUM_DEPTH} groups within each other at {_shown(place)}")
    yield place, group
    for name in group:
        own = f"{place}/{name}"
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise StoreError(f"{file}: {_shown(own)} is a link, which no results of hipuq hold")
        item = group[name]
        if isinstance(item, h5py.Group):
            yield from _items(file, item, own, (*above, group))
        else:
            yield own, item


def _check_variable(file: Path, name: str, item: Any) -> None:
    """Raise a StoreError for a variable that lies elsewhere, or holds what results never do."""
    import h5py

    if item.is_virtual or item.external:
        raise StoreError(f"{file}: the values of {_shown(name)} lie in another file, which is not read")
    if item.dtype.kind not in KINDS or (
        item.dtype.kind == "O" and h5py.check_string_dtype(item.dtype) is None
    ):
        raise StoreError(
            f"{file}: {_shown(name)} holds {one_line(str(item.dtype))}: results hold numbers and text"
        )


def _check_attrs(file: Path, name: str, attrs: dict[str, Any]) -> bool:
    """Check the attributes of a group; say whether hipuq wrote it."""
    for key in TEXTS:
        if not isinstance(attrs.get(key, ""), str):
            raise StoreError(f"{file}: the attribute {key} of {_shown(name)} is no text")
    for key in JSON_TEXTS:
        try:
            fine = not attrs.get(key) or isinstance(json.loads(attrs[key]), dict)
        except (ValueError, RecursionError):
            fine = False
        if not fine:
            raise StoreError(
                f"{file}: {_shown(name)} does not say of which model and inputs it is: "
                f"its attribute {key} is not what hipuq writes there"
            )
    if "hipuq_version" not in attrs:
        return False
    check_version(file, attrs["hipuq_version"])
    return True


def _shown(name: str) -> str:
    return one_line(name.lstrip("/"))[:80] or "the file"
