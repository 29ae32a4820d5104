"""Zarr stores looked through before anything in them is opened.

What the metadata of a store ask for is done by whoever opens it: codecs that unpickle, arrays larger than
any memory, files outside the folder. Stores of hipuq ask for none of it.
"""

from __future__ import annotations

import json
import math
import os
import re
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from hipuq.errors import StoreError
from hipuq.schema import COORDINATES
from hipuq.store.inspecting import check_version
from hipuq.store.reporting import check_plain_file, one_line

CODECS = frozenset(["blosc", "zstd", "zlib", "gzip", "lz4", "crc32", "shuffle", "vlen-utf8"])
"""Codecs that are known to do nothing but pack numbers and text; ``pickle`` runs what it is given."""

METADATA_MAXIMUM = 2**24
"""Largest file of metadata [byte]."""

CHUNK_MAXIMUM = 2**28
"""Largest chunk of an array [byte]; whole chunks are read."""

INDEX_MAXIMUM = 2**30
"""Largest coordinate [byte]: one along its own dim is read when a store is opened."""

ARRAY_MAXIMUM = 2**44
"""Largest array [byte]."""

_NAME = re.compile(r"\w[^/\\:\x00-\x1f\x7f]*")
_PLACE = re.compile(r"(?:(?P<name>[^/]*)/)?(?P<kind>\.zarray|\.zattrs|\.zgroup)")
_DTYPE = re.compile(r"[<>|]([biufcU])([0-9]{1,6})", re.ASCII)
_TEXT = "|O"


def check_store(folder: Path) -> None:
    """Raise a StoreError unless a Zarr store can be opened with nothing to fear; no array is read.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    StoreError
        If it is no store of format 2, a later hipuq wrote it, its metadata are broken or too large, it asks
        for a codec that is none of `CODECS` or for other values than numbers and text, or something in it is
        a link, a pipe or a device.
    """
    if not folder.is_dir():
        raise StoreError(f"there are no outcomes at {folder}: it is not a folder")
    files = {place: path for place, path in _files(folder) if _PLACE.fullmatch(place)}
    if ".zgroup" not in files:
        raise StoreError(f"there are no outcomes at {folder}: it is not a Zarr store of format 2")
    for place, path in files.items():
        _check_metadata(folder, place, _read(path))
    joined = folder / ".zmetadata"
    if joined.exists():
        found = _read(joined).get("metadata")
        if not isinstance(found, dict):
            raise StoreError(f"{joined} holds no metadata")
        for place, own in found.items():
            _check_metadata(folder, place, own)


def _files(folder: Path, place: str = "") -> Iterator[tuple[str, Path]]:
    """Yield every file of a store with its place in it; arrays are one folder each."""
    with os.scandir(folder) as entries:
        for entry in entries:
            own, path = f"{place}{entry.name}", Path(entry.path)
            mode = entry.stat(follow_symlinks=False).st_mode
            if entry.name == "zarr.json":
                raise StoreError(f"{path} is of format 3 of Zarr: stores of hipuq are of format 2")
            if stat.S_ISDIR(mode) and not place:
                yield from _files(path, f"{own}/")
            elif stat.S_ISREG(mode):
                yield own, path
            else:
                raise StoreError(f"{path} is neither a chunk nor an array: links and pipes are not followed")


def _read(file: Path) -> dict[str, Any]:
    """Return a file of metadata."""
    try:
        check_plain_file(file, METADATA_MAXIMUM)
        found = json.loads(file.read_bytes())
    except StoreError:
        raise
    except (OSError, ValueError, RecursionError) as error:
        raise StoreError(f"cannot read {file}: {one_line(str(error))}") from error
    if not isinstance(found, dict):
        raise StoreError(f"cannot read {file}: it holds no metadata")
    return found


def _check_metadata(folder: Path, place: str, own: Any) -> None:
    """Raise a StoreError for metadata, at their place in the store, that hipuq does not write."""
    known = _PLACE.fullmatch(place)
    name = None if known is None else known["name"]
    if known is None or not (name is None or _NAME.fullmatch(name)) or not isinstance(own, dict):
        raise StoreError(f"{folder} has metadata of {one_line(place)[:80]!r}, which can be no array of it")
    if known["kind"] == ".zarray":
        try:
            _check_array(name or "", own)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            why = one_line(str(error)) if type(error) is ValueError else "they are not complete"
            raise StoreError(f"the metadata of {place} in {folder} cannot be used: {why}") from error
    elif place == ".zattrs" and "hipuq_version" in own:
        check_version(folder, own["hipuq_version"])


def _check_array(name: str, own: Mapping[str, Any]) -> None:
    """Raise a ValueError unless an array is one of numbers or text, of a size that can be."""
    if own["zarr_format"] != 2 or own["order"] not in ("C", "F"):
        raise ValueError("format or order are others")
    codecs = [own["compressor"], *(own["filters"] or ())]
    names = [codec["id"] for codec in codecs if codec is not None]
    for codec in names:
        if codec not in CODECS:
            raise ValueError(f"codec {str(codec)[:40]!r} is none of {', '.join(sorted(CODECS))}")
    known = _DTYPE.fullmatch(own["dtype"])
    if known is None and not (own["dtype"] == _TEXT and "vlen-utf8" in names):
        raise ValueError(f"dtype {str(own['dtype'])[:40]!r} is neither of numbers nor of text")
    shape, chunks = own["shape"], own["chunks"]
    if len(shape) != len(chunks) or len(shape) > 8 or not all(map(_is_length, [*shape, *chunks])):
        raise ValueError("shape and chunks do not go together")
    width = 64 if known is None else int(known[2]) * (4 if known[1] == "U" else 1)
    if math.prod(shape) * width > (INDEX_MAXIMUM if name in COORDINATES else ARRAY_MAXIMUM):
        raise ValueError(f"shape {str(shape)[:60]} is too large")
    if math.prod(chunks) * width > CHUNK_MAXIMUM:
        raise ValueError(f"the chunks {str(chunks)[:60]} are too large")


def _is_length(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**63


def check_array_name(name: str) -> None:
    """Raise a StoreError unless an array of a store may have a name.

    Parameters
    ----------
    name : str

    Raises
    ------
    StoreError
        If it leads elsewhere, or begins with a sign.
    """
    if not _NAME.fullmatch(name):
        raise StoreError(
            f"{one_line(repr(name))} cannot be stored: a name begins with a letter, a digit or '_' and has "
            "no slash and no colon; rename it"
        )
