"""Results in netCDF; nothing in them is ever unpickled."""

from __future__ import annotations

import os
import shutil
import warnings
from collections.abc import Mapping
from pathlib import Path

import xarray as xr

from hipuq.errors import StoreError
from hipuq.store.inspecting import check_inside
from hipuq.store.reporting import reported

RESULTS_NAME = "results.nc"
"""Name of the results file in an output folder."""


def save_results(results: xr.DataTree | xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write results to a netCDF file; an old file stays until the new one is complete.

    Parameters
    ----------
    results : DataTree or Dataset
        As from `hipuq.run` or `hipuq.estimate`; a tree as from `hipuq.run_study`.
    path : path
        File to write; its folder is made.

    Raises
    ------
    StoreError
        If it cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> inputs = model.inputs(friction=cp.Uniform(0.0, 1.0))
    >>> results = hipuq.run(
    ...     model, inputs, method="monte_carlo", n=100, of="margin", rng=1
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     hipuq.save_results(results, f"{folder}/results.nc")
    ...     again = hipuq.load_results(f"{folder}/results.nc")
    >>> again.to_dataset().identical(results)
    True
    """
    file = Path(path)
    tree = results if isinstance(results, xr.DataTree) else xr.DataTree(results)
    part = file.with_name(file.name + ".part")
    with reported("write", file):
        file.parent.mkdir(parents=True, exist_ok=True)
        # What is there may be a link to anything.
        part.unlink(missing_ok=True)
        tree.to_netcdf(part, engine="h5netcdf")
        _put(part, file)


def add_results(groups: Mapping[str, xr.Dataset], path: str | os.PathLike[str]) -> None:
    """Add groups to a results file; the old file stays until the new one is complete.

    Parameters
    ----------
    groups : mapping of Dataset
        By name, such as ``"printed/any_unstable"``; none that the file has already.
    path : path
        A file that `save_results` wrote.

    Raises
    ------
    StoreError
        If it cannot be read or written.
    """
    file = Path(path)
    part = file.with_name(file.name + ".part")
    check_ours(file)
    with reported("write", file):
        part.unlink(missing_ok=True)
        shutil.copyfile(file, part)
        for name, dataset in groups.items():
            dataset.to_netcdf(part, mode="a", group=name, engine="h5netcdf")
        _put(part, file)


def _put(part: Path, file: Path) -> None:
    """Give a file its name once the disk has all of it."""
    with part.open("rb+") as stream:
        os.fsync(stream.fileno())
    part.replace(file)


def load_results(path: str | os.PathLike[str]) -> xr.DataTree:
    """Read results into memory.

    Parameters
    ----------
    path : path
        A results file, or the output folder that holds it.

    Returns
    -------
    DataTree
        Identical to what was saved: groups ``<analysis>/<of>`` of a study, a single Dataset as the root.

    Raises
    ------
    StoreError
        If there is no such file, it cannot be read, another program or a later hipuq wrote it, it is too
        large, or it leads to other files.

    Examples
    --------
    >>> import tempfile
    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> inputs = model.inputs(friction=cp.Uniform(0.0, 1.0))
    >>> results = hipuq.run(
    ...     model, inputs, method="monte_carlo", n=100, of="margin", rng=1
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     hipuq.save_results(results, f"{folder}/results.nc")
    ...     again = hipuq.load_results(f"{folder}/results.nc")
    >>> again.to_dataset().identical(results)
    True
    """
    file = Path(path)
    if file.is_dir():
        file = file / RESULTS_NAME
    if not file.exists():
        raise StoreError(
            f"there are no results at {file}: give an output folder of hipuq run, or its {RESULTS_NAME}"
        )
    check_ours(file)
    with reported("read", file), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of files that are HDF5 and not netCDF
        with xr.open_datatree(file, engine="h5netcdf") as opened:
            tree = opened.load().copy()
    return tree


def check_ours(file: Path) -> None:
    """Raise a StoreError unless a file is one of results that this hipuq can read; values are not read.

    Parameters
    ----------
    file : Path

    Raises
    ------
    StoreError
        If it cannot be read, another program or a later hipuq wrote it, it is too large, or it leads to other
        files.
    """
    with reported("read", file):
        check_inside(file)
