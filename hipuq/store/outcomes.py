"""Outcomes in Zarr stores; nothing in them is ever unpickled."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import xarray as xr

from hipuq.errors import StoreError
from hipuq.store.arrays import open_arrays
from hipuq.store.completeness import is_store, missing_in
from hipuq.store.guarding import check_store
from hipuq.store.ledger import ABOUT
from hipuq.store.lock import locked
from hipuq.store.reporting import reported


def save_outcomes(outcomes: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write samples or outcomes to a Zarr store; an old store stays until the new one is complete.

    Parameters
    ----------
    outcomes : Dataset
        As from `hipuq.evaluate`, or samples as from `hipuq.design`.
    path : path
        Folder to write; only a Zarr store or nothing is replaced.

    Raises
    ------
    StoreError
        If it cannot be written, or something else is there.

    Examples
    --------
    >>> import tempfile
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> outcomes = hipuq.evaluate(model, model.nominal(friction=[0.4, 0.5]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     hipuq.save_outcomes(outcomes, f"{folder}/outcomes.zarr")
    ...     again = hipuq.load_outcomes(f"{folder}/outcomes.zarr").load()
    >>> again.identical(outcomes)
    True
    """
    folder = Path(path)
    part, old = (folder.with_name(f".{folder.name}.hipuq-{end}") for end in ("part", "saved"))
    with locked(folder), reported("write", folder):
        if old.exists() and not folder.exists():
            # A process was killed between the two names.
            old.rename(folder)
        if folder.exists() and not is_store(folder):
            raise StoreError(f"cannot write {folder}: something that is not a Zarr store is there")
        folder.parent.mkdir(parents=True, exist_ok=True)
        # A process that was killed may have left half of them.
        for half in (part, old):
            if half.exists():
                shutil.rmtree(half)
        # Version 2 of the format: version 3 has no settled strings yet.
        outcomes.drop_encoding().to_zarr(part, mode="w", zarr_format=2, consolidated=True)
        if folder.exists():
            folder.rename(old)
        part.rename(folder)
        if old.exists():
            shutil.rmtree(old)


def load_outcomes(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open samples or outcomes; values are read when they are used.

    Parameters
    ----------
    path : path
        Folder that `save_outcomes` wrote, or `hipuq.evaluate` with a store.

    Returns
    -------
    Dataset
        Identical to what was saved by `save_outcomes`, or written by `hipuq.evaluate` with a store.

    Raises
    ------
    StoreError
        If there is no such store, it cannot be read, or hipuq did not write it.

    Examples
    --------
    >>> import tempfile
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> outcomes = hipuq.evaluate(model, model.nominal(friction=[0.4, 0.5]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     hipuq.save_outcomes(outcomes, f"{folder}/outcomes.zarr")
    ...     again = hipuq.load_outcomes(f"{folder}/outcomes.zarr").load()
    >>> again.identical(outcomes)
    True
    """
    folder = Path(path)
    if (folder / ABOUT).is_file():
        with reported("read", folder):
            missing = missing_in(folder)
        if missing:
            raise StoreError(f"cannot read {folder}: {missing}; evaluate again with resume=True")
    with reported("read", folder):
        check_store(folder)
        outcomes = open_arrays(folder)
    if "hipuq_version" not in outcomes.attrs:
        raise StoreError(f"{folder} is not a store of hipuq: it has no attribute hipuq_version")
    return outcomes
