"""The problems that the benchmarks solve."""

from __future__ import annotations

import chaospy as cp
import numpy as np
import xarray as xr
from numpy.typing import NDArray

import hipuq

Array = NDArray[np.float64]


def ring(damping_ratio: float = 0.0) -> hipuq.models.CEAModel:
    """Return the ring of Oberst et al. (2016) as printed."""
    return hipuq.models.ring("oberst2016", damping_ratio=damping_ratio)


def inputs_of(model: hipuq.models.CEAModel) -> hipuq.Inputs:
    """Return 39 numbers: friction, stiffnesses off by up to 10 %, angles off by up to 1 deg."""
    return model.inputs(
        friction=cp.Uniform(0.0, 0.1),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
        contact_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"),
        spring_angle=hipuq.shift(cp.Uniform(-1.0, 1.0), each="spring"),
        contact_angle=hipuq.shift(cp.Uniform(-1.0, 1.0), each="oscillator"),
    )


def scattered(model: hipuq.models.CEAModel, n: int) -> tuple[xr.Dataset, dict[str, Array]]:
    """Return random samples of the 39 inputs, as a Dataset and as arrays."""
    samples = hipuq.design("monte_carlo", inputs_of(model), n=n, rng=1)
    return samples, {str(name): np.array(own.values) for name, own in samples.data_vars.items()}


def unit(model: hipuq.models.CEAModel, samples: xr.Dataset) -> Array:
    """Return the 39 inputs on (-1, 1), (s, 39)."""
    nominal = {name: parameter.nominal for name, parameter in model.parameters.items()}
    return np.column_stack(
        [
            samples["friction"].values / 0.05 - 1.0,
            (samples["spring_stiffness"].values / nominal["spring_stiffness"] - 1.0) / 0.1,
            (samples["contact_stiffness"].values / nominal["contact_stiffness"] - 1.0) / 0.1,
            samples["spring_angle"].values - nominal["spring_angle"],
            samples["contact_angle"].values - nominal["contact_angle"],
        ]
    )
