"""A parameter of a model: its nominal value and the values that it may take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import InputError, SchemaError
from hipuq.schema import Variable

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """A parameter of a model: its nominal value and the values that it may take.

    Attributes
    ----------
    nominal : (size,) array or float
        Nominal value, in the units of its variable; a number for a parameter without an element dim.
    minimum : float
        Smallest value allowed, in the units of its variable.
    open : bool
        Whether the minimum itself is excluded.
    boolean : bool
        Whether only 0 and 1 are allowed.
    variable : Variable or None
        Its meaning, unit and dims; None for what the schema says of its name.
    """

    nominal: Array
    minimum: float = -np.inf
    open: bool = False
    boolean: bool = False
    variable: Variable | None = None

    def described(self, name: str) -> Variable:
        """Return meaning, unit and dims of the parameter.

        Parameters
        ----------
        name : str
            Its name.

        Returns
        -------
        Variable
            That of the schema, or its own.

        Raises
        ------
        InputError
            If neither it nor the schema has them, or both do and differ.
        """
        known = schema.PARAMETERS.get(name)
        if known is not None and self.variable not in (None, known):
            raise InputError(
                f"{name!r} is the {known.long_name} ({known.units}) in the schema: "
                "take another name for a parameter that means something else"
            )
        found = known or self.variable
        if found is None:
            raise InputError(
                f"the schema does not know the parameter {name!r}: "
                "say what it is, Parameter(..., variable=hipuq.schema.Variable(...))"
            )
        return found

    def check(self, name: str, values: Array) -> None:
        """Check values.

        Parameters
        ----------
        name : str
            Of the parameter.
        values : (s,) or (s, size) array
            In the units of its variable.

        Raises
        ------
        InputError
            If one is not allowed; the message says which.
        """
        if not self.boolean and values.size:
            low, high = values.min(), values.max()
            inside = low > self.minimum if self.open else low >= self.minimum
            if inside and -np.inf < low and high < np.inf:
                return
        units = self.described(name).units
        unit = "" if units == "1" else f" {units}"
        if self.boolean:
            bad, rule = ~np.isin(values, (0, 1)), "must be true or false"
        else:
            below = values <= self.minimum if self.open else values < self.minimum
            bad = below | ~np.isfinite(values)
            rule = "must be a finite number"
            if np.isfinite(self.minimum):
                rule += f" {'above' if self.open else 'not below'} {self.minimum:g}{unit}"
        if bad.any():
            where = tuple(np.argwhere(bad)[0])
            place = f"sample {where[0]}" + "".join(f", element {i + 1}" for i in where[1:])
            raise InputError(f"{name} is {values[where]:g}{unit} in {place}: it {rule}")

    def values(self, name: str, samples: xr.Dataset) -> Array:
        """Return the values of the parameter in samples, checked.

        Parameters
        ----------
        name : str
            Of the parameter.
        samples : Dataset
            With the variable `name` over ``sample`` and the dim of its elements, if it has one.

        Returns
        -------
        (s,) or (s, size) array
            In the units of its variable, elements in the order of their numbers.

        Raises
        ------
        SchemaError
            If the shape, a dim or the numbers of the elements do not fit.
        InputError
            If a value is not allowed.
        """
        given, dims = samples[name], self.described(name).dims
        shape = (samples.sizes["sample"], *self.nominal.shape)
        if set(given.dims) != set(dims) or given.transpose(*dims).shape != shape:
            raise SchemaError(
                f"{name} has the shape {given.shape}, dims {given.dims}: it needs {shape}, dims {dims}"
            )
        given = given.transpose(*dims)
        for dim in dims[1:]:
            if dim in given.coords:
                labels, numbers = given[dim].values, np.arange(1, given.sizes[dim] + 1)
                if np.array_equal(labels, numbers):
                    continue
                if not np.array_equal(np.sort(labels), numbers):
                    raise SchemaError(f"{dim} of {name} is labelled {labels}: it needs {numbers}")
                given = given.sortby(dim)
        values = np.ascontiguousarray(given.values, dtype=np.float64)
        self.check(name, values)
        return values
