"""A parameter of a model: its nominal value and the values that it may take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """A parameter of a model: its nominal value and the values that it may take.

    Attributes
    ----------
    nominal : (size,) array or float
        Nominal value; a number for a parameter without an element dim.
    minimum : float
        Smallest value allowed.
    open : bool
        Whether the minimum itself is excluded.
    boolean : bool
        Whether only 0 and 1 are allowed.
    """

    nominal: Array
    minimum: float = -np.inf
    open: bool = False
    boolean: bool = False

    def check(self, name: str, values: Array) -> None:
        """Raise an InputError if any of the values, sample first, is not allowed."""
        if not self.boolean and values.size:
            low, high = values.min(), values.max()
            inside = low > self.minimum if self.open else low >= self.minimum
            if inside and -np.inf < low and high < np.inf:
                return
        units = schema.PARAMETERS[name].units
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
