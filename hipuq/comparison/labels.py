"""What is compared, picked out of the results of a run and brought into one order."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from hipuq.comparison.contender import Contender
from hipuq.errors import InputError


def labels_of(one: Contender, results: xr.Dataset) -> dict[str, Any]:
    """Return how the compared result of a run is labelled, JSON-able.

    Returns
    -------
    dict
        ``name`` of the variable, ``contender``, ``long_name``, ``units``, ``dims``, and ``coords``, which
        maps dims to their labels.

    Raises
    ------
    InputError
        If the results lack what is compared.
    """
    values = results[one.compared(results)]
    dims = [str(dim) for dim in values.dims]
    return {
        "name": str(values.name),
        "contender": one.name,
        "long_name": str(values.attrs.get("long_name", values.name)),
        "units": str(values.attrs.get("units", "") or "1"),
        "dims": dims,
        "coords": {dim: values[dim].values.tolist() for dim in dims},
    }


def in_order(one: Contender, results: xr.Dataset, labels: Mapping[str, Any]) -> list[Any]:
    """Return estimate and limits as arrays in the order of the labels.

    Parameters
    ----------
    one : Contender
    results : Dataset
        Of a run of it.
    labels : mapping
        As from `labels_of`, of the contender that came first.

    Returns
    -------
    list of three arrays
        Limits are NaN where there are none.

    Raises
    ------
    InputError
        If the results lack what is compared, or have it over something else.
    """
    name = one.compared(results)
    found = results[[name, *(f"{name}_{end}" for end in ("low", "high") if f"{name}_{end}" in results)]]
    if set(map(str, found[name].dims)) != set(labels["dims"]):
        raise InputError(
            f"{name} of {one.name!r} is over {list(found[name].dims) or 'nothing'}, that of the first "
            f"contender over {labels['dims'] or 'nothing'}"
        )
    for dim, wanted in labels["coords"].items():
        if sorted(found[dim].values.tolist()) != sorted(wanted):
            raise InputError(f"{name} of {one.name!r} has another {dim} than the first contender")
        found = found.sel({dim: wanted})
    middle = found[name].transpose(*labels["dims"]).values.astype(np.float64)
    limits = [
        found[f"{name}_{end}"].transpose(*labels["dims"]).values.astype(np.float64)
        if f"{name}_{end}" in found
        else np.full_like(middle, np.nan)
        for end in ("low", "high")
    ]
    return [middle, *limits]
