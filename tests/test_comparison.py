"""Methods compared on a problem with a known answer: errors, coverage, seeds, budgets."""

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from functions import ishigami

import hipuq
from hipuq import compare
from hipuq.comparison import Reference, reference_from

INPUTS = hipuq.Inputs(a=cp.Uniform(0.0, 1.0), b=cp.Uniform(0.0, 1.0))

CONTENDERS = {
    "random": {"method": "monte_carlo"},
    "latin hypercube": {"method": "monte_carlo", "options": {"sampler": "latin_hypercube"}},
    "Sobol points": {"method": "monte_carlo", "options": {"sampler": "sobol"}},
    "chaos": {"method": "chaos", "options": {"degree": 2}},
}


def smooth(samples: xr.Dataset) -> xr.Dataset:
    """Return a smooth function of mean 1/3 + 1/4."""
    return xr.Dataset({"y": samples["a"] ** 2 + samples["a"] * samples["b"]})


@pytest.fixture(scope="module")
def race() -> xr.Dataset:
    """Return 24 replicates of those whose spread is judged, few of the others."""
    few = {name: CONTENDERS[name] | {"replicates": 3} for name in ("latin hypercube", "chaos")}
    contenders = CONTENDERS | few
    return compare(
        smooth, INPUTS, contenders, of="y", reference=7 / 12, budgets=[64, 256, 1024], replicates=24, rng=1
    )


def test_errors_fall_as_they_should(race):
    """Monte Carlo as n**-1/2; Sobol points of a smooth function faster."""
    slope = {
        name: np.polyfit(
            np.log(race["evaluations"].loc[{"method": name}]), np.log(race["rmse"].loc[{"method": name}]), 1
        )[0]
        for name in ("random", "Sobol points")
    }
    assert slope["random"] == pytest.approx(-0.5, abs=0.15)
    # Owen scrambled points of a smooth function: n**-3/2, up to logarithms.
    assert slope["Sobol points"] == pytest.approx(-1.5, abs=0.4)
    exact = float(race["rmse"].loc[{"method": "random", "budget": 256}])
    # variance 4/45 + 2 * 1/24 + 7/144 of y over 256 samples
    assert exact == pytest.approx(np.sqrt((4 / 45 + 1 / 12 + 7 / 144) / 256), rel=0.4)
    assert float(race["rmse"].loc[{"method": "chaos"}].max()) < 1e-9
    assert (race["rmse_low"] <= race["rmse"]).all() and (race["rmse"] <= race["rmse_high"]).all()


def test_intervals_hold_the_answer_as_often_as_they_say(race):
    held = race["coverage"].loc[{"method": "random"}]
    assert (held >= 0.8).all()
    assert (race["coverage_low"] <= race["coverage"]).all()
    assert race["low"].shape == (4, 3, 24)


def test_budgets_are_kept_and_used(race):
    found = race["evaluations"]
    assert (found <= race["budget"]).all()
    assert found.loc[{"method": "random"}].values.tolist() == [64, 256, 1024]
    assert (found > 0.97 * race["budget"]).all()


@pytest.mark.parametrize("budget", [200, 1024, 5000])
def test_evaluations_of_a_correction_count(budget):
    """A cost that does not start from 0 is still used to the full."""
    contender = {"method": "chaos", "options": {"degree": 1, "correction": 128}}
    plan = hipuq.comparison.race(
        smooth, INPUTS, {"chaos": contender}, of="y", reference=0.5, budgets=[budget], replicates=2
    )
    assert 0.99 * budget <= plan.contenders[0].evaluations(budget) <= budget
    assert plan.evaluations == 2 * plan.contenders[0].evaluations(budget)


def test_seeds_belong_to_the_contender(race):
    two = {"chaos": CONTENDERS["chaos"], "random": CONTENDERS["random"]}
    alone = compare(smooth, INPUTS, two, of="y", reference=7 / 12, budgets=[64], replicates=3, rng=1)
    here = race["estimate"].loc[{"method": "random", "budget": 64}][:3]
    assert alone["estimate"].loc[{"method": "random", "budget": 64}].equals(here)
    estimate = race["estimate"].loc[{"method": "random"}].values.ravel()
    assert len(np.unique(estimate)) == estimate.size


