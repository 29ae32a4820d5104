"""Outcomes of several rounds of an analysis, or of several values of a parameter, as one."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.errors import SchemaError
from hipuq.store.failures import FAILURES, failure_table


def together(first: xr.Dataset, more: xr.Dataset) -> xr.Dataset:
    """Return outcomes of two rounds of one analysis as one.

    Parameters
    ----------
    first, more : Dataset
        Outcomes of the same model; bookkeeping that only the first one has is missing (NaN) in the rest.

    Returns
    -------
    Dataset
        With the attributes of the first one, but seconds and options of both.
    """
    variables: dict[Any, Any] = {}
    for name, values in first.variables.items():
        if name in FAILURES:
            continue
        if "sample" not in values.dims:
            variables[name] = values
            continue
        axis = values.dims.index("sample")
        if name in more.variables:
            rest = more[name].transpose(*values.dims).values
        else:
            shape = list(values.shape)
            shape[axis] = more.sizes["sample"]
            rest = np.full(shape, np.nan)
        arrays = _padded([values.values, rest], axis)
        variables[name] = (values.dims, np.concatenate(arrays, axis), values.attrs)
    data = {name: values for name, values in variables.items() if name in first.data_vars}
    coords = {name: values for name, values in variables.items() if name in first.coords}
    seconds = sum(float(part.attrs.get("seconds", np.nan)) for part in (first, more))
    options = {**json.loads(more.attrs.get("options", "{}")), **json.loads(first.attrs.get("options", "{}"))}
    whole = xr.Dataset(data, coords, first.attrs).assign_attrs(seconds=seconds, options=json.dumps(options))
    failures = _failures(first, 0) | _failures(more, first.sizes["sample"])
    return whole.merge(failure_table(failures)) if failures else whole


def _failures(outcomes: xr.Dataset, before: int) -> dict[int, str]:
    """Return the table of failures of outcomes that come after others."""
    number, text = FAILURES
    if text not in outcomes:
        return {}
    rows = (outcomes[number].values + before).tolist()
    return dict(zip(rows, outcomes[text].values.tolist(), strict=True))


def _padded(arrays: list[NDArray[Any]], axis: int) -> list[NDArray[Any]]:
    """Return float arrays made equally long but for one axis, with NaN: blocks may need different lengths."""
    shape = np.max([array.shape for array in arrays], axis=0)
    made = []
    for array in arrays:
        width = [(0, int(n) - k) for n, k in zip(shape, array.shape, strict=True)]
        width[axis] = (0, 0)
        padding = any(after for _, after in width)
        if padding and array.dtype.kind != "f":
            raise SchemaError("the model returned arrays of different lengths in different blocks")
        made.append(np.pad(array, width, constant_values=np.nan) if padding else array)
    return made
