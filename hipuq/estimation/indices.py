"""Names and labels of Sobol indices, the same whatever method estimates them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.estimation.results import ENDS

Array = NDArray[np.float64]

ORDERS = {"S1": "first-order index", "ST": "total-order index", "S2": "second-order index"}
"""Names of indices -> their meaning."""

REASONS = 3
"""Different reasons that are written out."""


def symmetric(pairs: Array, size: int) -> Array:
    """Return second-order indices as symmetric matrices with NaN on the diagonal.

    Parameters
    ----------
    pairs : (size (size - 1) / 2, ...) array
        In the order 1-2, 1-3, ..., 2-3, ...
    size : int
        Number of parameters.

    Returns
    -------
    (size, size, ...) array
    """
    whole = np.full((size, size, *pairs.shape[1:]), np.nan)
    j, k = np.triu_indices(size, 1)
    whole[j, k] = whole[k, j] = pairs
    return whole


def labelled(
    arrays: Mapping[str, Array],
    names: Sequence[str],
    values: xr.DataArray,
    reasons: Mapping[str, str],
    budget: NDArray[np.int64] | None = None,
) -> xr.Dataset:
    """Return indices as a Dataset.

    Parameters
    ----------
    arrays : mapping of array
        ``S1``, ``ST`` (parameter, ...) and ``S2`` (parameter, parameter_2, ...); also with ``_low`` and
        ``_high``; ``S1_by_budget`` (budget, parameter, ...) and its limits. The last axes are those of
        the outcome besides ``sample``.
    names : sequence of str
        Names of the parameters.
    values : DataArray
        The outcome, ``sample`` first.
    reasons : mapping of str
        Name of an array -> why some of it is undefined, see `undefined`; empty if nothing is.
    budget : (b,) array of int, optional
        Numbers of evaluations.

    Returns
    -------
    Dataset
        Undefined indices have the reason as attribute ``undefined``.
    """
    extra = [str(dim) for dim in values.dims[1:]]
    name = values.attrs.get("long_name", values.name)
    labels = {"parameter": np.array(names), "parameter_2": np.array(names), "budget": budget}
    coords: dict[Any, Any] = {
        key: coord.variable
        for key, coord in values.coords.items()
        if coord.dims and set(coord.dims) <= set(extra)
    }
    variables = {}
    for key, array in arrays.items():
        order, _, end = key.partition("_")
        by_budget = end.startswith("by_budget")
        leading = ["budget"] * by_budget + ["parameter"] + ["parameter_2"] * (order == "S2")
        coords |= {dim: (dim, labels[dim], schema.COORDINATES[dim].attrs) for dim in leading}
        limit = ENDS[key[key.rindex("_") :] if key.endswith(("_low", "_high")) else ""]
        text = f"{ORDERS[order]} of {name}" + ", by evaluations" * by_budget + limit
        attrs = {"long_name": text, "units": "1"}
        if reasons.get(key):
            attrs["undefined"] = reasons[key]
        variables[key] = ((*leading, *extra), array, attrs)
    return xr.Dataset(variables, coords)


def undefined(reasons: Sequence[str], values: xr.DataArray) -> str:
    """Return one text for the reasons why indices are undefined.

    Parameters
    ----------
    reasons : sequence of str
        One for each element of a sample of the outcome, empty where there are indices.
    values : DataArray
        The outcome, ``sample`` first.

    Returns
    -------
    str
        The reason alone where it is that of all, else ``mode 1, 2: the outcome does not vary; ...``.
        Empty if there is none.
    """
    if len(set(reasons)) == 1:
        return reasons[0]
    dims = values.dims[1:]
    places: dict[str, list[str]] = {}
    for text, at in zip(reasons, np.ndindex(values.shape[1:]), strict=True):
        if text:
            places.setdefault(text, []).append(
                "/".join(str(values[dim].values[i]) for dim, i in zip(dims, at, strict=True))
            )
    said = [f"{'/'.join(map(str, dims))} {', '.join(where)}: {text}" for text, where in places.items()]
    more = len(said) - REASONS
    return "; ".join(said[:REASONS] + [f"and {more} more"] * (more > 0))
