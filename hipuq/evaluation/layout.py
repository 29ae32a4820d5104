"""What the outputs of a model look like: names, dims, lengths, types; blocks of them put together."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.store.arrays import outputs_of


@dataclass(frozen=True)
class Layout:
    """Outputs of a model, without their values.

    Attributes
    ----------
    variables : dict
        Name -> dims, lengths but for ``sample`` in their order, dtype, attributes.
    coords : dict
        Coordinates that are not over ``sample``.
    ragged : tuple of str
        Dims that may be longer in other blocks: what is missing there is NaN.
    """

    variables: dict[Hashable, tuple[tuple[Hashable, ...], tuple[int, ...], np.dtype[Any], dict[Any, Any]]]
    coords: dict[Hashable, xr.Variable]
    ragged: tuple[str, ...] = ()

    @classmethod
    def of(cls, outputs: xr.Dataset, ragged: Iterable[str] = ()) -> Layout:
        """Return the layout of outputs over ``sample``."""
        found = outputs_of(outputs)
        variables = {
            name: (
                values.dims,
                tuple(n for dim, n in values.sizes.items() if dim != "sample"),
                values.dtype,
                dict(values.attrs),
            )
            for name, values in found.items()
            if name != "status"
        }
        coords = {name: values.variable for name, values in outputs.coords.items() if name not in found}
        return cls(variables, coords, tuple(ragged))

    def fault(self, outputs: xr.Dataset) -> str:
        """Say in what outputs differ from the layout; empty if they do not."""
        other = Layout.of(outputs, self.ragged).variables
        for name in (*self.variables, *other):
            if name not in other:
                return f"the model returned no {str(name)!r}, which it returned for other samples"
            if name not in self.variables:
                return f"the model returned {str(name)!r}, which it did not for other samples"
            dims, lengths, dtype, _ = self.variables[name]
            dims_here, lengths_here, dtype_here, _ = other[name]
            fixed = [dim not in self.ragged for dim in dims if dim != "sample"]
            if dims_here != dims:
                return (
                    f"the model returned {str(name)!r} with different dims in different blocks: "
                    f"{dims_here}, not {dims}"
                )
            if any(a != b for a, b, same in zip(lengths_here, lengths, fixed, strict=True) if same):
                return f"output {str(name)!r} of the model has the lengths {lengths_here}, not {lengths}"
            if dtype_here != dtype:
                return f"output {str(name)!r} of the model holds {dtype_here}, not {dtype}"
        return ""

    def joined(self, pieces: Sequence[tuple[slice | NDArray[np.intp], xr.Dataset]], size: int) -> xr.Dataset:
        """Return outputs of some samples in their places among all; the others are missing.

        Parameters
        ----------
        pieces : sequence of (rows, Dataset)
            Places of samples, and their outputs.
        size : int
            Number of all samples.

        Returns
        -------
        Dataset
            Over ``sample``; NaN, in flags -1, where there is no piece. ``status`` is left to others if any
            sample has none.
        """
        covered = np.zeros(size, bool)
        for rows, _ in pieces:
            covered[rows] = True
        data: dict[Any, Any] = {}
        names: list[Hashable] = [*self.variables]
        if pieces and all("status" in part for _, part in pieces):
            names.append("status")
        for name in names:
            parts = [part[name] for _, part in pieces]
            dims, lengths, dtype, attrs = self.variables.get(
                name, (("sample",), (), np.dtype(np.int8), parts[0].attrs if parts else {})
            )
            axis = dims.index("sample")
            other = [
                max(ends) for ends in zip(lengths, *(_without(p.shape, axis) for p in parts), strict=True)
            ]
            shape = (*other[:axis], size, *other[axis:])
            missing = np.nan if dtype.kind in "fc" else -1
            values = np.empty(shape, dtype) if covered.all() else np.full(shape, missing, dtype)
            for (rows, _), part in zip(pieces, parts, strict=True):
                if part.shape == shape:
                    values[...] = part.values
                    continue
                place: list[Any] = [slice(0, n) for n in part.shape]
                place[axis] = rows
                if _without(part.shape, axis) != tuple(other):
                    rest: list[Any] = [slice(None)] * len(shape)
                    rest[axis] = rows
                    values[tuple(rest)] = np.nan
                values[tuple(place)] = part.values
            data[name] = (dims, values, attrs)
        return xr.Dataset(data, self.coords)


def _without(shape: tuple[int, ...], axis: int) -> tuple[int, ...]:
    return (*shape[:axis], *shape[axis + 1 :])
