"""The answer that contenders are held against: exact, or known far better than they tell it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from hipuq.comparison.contender import QUANTITIES
from hipuq.errors import InputError, check_name

Array = NDArray[np.float64]

Value = ArrayLike | Mapping[str, float] | xr.DataArray


SAME = 1e-12
"""Limits of exact results that are this close to the value, relatively, are rounding."""


@dataclass(frozen=True)
class Reference:
    """A known answer.

    Attributes
    ----------
    value : float, array, mapping or DataArray
        A number; for indices one for each parameter: by name, or in the order of the first contender's
        inputs. A DataArray is matched by its coords.
    low, high : like value, optional
        Limits of a reference that is not exact.
    source : str
        Where it comes from.
    """

    value: Value
    low: Value | None = None
    high: Value | None = None
    source: str = ""

    def __post_init__(self) -> None:
        if (self.low is None) != (self.high is None):
            raise InputError("the reference has one limit: give both, or none where it is exact")
        parts = [self.value] if self.exact else [self.low, self.value, self.high]
        numbers = [_values(part) for part in parts]
        shapes = {part.shape for part in numbers}
        if len(shapes) != 1:
            raise InputError(f"the limits of the reference have other shapes than its value: {shapes}")
        if not self.exact and not (np.diff(np.stack(numbers), axis=0) >= 0).all():
            raise InputError("the limits of the reference do not hold its value")

    @property
    def exact(self) -> bool:
        """Whether it has no limits."""
        return self.low is None

    def aligned(self, dims: list[str], coords: Mapping[str, list[Any]], what: str) -> Array:
        """Return value, low and high, (3, ...) in the order of a result.

        Parameters
        ----------
        dims : list of str
            Dims of the result.
        coords : mapping
            Dim -> its labels.
        what : str
            Name of the result, for messages.

        Raises
        ------
        InputError
            If it has not the same dims and labels.
        """
        parts = [self.value, *((self.value, self.value) if self.exact else (self.low, self.high))]
        return np.stack([_aligned(part, dims, coords, what) for part in parts])


def as_reference(reference: Value | Reference) -> Reference:
    """Return a `Reference`; anything else than one is taken as its value.

    Raises
    ------
    InputError
        If it is no finite number, and no array or mapping of such.
    """
    return reference if isinstance(reference, Reference) else Reference(reference)


def reference_from(results: xr.Dataset, quantity: str | None = None, source: str = "") -> Reference:
    """Return a reference from results, with their limits.

    Parameters
    ----------
    results : Dataset
        As from `hipuq.estimate`.
    quantity : str, optional
        The result to take; by default probability or mean over everything.
    source : str
        Where they come from.

    Returns
    -------
    Reference

    Raises
    ------
    InputError
        If the results lack it or its limits, or it is not known everywhere.
    """
    names = [str(name) for name in results.data_vars]
    if quantity is None:
        found = [name for name in QUANTITIES if name in names and results[name].ndim == 0]
        if not found:
            raise InputError(f"the reference has no {' or '.join(QUANTITIES)} over everything")
        quantity = found[0]
    check_name("result of the reference", quantity, names)
    value = results[quantity]
    ends = [f"{quantity}_{end}" for end in ("low", "high")]
    if not set(ends) <= set(names):
        raise InputError(f"{quantity} of the reference has no limits: nothing says how far it can be trusted")
    low, high = (results[end] for end in ends)
    if all(np.allclose(end, value, SAME, 0.0) for end in (low, high)):
        return Reference(value, source=source)
    return Reference(value, low, high, source)


def _values(value: Any) -> Array:
    """Return a part of a reference as finite numbers."""
    try:
        numbers = np.asarray(list(value.values()) if isinstance(value, Mapping) else value, np.float64)
    except (TypeError, ValueError):
        raise InputError(f"reference is {value!r}: it must be a number, or one for each index") from None
    if not np.isfinite(numbers).all():
        raise InputError(f"reference is {numbers.tolist()}: it must be finite")
    return numbers


def _aligned(value: Any, dims: list[str], coords: Mapping[str, list[Any]], what: str) -> Array:
    if isinstance(value, Mapping):
        value = xr.DataArray(list(value.values()), {"parameter": list(value)}, ["parameter"])
    shape = tuple(len(coords[dim]) for dim in dims)
    if not isinstance(value, xr.DataArray):
        numbers = _values(value)
        if numbers.shape != shape:
            raise InputError(f"{what} has the shape {shape}, the reference has {numbers.shape}")
        return numbers
    if set(map(str, value.dims)) != set(dims):
        raise InputError(f"{what} is over {dims or 'nothing'}, the reference over {list(value.dims)}")
    for dim in dims:
        labels = value[dim].values.tolist()
        if sorted(labels) != sorted(coords[dim]):
            raise InputError(f"the reference has another {dim} than {what}: {labels}, not {coords[dim]}")
        value = value.sel({dim: coords[dim]})
    return np.asarray(value.transpose(*dims).values, np.float64)
