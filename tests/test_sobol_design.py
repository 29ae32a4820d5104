"""Designs of Sobol indices: SALib's bit for bit, and which outcomes are of one."""

import json

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from SALib.sample import sobol as salib_sample
from sobol_designs import (
    Identity,
    assert_same,
    estimate,
    grouped_inputs,
    outcomes_of,
    problem,
    unit_inputs,
)

import hipuq
from hipuq.errors import InputError, SchemaError
from hipuq.sampling import spawn

# -------------------------------------------------------------------------------- the design


def matrix_of(samples) -> np.ndarray:
    """Return the values of all parameters, columns in order."""
    size = samples.sizes["sample"]
    return np.concatenate([v.values.reshape(size, -1) for v in samples.data_vars.values()], axis=1)


@pytest.mark.parametrize("second_order", [False, True])
@pytest.mark.parametrize("groups", [False, True])
def test_the_design_is_salibs(groups, second_order):
    """From the same scrambled points the same rows in the same order, to the last bit."""
    inputs = grouped_inputs()
    samples = hipuq.design("sobol", inputs, 32, 5, groups=groups, second_order=second_order)
    theirs = salib_sample.sample(
        problem(inputs, groups=groups), 32, calc_second_order=second_order, seed=spawn(5, 0)
    )
    assert np.array_equal(matrix_of(samples), theirs)
    names = list(inputs) if groups else ["b[1]", "b[2]", "b[3]", "a", "c[1]", "c[2]"]
    mixed = [f"{kind}:{name}" for kind in ("AB", "BA")[: 1 + second_order] for name in names]
    matrix = samples["matrix"]
    assert matrix.attrs["flag_meanings"].split() == ["A", *mixed, "B"]
    width = len(mixed) + 2
    assert matrix.attrs["flag_values"].tolist() == list(range(width))
    assert matrix.attrs["flag_values"].dtype == matrix.dtype
    assert np.array_equal(samples["block"], np.repeat(np.arange(32), width))
    assert np.array_equal(matrix, np.tile(np.arange(width), 32))
    method = hipuq.methods.METHODS["sobol"]
    assert method.evaluations(inputs, 32, groups=groups, second_order=second_order) == len(theirs)
    assert json.loads(samples.attrs["options"])["design"] == {
        "n": 32,
        "groups": groups,
        "second_order": second_order,
    }


@pytest.mark.parametrize("second_order", [False, True])
@pytest.mark.parametrize("groups", [False, True])
def test_rows_are_rows_of_the_same_design(groups, second_order):
    inputs = hipuq.models.ring().inputs(
        friction=cp.Normal(0.3, 0.01),
        mass=hipuq.relative(cp.Beta(2, 3, -0.1, 0.1), each="oscillator"),
        contact=hipuq.ContactPatterns((0, 9)),
    )
    options = {"groups": groups, "second_order": second_order}
    whole = hipuq.design("sobol", inputs, 1024, 3, **options)
    total = whole.sizes["sample"]
    assert total > 4200
    for cut in (slice(0, 1), slice(3, 5), slice(4090, 4200), slice(4096, 4097), slice(total - 2, None)):
        part = hipuq.design("sobol", inputs, 1024, 3, rows=cut, **options)
        assert part.identical(whole.isel(sample=cut).assign_attrs(part.attrs))


def test_a_discrete_input_is_one_column():
    """Patterns come from A or B as a whole, and the elements of a group together."""
    inputs = hipuq.models.ring().inputs(
        contact=hipuq.ContactPatterns((6, 7, 8, 9)),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
    )
    samples = hipuq.design("sobol", inputs, 64, 0, second_order=True)
    rows = {
        name: samples.isel(sample=samples["matrix"].values == i)
        for i, name in enumerate(samples["matrix"].attrs["flag_meanings"].split())
    }
    for name, other in (("contact", "spring_stiffness"), ("spring_stiffness", "contact")):
        for mixed, base in ((f"AB:{name}", "A"), (f"BA:{name}", "B")):
            from_other = {"A": "B", "B": "A"}[base]
            assert np.array_equal(rows[mixed][name], rows[from_other][name])
            assert np.array_equal(rows[mixed][other], rows[base][other])
    assert not np.array_equal(rows["A"]["contact"], rows["B"]["contact"])
    with_elements = hipuq.design("sobol", inputs, 64, 0, groups=False)
    assert with_elements["matrix"].attrs["flag_meanings"].split()[1:3] == [
        "AB:contact",
        "AB:spring_stiffness[1]",
    ]


def test_infeasible_designs_are_errors():
    inputs = unit_inputs("x", "y")
    cases = [
        ("n is 12: .* take 8 or 16", 12, {}),
        ("n is 1: it must be an integer of 2 or more", 1, {}),
        ("n is 8.0", 8.0, {}),
        ("n is 2147483648: there are at most 1073741824", 2**31, {}),
        ("rows is slice", 8, {"rows": slice(4, 33)}),
        ("groups is 'no': it must be True or False", 8, {"groups": "no"}),
        ("second_order is 1: it must be True or False", 8, {"second_order": 1}),
    ]
    for message, n, options in cases:
        with pytest.raises(InputError, match=message):
            hipuq.design("sobol", inputs, n, 1, **options)
    counted = hipuq.design("sobol", inputs, np.int64(8), 1, second_order=np.bool_(True))
    assert json.loads(counted.attrs["options"])["design"]["n"] == 8
    many = hipuq.Inputs(x=hipuq.shift(cp.Uniform(0, 1), each="e", nominal=np.zeros(10601)))
    with pytest.raises(InputError, match=r"10601 elements: .* at most 10600"):
        hipuq.design("sobol", many, 8, 1)


