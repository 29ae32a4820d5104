"""Small designs of the method sobol, outcomes of them and estimates: what its tests are made with."""

import chaospy as cp
import functions
import numpy as np
import xarray as xr

import hipuq

UPPER = np.triu_indices(3, 1)


class Identity:
    """The uniform distribution on 0 to 1, as exact as can be."""

    def ppf(self, u):
        return u


def unit_inputs(*names) -> hipuq.Inputs:
    return hipuq.Inputs(**dict.fromkeys(names, cp.Uniform(0, 1)))


def grouped_inputs() -> hipuq.Inputs:
    """Return three parameters of three, one and two elements; draws are the points themselves."""
    return hipuq.Inputs(
        b=hipuq.shift(Identity(), each="e", nominal=np.zeros(3)),
        a=Identity(),
        c=hipuq.shift(Identity(), each="f", nominal=np.zeros(2)),
    )


def problem(inputs, *, groups) -> dict:
    names = inputs.elements
    extra = {"groups": inputs.groups} if groups else {}
    return {"num_vars": len(names), "names": names, "bounds": [[0, 1]] * len(names)} | extra


def estimate(outcomes, inputs, **options) -> xr.Dataset:
    return hipuq.estimate("sobol", outcomes, inputs, of="y", **{"resamples": 20, **options})


def rough(samples) -> xr.DataArray:
    """Return something with interactions of all parameters and an offset."""
    total = 3.0
    for i, values in enumerate(samples.data_vars.values()):
        total = total + (i + 1) * values.sum([d for d in values.dims if d != "sample"])
    return total**2


def ishigami(samples) -> xr.DataArray:
    """Return the Ishigami function of any inputs x1, x2, x3."""
    return functions.ishigami().model(samples)["y"]


def additive(samples):
    return samples["x1"] + 2 * samples["x2"] + 3 * samples["x3"]


def outcomes_of(inputs, n, seed=0, model=rough, **options) -> xr.Dataset:
    samples = hipuq.design("sobol", inputs, n, seed, **options)
    return samples.assign(y=model(samples).drop_attrs())


def assert_same(one, other, *, but=()) -> None:
    """Assert that results are the same to the last bit, apart from some."""
    names = [name for name in one.data_vars if name not in but]
    for name in names:
        assert np.array_equal(one[name], other[name], equal_nan=True), name
