"""What every method and every model has to keep to: schema, seeds, purity, certainty at 0 and 1.

The tests run over both registries; a new method or model needs no new test here. `SIZES` gives each
method a small n that suits it.
"""

import json

import chaospy as cp
import numpy as np
import pytest
import xarray as xr

import hipuq
from hipuq import schema
from hipuq.inputs import Inputs
from hipuq.methods import METHODS
from hipuq.models import MODELS

SIZES = {name: 64 for name in METHODS}

METHODS_OF_PROBABILITY = ["monte_carlo"]
"""Methods whose result for a verdict is a probability."""

ATTRIBUTES = {"hipuq_version", "model", "method", "seed", "options", "inputs", "history"}


def uncertain(model) -> Inputs:
    """Return inputs that every model takes: friction from nothing to much."""
    return model.inputs(friction=cp.Uniform(0.0, 0.5))


def assert_labelled(dataset: xr.Dataset) -> None:
    """Assert that every variable says what it is and in which unit, and the whole where it is from."""
    for name, variable in dataset.variables.items():
        assert variable.attrs.get("long_name"), f"{name} has no long_name"
        assert "units" in variable.attrs, f"{name} has no units"
    missing = ATTRIBUTES - set(dataset.attrs)
    assert not missing
    json.loads(dataset.attrs["options"])


@pytest.mark.parametrize("model_name", MODELS)
@pytest.mark.parametrize("method", METHODS)
def test_every_stage_is_labelled(method, model_name):
    model = MODELS[model_name]()
    inputs = uncertain(model)
    samples = hipuq.design(method, inputs, SIZES[method], 1)
    outcomes = hipuq.evaluate(model, samples)
    results = hipuq.estimate(method, outcomes, inputs, of="margin")
    for dataset in (samples, outcomes, results):
        assert_labelled(dataset)
        assert dataset.attrs["method"] == method
        assert dataset.attrs["seed"] == 1
        assert Inputs.from_json(dataset.attrs["inputs"]) == inputs
    for dataset in (outcomes, results):
        assert dataset.attrs["model"] == model.label
    assert results.attrs["of"] == "margin"
    assert schema.check_results(results) is results
    assert METHODS[method].evaluations(inputs, SIZES[method]) == samples.sizes["sample"]
    assert int(results["evaluations"]) == samples.sizes["sample"]


@pytest.mark.parametrize("model_name", MODELS)
@pytest.mark.parametrize("method", METHODS)
def test_same_seed_same_result(method, model_name):
    """In one call or in three, twice: everything but the clock is the same. Seed 0 is a seed."""
    model = MODELS[model_name]()
    inputs = uncertain(model)
    n = SIZES[method]
    for seed in (0, 5):
        one = hipuq.run(model, inputs, method=method, n=n, of="margin", rng=seed)
        two = hipuq.run(model, inputs, method=method, n=n, of="margin", rng=seed)
        assert one.drop_vars("seconds").equals(two.drop_vars("seconds"))
        assert one.attrs["seed"] == seed
        samples = hipuq.design(method, inputs, n, seed)
        assert samples.identical(hipuq.design(method, inputs, n, seed).assign_attrs(samples.attrs))
        outcomes = hipuq.evaluate(model, samples, keep=["margin"])
        stages = hipuq.estimate(method, outcomes, inputs, of="margin")
        assert stages.drop_vars("seconds").equals(one.drop_vars("seconds"))
    other = hipuq.design(method, inputs, n, 6)
    assert not np.array_equal(other["friction"], samples["friction"])


@pytest.mark.parametrize("method", METHODS)
def test_without_a_seed_the_one_taken_is_named(method):
    inputs = uncertain(hipuq.models.two_dof())
    samples = hipuq.design(method, inputs, SIZES[method])
    again = hipuq.design(method, inputs, SIZES[method], samples.attrs["seed"])
    assert samples.equals(again)


@pytest.mark.parametrize("method", METHODS)
def test_nothing_given_is_changed(method):
    model = hipuq.models.two_dof()
    inputs = uncertain(model)
    described = inputs.to_json()
    samples = hipuq.design(method, inputs, SIZES[method], 1)
    kept_samples = samples.copy(deep=True)
    outcomes = hipuq.evaluate(model, samples)
    kept_outcomes = outcomes.copy(deep=True)
    hipuq.estimate(method, outcomes, inputs, of="any_unstable")
    assert samples.identical(kept_samples)
    assert outcomes.identical(kept_outcomes)
    assert inputs.to_json() == described


