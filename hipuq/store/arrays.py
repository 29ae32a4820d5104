"""Zarr stores as they are opened here: without what readers look at first, which is written last."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import xarray as xr


def open_arrays(folder: Path) -> xr.Dataset:
    """Return the arrays of a store; values are read when they are used."""
    with quiet():
        arrays: xr.Dataset = xr.open_zarr(folder, chunks=None, consolidated=False)
    return arrays.drop_encoding()


@contextmanager
def quiet() -> Iterator[None]:
    """Let zarr list a store without a warning of each file that is not its own."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Object at")
        yield
