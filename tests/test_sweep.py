"""An analysis over values of a parameter: the same numbers as one analysis at each, with the same draws."""

import itertools
import json

import chaospy as cp
import numpy as np
import pytest
import xarray as xr

import hipuq
from hipuq.combinations import at, gathered, swept
from hipuq.errors import InputError, SchemaError
from hipuq.methods import METHODS

RATIOS = [0.0, 0.005, 0.02]


@pytest.fixture(scope="module")
def ring():
    return hipuq.models.ring("oberst2016-calibrated")


@pytest.fixture(scope="module")
def inputs(ring):
    return ring.inputs(friction=cp.Uniform(0.0, 0.4), contact=hipuq.ContactPatterns(in_contact=(8, 9)))


@pytest.fixture(scope="module")
def over_damping(ring, inputs):
    return hipuq.sweep(
        ring,
        inputs,
        {"damping_ratio": RATIOS},
        method="monte_carlo",
        n=8,
        of="unstable",
        rng=0,
        stratify="contact",
    )


def test_each_value_is_an_analysis_with_the_same_draws(over_damping, inputs):
    for ratio in RATIOS:
        model = hipuq.models.ring("oberst2016-calibrated", damping_ratio=ratio)
        alone = hipuq.run(model, inputs, method="monte_carlo", n=8, of="unstable", rng=0, stratify="contact")
        here = at(over_damping, damping_ratio=ratio)
        assert float(here["damping_ratio"]) == ratio
        for name in alone.data_vars:
            if name != "seconds":
                np.testing.assert_array_equal(here[name].values, alone[name].values, err_msg=str(name))


def test_dims_attributes_and_labels(over_damping):
    assert swept(over_damping) == ("damping_ratio",)
    assert over_damping["probability"].dims == ("damping_ratio", "pattern", "mode")
    assert over_damping["weight"].dims == ("pattern",)
    assert over_damping["contact"].dims == ("pattern", "oscillator")
    assert over_damping["damping_ratio"].attrs["units"] == "1"
    assert json.loads(over_damping.attrs["options"])["over"] == {"damping_ratio": RATIOS}
    assert over_damping.attrs["seed"] == 0
    assert swept(at(over_damping, damping_ratio=0.0)) == ()


def test_two_parameters_give_every_combination(ring):
    inputs = ring.inputs(contact_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"))
    over = {"damping_ratio": [0.0, 0.01], "friction": [0.05, 0.2, 0.4]}
    results = hipuq.sweep(ring, inputs, over, method="monte_carlo", n=16, of="any_unstable", rng=3)
    assert results["probability"].dims == ("damping_ratio", "friction")
    one = at(results, friction=0.2)
    assert swept(one) == ("damping_ratio",)
    model = hipuq.models.ring("oberst2016-calibrated", damping_ratio=0.01, friction=0.2)
    alone = hipuq.run(model, inputs, method="monte_carlo", n=16, of="any_unstable", rng=3)
    assert float(at(one, damping_ratio=0.01)["probability"]) == float(alone["probability"])


@pytest.mark.parametrize("method", METHODS)
def test_every_method_can_be_swept(method, ring):
    inputs = ring.inputs(friction=cp.Uniform(0.0, 0.4))
    over = {"damping_ratio": [0.0, 0.01]}
    results = hipuq.sweep(ring, inputs, over, method=method, n=32, of="margin", rng=1)
    assert swept(results) == ("damping_ratio",)
    assert results["evaluations"].dims == ("damping_ratio",)


def test_integrated_friction_can_be_swept(ring):
    exact = hipuq.integrate_friction(ring, cp.Uniform(0.0, 0.1))
    inputs = exact.inputs(contact=hipuq.ContactPatterns(in_contact=(9,)))
    over = {"damping_ratio": [0.0, 0.01]}
    results = hipuq.sweep(
        exact, inputs, over, method="monte_carlo", n=1, of="probability", stratify="contact"
    )
    np.testing.assert_allclose(results["probability_overall"], [0.4698782819, 0.0], atol=1e-10)


def test_a_plain_function_can_be_swept():
    def above(samples):
        return xr.Dataset({"above": (samples["x"] > samples["level"]).astype(float)})

    inputs = hipuq.Inputs(x=cp.Uniform(0.0, 1.0))
    results = hipuq.sweep(
        above, inputs, {"level": np.array([0.25, 1.0])}, method="monte_carlo", n=64, of="above", rng=1
    )
    assert results["probability"].values.tolist() == [pytest.approx(0.75, abs=0.15), 0.0]


@pytest.mark.parametrize(
    ("over", "said"),
    [
        ({}, "it must name parameters"),
        ([0.0], "it must name parameters"),
        ({"dampingratio": [0.0]}, "did you mean 'damping_ratio'"),
        ({"friction": [0.0]}, "friction is uncertain and in over too"),
        ({"contact_stiffness": [1.0]}, "a value for each element"),
        ({"damping_ratio": []}, "finite numbers that ascend"),
        ({"damping_ratio": [0.0, 0.0]}, "finite numbers that ascend"),
        ({"damping_ratio": [0.01, 0.0]}, "finite numbers that ascend"),
        ({"damping_ratio": [np.nan]}, "finite numbers that ascend"),
        ({"damping_ratio": ["a"]}, "finite numbers that ascend"),
        ({"damping_ratio": 0.01}, "finite numbers that ascend"),
        ({"damping_ratio": ["0.0", "0.01"]}, "finite numbers that ascend"),
        ({"damping_ratio": [False, True]}, "finite numbers that ascend"),
        ({"damping_ratio": itertools.count()}, "more than 10,000 combinations"),
        ({"damping_ratio": [-0.1, 0.0]}, "must be a finite number not below 0"),
        ({"damping_ratio": np.linspace(0, 1, 10_001)}, "more than 10,000 combinations"),
    ],
)
def test_what_cannot_be_swept_is_one_line(over, said, ring, inputs):
    with pytest.raises(InputError, match=said) as error:
        hipuq.sweep(ring, inputs, over, method="monte_carlo", n=8, of="margin")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["mode", "mean", "probability_low", "S1", "of", "seconds", "a b", ""])
