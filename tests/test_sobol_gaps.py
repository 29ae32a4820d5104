"""Sobol indices of what is unknown, certain, rare or constant: undefined, with a reason, never 0."""

import numpy as np
import pytest
import xarray as xr
from sobol_designs import assert_same, estimate, grouped_inputs, ishigami, outcomes_of, unit_inputs

import hipuq
from hipuq.errors import InputError
from hipuq.estimation.indices import undefined
from hipuq.sampling import spawn


@pytest.mark.parametrize("how", ["unknown", "failed", "missing"])
def test_a_dropped_block_is_as_if_it_had_not_been_there(how):
    inputs = grouped_inputs()
    outcomes = outcomes_of(inputs, 32, second_order=True)
    bad = [11, 100, 101]
    hit = outcomes.assign(y=outcomes["y"].copy())
    if how != "missing":
        hit["y"][bad] = np.nan
    if how == "failed":
        status = np.zeros(outcomes.sizes["sample"], np.int8)
        status[bad] = hipuq.schema.STATUS["failed"]
        hit["status"] = ("sample", status)
    elif how == "missing":
        hit = outcomes.drop_isel(sample=bad)
    results = estimate(hit, inputs)
    blocks = np.unique(outcomes["block"].values[bad])
    rest = outcomes.isel(sample=~np.isin(outcomes["block"], blocks))
    assert int(results["dropped"]) == len(blocks) == 2
    assert int(results["base_samples"]) == 30
    assert int(results["failed"]) == (3 if how == "failed" else 0)
    counts = ("dropped", "evaluations", "failed", "seconds")
    early = [str(name) for name in results.data_vars if "by_budget" in str(name)]
    assert_same(results, estimate(rest, inputs), but=(*counts, *early))


@pytest.mark.parametrize("value", [0.0, 1.0, 3.7, -1e9])
def test_an_outcome_that_does_not_vary_has_no_indices(value):
    inputs = unit_inputs("x1", "x2")
    noise = spawn(0).random(32 * 6) * 2e-15
    for outcome in (np.full(32 * 6, value), value * (1 + noise)):
        outcomes = outcomes_of(inputs, 32, second_order=True).assign(
            y=("sample", outcome, {"long_name": "y", "units": "N"})
        )
        results = estimate(outcomes, inputs)
        for name in ("S1", "ST", "S2", "S1_low", "ST_high", "S2_low", "S1_by_budget", "ST_by_budget_low"):
            assert np.isnan(results[name]).all(), name
            assert results[name].attrs["undefined"].startswith("the outcome does not vary: it is "), name
        assert float(results["mean"]) == pytest.approx(value)
        assert float(results["variance"]) == pytest.approx(0, abs=1e-20 * max(value**2, 1))
        assert "events" not in results


def test_nothing_known_is_nothing_estimated():
    inputs = unit_inputs("x1", "x2")
    outcomes = outcomes_of(inputs, 32)
    unknown = estimate(outcomes.assign(y=outcomes["y"] * np.nan), inputs)
    for name in ("S1", "ST", "S1_high", "ST_by_budget", "mean", "variance"):
        assert np.isnan(unknown[name]).all(), name
    assert unknown["ST"].attrs["undefined"] == (
        "0 of 32 base points have no failed, unknown or missing sample: it takes 2"
    )
    assert int(unknown["dropped"]) == 32
    assert int(unknown["base_samples"]) == 0
    one = estimate(outcomes.isel(sample=outcomes["block"].values == 3), inputs)
    assert one["S1"].attrs["undefined"].startswith("1 of 1 base points")
    two = estimate(outcomes.isel(sample=outcomes["block"].values < 2), inputs)
    assert np.isfinite(two["ST"]).all()
    assert "undefined" not in two["ST"].attrs


@pytest.mark.parametrize("certain", [False, True])
def test_a_certain_event_has_a_mean_but_no_indices(certain):
    inputs = unit_inputs("x1", "x2")
    results = estimate(outcomes_of(inputs, 64, model=lambda s: (s["x1"] > 2) != certain), inputs)
    assert float(results["mean"]) == certain
    assert float(results["variance"]) == 0
    events = 128 * certain
    assert (int(results["events"]), int(results["non_events"])) == (events, 128 - events)
    assert np.isnan(results["S1"]).all()
    reason = f"the outcome does not vary: it is {certain:d} in all samples of A and B"
    assert results["S1"].attrs["undefined"] == reason
    anyway = estimate(
        outcomes_of(inputs, 64, model=lambda s: (s["x1"] > 2) != certain), inputs, minimum_events=0
    )
    assert anyway["S1"].attrs["undefined"] == reason


