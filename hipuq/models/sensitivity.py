"""Sensitivity of an onset to every parameter of a model."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.cea.pencils import Pencils
from hipuq.cea.sensitivity import Derivatives
from hipuq.cea.sensitivity import onset_sensitivity as kernel
from hipuq.errors import InputError
from hipuq.models.base import CEAModel
from hipuq.models.matrices import MatrixModel

Array = NDArray[np.float64]

RELATIVE_STEP = 2.0**-9
"""Step of the differences, relative to the value; absolute for a parameter that is 0."""

ANGLE_STEP = 0.125
"""Step of the differences in an angle [deg]."""

# Differences of fourth order, at -2 to 2 steps or, beside a bound, at 0 to 4 steps: exact where the
# matrices are of fourth degree or lower, right to 1e-11 for angles and the square roots of damping.
CENTRAL = (np.arange(-2.0, 3.0), np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12)
FORWARD = (np.arange(0.0, 5.0), np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / 12)


def onset_sensitivity(
    model: CEAModel, sample: xr.Dataset | None = None, *, friction: float, frequency: float
) -> xr.Dataset:
    """Compute how a friction at which stability changes moves with every parameter of a model.

    Parameters
    ----------
    model : CEAModel
        Its growth threshold is that of the boundary.
    sample : Dataset, optional
        One sample, as from ``model.nominal(...)``; nominal values by default. Its own friction is
        not used.
    friction : float
        Friction coefficient of the boundary, to about 4 digits at least: it is refined [1].
    frequency : float
        Frequency of the mode there, to about 6 digits at least; 0 for divergence [Hz].

    Returns
    -------
    Dataset
        One variable d mu / d p for each parameter p but friction and those that are yes or no, along
        the dim of its elements, such as ``contact_stiffness(oscillator)``, in 1 over the parameter's unit.
        Each parameter moves alone: the friction angle of the ring too does not follow the contact angle here,
        so for one that does add the two derivatives. NaN for damping parameters at flutter of a model without
        damping: there the smallest damping moves the onset by a jump, not in proportion. Right to 4e-11 of
        the largest of a parameter's elements for undamped rings, to 5e-9 with a damping ratio of 1e-4.

    Raises
    ------
    InputError
        If there is not exactly one sample, divergence is asked of a sample with mechanisms, or
        there is no boundary where it was said to be.
    UnknownNameError, SchemaError
        If the sample does not fit the model.

    Notes
    -----
    Derivatives of the matrices are exact for a model of `hipuq.models.from_matrices`. For others they are
    differences over steps of 0.125 degrees in an angle, of 2^-9 of any other value, and of 2^-9 in the
    parameter's unit where the value is 0. Rounding shows in them where a step hardly changes the matrices:
    give a parameter of your own that is 0 a unit in which 1 is a large change.

    Examples
    --------
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hulten")
    >>> onset = {"friction": 7 / 24, "frequency": 7812.5**0.5}
    >>> found = hipuq.onset_sensitivity(model, **onset)
    >>> float(found["frequency_1"].round(6))
    0.010417
    """
    sample = model.nominal() if sample is None else sample
    pencils = model.pencils(sample)
    if len(pencils.stiffness) != 1:
        raise InputError(f"sensitivities need exactly one sample, not {len(pencils.stiffness)}")
    batch = model.values(sample)
    values = {name: value[0] for name, value in batch.items()}
    names = [name for name, p in model.parameters.items() if name != "friction" and not p.boolean]
    # What a subclass makes of the parts it alone knows.
    if type(model) is MatrixModel:
        derivatives = model.derivatives(batch, names)
    else:
        derivatives = _differences(model, values, names)
    found = kernel(
        pencils, float(friction), float(frequency), derivatives, growth_threshold=model.growth_threshold
    )
    data: dict[str, Any] = {}
    coords: dict[str, Any] = {}
    start = 0
    for name in names:
        variable, shape = model.parameters[name].described(name), values[name].shape
        own = found[start : start + values[name].size].reshape(shape)
        start += values[name].size
        attrs = {"long_name": f"sensitivity of the onset to {variable.long_name}", "units": "1"}
        if variable.units != "1":
            attrs["units"] = f"1/({variable.units})" if "/" in variable.units else f"1/{variable.units}"
        if np.isnan(own).any():
            attrs["comment"] = "undamped flutter: the smallest damping moves the onset by a jump"
        data[name] = (variable.dims[1:], own, attrs)
        coords |= {
            dim: schema.index(dim, size)
            for dim, size in zip(variable.dims[1:], shape, strict=True)
            if dim in schema.COORDINATES
        }
    coords["friction"] = ((), float(friction), {"long_name": "friction of the boundary", "units": "1"})
    coords["frequency"] = ((), float(frequency), {"long_name": "frequency of the boundary", "units": "Hz"})
    return schema.stamp(
        xr.Dataset(data, coords=coords),
        "onset sensitivities",
        model=model.label,
        options={"model": model.options},
        like=sample.attrs,
    )


def _differences(model: CEAModel, values: dict[str, Array], names: list[str]) -> Derivatives:
    """Return differences of the matrices for derivatives in each element of the named parameters."""
    total = sum(values[name].size for name in names)
    batch = {name: np.tile(value, (5 * total,) + (1,) * value.ndim) for name, value in values.items()}
    batch = {name: array.reshape(5 * total, *values[name].shape) for name, array in batch.items()}
    weights = np.empty((total, 5))
    row = 0
    for name in names:
        for element, value in np.ndenumerate(values[name]):
            angle = model.parameters[name].described(name).units == "deg"
            step = ANGLE_STEP if angle else RELATIVE_STEP * (abs(value) or 1.0)
            inside = value - 2 * step >= model.parameters[name].minimum
            offsets, factors = CENTRAL if inside else FORWARD
            batch[name][(slice(5 * row, 5 * row + 5), *element)] = value + step * offsets
            weights[row] = factors / step
            row += 1
    pencils: Pencils = model.assemble(batch)

    def combined(matrices: Array) -> Array:
        parts = matrices.reshape(total, 5, *matrices.shape[1:])
        # Less one of the five, so that entries that do not change give exactly zero.
        sums: Array = np.einsum("pk,pk...->p...", weights, parts - parts[:, 2:3])
        return sums

    return Derivatives(
        mass=combined(pencils.mass),
        stiffness=combined(pencils.stiffness),
        friction_stiffness=combined(pencils.friction_stiffness),
        damping=None if pencils.damping is None else combined(pencils.damping),
    )
