"""The headline of a report: what it says of a probability, which analysis it is, which damping it assumes."""

import json

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from squeak_results import CONTACT, PRESET, everything, tree, without

import hipuq
from hipuq.report.damping import at_damping, changed_words, damping_words, label
from hipuq.report.first_part import blocks
from hipuq.report.over_damping import in_words
from hipuq.report.reading import Reading
from hipuq.report.squeak import headline, lead


def results(value, low, high, *, known=1000, confidence=0.95, method="monte_carlo", **options):
    """Return results of any_unstable with one probability."""
    said = {"probability": value, "probability_low": low, "probability_high": high, "known": known}
    said |= {"evaluations": 1000, "undecided": 1000 - known, "failed": 0}
    attrs = {"hipuq_version": "0", "model": "mine", "method": method, "of": "any_unstable"}
    options = json.dumps({"design": options})
    return xr.Dataset(said, attrs=attrs | {"confidence": confidence, "inputs": "{}", "options": options})


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((0.79, 0.7812, 0.7991), "= 0.790 (0.781 to 0.799, 95 % interval); Monte Carlo"),
        ((0.0089, 0.0079, 0.0100), "= 0.0089 (0.0079 to 0.0100, 95 % interval)"),
        ((0.0, 0.0, 0.00383), "= 0: none of 1,000 evaluations is unstable; at most 0.0038, 95 % interval"),
        ((1.0, 0.9962, 1.0), "= 1: all of 1,000 evaluations are unstable; at least 0.9962, 95 % interval"),
        ((3e-10, 1e-10, 9e-10), "= 3e-10 (1e-10 to 9e-10, 95 % interval)"),
    ],
)
def test_what_is_said_of_a_probability(given, said):
    assert f"P(squeak) {said}" in lead(results(*given))


def test_all_undecided_is_no_number():
    assert "P(squeak) is not known" in lead(results(np.nan, 0.0, 1.0, known=0))
    assert "between 0 and 1" in lead(results(np.nan, 0.0, 1.0, known=0))


def test_exact_and_other_methods_in_words():
    exact = results(0.25, 0.25, 0.25, confidence=1.0)
    assert lead(exact) == "P(squeak) = 0.2500; exact: every level of the inputs once, 1,000 evaluations"
    assert "= 1.23e-05; exact" in lead(results(1.23e-5, 1.23e-5, 1.23e-5, confidence=1.0))
    assert "(bounds 0.2000 to 0.3000)" in lead(results(0.25, 0.2, 0.3, confidence=1.0))
    words = lead(results(0.5, 0.4, 0.6, sampler="sobol", stratify="contact"))
    assert words.endswith("; Monte Carlo, Sobol points, stratified by contact, 1,000 evaluations")
    assert "polynomial chaos corrected by true evaluations" in lead(results(0.5, 0.4, 0.6, method="chaos"))


def test_unknown_verdicts_are_told():
    text = headline(Reading(tree({"one/any_unstable": results(0.5, 0.4, 0.6, known=900)}))).lines
    assert any("100 of 1,000 evaluations have no verdict" in line for line in text)


# Damping


def run(model, **inputs):
    made = model.inputs(**inputs)
    return hipuq.run(model, made, method="monte_carlo", n=2, of="any_unstable", rng=1, progress=False)


@pytest.mark.parametrize(
    ("changes", "inputs", "said"),
    [
        ({}, {}, "no damping"),
        ({"damping_ratio": 0.01}, {}, "1 % modal damping"),
        ({"damping_ratio": 0.0025, "mass_damping": 3.0}, {}, "0.25 % modal damping and mass proportional"),
        ({}, {"damping_ratio": cp.Uniform(0, 0.02)}, "uncertain modal damping, Uniform(lower=0, upper=0.02)"),
    ],
)
def test_damping_of_a_ring_in_words(changes, inputs, said):
    made = run(hipuq.models.ring(**changes), friction=cp.Uniform(0, 0.1), **inputs)
    assert damping_words(made).startswith(said)


def test_damping_of_other_models_in_words():
    hulten = run(hipuq.models.two_dof("hulten", damping_1=0.02), friction=cp.Uniform(0, 0.4))
    assert damping_words(hulten) == "relative damping 1 (twice the damping ratio) of 2 %"
    none = run(hipuq.models.two_dof(), friction=cp.Uniform(0, 0.4))
    assert damping_words(none) == at_damping(none) == ""
    assert damping_words(results(0.5, 0.4, 0.6)) == ""
    assert at_damping(run(hipuq.models.ring(), friction=cp.Uniform(0, 0.1))) == "without damping"


def test_a_title_shows_what_is_not_as_in_the_preset():
    model = hipuq.models.ring(damping_ratio=0.01, mass=20.0, contact=[1] * 8 + [0], growth_threshold=5.0)
    made = run(model, friction=cp.Uniform(0, 0.1))
    assert changed_words(made) == (
        "contact oscillators 1, 2, 3, 4, 5, 6, 7, 8 of 9, mass 20 kg, unstable above a growth rate of 5 1/s"
    )
    assert label(made).startswith("ring(oberst2016), 1 % modal damping, contact oscillators")
    drawn = run(model, friction=cp.Uniform(0, 0.1), contact=hipuq.ContactPatterns(in_contact=(9,)))
    assert "contact" not in changed_words(drawn)


# Which analysis, at which value


