"""Results over values of parameters: Datasets of all combinations as one, and those of one combination."""

from __future__ import annotations

import itertools
import json
from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.errors import InputError, SchemaError, check_name

OVER = "over"
"""Attribute of results over values of parameters: their names, JSON."""

PER_VALUE = "per_value"
"""Attribute of a variable over them: those of its attributes that differ, for each combination, JSON."""

ALIKE = ("weight",)
"""Variables of results that no parameter changes."""

Values = dict[str, tuple[float, ...]]
"""Parameter -> its values, ascending."""


def points(values: Values) -> list[dict[str, float]]:
    """Return every combination of the values, the last parameter changing fastest; one of none is empty."""
    return [dict(zip(values, place, strict=True)) for place in itertools.product(*values.values())]


def gathered(parts: Sequence[xr.Dataset], values: Values) -> xr.Dataset:
    """Return Datasets of all combinations as one.

    Parameters
    ----------
    parts : sequence of Dataset
        One for each of `points`; dims that differ between them are left out.
    values : dict
        Parameter -> its values.

    Returns
    -------
    Dataset
        Each data variable with the parameters as first dims; what is the only one is returned as it is where
        nothing is swept.

    Raises
    ------
    SchemaError
        If nothing is left.
    """
    if not values:
        return parts[0]
    for name in values:
        if name in parts[0].data_vars:
            raise InputError(f"{name!r} in over cannot be a parameter: results use the name")
    whole = _joined(list(parts), list(values.items()))
    for key, variable in whole.data_vars.items():
        variable.attrs = _attributes([part[key].attrs for part in parts], values)
    first = parts[0].attrs
    text = ", ".join(f"{name} at {len(own)} values" for name, own in values.items())
    options = {OVER: {name: list(own) for name, own in values.items()}}
    whole = schema.stamp(whole.assign_attrs(first), f"sweep over {text}", options=options, like=first)
    if "seconds" in first:
        whole.attrs["seconds"] = sum(float(part.attrs["seconds"]) for part in parts)
    return whole.assign_attrs({OVER: json.dumps(list(values))})


def _attributes(each: list[dict[str, Any]], values: Values) -> dict[str, Any]:
    """Return the attributes that are alike, and those that differ as a list in `PER_VALUE`."""
    plain = [
        {key: value.tolist() if hasattr(value, "tolist") else value for key, value in own.items()}
        for own in each
    ]
    keys = dict.fromkeys(key for own in plain for key in own)
    unlike = [key for key in keys if any(own.get(key) != plain[0].get(key) for own in plain)]
    alike = {key: value for key, value in each[0].items() if key not in unlike}
    if not unlike:
        return alike
    told = [{key: own[key] for key in unlike if key in own} for own in plain]
    return {**alike, PER_VALUE: json.dumps({"over": list(values), "attrs": _keyed(points(values), told)})}


def _keyed(places: list[dict[str, float]], told: list[dict[str, Any]]) -> list[list[Any]]:
    """Return what is told at each place: its values, then the attributes."""
    return [[list(place.values()), own] for place, own in zip(places, told, strict=True)]


def _joined(parts: list[xr.Dataset], values: list[tuple[str, tuple[float, ...]]]) -> xr.Dataset:
    """Return Datasets joined along the first parameter, each made of those along the others."""
    (name, own), *rest = values
    step = len(parts) // len(own)
    inner = parts
    if rest:
        inner = [_joined(parts[i : i + step], rest) for i in range(0, len(parts), step)]
    attrs = schema.PARAMETERS[name].attrs if name in schema.PARAMETERS else {"long_name": name, "units": ""}
    along = xr.Variable(name, np.array(own), attrs)
    # A coordinate that was fixed in the samples gives way to the dim.
    inner = [part.drop_vars(name, errors="ignore").drop_dims(_unlike(inner)) for part in inner]
    if not inner[0].data_vars:
        raise SchemaError(f"the results at different {name} have nothing alike: their dims differ")
    return xr.concat(
        inner,
        xr.DataArray(along, name=name),
        data_vars=[str(key) for key in inner[0].data_vars if key not in ALIKE],
        coords="different",
        compat="equals",
        join="exact",
        combine_attrs="override",
    )


def _unlike(parts: list[xr.Dataset]) -> list[Hashable]:
    """Return the dims whose length or labels differ between Datasets."""
    first, *rest = parts
    return [
        dim
        for dim in first.dims
        if any(
            dim not in part.dims or part.sizes[dim] != first.sizes[dim] or not part[dim].equals(first[dim])
            for part in rest
        )
    ]


def swept(results: xr.Dataset) -> tuple[str, ...]:
    """Return the parameters that results are over; none of ordinary ones, or once a value is selected."""
    return tuple(name for name in json.loads(results.attrs.get(OVER, "[]")) if name in results.dims)


def at(results: xr.Dataset, **values: float) -> xr.Dataset:
    """Return the results of a sweep at a value of one or more of its parameters.

    Parameters
    ----------
    results : Dataset
        As from `sweep`.
    **values
        Parameter = one of its values, in the units of the schema.

    Returns
    -------
    Dataset
        Results as from `run` where no parameter is left; the values are scalar coords.

    Raises
    ------
    UnknownNameError
        If the results are not over the parameter.
    InputError
        If they have no such value.
    """
    names = swept(results)
    place: dict[str, int] = {}
    for name, value in values.items():
        check_name("parameter of the sweep", name, names)
        there = results[name].values
        near = np.isclose(there, value, rtol=1e-9, atol=1e-15)
        if not near.any():
            raise InputError(f"the results have no {name} {value!r}: it must be one of {there.tolist()}")
        place[name] = int(near.argmax())
    left = [name for name in names if name not in values]
    found = results.isel(place)
    for variable in found.data_vars.values():
        if PER_VALUE in variable.attrs:
            variable.attrs = _settled(variable)
    attrs = {key: own for key, own in results.attrs.items() if key != OVER}
    found.attrs = attrs | ({OVER: json.dumps(left)} if left else {})
    return found


def _settled(variable: xr.DataArray) -> dict[str, Any]:
    """Return the attributes of a variable at the values that its coordinates have.

    What is told of values that are not there any more is left out.
    """
    rest = {key: value for key, value in variable.attrs.items() if key != PER_VALUE}
    said = json.loads(variable.attrs[PER_VALUE])
    table = {tuple(key): own for key, own in said["attrs"]}
    if not all(name in variable.coords for name in said["over"]):
        return rest
    there = {name: tuple(np.atleast_1d(variable[name].values).tolist()) for name in said["over"]}
    kept = [(place, table.get(tuple(place.values()))) for place in points(there)]
    if any(own is None for _, own in kept):
        return rest
    if all(name not in variable.dims for name in said["over"]):
        return {**rest, **(kept[0][1] or {})}
    again = {"over": said["over"], "attrs": [[list(place.values()), own] for place, own in kept]}
    return {**rest, PER_VALUE: json.dumps(again)}
