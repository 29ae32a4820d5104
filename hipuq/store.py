"""Results in netCDF, outcomes in Zarr; nothing in them is ever unpickled."""

from __future__ import annotations

import os
import platform
import shutil
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import metadata
from pathlib import Path

import xarray as xr

from hipuq.errors import StoreError

RESULTS_NAME = "results.nc"
"""Name of the results file in an output folder."""


PACKAGES = ("hipuq", "numpy", "scipy", "xarray", "chaospy", "SALib", "python-flint")
"""Packages that numbers depend on."""


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that numbers depend on, as far as there are any."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return found


def save_results(results: xr.DataTree | xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write results to a netCDF file; an old file stays until the new one is complete.

    Parameters
    ----------
    results : DataTree or Dataset
    path : path
        File to write; its folder is made.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    file = Path(path)
    tree = results if isinstance(results, xr.DataTree) else xr.DataTree(results)
    part = file.with_name(file.name + ".part")
    with _reported("write", file):
        file.parent.mkdir(parents=True, exist_ok=True)
        tree.to_netcdf(part, engine="h5netcdf")
        part.replace(file)


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
    with _reported("write", file):
        shutil.copyfile(file, part)
        for name, dataset in groups.items():
            dataset.to_netcdf(part, mode="a", group=name, engine="h5netcdf")
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
        Groups ``<analysis>/<of>``, identical to what was saved.

    Raises
    ------
    StoreError
        If there is no such file, it cannot be read, or hipuq did not write it.
    """
    file = Path(path)
    if file.is_dir():
        file = file / RESULTS_NAME
    if not file.exists():
        raise StoreError(
            f"there are no results at {file}: give an output folder of hipuq run, or its {RESULTS_NAME}"
        )
    with _reported("read", file), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of files that are not netCDF, refused below
        with xr.open_datatree(file, engine="h5netcdf") as opened:
            tree = opened.load().copy()
    if not any("hipuq_version" in node.attrs for node in tree.subtree):
        raise StoreError(f"{file} is not a results file of hipuq: it has no attribute hipuq_version")
    return tree


def check_ours(file: Path) -> None:
    """Raise a StoreError unless a file is one of results that hipuq wrote; values are not read.

    Parameters
    ----------
    file : Path

    Raises
    ------
    StoreError
        If it cannot be read, or another program wrote it.
    """
    import h5netcdf

    with _reported("read", file), h5netcdf.File(file, "r") as opened:
        groups = [opened, *opened.groups.values()]
        ours = any(
            "hipuq_version" in one.attrs for group in groups for one in (group, *group.groups.values())
        )
    if not ours:
        raise StoreError(f"{file} is not a results file of hipuq: it has no attribute hipuq_version")


def save_outcomes(outcomes: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write samples or outcomes to a Zarr store; an old store stays until the new one is complete.

    Parameters
    ----------
    outcomes : Dataset
    path : path
        Folder to write; only a Zarr store or nothing is replaced.

    Raises
    ------
    StoreError
        If it cannot be written, or something else is there.
    """
    folder = Path(path)
    part, old = (folder.with_name(f".{folder.name}.hipuq-{end}") for end in ("part", "old"))
    with _reported("write", folder):
        if folder.exists() and not _is_store(folder):
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
        Folder that `save_outcomes` wrote.

    Returns
    -------
    Dataset
        Identical to what was saved.

    Raises
    ------
    StoreError
        If there is no such store, it cannot be read, or hipuq did not write it.
    """
    folder = Path(path)
    if not _is_store(folder):
        raise StoreError(f"there are no outcomes at {folder}: it is not a Zarr store")
    with _reported("read", folder):
        outcomes = xr.open_zarr(folder, chunks=None, consolidated=True)
    if "hipuq_version" not in outcomes.attrs:
        raise StoreError(f"{folder} is not a store of hipuq: it has no attribute hipuq_version")
    found: xr.Dataset = outcomes.drop_encoding()
    return found


def _is_store(folder: Path) -> bool:
    return (folder / ".zgroup").is_file() or (folder / "zarr.json").is_file()


@contextmanager
def _reported(action: str, path: Path) -> Iterator[None]:
    """Turn what the libraries raise about a file into one line."""
    try:
        yield
    except StoreError:
        raise
    except (OSError, ValueError, KeyError, TypeError, RuntimeError, AttributeError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error).splitlines()
        first = why if isinstance(why, str) else (why[0] if why else type(error).__name__)
        raise StoreError(f"cannot {action} {path}: {first}") from error
