"""A store is made, gone on with, extended or refused, by one run at a time."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hipuq.differences import difference
from hipuq.errors import StoreError
from hipuq.store.arrays import open_arrays
from hipuq.store.blocks import ATTRS, METADATA, BlockStore, units_of
from hipuq.store.completeness import is_store, missing_in, size_of
from hipuq.store.guarding import check_store
from hipuq.store.ledger import ABOUT, END, Unit, as_they_were, read_about, read_units
from hipuq.store.lock import locked
from hipuq.store.reporting import reported
from hipuq.store.reuse import Reuse


@contextmanager
def opened(
    folder: Path, definition: Mapping[str, Any], block: int, *, resume: bool, replace: bool = False
) -> Iterator[BlockStore]:
    """Open a store for writing; no other run can, until it is closed.

    Parameters
    ----------
    folder : Path
    definition : mapping
        What the outcomes follow from, JSON-able; ``"samples"`` is their number.
    block : int
        Samples that the model takes at a time.
    resume : bool
        Whether to go on with what is there.
    replace : bool
        Whether a store that is there gives way once the first unit of the new one is complete.

    Raises
    ------
    StoreError
        If there is something else, a store of other outcomes, or another run writes to it.
    """
    with locked(folder):
        with reported("write", folder):
            store, before = _begun(folder, json.loads(json.dumps(definition)), block, resume, replace)
        try:
            yield store
        finally:
            if before is not None and not store.units:
                # Nothing came of it.
                shutil.rmtree(folder, ignore_errors=True)
                before.rename(folder)
        if store.complete and store.folder == folder:
            for end in ("old", "replaced"):
                shutil.rmtree(_beside(folder, end), ignore_errors=True)


def _begun(
    folder: Path, asked: dict[str, Any], block: int, resume: bool, replace: bool
) -> tuple[BlockStore, Path | None]:
    """Return the store to write to, and where the one is now that was there before it."""
    there = folder.exists() and (not folder.is_dir() or any(folder.iterdir()))
    if there and not (folder / ABOUT).is_file() and not (replace and is_store(folder)):
        raise StoreError(f"cannot write {folder}: something that is not a store of hipuq is there")
    if there and not resume and not replace:
        raise StoreError(
            f"there is a store at {folder} already: go on with resume=True, or take another path"
        )
    aside = _beside(folder, "old" if resume else "replaced")
    if resume and (kept := _kept(folder, aside, asked)) is not None:
        return kept, None
    if there:
        if aside.exists():
            shutil.rmtree(aside)
        folder.rename(aside)
    reuse = _reuse(aside, asked) if resume else None
    folder.mkdir(parents=True, exist_ok=True)
    size = size_of(asked)
    chunk = units_of(size, block)
    (folder / ABOUT).write_text(json.dumps({"definition": asked, "chunk": chunk}, indent=1))
    return BlockStore(folder, size, chunk, {}, reuse), aside if there else None


def _kept(folder: Path, aside: Path, asked: dict[str, Any]) -> BlockStore | None:
    """Return the store that is there, if it has what is asked for or can get it; None if it has less."""
    if not (folder / ABOUT).is_file():
        return None
    about = read_about(folder)
    if check_same(folder, about["definition"], asked) < size_of(asked):
        if aside.exists() and missing_in(folder):
            raise StoreError(
                f"the store at {folder} is being extended, to {size_of(about['definition']):,} samples: go "
                "on with that first"
            )
        return None
    if size_of(about["definition"]) > size_of(asked) and missing_in(folder):
        # A further round was begun: what is asked for lies aside.
        folder, about = aside, read_about(aside)
        check_same(folder, about["definition"], asked)
    size, units = size_of(about["definition"]), _whole(folder)
    count = -(-size // about["chunk"])
    incomplete = any(number not in units for number in range(count))
    reuse = _reuse(aside, asked) if incomplete and aside != folder else None
    return BlockStore(folder, size, about["chunk"], units, reuse)


def check_same(folder: Path, there: dict[str, Any], asked: dict[str, Any]) -> int:
    """Return the number of samples of a store, once it is known that they are of those asked for.

    More samples of the same design may be asked for, and more rounds or fewer.

    Raises
    ------
    StoreError
        If they are not; it says what differs.
    """
    here, asked = json.loads(json.dumps(there)), dict(asked)
    rounds = [one.pop("rounds", []) for one in (here, asked)]
    if here["samples"] < asked["samples"]:
        here["samples"] = asked["samples"]
        if isinstance(here.get("design"), dict) and "n" in asked.get("design", {}):
            here["design"]["n"] = asked["design"]["n"]
    elif all(a == b for a, b in zip(*rounds, strict=False)):
        rounds = []
    found = difference(here, asked) or (
        difference({"rounds": rounds[0]}, {"rounds": rounds[1]}) if rounds else None
    )
    if found is not None:
        place, old, new = found
        raise StoreError(
            f"the store at {folder} was made with {place} {old}, not {new}: take another path, or what it "
            "was made with"
        )
    return size_of(there)


def _whole(folder: Path) -> dict[int, Unit]:
    """Return the units of a store whose files are as they were written."""
    units = read_units(folder)
    # Both are written last: what is left of them says nothing of the units.
    if (folder / ATTRS).is_file() and not _is_json(folder / ".zattrs"):
        shutil.copyfile(folder / ATTRS, folder / ".zattrs")
    if (folder / METADATA).is_file() and not _is_json(folder / METADATA):
        (folder / METADATA).unlink()
    try:
        if units:
            check_store(folder)
            open_arrays(folder)
        readable = True
    except Exception:
        # Whatever the libraries say of broken metadata: what is there cannot be read.
        readable = False
    return {
        number: unit
        for number, unit in units.items()
        if readable and as_they_were(folder, unit.files, whole=True)
    }


def _reuse(folder: Path, asked: dict[str, Any]) -> Reuse | None:
    """Return what can be taken from a store of fewer samples."""
    if not (folder / ABOUT).is_file():
        return None
    about = read_about(folder)
    check_same(folder, about["definition"], asked)
    units = {number: unit for number, unit in _whole(folder).items() if number != END}
    return Reuse(folder, about["chunk"], units) if units else None


def _is_json(file: Path) -> bool:
    try:
        json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return True


def _beside(folder: Path, end: str) -> Path:
    return folder.with_name(f".{folder.name}.hipuq-{end}")
