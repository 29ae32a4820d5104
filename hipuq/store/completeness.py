"""How much of a store is there, as its own files say."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hipuq.store.ledger import END, as_they_were, read_about, read_units


def size_of(definition: Mapping[str, Any]) -> int:
    """Return the number of samples of a definition, those of all rounds."""
    return int(definition["samples"]) + sum(map(int, definition.get("rounds", [])))


def progress_of(folder: Path) -> tuple[int, int]:
    """Return the number of samples that a store has, by its ledger, and that of all that it is to have."""
    about = read_about(folder)
    size, chunk = size_of(about["definition"]), about["chunk"]
    numbers = [number for number in read_units(folder) if 0 <= number < -(-size // chunk)]
    return sum(min(chunk, size - number * chunk) for number in numbers), size


def missing_in(folder: Path) -> str:
    """Say what is missing in a store that was written unit by unit; empty if nothing is."""
    units = read_units(folder)
    done, size = progress_of(folder)
    if done < size or END not in units:
        return f"it is not complete, {done:,} of {size:,} samples are there"
    for number, unit in units.items():
        if not as_they_were(folder, unit.files, whole=number < 0):
            return "files in it are missing or damaged"
    return ""


def is_store(folder: Path) -> bool:
    """Say whether a folder is a Zarr store."""
    return (folder / ".zgroup").is_file() or (folder / "zarr.json").is_file()
