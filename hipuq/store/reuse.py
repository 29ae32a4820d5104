"""Outcomes that are there already, found by the values of their samples: what was evaluated is not again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.store.arrays import open_arrays, outputs_of
from hipuq.store.ledger import Unit

_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)
_SHIFT = np.uint64(29)


class Reuse:
    """Outcomes of a store that has some of the samples asked for.

    Parameters
    ----------
    folder : Path
    chunk : int
        Samples in a unit.
    units : mapping
        Number -> unit, those that are complete.
    """

    def __init__(self, folder: Path, chunk: int, units: Mapping[int, Unit]) -> None:
        whole = open_arrays(folder)
        self._outcomes = whole[[name for name, own in whole.variables.items() if "sample" in own.dims]]
        size = self._outcomes.sizes["sample"]
        self._rows = [slice(k * chunk, min((k + 1) * chunk, size)) for k in sorted(units)]
        self._failures = {row: text for unit in units.values() for row, text in unit.failures.items()}
        self._keys: NDArray[np.uint64] | None = None
        self._places: NDArray[np.int64] = np.empty(0, np.int64)

    def of(self, samples: xr.Dataset) -> tuple[NDArray[np.intp], xr.Dataset, dict[int, str]]:
        """Return the outcomes of those samples that have some.

        Parameters
        ----------
        samples : Dataset

        Returns
        -------
        places : array of int
            Which of the samples have outcomes.
        outputs : Dataset
            Theirs, without the samples.
        failures : dict
            Place -> message.
        """
        names = sorted(str(name) for name in samples.data_vars)
        if self._keys is None:
            parts = [(_keys(self._outcomes[names].isel(sample=rows)), rows) for rows in self._rows]
            keys = np.concatenate([own for own, _ in parts])
            order = np.argsort(keys, kind="stable")
            self._keys = keys[order]
            self._places = np.concatenate([np.arange(rows.start, rows.stop) for _, rows in parts])[order]
        wanted = _keys(samples[names])
        found = np.minimum(np.searchsorted(self._keys, wanted), len(self._keys) - 1)
        places = np.flatnonzero(self._keys[found] == wanted)
        rows = self._places[found[places]]
        there = self._outcomes.isel(sample=rows).load()
        # Equal keys are not yet equal samples.
        same = np.ones(len(places), bool)
        for name in names:
            new, old = (_bits(one[name]) for one in (samples.isel(sample=places), there))
            same &= (new == old).all(axis=1)
        there, places, rows = there.isel(sample=same), places[same], rows[same]
        kept = [name for name in outputs_of(there) if name not in samples.variables]
        failures = {
            int(place): self._failures[row]
            for place, row in zip(places, rows.tolist(), strict=True)
            if row in self._failures
        }
        rest = [name for name in there.variables if "sample" in there[name].dims and name not in kept]
        return places, there.drop_vars(rest), failures


def _bits(values: xr.DataArray) -> NDArray[np.uint64]:
    """Return values as words, (samples, elements)."""
    array: NDArray[Any] = values.transpose("sample", ...).values
    array = np.ascontiguousarray(array.reshape(len(array), int(np.prod(array.shape[1:]))))
    if array.dtype.kind == "f":
        return array.astype(np.float64, copy=False).view(np.uint64)
    return array.astype(np.int64).view(np.uint64)


def _keys(samples: xr.Dataset) -> NDArray[np.uint64]:
    """Return a number for each sample, the same for the same values."""
    keys = np.full(samples.sizes["sample"], 1, np.uint64)
    for values in samples.data_vars.values():
        for column in _bits(values).T:
            keys = (keys ^ column) * _MULTIPLIER
            keys ^= keys >> _SHIFT
    return keys