def test_indices_too_can_be_compared():
    known = ishigami()
    contenders = {
        "sobol": {"method": "sobol", "options": {"resamples": 100}},
        "chaos": {"method": "chaos", "options": {"fit": "sparse"}},
    }
    race = compare(
        known.model,
        known.inputs,
        contenders,
        of="y",
        quantity="ST",
        reference=known.total,
        budgets=[320, 1280],
        replicates=2,
        rng=0,
    )
    assert race["rmse"].dims == ("method", "budget", "parameter")
    assert race["evaluations"].loc[{"method": "sobol"}].values.tolist() == [320, 1280]
    last = race["rmse"].sel(budget=1280)
    assert (last.loc[{"method": "chaos"}] < last.loc[{"method": "sobol"}]).all()
    assert np.isnan(race["coverage"].loc[{"method": "chaos"}]).all()


def test_parameters_are_matched_by_name():
    """A contender may have its inputs in another order than the first one."""
    turned = hipuq.Inputs(b=cp.Uniform(0.0, 1.0), a=cp.Uniform(0.0, 1.0))
    contenders = {
        "one": {"method": "chaos", "options": {"degree": 2}},
        "other": {"method": "chaos", "options": {"degree": 2}, "inputs": turned},
    }
    # var y = 97/720 + ...: by hand E(y | a) = a^2 + a / 2, E(y | b) = 1/3 + b / 2
    first = np.array([4 / 45 + 1 / 12 + 1 / 48, 1 / 48])
    first = first / (first.sum() + 1 / 144)
    race = compare(
        smooth, INPUTS, contenders, of="y", quantity="S1", reference=first, budgets=[64], replicates=2, rng=0
    )
    assert race["parameter"].values.tolist() == ["a", "b"]
    assert float(race["rmse"].max()) < 1e-9
    assert race.attrs["inputs"] == INPUTS.to_json()
    assert '"contenders"' in race.attrs["options"]


def test_references_are_matched_by_name():
    """A mapping, results and their limits, in whatever order of parameters."""
    known = ishigami()
    total = dict(zip(known.inputs, known.total, strict=True))
    mixed = {name: total[name] for name in reversed(total)}
    stored = hipuq.run(known.model, known.inputs, method="sobol", n=64, of="y", rng=0)
    given = {"of": "y", "quantity": "ST", "budgets": [320], "replicates": 2, "rng": 0}
    contenders = {"sobol": {"method": "sobol", "options": {"resamples": 10}}}
    by_name = compare(known.model, known.inputs, contenders, reference=mixed, **given)
    by_place = compare(known.model, known.inputs, contenders, reference=known.total, **given)
    assert by_name["rmse"].equals(by_place["rmse"])
    assert by_name["reference"].sel(parameter="x3").item() == total["x3"]
    assert by_name["reference_low"].equals(by_name["reference"])
    by_results = compare(
        known.model,
        known.inputs,
        contenders,
        reference=reference_from(stored.sel(parameter=["x3", "x1", "x2"]), "ST", "64 base points"),
        **given,
    )
    for end in ("", "_low", "_high"):
        np.testing.assert_array_equal(by_results[f"reference{end}"], stored[f"ST{end}"])
    assert by_results.attrs["reference_source"] == "64 base points"
    np.testing.assert_allclose(
        by_results["rmse_overall"].item(), np.sqrt((by_results["rmse"] ** 2).mean().item())
    )


