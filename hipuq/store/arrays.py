"""Zarr stores as they are opened and written here.

They are opened without what readers look at first, which is written last. Chunks are written without zarr's
own machinery: it hands every one to another thread, which takes milliseconds where the interpreter is busy
evaluating. Their format is fixed, and zarr reads them.
"""

from __future__ import annotations

import itertools
import os
import warnings
import zlib
from collections.abc import Hashable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.store.ledger import HALF, Files


def open_arrays(folder: Path) -> xr.Dataset:
    """Return the arrays of a store; values are read when they are used."""
    with quiet():
        arrays: xr.Dataset = xr.open_zarr(folder, chunks=None, consolidated=False)
    return arrays.drop_encoding()


def outputs_of(given: xr.Dataset) -> dict[Hashable, xr.DataArray]:
    """Return what a model gave: xarray takes one named like a dim of its own for a coordinate."""
    named = {name: values for name, values in given.coords.items() if name in values.dims and values.ndim > 1}
    return {**given.data_vars, **named}


@contextmanager
def quiet() -> Iterator[None]:
    """Let zarr list a store without a warning of each file that is not its own."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Object at")
        yield


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
