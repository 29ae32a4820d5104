"""Monte Carlo: exact probabilities are covered, intervals are the published ones, designs as described."""

import chaospy as cp
import numpy as np
import published
import pytest
import xarray as xr
from scipy import stats

import hipuq
from hipuq.errors import InputError, UnknownNameError

SEEDS = range(20)


def closed_form_cases():
    hoffmann = hipuq.models.two_dof("hoffmann2002")
    hulten = hipuq.models.two_dof("hulten", friction=0.3)
    return {
        "hoffmann": (
            hoffmann,
            hoffmann.inputs(friction=cp.Uniform(0.0, 0.8)),
            published.HOFFMANN_PROBABILITY,
        ),
        "hulten": (
            hulten,
            hulten.inputs(frequency_1=cp.Uniform(90.0, 110.0)),
            published.HULTEN_PROBABILITY,
        ),
    }


CASES = closed_form_cases()


@pytest.mark.parametrize("sampler", ["random", "latin_hypercube", "sobol"])
@pytest.mark.parametrize("case", CASES)
def test_intervals_cover_the_exact_probability(case, sampler):
    """At 95 % and 20 seeds: fewer than 17 covered would happen by chance in 1.6 % of all suites."""
    model, inputs, exact = CASES[case]
    runs = [
        hipuq.run(model, inputs, method="monte_carlo", n=512, of="any_unstable", rng=seed, sampler=sampler)
        for seed in SEEDS
    ]
    covered = sum(float(r["probability_low"]) <= exact <= float(r["probability_high"]) for r in runs)
    assert covered >= 17
    estimates = np.array([float(r["probability"]) for r in runs])
    assert estimates.mean() == pytest.approx(exact, abs=0.02)
    # Balanced points in one dimension are far better than independent ones.
    deviation = np.sqrt(exact * (1 - exact) / 512)
    if sampler == "random":
        assert estimates.std() == pytest.approx(deviation, rel=0.5)
    else:
        assert estimates.std() < 0.5 * deviation


@pytest.fixture(scope="module")
def hip():
    """Return the study of the paper with few draws: 130 patterns, friction uniform on 0 to 0.1."""
    model = hipuq.models.ring("oberst2016")
    inputs = model.inputs(
        friction=cp.Uniform(0.0, 0.1), contact=hipuq.ContactPatterns(in_contact=(6, 7, 8, 9))
    )
    samples = hipuq.design("monte_carlo", inputs, 64, 1, stratify=True)
    return inputs, samples, hipuq.evaluate(model, samples)


def test_a_stratified_design_gives_every_level_its_share(hip):
    inputs, samples, _ = hip
    levels = inputs.levels("contact")
    assert samples.sizes["sample"] == 130 * 64
    numbers, counts = np.unique(samples["pattern"], return_counts=True)
    assert numbers.tolist() == list(range(1, 131))
    assert (counts == 64).all()
    at = levels.sel(pattern=samples["pattern"])
    assert np.array_equal(samples["contact"], at["contact"])
    assert np.array_equal(samples["weight"], at["weight"])
    assert np.array_equal(samples["in_contact"], samples["contact"].sum("oscillator"))
    # Levels have draws of their own.
    friction = samples["friction"].values.reshape(130, 64)
    assert len(np.unique(friction)) == friction.size


def test_stratified_results_are_labelled_by_pattern(hip):
    inputs, _, outcomes = hip
    results = hipuq.estimate("monte_carlo", outcomes, inputs, of="unstable")
    assert results["probability"].dims == ("pattern", "mode")
    assert results["probability_mean"].dims == ("count", "mode")
    assert results["count"].values.tolist() == [6, 7, 8, 9]
    assert results["contact"].dims == ("pattern", "oscillator")
    by_hand = outcomes["unstable"].groupby("pattern").mean()
    assert results["probability"].values == pytest.approx(by_hand.values, rel=1e-6)
    some = results["probability"].where(results["in_contact"] == 7, drop=True)
    for key, value in (
        ("mean", some.mean("pattern")),
        ("min", some.min("pattern")),
        ("max", some.max("pattern")),
    ):
        assert results[f"probability_{key}"].sel(count=7).values == pytest.approx(value.values, rel=1e-6)


def test_a_mode_is_never_more_probable_than_any_mode(hip):
    """Also where some modes are unknown: both ends of the bounds."""
    inputs, _, outcomes = hip
    modes = hipuq.estimate("monte_carlo", outcomes, inputs, of="unstable")
    any_mode = hipuq.estimate("monte_carlo", outcomes, inputs, of="any_unstable")
    assert (modes["probability_low"].max("mode") <= any_mode["probability_high"]).all()
    known = outcomes["unstable"] == 1
    assert (known.any("mode") == (outcomes["any_unstable"] == 1)).all()