def test_results_by_level_can_be_compared():
    """Friction over each contact pattern, against the exact probabilities."""
    model = hipuq.models.ring("oberst2016")
    patterns = hipuq.ContactPatterns(in_contact=(8, 9))
    exact = hipuq.integrate_friction(model, cp.Uniform(0.0, 0.1))
    answer = hipuq.run(
        exact,
        exact.inputs(contact=patterns),
        method="monte_carlo",
        n=1,
        stratify=True,
        of="probability",
    )
    race = compare(
        model,
        model.inputs(friction=cp.Uniform(0.0, 0.1), contact=patterns),
        {"each": {"method": "monte_carlo", "options": {"stratify": True, "sampler": "sobol"}}},
        of="any_unstable",
        quantity="probability",
        reference=reference_from(answer, "probability"),
        budgets=[10 * 64],
        replicates=2,
        rng=0,
    )
    assert race["rmse"].sizes == {"method": 1, "budget": 1, "pattern": 10}
    assert race["evaluations"].item() == 640
    assert race["rmse_overall"].item() < 0.05
    assert race.attrs["quantity"] == "probability"
    with pytest.raises(hipuq.HipuqError, match="the reference has another pattern"):
        compare(
            model,
            model.inputs(friction=cp.Uniform(0.0, 0.1), contact=patterns),
            {"each": {"method": "monte_carlo", "options": {"stratify": True}}},
            of="any_unstable",
            quantity="probability",
            reference=reference_from(answer.isel(pattern=slice(0, 3)), "probability"),
            budgets=[640],
            replicates=2,
        )


def test_contenders_of_different_sizes():
    """One takes part in some budgets, with fewer replicates, and is told by another result."""
    contenders = {
        "plain": {"method": "monte_carlo"},
        "dear": {"method": "chaos", "budgets": [128], "replicates": 3, "quantity": "mean"},
    }
    race = compare(
        smooth, INPUTS, contenders, of="y", reference=7 / 12, budgets=[64, 128], replicates=5, rng=0
    )
    dear = race.loc[{"method": "dear"}]
    assert dear["replicates"].values.tolist() == [0, 3]
    assert dear["evaluations"].values[0] == 0
    assert dear["estimate"].notnull().values.tolist() == [[False] * 5, [True] * 3 + [False] * 2]
    assert np.isnan(dear["rmse"][0])
    assert race["rmse_ratio"].loc[{"budget": 64}].values[0] == 1.0
    assert race["model_seconds"].fillna(0).values.max() < race["seconds"].max()
    assert race.attrs["baseline"] == "plain"


def test_friction_integrated_takes_part():
    model = hipuq.models.two_dof("hoffmann2002")
    exact = hipuq.integrate_friction(model, cp.Uniform(0.0, 0.8))
    scatter = {"k3": hipuq.relative(cp.Uniform(-0.1, 0.1))}
    contenders = {
        "sampled": {"method": "monte_carlo"},
        "integrated": {
            "method": "monte_carlo",
            "model": exact,
            "inputs": exact.inputs(**scatter),
            "of": "probability",
        },
    }
    inputs = model.inputs(friction=cp.Uniform(0.0, 0.8), **scatter)
    reference = hipuq.run(
        exact, exact.inputs(**scatter), method="chaos", n=12, sampler="quadrature", of="probability"
    )
    race = compare(
        model,
        inputs,
        contenders,
        of="any_unstable",
        reference=float(reference["mean"]),
        budgets=[32],
        replicates=5,
        rng=2,
    )
    error = race["rmse"].sel(budget=32)
    assert float(error.loc[{"method": "integrated"}]) < float(error.loc[{"method": "sampled"}])


@pytest.mark.parametrize(
    ("low", "high", "exact"), [(0.5, 0.5, True), (0.5 - 1e-14, 0.5, True), (0.5, 0.6, False)]
)
def test_limits_that_are_rounding_make_an_exact_reference(low, high, exact):
    results = xr.Dataset({"probability": 0.5, "probability_low": low, "probability_high": high})
    assert reference_from(results).exact == exact


def test_limits_of_a_reference_must_hold_it():
    with pytest.raises(hipuq.HipuqError, match="do not hold its value"):
        Reference(0.5, 0.6, 0.7)
    with pytest.raises(hipuq.HipuqError, match="other shapes"):
        Reference([0.5, 0.6], 0.4, 0.7)
    with pytest.raises(hipuq.HipuqError, match="one limit"):
        Reference(0.5, low=0.4)
    with pytest.raises(hipuq.HipuqError, match="probability of the reference has no limits"):
        reference_from(xr.Dataset({"probability": 0.5}))


def test_a_numpy_number_is_an_option_like_any_other():
    contender = {"method": "chaos", "options": {"degree": np.int64(2)}}
    found = compare(
        smooth, INPUTS, {"a": contender}, of="y", reference=0.5, budgets=[64], replicates=2, rng=0
    )
    assert '"degree": 2' in found.attrs["options"]


