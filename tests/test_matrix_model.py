"""A model made from matrices in every analysis: stores, processes, methods, sweeps, own parameters."""

import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import chaospy as cp
import numpy as np
import pytest
from test_matrices import CONTACT, NONE, SPRINGS, hoffmann

import hipuq
from hipuq import schema
from hipuq.errors import InputError, StoreError
from hipuq.models import Parameter, from_matrices


def test_another_matrix_is_another_model(tmp_path):
    """A store is gone on with for the same matrices, and refused for others, which are named."""
    samples = hoffmann().nominal(friction=np.linspace(0.0, 1.0, 9))
    store = tmp_path / "outcomes.zarr"
    first = hipuq.evaluate(hoffmann(), samples, store=store, progress=False)
    assert hipuq.evaluate(hoffmann(), samples, store=store, resume=True, progress=False).equals(first)
    other = CONTACT | {"stiffness": [[0, 0], [0, 11.000001]]}
    model = from_matrices([1, 1], SPRINGS, NONE, parts={"contact_factor": other})
    with pytest.raises(StoreError, match=r"matrices\.contact_factor\.stiffness"):
        hipuq.evaluate(model, samples, store=store, resume=True, progress=False)


def test_processes():
    model = pickle.loads(pickle.dumps(hoffmann()))
    assert model.options == hoffmann().options
    samples = model.nominal(friction=np.linspace(0.0, 1.0, 9))
    here = hipuq.evaluate(hoffmann(), samples, progress=False)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert hipuq.evaluate(model, samples, executor=pool, progress=False).equals(here)


@pytest.mark.parametrize("method", ["monte_carlo", "chaos", "sobol"])
def test_methods_take_own_names_of_parameters(method, tmp_path):
    model = hoffmann()
    inputs = model.inputs(friction=cp.Uniform(0.0, 0.8), contact_factor=hipuq.relative(cp.Normal(0.0, 0.05)))
    results = hipuq.run(model, inputs, method=method, n=64, of="margin", rng=1)
    assert int(results["failed"]) == int(results["undecided"]) == 0
    hipuq.save_results(results, tmp_path / "results.nc")
    assert hipuq.load_results(tmp_path / "results.nc").to_dataset().equals(results)
    exact = hipuq.integrate_friction(model, cp.Uniform(0.0, 0.8))
    results = hipuq.run(exact, inputs.without("friction"), method=method, n=64, of="probability", rng=1)
    assert int(results["failed"]) == 0


def test_sweep_and_figures():
    from matplotlib import pyplot as plt

    model = hoffmann()
    swept = hipuq.sweep(
        model,
        model.inputs(friction=cp.Uniform(0.0, 0.8)),
        over={"contact_factor": [0.9, 1.0, 1.1], "damping_ratio": [0.0, 0.01]},
        method="monte_carlo",
        n=64,
        of="any_unstable",
        rng=1,
    )
    assert swept["probability"].dims == ("contact_factor", "damping_ratio")
    axes = hipuq.plots.probability_over(swept.isel(damping_ratio=0), dim="contact_factor")
    assert "contact_factor" in axes.get_xlabel()
    inputs = model.inputs(friction=cp.Uniform(0.0, 0.8), contact_factor=cp.Uniform(0.9, 1.1))
    axes = hipuq.plots.index_bars(hipuq.run(model, inputs, method="sobol", n=64, of="margin", rng=1))
    assert "contact_factor" in [label.get_text() for label in axes.get_xticklabels() + axes.get_yticklabels()]
    plt.close("all")


def test_own_parameters_of_a_subclass():
    """Names and units of a model's own, in degrees: labelled, checked, and with derivatives."""

    class Inclined(type(hoffmann())):
        name = "inclined"

        def assemble(self, values):
            angle = np.radians(values["pad_angle"])
            return super().assemble(values | {"contact_factor": np.cos(angle) ** 2})

    base = hoffmann()
    angle = Parameter(np.array(10.0), 0.0, variable=schema.Variable("angle of the pad", "deg"))
    model = Inclined(base.base, base.parts, base.parameters | {"pad_angle": angle}, 0, preset="inclined")
    assert model.nominal(pad_angle=20.0)["pad_angle"].attrs["units"] == "deg"
    inputs = model.inputs(
        pad_angle=cp.Uniform(5.0, 15.0), contact_factor=hipuq.relative(cp.Uniform(0.0, 0.1))
    )
    for same in (inputs, hipuq.Inputs.from_json(inputs.to_json())):
        assert same == inputs
        samples = hipuq.design("monte_carlo", same, n=4, rng=1)
        assert samples["pad_angle"].attrs == {"long_name": "angle of the pad", "units": "deg"}
        assert samples["contact_factor"].attrs["units"] == "1"
    broken = inputs.to_json().replace('"deg"', "3")
    with pytest.raises(InputError, match="labels of pad_angle"):
        hipuq.Inputs.from_json(broken)
    with pytest.raises(InputError, match="not below 0 deg"):
        model(model.nominal(pad_angle=-1.0))
    factor = np.cos(np.radians(10.0)) ** 2
    found = hipuq.unstable_friction(base, base.nominal(contact_factor=factor), upper=1.0)
    place = {name: found[name].item() for name in ("friction", "frequency")}
    slope = hipuq.onset_sensitivity(model, **place)["pad_angle"]
    by_angle = -np.radians(1) * np.sin(np.radians(20.0))
    by_factor = hipuq.onset_sensitivity(base, base.nominal(contact_factor=factor), **place)["contact_factor"]
    assert slope.item() == pytest.approx(by_angle * by_factor.item(), rel=1e-8)
    assert slope.attrs["units"] == "1/deg"
    unnamed = base.parameters | {"pad_angle": Parameter(np.array(10.0))}
    with pytest.raises(InputError, match="schema does not know the parameter 'pad_angle'"):
        Inclined(base.base, base.parts, unnamed, 0, preset="inclined")
