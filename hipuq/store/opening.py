"""A store is made, gone on with, extended or refused, by one run at a time."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from hipuq.differences import difference
from hipuq.errors import StoreError
from hipuq.store.arrays import open_arrays, write_metadata
from hipuq.store.blocks import ATTRS, ZATTRS, BlockStore, drop_table, plain, units_of
from hipuq.store.completeness import is_store, missing_in, size_of
from hipuq.store.guarding import check_store
from hipuq.store.ledger import (
    ABOUT,
    END,
    HALF,
    START,
    Unit,
    as_they_were,
    read_about,
    read_units,
    write_about,
)
from hipuq.store.lock import locked
from hipuq.store.reporting import reported
from hipuq.store.reuse import Reuse


@contextmanager
def opened(
    folder: Path,
    definition: Mapping[str, Any],
    variables: Iterable[str],
    block: int,
    *,
    resume: bool,
    replace: bool = False,
) -> Iterator[BlockStore]:
    """Open a store for writing; no other run can, until it is closed.

    Parameters
    ----------
    folder : Path
    definition : mapping
        What the outcomes follow from, JSON-able; ``"samples"`` is their number.
    variables : iterable of str
        Names of the data variables of the samples.
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
    about = {"definition": json.loads(json.dumps(definition, default=plain)), "variables": sorted(variables)}
    with locked(folder):
        with reported("write", folder):
            store, before = _begun(folder, about, block, resume, replace)
        try:
            yield store
        finally:
            if before is not None and not store.units:
                _undo(folder, before)
        if store.complete and store.folder == folder:
            for end in ("old", "replaced"):
                shutil.rmtree(_beside(folder, end), ignore_errors=True)


def _begun(
    folder: Path, about: dict[str, Any], block: int, resume: bool, replace: bool
) -> tuple[BlockStore, Path | None]:
    """Return the store to write to, and where the one is now that was there before it."""
    asked = about["definition"]
    if _is_unborn(folder):
        shutil.rmtree(folder)
    there = folder.exists()
    if there and not (folder / ABOUT).is_file() and not (replace and is_store(folder)):
        raise StoreError(f"cannot write {folder}: something that is not a store of hipuq is there")
    if there and not resume and not replace:
        raise StoreError(
            f"there is a store at {folder} already: go on with resume=True, or take another path"
        )
    aside = _beside(folder, "old" if resume else "replaced")
    if there and resume and (kept := _kept(folder, aside, about)) is not None:
        return kept, None
    if there and aside.exists() and not read_units(folder):
        # What lies aside has outcomes, this has none.
        shutil.rmtree(folder)
    elif there:
        shutil.rmtree(aside, ignore_errors=True)
        folder.rename(aside)
    try:
        reuse = _reuse(aside, about) if resume else None
        folder.mkdir(parents=True, exist_ok=True)
        size = size_of(asked)
        chunk = units_of(size, block)
        write_about(folder, {**about, "chunk": chunk})
    except BaseException:
        if there:
            _undo(folder, aside)
        raise
    return BlockStore(folder, size, chunk, {}, reuse), aside if there else None


def _undo(folder: Path, before: Path) -> None:
    """Put back the store that was there: nothing came of the new one."""
    with suppress(OSError):
        shutil.rmtree(folder, ignore_errors=True)
        before.rename(folder)


def _is_unborn(folder: Path) -> bool:
    """Say whether a folder is empty, or holds no more than the beginning of what a store is of."""
    if not folder.is_dir() or folder.is_symlink():
        return False
    return all(path.name == f"{ABOUT}{HALF}" for path in folder.iterdir())