def test_models_are_the_same_only_if_they_say_so():
    """Two functions of one name are two models: nothing is saved by one in evaluations of the other."""

    def other(samples):
        return smooth(samples)

    other.__qualname__ = smooth.__qualname__
    contenders = {"random": {"method": "monte_carlo"}, "other": {"method": "monte_carlo", "model": other}}
    found = compare(smooth, INPUTS, contenders, of="y", reference=0.5, budgets=[64], replicates=3, rng=0)
    assert np.isnan(found["break_even"]).all()
    assert np.isfinite(found["cost_ratio"]).all()
    assert found.attrs["jobs"].isdecimal()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"budgets": [64, 32]}, "they must rise"),
        ({"budgets": [2], "contenders": {"s": {"method": "sobol"}}}, "within a budget of 2"),
        ({"contenders": {}}, "no contenders"),
        ({"contenders": {"a": {}}}, "names no method"),
        ({"contenders": {"a": {"method": "monte"}}}, "did you mean 'monte_carlo'"),
        ({"contenders": {"a": {"method": "monte_carlo", "options": {"degree": 2}}}}, "unknown option"),
        ({"reference": np.nan}, "must be finite"),
        ({"reference": [1.0, 2.0]}, "the reference has"),
        ({"quantity": "S1"}, "have no 'S1' to compare"),
        ({"replicates": 1}, "replicates is 1"),
        ({"budgets": 64}, "a list of numbers"),
        ({"contenders": ["monte_carlo"]}, "a mapping of names"),
        ({"contenders": {"a": "monte_carlo"}}, "names no method"),
        ({"contenders": {"a": {"method": "monte_carlo", "inputs": {}}}}, "inputs of 'a' is dict"),
        ({"contenders": {"a": {"method": "monte_carlo", "option": {}}}}, "did you mean 'options'"),
        ({"contenders": {"a": {"method": "monte_carlo", "options": 3}}}, "options of 'a' is 3"),
        ({"contenders": {"a": {"method": "monte_carlo", "model": 3}}}, "model of 'a' is 3"),
        ({"contenders": {"a": {"method": "monte_carlo", "budgets": [32]}}}, "budget 32 of 'a' is none"),
        ({"contenders": {"a": {"method": "monte_carlo", "replicates": 3}}}, "the comparison has 2"),
        ({"contenders": {"a": {"method": "monte_carlo", "quantity": "S1"}}}, "'a' have no 'S1'"),
        ({"contenders": {1: {"method": "monte_carlo"}}}, "the name of a contender is 1"),
        ({"contenders": {"a\nb": {"method": "monte_carlo"}}}, "characters in a line"),
        ({"contenders": {"": {"method": "monte_carlo"}}}, "the name of a contender is ''"),
        ({"contenders": {"a": {"method": "chaos", "options": {"degree": {1}}}}}, "plain numbers"),
        ({"contenders": {"plumless": CONTENDERS["chaos"], "buckeroo": CONTENDERS["chaos"]}}, "same samples"),
        (
            {"budgets": [64, 10**20], "contenders": {"a": {**CONTENDERS["chaos"], "budgets": [64]}}},
            "no contender",
        ),
        ({"store": 5}, "store is 5"),
        ({"store": "runs", "resume": True}, "has no label and options"),
        ({"n_jobs": 0}, "n_jobs is 0"),
        ({"baseline": "a"}, "unknown baseline 'a'"),
        ({"reference": {"a": 1.0}}, "the reference over"),
        ({"reference": "x"}, "it must be a number"),
        ({"contenders": {"a": {"method": "sobol", "options": {"resamples": "many"}}}}, "resamples is 'many'"),
    ],
)
def test_what_cannot_be_compared(changes, message):
    given = {
        "contenders": CONTENDERS,
        "of": "y",
        "reference": 0.5,
        "budgets": [64],
        "replicates": 2,
        **changes,
    }
    with pytest.raises(hipuq.HipuqError, match=message):
        compare(smooth, INPUTS, given.pop("contenders"), rng=0, **given)