@pytest.mark.parametrize("method", METHODS)
def test_estimate_needs_no_model_of_ours(method):
    """Outcomes may come from anywhere: a bare array beside the samples is enough."""
    inputs = hipuq.Inputs(a=cp.Uniform(0, 1), b=cp.Normal(0, 1))
    samples = hipuq.design(method, inputs, SIZES[method], 3)
    outcomes = samples.assign(y=samples["a"] + 2 * samples["b"]).drop_attrs()
    results = hipuq.estimate(method, outcomes, inputs, of="y")
    assert results.sizes.get("sample") is None
    assert int(results["evaluations"]) == samples.sizes["sample"]


@pytest.mark.parametrize("certain", [0, 1])
@pytest.mark.parametrize("method", METHODS_OF_PROBABILITY)
def test_certainty_is_estimated_as_certain(method, certain):
    """An event that always or never happens: exactly 0 or 1, with an interval that ends there."""
    inputs = hipuq.Inputs(x=cp.Uniform(0, 1))

    def model(samples):
        return xr.Dataset({"event": ("sample", np.full(samples.sizes["sample"], bool(certain)))})

    results = hipuq.run(model, inputs, method=method, n=SIZES[method], of="event", rng=1)
    assert float(results["probability"]) == certain
    ends = float(results["probability_low"]), float(results["probability_high"])
    assert ends[certain] == certain
    assert 0.0 < abs(ends[1 - certain] - certain) < 0.1


@pytest.mark.parametrize("stage", ["design", "estimate"])
@pytest.mark.parametrize("method", METHODS)
def test_unknown_options_are_errors(method, stage):
    inputs = uncertain(hipuq.models.two_dof())
    options = METHODS[method].options(stage)
    name = next(iter(options), "")  # a method may have none: then there is no near one to tell
    near, hint = f"{name[:-1]}x", f"did you mean '{name}'" if name else "unknown option"
    with pytest.raises(hipuq.HipuqError, match=hint):
        if stage == "design":
            hipuq.design(method, inputs, SIZES[method], 1, **{near: 1})
        else:
            hipuq.estimate(method, xr.Dataset(), inputs, of="y", **{near: 1})
    with pytest.raises(hipuq.HipuqError, match="unknown option"):
        hipuq.run(hipuq.models.two_dof(), inputs, method=method, n=8, of="margin", nonsense=1)


def test_unknown_methods_are_errors():
    inputs = uncertain(hipuq.models.two_dof())
    with pytest.raises(hipuq.HipuqError, match="did you mean 'monte_carlo'"):
        hipuq.design("monte_carlos", inputs, 8, 1)
    with pytest.raises(hipuq.HipuqError, match="inputs is dict"):
        hipuq.design("monte_carlo", {"friction": cp.Uniform(0, 1)}, 8, 1)


@pytest.mark.parametrize("model_name", MODELS)
def test_models_say_what_they_are(model_name):
    """Parameters are in the schema, outcomes have role and unit, modes are numbered from 1."""
    model = MODELS[model_name]()
    assert model.name == model_name
    assert set(model.parameters) <= set(schema.PARAMETERS)
    outcomes = model(model.nominal())
    assert set(outcomes.data_vars) == set(model.outcomes)
    for name in schema.OUTCOMES:
        assert outcomes[name].attrs == schema.OUTCOMES[name].attrs
        assert outcomes[name].dims == schema.OUTCOMES[name].dims
    assert outcomes["mode"].values.tolist() == list(range(1, model.dofs + 1))
    assert outcomes["unstable"].dtype == outcomes["any_unstable"].dtype == np.float32
    json.dumps(model.options)


@pytest.mark.parametrize("model_name", MODELS)
def test_models_give_what_is_asked_for(model_name):
    model = MODELS[model_name]()
    samples = model.nominal(friction=[0.0, 0.3])
    whole = model(samples)
    for name in schema.OUTCOMES:
        part = model(samples, [name])
        assert set(part.data_vars) == {name, "status", "decided_by"}
        assert part[name].equals(whole[name])


@pytest.mark.parametrize("model_name", MODELS)
def test_a_model_is_rebuilt_from_its_options(model_name):
    options = MODELS[model_name](growth_threshold=2.5).options
    again = MODELS[options["model"]](
        options["preset"], growth_threshold=options["growth_threshold"], **options["nominal"]
    )
    assert again.options == options
