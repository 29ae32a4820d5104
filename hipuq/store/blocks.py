"""A Zarr store of outcomes that is written unit by unit, and goes on where it was cut off."""

from __future__ import annotations

import itertools
import json
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from hipuq.errors import StoreError
from hipuq.store.arrays import METADATA, add_arrays, open_arrays, outputs_of, write_chunks, write_metadata
from hipuq.store.failures import FAILURES, MOST, failure_table
from hipuq.store.guarding import check_array_name
from hipuq.store.ledger import ABOUT, END, START, Files, Unit, add_unit, files_of
from hipuq.store.reporting import reported
from hipuq.store.reuse import Reuse

UNITS, STEPS, STEP = 64, 64, 1024
"""A store has about so many units, each of so many steps at most, each of so many samples at most."""

ATTRS = "hipuq.attrs.json"
"""Attributes as xarray wrote them at first: the last ones replace them, and could be cut off."""

ZATTRS = ".zattrs"
"""Attributes."""

CHUNK_BYTES = 2**26
"""Largest chunk [byte], if it can be divided."""


class BlockStore:
    """A store that is open for writing.

    Attributes
    ----------
    folder : Path
    size : int
        Number of samples.
    chunk : int
        Samples in a unit, a chunk of each array.
    units : dict
        Number of a complete unit -> what the ledger says of it.
    reuse : Reuse or None
        Outcomes of fewer samples, which need not be evaluated again.
    labels : Dataset
        Coordinates over ``sample`` that are no numbers, of all samples.
    """

    def __init__(
        self, folder: Path, size: int, chunk: int, units: dict[int, Unit], reuse: Reuse | None
    ) -> None:
        self.folder, self.size, self.chunk, self.units, self.reuse = folder, size, chunk, units, reuse
        self.labels = xr.Dataset()
        self._began = time.perf_counter()
        self._arrays: dict[str, Any] = {}

    @property
    def open_units(self) -> list[int]:
        """Numbers of the units that are not complete."""
        return [k for k in range(-(-self.size // self.chunk)) if k not in self.units]

    @property
    def done(self) -> int:
        """Number of samples in complete units."""
        rows = [self.rows(number) for number in self.units if number >= 0]
        return sum(one.stop - one.start for one in rows)

    @property
    def complete(self) -> bool:
        """Whether there is nothing left to write."""
        return END in self.units and not self.open_units

    @property
    def failed(self) -> int:
        """Number of failed samples."""
        return sum(unit.failed for unit in self.units.values())

    @property
    def failures(self) -> dict[int, str]:
        """Row of failed samples -> message, in order, as many as are kept."""
        return dict(sorted(pair for unit in self.units.values() for pair in unit.failures.items()))

    @property
    def undecided(self) -> int:
        """Number of undecided samples."""
        return sum(unit.undecided for unit in self.units.values())

    @property
    def seconds(self) -> float:
        """Time that its units took [s]."""
        return sum(unit.seconds for unit in self.units.values())

    def forget_failed(self) -> None:
        """Take units with failed samples for incomplete."""
        failed = [number for number, unit in self.units.items() if unit.failed]
        for number in failed:
            del self.units[number]
        if failed:
            self.units.pop(END, None)

    def rows(self, number: int) -> slice:
        """Return the rows of a unit."""
        return slice(number * self.chunk, min((number + 1) * self.chunk, self.size))

    def example(self, samples: xr.Dataset) -> xr.Dataset | None:
        """Return outputs of one sample, None without a complete unit.

        Parameters
        ----------
        samples : Dataset
            Any samples of the design: what they hold is no output.
        """
        numbers = [number for number in self.units if number >= 0]
        if not numbers:
            return None
        row = self.rows(min(numbers)).start
        there = open_arrays(self.folder)
        there = there.drop_vars([name for name in (*samples.variables, *FAILURES) if name in there.variables])
        named = [name for name, values in outputs_of(there).items() if "sample" in values.dims]
        example: xr.Dataset = there[named].isel(sample=slice(row, row + 1)).load()
        return example

    def check_samples(self, samples: Callable[[int, int], xr.Dataset]) -> None:
        """Check that the outcomes that are there are of the samples that are given.

        Parameters
        ----------
        samples : callable
            First row and the one after the last -> samples.

        Raises
        ------
        StoreError
            If a value differs.
        """
        with reported("read", self.folder):
            there = open_arrays(self.folder) if any(number >= 0 for number in self.units) else xr.Dataset()
            for rows in (self.rows(number) for number in sorted(self.units) if number >= 0):
                for name, values in samples(rows.start, rows.stop).variables.items():
                    if "sample" in values.dims and values.dtype.kind in "biufc":
                        self._compare(str(name), there.variables.get(name), values, rows)

    def _compare(self, name: str, old: xr.Variable | None, values: xr.Variable, rows: slice) -> None:
        """Raise a StoreError unless values over some rows are those that are there."""
        what = f"the store at {self.folder} is of other samples: {name}"
        if old is None or old.dims != values.dims:
            raise StoreError(f"{what} differs")
        there = old.isel(sample=rows).transpose("sample", ...).values
        here = values.transpose("sample", ...).values
        if there.shape != here.shape:
            raise StoreError(f"{what} differs")
        differs = (there != here) & ~((there != there) & (here != here))
        if differs.any():
            place = tuple(np.argwhere(differs)[0])
            raise StoreError(
                f"{what} of sample {rows.start + place[0]} is {there[place]} there, {here[place]} here"
            )

    def write(
        self, number: int, outcomes: xr.Dataset, failures: Mapping[int, str], lost: int, undecided: int
    ) -> None:
        """Write a unit; when this returns it is complete.

        Parameters
        ----------
        number : int
        outcomes : Dataset
            Of its rows.
        failures : mapping
            Row of a failed sample in the whole -> message.
        lost : int
            How many of them gave nothing.
        undecided : int

        Raises
        ------
        StoreError
            If it cannot be written.
        """
        with self._writing():
            if not self._arrays:
                self._open(outcomes)
            files: Files = {}
            longer = False
            for name, array in self._arrays.items():
                values, axis = outcomes[name].values, outcomes[name].dims.index("sample")
                shape = (*values.shape[:axis], self.size, *values.shape[axis + 1 :])
                if (longest := tuple(np.maximum(shape, array.shape).tolist())) != array.shape:
                    array.resize(longest)
                    longer = True
                files |= write_chunks(self.folder, name, array, values, axis, number)
            if longer:
                self._note(START)
            now = time.perf_counter()
            kept = dict(itertools.islice(failures.items(), MOST))
            unit = Unit(number, files, kept, len(failures), lost, undecided, now - self._began)
            add_unit(self.folder, unit)
            self.units[number], self._began = unit, now

    def finish(self, attrs: Mapping[Any, Any]) -> None:
        """Write attributes, the table of failures and what readers look at first.

        Parameters
        ----------
        attrs : mapping
            Attributes of the outcomes.
        """
        with self._writing():
            drop_table(self.folder)
            if failures := self.failures:
                add_arrays(self.folder, failure_table(failures), {})
            whole = json.loads((self.folder / ATTRS).read_text()) | dict(attrs)
            (self.folder / ZATTRS).write_text(json.dumps(whole, indent=1, default=plain))
            self._note(END)

    def _note(self, number: int) -> None:
        """Note in the ledger what was written beside the units: at first, or at the end."""
        write_metadata(self.folder)
        arrays = [file for name in self._arrays for file in (f"{name}/.zarray", f"{name}/.zattrs")]
        if number == END:
            names = [ZATTRS, METADATA, *files_in(self.folder, FAILURES)]
        else:
            rest = [path.name for path in self.folder.iterdir() if path.is_dir()]
            fixed = set(rest) - self._arrays.keys() - set(FAILURES)
            names = [*arrays, *files_in(self.folder, sorted(fixed))]
        unit = Unit(number, files_of(self.folder, names))
        add_unit(self.folder, unit)
        self.units[number] = unit

    def _open(self, outcomes: xr.Dataset) -> None:
        """Open the arrays, or make them like a unit's outcomes."""
        names = [
            str(name)
            for name, values in outcomes.variables.items()
            if "sample" in values.dims and values.dtype.kind in "biufc"
        ]
        new = not any(number >= 0 for number in self.units)
        if new:
            clear(self.folder)
            self.units.clear()
            self._make(outcomes, names)
        group = _group(self.folder)
        self._arrays = {name: group[name] for name in names}
        if new:
            self._note(START)

    def _make(self, outcomes: xr.Dataset, names: list[str]) -> None:
        encoding = {}
        for name in names:
            check_array_name(name)
            encoding[name] = {"chunks": chunks_of(outcomes[name], self.chunk)}
        empty = outcomes.drop_vars(self.labels.variables, errors="ignore").isel(sample=slice(0, 0))
        empty = empty.drop_attrs(deep=False).drop_encoding()
        add_arrays(self.folder, empty, encoding)
        group = _group(self.folder)
        for name in names:
            shape = [self.size if dim == "sample" else n for dim, n in outcomes[name].sizes.items()]
            group[name].resize(tuple(shape))
        if self.labels.variables:
            add_arrays(self.folder, self.labels, {})
        attrs = dict(group.attrs)
        # Where xarray looks for coordinates that no variable names.
        coordinates = [str(attrs.get("coordinates", "")), *map(str, self.labels.variables)]
        attrs["coordinates"] = " ".join(coordinates).strip()
        for name in (ATTRS, ZATTRS):
            (self.folder / name).write_text(json.dumps(attrs, default=plain))

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            with reported("write", self.folder):
                yield
        except StoreError as error:
            raise StoreError(
                f"{error}; what was complete stays: go on with resume=True, or --resume"
            ) from error


def labels_of(samples: xr.Dataset) -> xr.Dataset:
    """Return the coordinates over ``sample`` that are no numbers."""
    named = [
        name
        for name, values in samples.coords.items()
        if "sample" in values.dims and values.dtype.kind not in "biufc"
    ]
    return xr.Dataset(coords={name: samples[name].variable for name in named})


def units_of(size: int, block: int) -> int:
    """Return the samples of a unit: about a 64th of all.

    At least a step, which is what the model takes, or 1024 if it takes more; at most 64 steps.

    Parameters
    ----------
    size : int
        Number of all.
    block : int
        Samples that the model takes at a time, at most.
    """
    step = min(block, STEP)
    return min(max(-(-size // (UNITS * step)), 1), STEPS) * step


def clear(folder: Path) -> None:
    """Remove everything from a store but what it is of."""
    for path in folder.iterdir():
        if path.name != ABOUT:
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def drop_table(folder: Path) -> None:
    """Remove the table of failures."""
    for name in FAILURES:
        shutil.rmtree(folder / name, ignore_errors=True)


def files_in(folder: Path, names: Iterable[str]) -> list[str]:
    """Return the files of arrays, as paths in the store."""
    return [f"{name}/{file.name}" for name in names for file in sorted((folder / name).glob("*"))]


def chunks_of(values: xr.DataArray, length: int) -> tuple[int, ...]:
    """Return the lengths of chunks: that of a unit over ``sample``, else whole unless that is large."""
    lengths = [length if dim == "sample" else max(1, n) for dim, n in values.sizes.items()]
    while np.prod(lengths, dtype=float) * values.dtype.itemsize > CHUNK_BYTES:
        other = [k for k, dim in enumerate(values.dims) if dim != "sample" and lengths[k] > 1]
        if not other:
            break
        longest = max(other, key=lambda k: lengths[k])
        lengths[longest] = -(-lengths[longest] // 2)
    return tuple(lengths)


def plain(value: Any) -> Any:
    """Return an attribute as JSON has it, one of numpy among them."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _group(folder: Path) -> Any:
    import zarr

    return zarr.open_group(folder, mode="r+", zarr_format=2, use_consolidated=False)
