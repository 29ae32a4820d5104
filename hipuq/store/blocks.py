"""A Zarr store of outcomes that is written unit by unit, and goes on where it was cut off."""

from __future__ import annotations

import itertools
import json
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from hipuq.differences import difference
from hipuq.errors import StoreError
from hipuq.store.arrays import open_arrays, quiet
from hipuq.store.guarding import check_store
from hipuq.store.ledger import ABOUT, Unit, add_unit, as_they_were, files_of, read_about, read_units
from hipuq.store.lock import locked
from hipuq.store.reporting import reported
from hipuq.store.reuse import Reuse

UNITS, BLOCKS = 64, 64
"""A store has about so many units, but none of more blocks of the model than this."""

ATTRS = "hipuq.attrs.json"
"""Attributes as xarray wrote them at first: the last ones replace them, and could be cut off."""

METADATA = ".zmetadata"
"""What readers look at first: all metadata together."""

END = -1
"""Number of the unit that holds what is written at the end."""

FAILURES = ("failed_sample", "failure_message")
"""Variables of the table of failures, over ``failure``."""


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
        rows = [self.rows(number) for number in self.units if number != END]
        return sum(one.stop - one.start for one in rows)

    @property
    def complete(self) -> bool:
        """Whether there is nothing left to write."""
        return END in self.units and not self.open_units

    @property
    def failures(self) -> dict[int, str]:
        """Row of each failed sample -> message, in order."""
        return dict(sorted(pair for unit in self.units.values() for pair in unit.failures.items()))

    @property
    def undecided(self) -> int:
        """Number of undecided samples."""
        return sum(unit.undecided for unit in self.units.values())

    @property
    def seconds(self) -> float:
        """Time that its units took [s]."""
        return sum(unit.seconds for unit in self.units.values())

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
        numbers = [number for number in self.units if number != END]
        if not numbers:
            return None
        row = self.rows(min(numbers)).start
        there = open_arrays(self.folder)
        there = there.drop_vars([name for name in there.variables if name in samples.variables])
        named = [name for name, values in there.data_vars.items() if "sample" in values.dims]
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
        numbers = sorted(number for number in self.units if number != END)
        if not numbers:
            return
        with reported("read", self.folder):
            there = open_arrays(self.folder)
            for rows in map(self.rows, numbers):
                for name, values in samples(rows.start, rows.stop).data_vars.items():
                    old = there[name].isel(sample=rows) if name in there else None
                    if old is None or old.dims != values.dims or old.shape != values.shape:
                        raise StoreError(f"the store at {self.folder} is of other samples: {name} differs")
                    differs = (old.values != values.values).reshape(values.shape)
                    if differs.any():
                        axis = values.dims.index("sample")
                        place = np.argwhere(np.moveaxis(differs, axis, 0))[0]
                        index = (*place[1 : axis + 1], place[0], *place[axis + 1 :])
                        raise StoreError(
                            f"the store at {self.folder} is of other samples: {name} of sample "
                            f"{rows.start + place[0]} is {old.values[index]} there, "
                            f"{values.values[index]} here"
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
            rows, names = self.rows(number), []
            for name, array in self._arrays.items():
                values, axis = outcomes[name], outcomes[name].dims.index("sample")
                shape = (*values.shape[:axis], self.size, *values.shape[axis + 1 :])
                longest = tuple(np.maximum(shape, array.shape).tolist())
                if longest != array.shape:
                    array.resize(longest)
                place: list[slice] = [slice(0, n) for n in shape]
                place[axis] = rows
                array[tuple(place)] = values.values
                grid = [range(-(-n // c)) for n, c in zip(shape, array.chunks, strict=True)]
                grid[axis] = range(number, number + 1)
                names += [f"{name}/{'.'.join(map(str, key))}" for key in itertools.product(*grid)]
            now = time.perf_counter()
            unit = Unit(
                number, files_of(self.folder, names), dict(failures), lost, undecided, now - self._began
            )
            add_unit(self.folder, unit)
            self.units[number], self._began = unit, now

    def finish(self, attrs: Mapping[Any, Any]) -> None:
        """Write attributes, the table of failures and what readers look at first.

        Parameters
        ----------
        attrs : mapping
            Attributes of the outcomes.
        """
        import zarr

        with self._writing():
            if failures := self.failures:
                table = failure_table(failures)
                for name in FAILURES:
                    shutil.rmtree(self.folder / name, ignore_errors=True)
                with quiet():
                    table.to_zarr(self.folder, mode="a", zarr_format=2, consolidated=False)
            whole = json.loads((self.folder / ATTRS).read_text()) | dict(attrs)
            (self.folder / ".zattrs").write_text(json.dumps(whole, indent=1))
            with quiet():
                zarr.consolidate_metadata(str(self.folder), zarr_format=2)
            unit = Unit(
                END, files_of(self.folder, [".zattrs", ".zmetadata", *_chunks(self.folder, FAILURES)])
            )
            add_unit(self.folder, unit)
            self.units[END] = unit

    def _open(self, outcomes: xr.Dataset) -> None:
        """Open the arrays, or make them like a unit's outcomes."""
        import zarr

        names = [
            str(name)
            for name, values in outcomes.variables.items()
            if "sample" in values.dims and values.dtype.kind in "biufc"
        ]
        if not any(number != END for number in self.units):
            clear(self.folder)
            self._make(outcomes, names)
        group = _group(self.folder)
        # Chunks that hold nothing but zeros or NaN are written too: what is not there is known to be missing.
        with zarr.config.set({"array.write_empty_chunks": True}):
            self._arrays = {name: group[name] for name in names}

    def _make(self, outcomes: xr.Dataset, names: list[str]) -> None:
        encoding = {}
        for name in names:
            values = outcomes[name]
            lengths = [self.chunk if dim == "sample" else max(1, n) for dim, n in values.sizes.items()]
            encoding[name] = {"chunks": tuple(lengths)}
        empty = outcomes.drop_vars(self.labels.variables, errors="ignore").isel(sample=slice(0, 0))
        empty = empty.drop_attrs(deep=False).drop_encoding()
        with quiet():
            empty.to_zarr(self.folder, mode="a", zarr_format=2, consolidated=False, encoding=encoding)
        group = _group(self.folder)
        for name in names:
            shape = [self.size if dim == "sample" else n for dim, n in outcomes[name].sizes.items()]
            group[name].resize(tuple(shape))
        if self.labels.variables:
            with quiet():
                self.labels.to_zarr(self.folder, mode="a", zarr_format=2, consolidated=False)
        attrs = dict(group.attrs)
        # Where xarray looks for coordinates that no variable names.
        coordinates = [str(attrs.get("coordinates", "")), *map(str, self.labels.variables)]
        (self.folder / ATTRS).write_text(json.dumps(attrs | {"coordinates": " ".join(coordinates).strip()}))

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            with reported("write", self.folder):
                yield
        except StoreError as error:
            raise StoreError(f"{error}; what was complete stays: go on with resume") from error


def labels_of(samples: xr.Dataset) -> xr.Dataset:
    """Return the coordinates over ``sample`` that are no numbers."""
    named = [
        name
        for name, values in samples.coords.items()
        if "sample" in values.dims and values.dtype.kind not in "biufc"
    ]
    return xr.Dataset(coords={name: samples[name].variable for name in named})


def units_of(size: int, block: int) -> int:
    """Return the samples of a unit: a 64th of all, whole blocks of the model, at most 64 of them."""
    return min(max(-(-size // (UNITS * block)), 1), BLOCKS) * block


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
        if aside.exists() and complete(folder) is not None:
            raise StoreError(
                f"the store at {folder} is being extended, to {size_of(about['definition']):,} samples: go "
                "on with that first"
            )
        return None
    if size_of(about["definition"]) > size_of(asked) and complete(folder) is not None:
        # A further round was begun: what is asked for lies aside.
        folder, about = aside, read_about(aside)
        check_same(folder, about["definition"], asked)
    size, units = size_of(about["definition"]), _whole(folder)
    count = -(-size // about["chunk"])
    incomplete = any(number not in units for number in range(count))
    reuse = _reuse(aside, asked) if incomplete and aside != folder else None
    return BlockStore(folder, size, about["chunk"], units, reuse)


def size_of(definition: Mapping[str, Any]) -> int:
    """Return the number of samples of a definition, those of all rounds."""
    return int(definition["samples"]) + sum(map(int, definition.get("rounds", [])))


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


def complete(folder: Path) -> str | None:
    """Say what is missing in a store that was written unit by unit; None if nothing is."""
    units = read_units(folder)
    done, size = progress_of(folder)
    if done < size or END not in units:
        return f"it is not complete, {done:,} of {size:,} samples are there"
    for number, unit in units.items():
        if not as_they_were(folder, unit.files, whole=number == END):
            return "files in it are missing or damaged"
    return None


def progress_of(folder: Path) -> tuple[int, int]:
    """Return the number of samples that a store has, by its ledger, and that of all that it is to have."""
    about = read_about(folder)
    size, chunk = size_of(about["definition"]), about["chunk"]
    numbers = [number for number in read_units(folder) if 0 <= number < -(-size // chunk)]
    return sum(min(chunk, size - number * chunk) for number in numbers), size


def failure_table(failures: Mapping[int, str]) -> xr.Dataset:
    """Return the messages of failed samples.

    Parameters
    ----------
    failures : mapping
        Row -> message.

    Returns
    -------
    Dataset
        ``failure_message(failure)`` with the coord ``failed_sample``.
    """
    number, text = FAILURES
    rows = np.array(list(failures), np.int64)
    messages = np.array(list(failures.values()), dtype=object).astype(str)
    attrs = {"long_name": "message of a failed sample", "units": "1"}
    place = {"long_name": "place of a failed sample among all, from 0", "units": "1"}
    return xr.Dataset({text: ("failure", messages, attrs)}, {number: ("failure", rows, place)})


def is_store(folder: Path) -> bool:
    """Say whether a folder is a Zarr store."""
    return (folder / ".zgroup").is_file() or (folder / "zarr.json").is_file()


def clear(folder: Path) -> None:
    """Remove everything from a store but what it is of."""
    for path in folder.iterdir():
        if path.name != ABOUT:
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def _chunks(folder: Path, names: tuple[str, ...]) -> list[str]:
    return [f"{name}/{file.name}" for name in names for file in sorted((folder / name).glob("[0-9]*"))]


def _is_json(file: Path) -> bool:
    try:
        json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return True


def _group(folder: Path) -> Any:
    import zarr

    return zarr.open_group(folder, mode="r+", zarr_format=2, use_consolidated=False)


def _beside(folder: Path, end: str) -> Path:
    return folder.with_name(f".{folder.name}.hipuq-{end}")