def test_a_sweep_is_read_at_the_damping_that_is_asked_for():
    reading = Reading(everything())
    assert reading.analysis == "squeak"
    assert reading.assumed["squeak"]["damping_ratio"].value == 0.01
    assert reading.assumed["squeak"]["damping_ratio"].why == "the one that the study asks for"
    found = everything()["squeak/any_unstable"].to_dataset().sel(damping_ratio=0.01)
    assert float(reading.results["probability_overall"]) == float(found["probability_overall"])
    assert damping_words(reading.results) == "1 % modal damping"
    assert damping_words(reading.whole["squeak"]["any_unstable"]) == "0 to 1 % modal damping"


def reread(whole, **report):
    """Return the tree with another table [report]."""
    made = whole.copy()
    made.attrs = made.attrs | {"report": json.dumps(report)}
    return Reading(made)


def test_without_a_wish_it_is_the_nominal_value_or_the_first():
    assert reread(everything()).assumed["squeak"]["damping_ratio"].value == 0.0
    assert "nominal" in reread(everything()).assumed["squeak"]["damping_ratio"].why
    damped = everything()["squeak/any_unstable"].to_dataset().isel(damping_ratio=[1, 2])
    one = Reading(tree({"squeak/any_unstable": damped}, damping_ratio=0.5)).assumed["squeak"]["damping_ratio"]
    assert (one.value, one.why) == (0.005, "the first value of the sweep")


def test_the_study_chooses_the_headline():
    assert reread(everything(), headline="exact").analysis == "exact"
    assert "as the study asks" in headline(reread(everything(), headline="exact")).lines[2]
    reading = reread(everything(), headline="drivers")
    assert reading.analysis == "squeak"
    assert "'drivers', which the study asks for, gives no such probability" in headline(reading).lines[3]
    assert any("gives no such probability" in line for line in headline(reading).brief)


def test_an_analysis_over_friction_is_the_last_choice_and_a_fragility_curve():
    model = hipuq.models.ring(PRESET)
    over = hipuq.sweep(
        model, model.inputs(contact=CONTACT), {"friction": [0.02, 0.06, 0.3]},
        method="monte_carlo", n=4, of="any_unstable", rng=1, progress=False,
    )  # fmt: skip
    groups = {"curve/any_unstable": over, "exact/probability": everything()["exact/probability"].to_dataset()}
    reading = Reading(tree(groups))
    assert reading.analysis == "exact"
    (block,) = [one for one in blocks(reading) if one.key == "fragility"]
    assert any("at a friction of 0.02 and" in line for line in block.lines)
    alone = Reading(tree({"curve/any_unstable": over}))
    assert alone.analysis is None
    values = over["probability_overall" if "probability_overall" in over else "probability"].values
    said = f"P(squeak) is {values.min():.3f} to {values.max():.3f} over the friction of the analysis 'curve'"
    assert headline(alone).lines[0] == said


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ([0.9, 0.5, 0.1], "falls from 0.9000 (0.8000 to 1.0000) at 0 % to 0.1000"),
        ([0.5, 0.9, 0.1], "not falling throughout: it lies between 0.1000 and 0.9000"),
        ([0.5, 0.5, 0.5], "P(squeak) is 0.5000 at every damping ratio, 0 % to 2 %"),
        ([1.0, 1.0, 1.0], "P(squeak) is 1 at every damping ratio, 0 % to 2 %"),
        ([np.nan, 0.0, 0.0], "P(squeak) is 0 at every damping ratio with a verdict"),
        ([np.nan, 0.5, np.nan], "the one value with a verdict"),
        ([np.nan] * 3, "not known at any damping ratio"),
    ],
)
def test_what_damping_does_in_words(values, said):
    ends = {"": 0.0, "_low": -0.1, "_high": 0.1}
    made = {f"probability{end}": ("damping_ratio", np.array(values) + by) for end, by in ends.items()}
    curve = xr.Dataset(made, coords={"damping_ratio": [0.0, 0.01, 0.02]})
    for name in made:
        curve[name].attrs["long_name"] = "probability"
    assert said in in_words(curve.assign_attrs(over='["damping_ratio"]', confidence=0.95))


def test_a_model_of_the_user_has_a_plain_headline():
    def model(samples):
        return xr.Dataset({"any_unstable": samples["x"] > 0.5})

    inputs = hipuq.Inputs(x=cp.Uniform(0, 1))
    found = hipuq.run(model, inputs, method="monte_carlo", n=200, of="any_unstable", rng=1)
    made = {one.key: one for one in blocks(Reading(tree({"mine/any_unstable": found})))}
    assert made["squeak"].lines[0].endswith("interval); Monte Carlo, 200 evaluations")
    assert "limits" not in made
    assert [table.title for table in made["inputs"].text] == ["Uncertain inputs"]


def test_nothing_to_tell():
    assert blocks(Reading(tree({}))) == []
    text = headline(Reading(without(everything(), "squeak", "exact", "drivers/any_unstable"))).lines
    assert text[0].startswith("No analysis gives a probability of any unstable mode")


def test_an_analysis_of_indices_alone_tells_the_mean_of_the_verdict():
    drivers = everything()["drivers/any_unstable"].to_dataset()
    text = headline(Reading(without(everything(), "squeak", "exact"))).lines
    assert text[0].startswith(f"P(squeak) = {float(drivers['mean']):.3f} at 1 % modal damping, the mean of")
    assert "Sobol indices, 256 evaluations" in text[0]
    assert text[1].startswith("It has no interval")
    ends = {f"mean_{end}": float(drivers["mean"]) + by for end, by in (("low", -0.1), ("high", 0.1))}
    told = headline(Reading(tree({"drivers/any_unstable": drivers.assign(ends)}))).lines
    assert len(told) == 1
    assert f"to {ends['mean_high']:.2f})" in told[0]
