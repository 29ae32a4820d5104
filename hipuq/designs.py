"""Samples that are made when they are needed, rows at a time, so that they are never all in memory."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.errors import InputError


@dataclass(frozen=True)
class Design:
    """Samples by rows.

    Attributes
    ----------
    size : int
        Number of samples.
    make : callable
        ``slice(start, stop) -> samples Dataset``, the same rows whatever the slices.
    definition : mapping
        What the samples follow from, JSON-able: equal definitions mean equal samples.
    given : bool
        Whether the samples are in memory already; their definition does not say all of them then.
    """

    size: int
    make: Callable[[slice], xr.Dataset]
    definition: Mapping[str, Any]
    given: bool = False

    def __len__(self) -> int:
        return self.size

    def rows(self, start: int, stop: int) -> xr.Dataset:
        """Return some of the samples.

        Parameters
        ----------
        start, stop : int
            First row, and the one after the last.

        Returns
        -------
        Dataset
            Over ``sample``, of length ``stop - start``, as from `hipuq.design`.
        """
        return self.make(slice(start, stop))

    def at(self, points: Sequence[Mapping[str, float]]) -> Design:
        """Return the same samples at each of several points, one point after the other.

        Parameters
        ----------
        points : sequence of mapping
            Parameter that is not uncertain -> its value, in the units of the schema; an empty mapping
            changes nothing.

        Returns
        -------
        Design
            Of ``len(points) * size`` samples.
        """
        if not any(points):
            return self

        def make(rows: slice) -> xr.Dataset:
            pieces = []
            for k in range(rows.start // self.size, -(-rows.stop // self.size)):
                start, stop = (min(max(end - k * self.size, 0), self.size) for end in (rows.start, rows.stop))
                pieces.append(with_fixed(self.rows(start, stop), points[k]))
            return (
                pieces[0] if len(pieces) == 1 else xr.concat(pieces, "sample", data_vars="all", join="exact")
            )

        definition = {**self.definition, "samples": len(points) * self.size, "over": [*map(dict, points)]}
        return Design(len(points) * self.size, make, definition, self.given)

    def followed_by(self, more: xr.Dataset) -> Design:
        """Return these samples and, after them, those of a further round of a sequential method.

        Parameters
        ----------
        more : Dataset
            Samples over ``sample``; what they lack of the bookkeeping of the first ones is missing (NaN).

        Returns
        -------
        Design
            Of the samples of both.
        """
        example, count = self.rows(0, 1), more.sizes["sample"]
        own = [name for name in example.variables if name in more.variables]
        lacking = [name for name in example.coords if name not in own and example[name].dims == ("sample",)]
        rest = more[own].assign_coords({name: ("sample", np.full(count, np.nan)) for name in lacking})

        def make(rows: slice) -> xr.Dataset:
            pieces = []
            if rows.start < self.size:
                pieces.append(self.rows(rows.start, min(rows.stop, self.size)))
            if rows.stop > self.size:
                part = slice(max(rows.start - self.size, 0), rows.stop - self.size)
                pieces.append(rest.isel(sample=part))
            if len(pieces) == 1:
                return pieces[0]
            return xr.concat(pieces, "sample", data_vars="all", join="exact", combine_attrs="override")

        rounds = [*self.definition.get("rounds", []), count]
        return Design(self.size + count, make, {**self.definition, "rounds": rounds}, self.given)


def with_fixed(samples: xr.Dataset, values: Mapping[str, float]) -> xr.Dataset:
    """Return samples with parameters that have one value in all of them."""
    size = samples.sizes["sample"]
    return samples.assign(
        {
            name: (
                "sample",
                np.full(size, value),
                schema.PARAMETERS[name].attrs
                if name in schema.PARAMETERS
                else {"long_name": name, "units": ""},
            )
            for name, value in values.items()
        }
    )


def as_design(samples: xr.Dataset | Design) -> Design:
    """Return samples as a Design.

    Parameters
    ----------
    samples : Dataset or Design

    Returns
    -------
    Design

    Raises
    ------
    SchemaError
        If a Dataset is none of samples; see `hipuq.schema.check_samples`.
    """
    if isinstance(samples, Design):
        return samples
    size = schema.check_samples(samples)
    return Design(size, lambda rows: samples.isel(sample=rows), definition_of(samples.attrs, size), True)


def definition_of(attrs: Mapping[Any, Any], size: int) -> dict[str, Any]:
    """Return what samples follow from, as far as their attributes say it.

    Parameters
    ----------
    attrs : mapping
        Of samples that a method designed, or of any.
    size : int
        Number of samples.

    Returns
    -------
    dict
    """
    found: dict[str, Any] = {"samples": size}
    for key in ("method", "seed"):
        if attrs.get(key, "") != "":
            value = attrs[key]
            found[key] = value.item() if isinstance(value, np.generic) else value
    try:
        options = json.loads(attrs.get("options") or "{}").get("design")
        inputs = json.loads(attrs.get("inputs") or "{}")
    except (TypeError, ValueError, AttributeError) as error:
        raise InputError(f"the attributes of the samples cannot be read as JSON: {error}") from error
    return found | ({"design": options} if options else {}) | ({"inputs": inputs} if inputs else {})
