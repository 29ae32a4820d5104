"""What of a store of outcomes is complete: one line of JSON for each unit of rows, in a file beside the data.

A line says which files a unit was written to, how long they are and what they hold (CRC-32). So a unit whose
line was written and whose data was not, as after a power cut, is found out, and made again.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from hipuq.errors import StoreError

ABOUT, LINES = "hipuq.json", "hipuq.jsonl"
"""Files of a store: what it is of, and its ledger."""

START, END = -2, -1
"""Numbers of the units that stand for what is written at first and at the end."""

LARGEST = 2**30
"""Bytes of these files that are read, at most."""

HALF = ".hipuq-part"
"""End of the name of a file that is being written."""

Files = dict[str, tuple[int, int]]
"""Path inside the store -> size in bytes and CRC-32."""


@dataclass(frozen=True)
class Unit:
    """A unit that is complete.

    Attributes
    ----------
    number : int
        From 0; `START` and `END` stand for what is beside the units.
    files : dict
    failures : dict
        Row of a failed sample -> message, as many as are kept.
    failed : int
        Number of failed samples.
    lost : int
        How many of them gave nothing; the others gave NaN.
    undecided : int
        Number of undecided samples.
    seconds : float
        Time that it took [s].
    """

    number: int
    files: Files
    failures: dict[int, str] = field(default_factory=dict)
    failed: int = 0
    lost: int = 0
    undecided: int = 0
    seconds: float = 0.0

    def line(self) -> str:
        """Return it as a line."""
        failures = [[row, message] for row, message in self.failures.items()]
        return json.dumps(
            {
                "unit": self.number,
                "files": {name: list(pair) for name, pair in self.files.items()},
                "failures": failures,
                "failed": self.failed,
                "lost": self.lost,
                "undecided": self.undecided,
                "seconds": self.seconds,
            }
        )

    @classmethod
    def from_line(cls, line: str) -> Unit:
        """Return the unit that a line is of.

        Raises
        ------
        ValueError
            If it is of none, as one that was cut off.
        """
        try:
            found = json.loads(line)
            files = {_inside(name): (int(size), int(crc)) for name, (size, crc) in found["files"].items()}
            failures = {int(row): str(message) for row, message in found["failures"]}
            counts = [int(found[name]) for name in ("failed", "lost", "undecided")]
            failed, lost, undecided = counts
            seconds = float(found["seconds"])
            return cls(int(found["unit"]), files, failures, failed, lost, undecided, seconds)
        except (KeyError, TypeError, AttributeError, RecursionError, OverflowError) as error:
            raise ValueError("not a line of a ledger") from error


def read_about(folder: Path) -> dict[str, Any]:
    """Return what a store is of.

    Raises
    ------
    StoreError
        If it does not say so.
    """
    try:
        found = json.loads(_text(folder / ABOUT))
        definition = found["definition"]
        counts = [definition["samples"], found["chunk"], *definition.get("rounds", [])]
        if not all(type(n) is int and 0 < n < 2**53 for n in counts):
            raise ValueError("it has no samples")
        if not isinstance(found["variables"], list):
            raise ValueError("it has no variables")
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise StoreError(f"{folder} is no store of hipuq that could go on: {ABOUT} cannot be used") from error
    return dict(found)


def write_about(folder: Path, about: Mapping[str, Any]) -> None:
    """Write what a store is of, whole or not at all."""
    half = folder / f"{ABOUT}{HALF}"
    half.write_text(json.dumps(about, indent=1))
    os.replace(half, folder / ABOUT)


def read_units(folder: Path) -> dict[int, Unit]:
    """Return the units that a ledger has lines of; a line that was cut off is none."""
    file = folder / LINES
    units: dict[int, Unit] = {}
    if not file.is_file():
        return units
    try:
        lines = _text(file).splitlines()
    except OSError as error:
        raise StoreError(f"cannot read {file}: {error.strerror or error}") from error
    for line in lines:
        try:
            unit = Unit.from_line(line)
        except ValueError:
            continue
        units[unit.number] = unit
    return units


def add_unit(folder: Path, unit: Unit) -> None:
    """Write the line of a unit whose files are there."""
    file = folder / LINES
    # A line that was cut off must not swallow this one.
    with file.open("ab") as stream:
        stream.write(b"\n" + unit.line().encode() + b"\n")


def files_of(folder: Path, names: Iterable[str]) -> Files:
    """Return size and CRC-32 of files as they are."""
    found: Files = {}
    for name in names:
        data = (folder / name).read_bytes()
        found[name] = (len(data), zlib.crc32(data))
    return found


def as_they_were(folder: Path, files: Mapping[str, tuple[int, int]], *, whole: bool) -> bool:
    """Say whether files are what the ledger says.

    Parameters
    ----------
    folder : Path
    files : mapping
    whole : bool
        Whether to read them; else sizes alone are compared.
    """
    try:
        # A pipe has a size too, and never ends.
        sizes = all(
            (folder / name).is_file() and (folder / name).stat().st_size == size
            for name, (size, _) in files.items()
        )
        return sizes and (not whole or files_of(folder, files) == dict(files))
    except OSError:
        return False


def _inside(name: str) -> str:
    """Return the name of a file in a store.

    Raises
    ------
    ValueError
        If it is none, but leads out of it.
    """
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts:
        raise ValueError(f"{name} is outside the store")
    return name


def _text(file: Path) -> str:
    """Return a text file, unless it is none or too large."""
    if not file.is_file() or file.stat().st_size > LARGEST:
        raise OSError(f"{file.name} is no file of a store")
    return file.read_bytes().decode("utf-8", errors="replace")