def _kept(folder: Path, aside: Path, about: dict[str, Any]) -> BlockStore | None:
    """Return the store that is there, if it has what is asked for or can get it; None if it has less."""
    there = read_about(folder)
    relation = check_same(folder, there, about)
    if relation == FEWER:
        if aside.exists() and missing_in(folder):
            raise StoreError(
                f"the store at {folder} is being extended, to {size_of(there['definition']):,} samples: go "
                "on with that first"
            )
        return None
    units = _whole(folder)
    if relation == MORE and len([k for k in units if k >= 0]) * there["chunk"] < size_of(there["definition"]):
        # A further round was begun: what is asked for may lie aside, and is taken from here if it does not.
        if not (aside / ABOUT).is_file() or missing_in(aside):
            return None
        there = read_about(aside)
        if check_same(aside, there, about) != SAME:
            return None
        folder, units = aside, _whole(aside)
    size = size_of(there["definition"])
    incomplete = any(number not in units for number in range(-(-size // there["chunk"])))
    reuse = _reuse(aside, about) if incomplete and aside != folder else None
    return BlockStore(folder, size, there["chunk"], units, reuse)


SAME, FEWER, MORE = "same", "fewer", "more"
"""What a store has, against what is asked for: as many samples, fewer ones, or further rounds too."""


def check_same(folder: Path, there: Mapping[str, Any], asked: Mapping[str, Any]) -> str:
    """Return how much a store has of what is asked for, once it is known to be of that.

    More samples of the same design may be asked for, and more rounds or fewer.

    Parameters
    ----------
    folder : Path
    there, asked : mapping
        What it is of, and what it should be of: ``definition`` and ``variables``.

    Returns
    -------
    str
        `SAME`, `FEWER` or `MORE`.

    Raises
    ------
    StoreError
        If it is of something else; it says what differs.
    """
    old, new = json.loads(json.dumps([there["definition"], asked["definition"]]))
    rounds = [one.pop("rounds", []) for one in (old, new)]
    relation = SAME
    if old["samples"] < new["samples"]:
        relation = FEWER
        old["samples"] = new["samples"]
        if isinstance(old.get("design"), dict) and "n" in new.get("design", {}):
            old["design"]["n"] = new["design"]["n"]
    elif rounds[0] != rounds[1]:
        relation = FEWER if len(rounds[0]) < len(rounds[1]) else MORE
    found = difference(old, new) or difference(
        {"variables of the samples": sorted(there["variables"])},
        {"variables of the samples": sorted(asked["variables"])},
    )
    if found is None and not (relation == FEWER and there["definition"]["samples"] < new["samples"]):
        shared = min(map(len, rounds))
        found = difference({"rounds": rounds[0][:shared]}, {"rounds": rounds[1][:shared]})
    if found is not None:
        place, before, now = found
        raise StoreError(
            f"the store at {folder} was made with {place} {before}, not {now}: take another path, or what it "
            "was made with"
        )
    return relation


def _whole(folder: Path) -> dict[int, Unit]:
    """Return the units of a store whose files are as they were written."""
    units = read_units(folder)
    try:
        # All of these are written last: what is left of them says nothing of the units.
        if not (END in units and as_they_were(folder, units[END].files, whole=True)):
            drop_table(folder)
            if (folder / ATTRS).is_file():
                shutil.copyfile(folder / ATTRS, folder / ZATTRS)
            write_metadata(folder)
        if units:
            check_store(folder)
            arrays = open_arrays(folder)
            named = {str(name) for name, own in arrays.variables.items() if own.dtype.kind in "biufc"}
            over = {name for name in named if "sample" in arrays[name].dims}
        readable = START in units and as_they_were(folder, units[START].files, whole=True)
    except Exception:
        # Whatever the libraries say of broken metadata: what is there cannot be read.
        readable = False
    return {
        number: unit
        for number, unit in units.items()
        if readable
        and (number < 0 or over <= {name.partition("/")[0] for name in unit.files})
        and as_they_were(folder, unit.files, whole=True)
    }


def _reuse(folder: Path, asked: dict[str, Any]) -> Reuse | None:
    """Return what can be taken from a store of other samples of the same design, if it is one."""
    if not (folder / ABOUT).is_file():
        return None
    try:
        about = read_about(folder)
        check_same(folder, about, asked)
    except StoreError:
        return None
    units = {number: unit for number, unit in _whole(folder).items() if number >= 0}
    return Reuse(folder, about["chunk"], units) if units else None


def _beside(folder: Path, end: str) -> Path:
    return folder.with_name(f".{folder.name}.hipuq-{end}")