def test_names_that_results_use_are_refused(name):
    inputs = hipuq.Inputs(x=cp.Uniform(0.0, 1.0))
    with pytest.raises(InputError, match="results use the name"):
        hipuq.sweep(lambda s: s, inputs, {name: [1.0]}, method="monte_carlo", n=8, of="y")


def test_what_is_said_of_a_variable_stays_with_its_value(tmp_path, ring):
    """Reasons why an index is undefined are those of one value of the sweep, not of the first."""
    inputs = ring.inputs(friction=cp.Uniform(0.0, 0.2), contact=hipuq.ContactPatterns(in_contact=(8, 9)))
    over = {"damping_ratio": [0.0, 0.5]}
    results = hipuq.sweep(ring, inputs, over, method="sobol", n=128, of="any_unstable", rng=1, progress=False)
    hipuq.save_results(results, tmp_path / "r.nc")
    results = hipuq.load_results(tmp_path / "r.nc").to_dataset()
    for ratio in over["damping_ratio"]:
        model = hipuq.models.ring("oberst2016-calibrated", damping_ratio=ratio)
        alone = hipuq.run(model, inputs, method="sobol", n=128, of="any_unstable", rng=1)
        here = at(results, damping_ratio=ratio)
        for name in ("S1", "ST", "S1_low"):
            assert here[name].attrs == alone[name].attrs
    assert "undefined" in at(results, damping_ratio=0.5)["S1"].attrs
    # Whatever is selected, and in whatever order.
    turned = results.sortby("damping_ratio", ascending=False)
    assert at(turned, damping_ratio=0.0)["S1"].attrs == at(results, damping_ratio=0.0)["S1"].attrs
    assert "per_value" not in at(results.isel(damping_ratio=slice(1, 2)), damping_ratio=0.5)["S1"].attrs
    assert "undefined" not in at(results, damping_ratio=0.0)["S1"].attrs


def test_a_value_that_was_selected_is_no_dim_to_sweep(over_damping):
    assert swept(over_damping.sel(damping_ratio=0.0)) == ()


def test_a_value_that_is_not_there_is_one_line(over_damping):
    with pytest.raises(InputError, match=r"no damping_ratio 0.01: it must be one of \[0.0, 0.005, 0.02\]"):
        at(over_damping, damping_ratio=0.01)
    with pytest.raises(InputError, match="unknown parameter of the sweep 'friction'"):
        at(over_damping, friction=0.1)


def test_results_of_other_dims_are_no_sweep(over_damping):
    parts = [xr.Dataset({"a": ("term", np.arange(k))}, attrs={"hipuq_version": "0"}) for k in (2, 3)]
    parts = [part.assign_coords(term=np.arange(part.sizes["term"])) for part in parts]
    with pytest.raises(SchemaError, match="have nothing alike"):
        gathered(parts, {"damping_ratio": (0.0, 0.01)})


def test_a_sweep_survives_the_file(over_damping, tmp_path):
    hipuq.save_results(over_damping, tmp_path / "r.nc")
    again = hipuq.load_results(tmp_path / "r.nc").to_dataset()
    xr.testing.assert_identical(again, over_damping)