def test_overall_is_the_weighted_mean(hip):
    inputs, _, outcomes = hip
    results = hipuq.estimate("monte_carlo", outcomes, inputs, of="any_unstable")
    weighted = (results["weight"] * results["probability"]).sum()
    assert float(results["probability_overall"]) == pytest.approx(float(weighted))
    assert (
        float(results["probability_overall_low"])
        < float(weighted)
        < float(results["probability_overall_high"])
    )
    weights = np.array([4.0, 3.0, 2.0, 1.0])
    other = hipuq.models.ring().inputs(
        friction=cp.Uniform(0.0, 0.1),
        contact=hipuq.ContactPatterns((6, 7, 8, 9), weights=weights),
    )
    again = hipuq.estimate("monte_carlo", outcomes, other, of="any_unstable")
    expected = float(np.dot(weights / 10, results["probability_mean"]))
    assert float(again["probability_overall"]) == pytest.approx(expected)


@pytest.mark.parametrize("preset", published.PROBABILITY_ANY_UNSTABLE)
def test_certified_means_of_the_study_are_covered(preset):
    """200 draws for each pattern of 8 and 9 contacts, unknown samples counted both ways."""
    model = hipuq.models.ring(preset)
    inputs = model.inputs(friction=cp.Uniform(0.0, 0.1), contact=hipuq.ContactPatterns((8, 9)))
    results = hipuq.run(
        model, inputs, method="monte_carlo", n=200, of="any_unstable", rng=0, stratify="contact"
    )
    for count, exact in published.PROBABILITY_ANY_UNSTABLE[preset].items():
        one = results.sel(count=count)
        assert float(one["probability_mean_low"]) <= exact <= float(one["probability_mean_high"])
        assert float(one["probability_mean_high"] - one["probability_mean_low"]) < 0.2
    if preset == "oberst2016":
        patterns = results["contact"]
        for missing, exact in published.PROBABILITY_WITHOUT.items():
            one = results.sel(pattern=int(patterns["pattern"][8 - missing + 1]))
            assert bool(one["contact"].sel(oscillator=missing)) is False
            assert float(one["probability_low"]) <= exact <= float(one["probability_high"])


@pytest.mark.parametrize("sampler", ["random", "latin_hypercube", "sobol"])
def test_a_stratum_needs_no_other_input(sampler):
    """Contact as the only uncertain parameter: the levels are the whole design."""
    model = hipuq.models.ring(friction=0.05)
    inputs = model.inputs(contact=hipuq.ContactPatterns((8, 9)))
    options = {"n": 8, "rng": 1, "stratify": "contact", "sampler": sampler}
    results = hipuq.run(model, inputs, method="monte_carlo", of="any_unstable", **options)
    assert results.sizes["pattern"] == 10
    assert (results["probability"] == 1).all()


@pytest.mark.parametrize("sampler", ["random", "latin_hypercube", "sobol"])
@pytest.mark.parametrize("stratify", [False, True])
def test_rows_are_rows_of_the_same_design(sampler, stratify):
    """Any cut of the design gives the same samples; here across blocks of 4096 rows and strata."""
    inputs = hipuq.models.ring().inputs(
        friction=cp.Normal(0.3, 0.01),
        mass=hipuq.relative(cp.Beta(2, 3, -0.1, 0.1), each="oscillator"),
        contact=hipuq.ContactPatterns((0, 9)),
    )
    n = 8192 if not stratify else 4096
    whole = hipuq.design("monte_carlo", inputs, n, 3, sampler=sampler, stratify=stratify)
    assert whole.sizes["sample"] == 8192
    for cut in (slice(0, 5), slice(4000, 4200), slice(4096, 4097), slice(8000, None)):
        part = hipuq.design("monte_carlo", inputs, n, 3, sampler=sampler, stratify=stratify, rows=cut)
        assert part.identical(whole.isel(sample=cut).assign_attrs(part.attrs))


