"""Zarr stores as they are opened and written here.

Chunks are written without zarr's own machinery: it hands every one to another thread, which takes
milliseconds where the interpreter is busy evaluating. Their format is fixed, and zarr reads them. Metadata
are put together here too, since zarr warns of every file in a store that is not its own.
"""

from __future__ import annotations

import itertools
import json
import os
import shutil
import zlib
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.store.ledger import HALF, Files

METADATA = ".zmetadata"
"""File of all metadata together."""


def open_arrays(folder: Path) -> xr.Dataset:
    """Return the arrays of a store; values are read when they are used."""
    arrays: xr.Dataset = xr.open_zarr(folder, chunks=None, consolidated=True)
    # Not drop_encoding: older releases of xarray read all values for it.
    for values in arrays.variables.values():
        values.encoding = {}
    arrays.encoding = {}
    return arrays


def outputs_of(given: xr.Dataset) -> dict[Hashable, xr.DataArray]:
    """Return what a model gave: xarray takes one named like a dim of its own for a coordinate."""
    named = {name: values for name, values in given.coords.items() if name in values.dims and values.ndim > 1}
    return {**given.data_vars, **named}


def add_arrays(folder: Path, dataset: xr.Dataset, encoding: Mapping[Any, Any]) -> None:
    """Write arrays to a store, in place of those of the same name; what else is there stays.

    Parameters
    ----------
    folder : Path
        The store; it need not be a group yet.
    dataset : Dataset
    encoding : mapping
        As xarray takes it.
    """
    made = folder.with_name(f".{folder.name}.hipuq-made")
    shutil.rmtree(made, ignore_errors=True)
    # Version 2 of the format: version 3 has no settled strings yet.
    dataset.to_zarr(made, mode="w", zarr_format=2, consolidated=False, encoding=encoding)
    for path in made.iterdir():
        target = folder / path.name
        if path.is_dir() or not target.exists():
            shutil.rmtree(target, ignore_errors=True)
            path.rename(target)
    shutil.rmtree(made)


def write_metadata(folder: Path) -> None:
    """Write what readers look at first: all metadata of a store together."""
    places = [".zgroup", ".zattrs", *(f"*/{name}" for name in (".zarray", ".zattrs"))]
    files = [file for place in places for file in sorted(folder.glob(place))]
    metadata = {file.relative_to(folder).as_posix(): json.loads(file.read_bytes()) for file in files}
    half = folder / f"{METADATA}{HALF}"
    half.write_text(json.dumps({"metadata": metadata, "zarr_consolidated_format": 1}))
    os.replace(half, folder / METADATA)


def write_chunks(folder: Path, name: str, array: Any, values: NDArray[Any], axis: int, number: int) -> Files:
    """Write the chunks of an array that hold some of its samples; each is there whole or not at all.

    Parameters
    ----------
    folder : Path
        The store.
    name : str
        The array.
    array : zarr.Array
        Of format 2, for its chunks, type and codec.
    values : array
        All values of these samples, in the order of dims of the array.
    axis : int
        That of the samples.
    number : int
        Of the chunks along it.

    Returns
    -------
    dict
        File in the store -> size in bytes and CRC-32.
    """
    codec, lengths = array.metadata.compressor, array.chunks
    files: Files = {}
    places = [range(-(-n // length)) for n, length in zip(values.shape, lengths, strict=True)]
    places[axis] = range(1)
    for place in itertools.product(*places):
        starts = [k * length for k, length in zip(place, lengths, strict=True)]
        part = values[tuple(slice(a, a + length) for a, length in zip(starts, lengths, strict=True))]
        if part.shape != lengths:
            # All chunks of an array are equally long: what is not there yet, or nowhere, is missing.
            whole = np.full(lengths, np.nan if array.dtype.kind in "fc" else 0, array.dtype)
            whole[tuple(slice(0, n) for n in part.shape)] = part
            part = whole
        part = np.ascontiguousarray(part, array.dtype)
        data = bytes(codec.encode(part)) if codec is not None else part.tobytes()
        key = [*place[:axis], number, *place[axis + 1 :]]
        file = f"{name}/{'.'.join(map(str, key))}"
        half = folder / f"{file}{HALF}"
        half.write_bytes(data)
        os.replace(half, folder / file)
        files[file] = (len(data), zlib.crc32(data))
    return files