def test_rare_events_are_not_analysed():
    """A probability of 1/8 gives exactly 16 events in the 128 samples of A and B: the points are balanced."""
    inputs = unit_inputs("x1", "x2")
    outcomes = outcomes_of(inputs, 64, model=lambda s: s["x1"] < 0.125)
    results = estimate(outcomes, inputs)
    assert (int(results["events"]), int(results["non_events"])) == (16, 112)
    assert "16 events and 112 non-events" in results["ST"].attrs["undefined"]
    enough = estimate(outcomes, inputs, minimum_events=16)
    assert enough["S1"].values == pytest.approx([1.0, 0.0], abs=0.3)
    assert enough["ST"].values[1] == 0
    # With as few points the first estimates are still undefined, and say of how many evaluations.
    assert np.isnan(enough["S1_by_budget"][0]).all()
    assert enough["S1_by_budget"].attrs["undefined"].startswith("at 64 evaluations: 4 events and 28 non-ev")
    # Values between 0 and 1 are no events, and neither are numbers with a unit.
    for attrs in ({"role": hipuq.schema.PROBABILITY}, {"units": "N"}):
        number = outcomes.assign(y=outcomes["y"].astype(float).assign_attrs(attrs))
        graded = estimate(number, inputs, minimum_events=16)
        assert graded["S1"].values == pytest.approx(enough["S1"].values)
        few = estimate(number, inputs)["ST"].attrs["undefined"]
        assert few.startswith("only 16 of 128 samples of A and B differ from 0, at least 50")
        assert "events" not in graded


def test_limits_need_resamples_that_vary():
    """An outcome that differs in one block of 16 is constant in every third resample or so."""
    inputs = unit_inputs("x1", "x2")
    outcomes = outcomes_of(inputs, 16)
    values = np.where(outcomes["block"] == 3, outcomes["y"], 2.5)
    results = estimate(outcomes.assign(y=("sample", values)), inputs, minimum_events=0)
    assert np.isfinite(results["ST"]).all()
    assert "undefined" not in results["ST"].attrs
    assert np.isnan(results["ST_low"]).all()
    assert "does not vary in some resamples" in results["ST_low"].attrs["undefined"]


def test_infinite_outcomes_are_errors():
    inputs = unit_inputs("x1", "x2")
    outcomes = outcomes_of(inputs, 16)
    infinite = outcomes.assign(y=outcomes["y"].where(outcomes["sample"] != 7, np.inf))
    with pytest.raises(InputError, match=r"y is infinite in 1 samples \(1.56%\): it has no variance"):
        estimate(infinite, inputs)


def test_each_mode_is_analysed_by_itself():
    """With gaps of its own; limits too are those that the mode has alone."""
    inputs = unit_inputs("x1", "x2", "x3")
    samples = hipuq.design("sobol", inputs, 64, 2, second_order=True)
    y = ishigami(samples)
    modes = [y, y.where(samples["sample"] != 20), y * 0 + 2.0, y**2, y.where(samples["sample"] == 0)]
    mode = xr.DataArray(np.arange(1, 6), dims="mode", attrs={"long_name": "mode", "units": "1"})
    whole = xr.concat(modes, mode).assign_attrs(long_name="frequency", units="Hz")
    outcomes = samples.assign(y=whole)
    results = estimate(outcomes, inputs)
    assert results["S1"].dims == ("parameter", "mode")
    assert results["S2_low"].dims == ("parameter", "parameter_2", "mode")
    assert results["ST_by_budget"].dims == ("budget", "parameter", "mode")
    assert results["dropped"].values.tolist() == [0, 1, 0, 0, 64]
    assert results["S1"].attrs["undefined"] == (
        "mode 3: the outcome does not vary: it is 2 in all samples of A and B; "
        "mode 5: 0 of 64 base points have no failed, unknown or missing sample: it takes 2"
    )
    for i in range(5):
        alone = samples.assign(y=modes[i].assign_attrs(whole.attrs))
        assert_same(estimate(alone, inputs), results.isel(mode=i))
    assert results["S1"].attrs["long_name"] == "first-order index of frequency"
    assert results["S2_high"].attrs["long_name"] == "second-order index of frequency, upper limit"
    assert results["S1"].attrs["units"] == "1"
    assert results["mean"].attrs["units"] == "Hz"
    assert results["variance"].attrs["units"] == "(Hz)^2"
    for name, variable in results.variables.items():
        assert variable.attrs["long_name"] and "units" in variable.attrs, name


def test_reasons_are_put_together():
    values = xr.DataArray(np.zeros((1, 2, 3)), dims=("sample", "a", "b"), coords={"b": [4, 5, 6]})
    assert undefined([""] * 6, values) == ""
    assert undefined(["gone"] * 6, values) == "gone"
    assert undefined(["gone", "", "lost", "", "", "gone"], values) == "a/b 0/4, 1/6: gone; a/b 0/6: lost"
    assert undefined([*"qwert", ""], values) == "a/b 0/4: q; a/b 0/5: w; a/b 0/6: e; and 2 more"
