"""Undamped modes by the compiled kernel: what it can tell of each sample, and which ones it leaves open."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.bounds import DOUBLE, EPS, SAFETY, ZERO
from hipuq.cea.compact import CompactPencils
from hipuq.cea.entries import Entries
from hipuq.cea.pencils import Array
from hipuq.cea.spectra import Spectra
from hipuq.compiled.binding import Batch, Bounds, Modes, Term


def lane_modes(compiled: Any, pencils: CompactPencils, threshold: float) -> tuple[Spectra, NDArray[np.bool_]]:
    """Return the modes of a batch.

    Parameters
    ----------
    compiled : Kernel
        Of `hipuq.compiled.binding`.
    pencils : CompactPencils
        Errors are bounded by the filter radius; where it is 0, by the condition number of each eigenvalue.
    threshold : float
        Growth rate above which a mode is unstable [1/s].

    Returns
    -------
    spectra : Spectra
    open_ : (s,) array of bool
        Samples with a verdict that rounding might change: the spectra say nothing of them.
    """
    n, s = len(pencils.mass), len(pencils.friction)
    spectra, open_ = Spectra.empty(s, n), np.empty(s, np.bool_)
    spectra.mechanisms[:] = pencils.mechanisms
    spectra.decided_by[:] = DOUBLE
    # What the structures point to must live until the call is over.
    friction = np.ascontiguousarray(pencils.friction)
    mass = pencils.mass
    mechanisms = np.ascontiguousarray(pencils.mechanisms, np.int64)
    parts = [(part, 0) for part in pencils.stiffness] + [(part, 1) for part in pencils.friction_stiffness]
    batch = Batch(
        samples=s,
        size=n,
        terms=len(parts),
        term=(Term * len(parts))(*(_term(part, times) for part, times in parts)),
        friction=friction.ctypes.data,
        mass=mass.ctypes.data,
        friction_stride=1,
        mass_row_stride=mass.strides[0] // mass.itemsize,
        mass_sample_stride=_sample_stride(mass),
        mechanisms=mechanisms.ctypes.data,
    )
    into = Modes(
        frequency=spectra.frequency.ctypes.data,
        growth_rate=spectra.growth_rate.ctypes.data,
        unstable=spectra.unstable.ctypes.data,
        margin=spectra.margin.ctypes.data,
        open=open_.ctypes.data,
    )
    bounds = Bounds(filter_radius=pencils.filter_radius, rounding=SAFETY * EPS, zero=ZERO)
    if compiled.undamped(ctypes.byref(batch), threshold, ctypes.byref(bounds), ctypes.byref(into)):
        raise MemoryError("no memory for the compiled kernel")
    return spectra, open_


def _term(part: Entries, times_friction: int) -> Term:
    return Term(
        values=part.values.ctypes.data,
        source=part.source.ctypes.data,
        row=part.row.ctypes.data,
        column=part.column.ctypes.data,
        places=len(part.source),
        row_stride=part.values.strides[0] // part.values.itemsize,
        sample_stride=_sample_stride(part.values),
        times_friction=times_friction,
    )


def _sample_stride(values: Array) -> int:
    """Return the distance of samples in numbers, 0 where one holds for all."""
    return values.strides[1] // values.itemsize if values.shape[1] > 1 else 0
