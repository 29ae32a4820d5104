"""The unstable friction coefficients of one configuration, as a table."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.cea.cells import Cells, stability_cells
from hipuq.errors import InputError
from hipuq.models.base import CEAModel

# name -> dims, meaning, unit
_TABLE = {
    "friction": ("boundary", "friction at which the number of unstable modes changes", "1"),
    "change": ("boundary", "change of the number of unstable modes", "1"),
    "unstable_above": ("boundary", "unstable modes above it", "1"),
    "mode": ("boundary", "number of the mode that changes, by frequency, on the unstable side", "1"),
    "frequency": ("boundary", "frequency of that mode there", "Hz"),
    "certified": ("boundary", "change proved between 1e-12 below and above it", "1"),
    "start": ("interval", "lower end of an interval with an unstable mode", "1"),
    "end": ("interval", "upper end of an interval with an unstable mode", "1"),
    "mode_number": ("mode_interval", "number of the mode, by frequency", "1"),
    "mode_start": ("mode_interval", "lower end of an interval in which that mode is unstable", "1"),
    "mode_end": ("mode_interval", "upper end of an interval in which that mode is unstable", "1"),
    "unknown": ("", "part of the range of which nothing is known", "1"),
}


def unstable_friction(
    model: CEAModel, sample: xr.Dataset | None = None, *, upper: float, lower: float = 0.0
) -> xr.Dataset:
    """Find every friction coefficient at which stability changes, and the unstable intervals between.

    Parameters
    ----------
    model : CEAModel
        Its growth threshold and damping count.
    sample : Dataset, optional
        One sample, as from ``model.nominal(...)``; nominal values by default. Its own friction is
        not used.
    upper, lower : float
        Range of friction, ``0 <= lower < upper`` [1].

    Returns
    -------
    Dataset
        Over ``boundary``: ``friction``, ``change``, ``unstable_above``, ``mode``, ``frequency`` [Hz],
        ``certified``; over ``interval``: ``start``, ``end`` of the intervals with any unstable mode;
        over ``mode_interval``: ``mode_number``, ``mode_start``, ``mode_end``, those of each mode. An
        interval that reaches an end of the range may go on beyond it.

    Raises
    ------
    InputError
        If there is not exactly one sample, or the range does not ascend from 0 or above.
    UnknownNameError, SchemaError
        If the sample does not fit the model.

    Examples
    --------
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> hipuq.unstable_friction(model, upper=0.8)["friction"].values.round(12)
    array([0.47237749])
    """
    if not (np.isfinite([lower, upper]).all() and 0 <= lower < upper):
        raise InputError(f"the range of friction is {lower} to {upper}: it must ascend from 0 or above")
    sample = model.nominal() if sample is None else sample
    pencils = model.pencils(sample)
    if len(pencils.stiffness) != 1:
        raise InputError(f"unstable_friction takes exactly one sample, not {len(pencils.stiffness)}")
    (cells,) = stability_cells(pencils, lower, upper, growth_threshold=model.growth_threshold)
    values = _values(cells)
    data: dict[str, Any] = {}
    for name, (dim, long_name, units) in _TABLE.items():
        data[name] = ((dim,) if dim else (), values[name], {"long_name": long_name, "units": units})
    found = schema.stamp(
        xr.Dataset(data),
        f"unstable friction between {lower:g} and {upper:g}",
        model=model.label,
        options={"model": model.options},
        like=sample.attrs,
    )
    return found.assign_attrs(lower=float(lower), upper=float(upper))


def _values(cells: Cells) -> dict[str, Any]:
    """Return the columns of the table."""
    count = cells.count
    starts = cells.edges[:-1]
    above = [count[np.searchsorted(starts, one.friction, side="right") - 1] for one in cells.boundaries]
    ends = cells.intervals(cells.any_unstable)
    modes = [
        (mode + 1, start, end)
        for mode, verdict in enumerate(cells.unstable.T)
        for start, end in cells.intervals(verdict)
    ]
    table = np.array(modes, dtype=np.float64).reshape(-1, 3)
    columns = {
        name: np.array([getattr(one, field) for one in cells.boundaries], dtype=kind)
        for name, field, kind in (
            ("friction", "friction", float),
            ("change", "direction", int),
            ("mode", "mode", int),
            ("frequency", "frequency", float),
            ("certified", "certified", bool),
        )
    }
    unknown = np.diff(cells.edges)[np.isnan(count)].sum()
    return columns | {
        "unstable_above": np.array(above, dtype=np.float64),
        "start": ends[:, 0],
        "end": ends[:, 1],
        "mode_number": table[:, 0].astype(int),
        "mode_start": table[:, 1],
        "mode_end": table[:, 2],
        "unknown": float(unknown),
    }