def test_infeasible_designs_are_errors():
    inputs = hipuq.models.ring().inputs(friction=cp.Uniform(0, 0.1), contact=hipuq.ContactPatterns((8, 9)))
    cases = [
        (InputError, "n is 0: it must be an integer of 1 or more", 0, {}),
        (InputError, "n is 1.5", 1.5, {}),
        (InputError, "n is True", True, {}),
        (InputError, "n is 30: it must be a multiple of the 8 replicates", 30, {"sampler": "sobol"}),
        (InputError, "take 64 or 128", 12 * 8, {"sampler": "sobol"}),
        (UnknownNameError, "did you mean 'sobol'", 8, {"sampler": "sobel"}),
        (UnknownNameError, "did you mean 'contact'", 8, {"stratify": "contacts"}),
        (UnknownNameError, "unknown discrete input to stratify 'friction'", 8, {"stratify": "friction"}),
        (InputError, "replicates is 0", 8, {"replicates": 0}),
        (InputError, "rows is slice", 8, {"rows": slice(4, 9)}),
    ]
    for error, message, n, options in cases:
        with pytest.raises(error, match=message):
            hipuq.design("monte_carlo", inputs, n, 1, **options)
    plain = hipuq.Inputs(x=cp.Uniform(0, 1))
    with pytest.raises(InputError, match="discrete inputs are none"):
        hipuq.design("monte_carlo", plain, 8, 1, stratify=True)
    with pytest.raises(InputError, match="rng is -1"):
        hipuq.design("monte_carlo", plain, 8, -1)


@pytest.mark.parametrize("confidence", [0, 1, 95, -0.5, "high"])
def test_a_confidence_lies_between_0_and_1(confidence):
    outcomes = xr.Dataset({"y": ("sample", [0.0, 1.0])})
    with pytest.raises(InputError, match="confidence is"):
        hipuq.estimate(
            "monte_carlo", outcomes, hipuq.Inputs(x=cp.Uniform(0, 1)), of="y", confidence=confidence
        )


@pytest.mark.parametrize("confidence", [0.5, 0.95, 0.999])
@pytest.mark.parametrize(("hits", "n"), [(0, 10), (3, 10), (10, 10), (1, 1), (0, 1), (999, 2000)])
def test_the_interval_of_a_share_is_wilsons(hits, n, confidence):
    outcomes = xr.Dataset({"y": ("sample", (np.arange(n) < hits).astype(float))})
    inputs = hipuq.Inputs(x=cp.Uniform(0, 1))
    results = hipuq.estimate("monte_carlo", outcomes, inputs, of="y", confidence=confidence)
    low, high = stats.binomtest(hits, n).proportion_ci(confidence, method="wilson")
    assert float(results["probability"]) == hits / n
    assert float(results["probability_low"]) == pytest.approx(low, abs=1e-12)
    assert float(results["probability_high"]) == pytest.approx(high, abs=1e-12)


@pytest.mark.parametrize("n", [16, 64])
def test_few_configurations_that_carry_a_mean_leave_it_open(n):
    """A probability that is 0 in nine of ten configurations: t limits hold in 69 and 90 % (of 95 %)."""
    rng = np.random.default_rng(3)
    inputs = hipuq.Inputs(x=cp.Uniform(0.0, 1.0))
    held = 0
    for _ in range(300):
        values = (rng.random(n) < 0.09) * rng.random(n) * 0.2
        outcomes = xr.Dataset({"p": ("sample", values, {"role": "probability", "units": "1"})})
        found = hipuq.estimate("monte_carlo", outcomes, inputs, of="p")
        held += float(found["probability_low"]) <= 0.009 <= float(found["probability_high"])
    assert held >= 0.92 * 300


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_what_never_came_may_be_rare(value):
    outcomes = xr.Dataset({"p": ("sample", np.full(32, value), {"role": "probability", "units": "1"})})
    found = hipuq.estimate("monte_carlo", outcomes, hipuq.Inputs(x=cp.Uniform(0.0, 1.0)), of="p")
    low, high = (float(found[f"probability_{end}"]) for end in ("low", "high"))
    assert [low, high] == pytest.approx([0.0, 0.1072] if value == 0 else [0.8928, 1.0], abs=1e-4)


def test_one_value_just_above_0_tells_no_more_than_none():
    values = np.zeros(64)
    inputs = hipuq.Inputs(x=cp.Uniform(0.0, 1.0))
    ends = []
    for value in (0.0, 1e-6, 1e-3):
        values[0] = value
        outcomes = xr.Dataset({"p": ("sample", values.copy(), {"role": "probability", "units": "1"})})
        ends.append(float(hipuq.estimate("monte_carlo", outcomes, inputs, of="p")["probability_high"]))
    assert ends == sorted(ends)
    assert ends[0] == pytest.approx(0.0566, abs=1e-3)