# ---------------------------------------------------------------------- outcomes of a design


def test_order_and_labels_of_samples_do_not_matter():
    inputs = unit_inputs("x1", "x2", "x3")
    outcomes = outcomes_of(inputs, 32, second_order=True)
    order = np.random.default_rng(0).permutation(outcomes.sizes["sample"])
    shuffled = outcomes.isel(sample=order).drop_vars("sample")
    assert_same(estimate(shuffled, inputs), estimate(outcomes, inputs))
    # The coords as data, without a word about them, or as floats are as good.
    plain = shuffled.reset_coords(["block", "matrix"]).drop_attrs().assign_attrs(seed=0)
    assert_same(estimate(plain.astype(float), inputs), estimate(outcomes, inputs))


def test_outcomes_must_be_of_the_design():
    inputs = grouped_inputs()
    outcomes = outcomes_of(inputs, 16)

    def fails(match, wrong, given=inputs):
        with pytest.raises(SchemaError, match=match):
            estimate(wrong, given)

    fails("no coord 'matrix'.* of the method 'sobol'", outcomes.drop_vars("matrix"))
    fails("no coord 'block'", outcomes.drop_vars("block"))
    monte_carlo = hipuq.design("monte_carlo", inputs, 16, 1)
    fails("no coord 'block'", monte_carlo.assign(y=monte_carlo["a"]))
    other = hipuq.Inputs(a=Identity(), b=Identity(), c=Identity())
    fails("other inputs than a, b, c: their matrices are A AB:b AB:a AB:c B", outcomes, other)
    fails("other inputs than x: matrix is 4 at most", outcomes.drop_attrs(), unit_inputs("x"))
    twice = xr.concat([outcomes, outcomes], "sample", data_vars="all", join="exact")
    fails("block 0 has several samples of the matrix 'A'", twice)
    gap = outcomes.assign_coords(matrix=outcomes["matrix"].where(outcomes["block"] != 3))
    fails("'matrix' of the outcomes must hold an integer", gap)
    fails("'block' of the outcomes must hold", outcomes.assign_coords(block=outcomes["block"] - 1))
    high = outcomes["matrix"].where(outcomes["sample"] != 7, 9)
    fails("other inputs", outcomes.assign_coords(matrix=high.assign_attrs(outcomes["matrix"].attrs)))
    parameters = outcomes["y"].expand_dims(parameter=2)
    fails("'y' has the dim 'parameter', which results use: rename it", outcomes.assign(y=parameters))
    with pytest.raises(InputError, match="resamples is 1: it must be an integer of 2 or more"):
        estimate(outcomes, inputs, resamples=1)
    with pytest.raises(InputError, match="minimum_events is -1"):
        estimate(outcomes, inputs, minimum_events=-1)


def test_a_design_without_its_attributes_is_recognised_if_it_can_be():
    """Two parameters of four elements: 2 + 4 rows of a block may be for pairs or for single elements."""
    inputs = hipuq.Inputs(a=hipuq.shift(Identity(), each="e", nominal=np.zeros(3)), b=Identity())
    for options in ({}, {"groups": False, "second_order": True}):
        outcomes = outcomes_of(inputs, 16, **options)
        assert_same(estimate(outcomes.drop_attrs().assign_attrs(seed=0), inputs), estimate(outcomes, inputs))
    for options in ({"groups": False}, {"second_order": True}):
        outcomes = outcomes_of(inputs, 16, **options)
        assert np.isfinite(estimate(outcomes, inputs)["S1"]).all()
        with pytest.raises(SchemaError, match=r"6 matrices .* keep the attributes that 'matrix' has"):
            estimate(outcomes.drop_attrs(), inputs)


@pytest.mark.parametrize("of", ["margin", "frequency"])
def test_stored_outcomes_give_the_same_and_results_can_be_stored(tmp_path, of):
    """Outcomes from a store are lazy, and flags come back as lists; here with the ring and its modes."""
    model = hipuq.models.ring()
    inputs = model.inputs(
        friction=cp.Uniform(0.0, 0.1),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
        contact=hipuq.ContactPatterns(in_contact=(6, 7, 8, 9)),
    )
    samples = hipuq.design("sobol", inputs, 32, 4, second_order=True)
    outcomes = hipuq.evaluate(model, samples, keep=[of])
    hipuq.save_outcomes(outcomes, tmp_path / "outcomes.zarr")
    stored = hipuq.load_outcomes(tmp_path / "outcomes.zarr")
    results = hipuq.estimate("sobol", outcomes, inputs, of=of, resamples=20)
    again = hipuq.estimate("sobol", stored, inputs, of=of, resamples=20)
    assert_same(again, results)
    assert results["ST"].isel(mode=-1).values.max() > 0.1 if of == "frequency" else results["ST"].max() > 0.1
    hipuq.save_results(results, tmp_path / "results.nc")
    loaded = hipuq.load_results(tmp_path / "results.nc").to_dataset()
    assert loaded.equals(results)
    assert loaded["S1"].attrs == results["S1"].attrs
