"""Sobol indices: SALib's estimates, analytic values, honest limits."""

import json

import chaospy as cp
import functions
import numpy as np
import pytest
import xarray as xr
from SALib.analyze import sobol as salib_analyze
from sobol_designs import (
    UPPER,
    additive,
    estimate,
    grouped_inputs,
    ishigami,
    outcomes_of,
    problem,
    unit_inputs,
)

import hipuq
from hipuq.errors import InputError
from hipuq.saltelli import resampling
from hipuq.saltelli.decomposition import standardised

# ---------------------------------------------------------------------- estimates as SALib's


@pytest.mark.parametrize("second_order", [False, True])
@pytest.mark.parametrize("groups", [False, True])
def test_estimates_are_salibs(groups, second_order):
    inputs = grouped_inputs()
    outcomes = outcomes_of(inputs, 64, groups=groups, second_order=second_order)
    results = estimate(outcomes, inputs)
    theirs = salib_analyze.analyze(
        problem(inputs, groups=groups), outcomes["y"].values, calc_second_order=second_order, seed=1
    )
    assert results["S1"].values == pytest.approx(theirs["S1"], abs=1e-12)
    assert results["ST"].values == pytest.approx(theirs["ST"], abs=1e-12)
    assert results["parameter"].values.tolist() == (list(inputs) if groups else inputs.elements)
    assert ("S2" in results) == second_order
    if second_order:
        upper = np.triu_indices(len(results["parameter"]), 1)
        assert results["S2"].values[upper] == pytest.approx(theirs["S2"][upper], abs=1e-12)
        assert np.array_equal(results["S2"].values, results["S2"].values.T, equal_nan=True)
        assert np.isnan(np.diag(results["S2"].values)).all()
    both = outcomes["y"].values[np.isin(outcomes["matrix"], (0, outcomes["matrix"].max()))]
    assert float(results["mean"]) == pytest.approx(both.mean())
    assert float(results["variance"]) == pytest.approx(both.var(ddof=1))


def test_rows_for_pairs_may_be_left_alone():
    """Then everything is as without them, even where only they are unknown."""
    inputs = grouped_inputs()
    whole = outcomes_of(inputs, 32, second_order=True)
    without = outcomes_of(inputs, 32)
    pairs = whole["matrix"].isin([4, 5, 6])
    unknown = whole.assign(y=whole["y"].where(~pairs))
    results = estimate(unknown, inputs, second_order=False)
    expected = estimate(without, inputs)
    for name in ("S1", "ST", "S1_low", "ST_high", "ST_by_budget_low", "mean", "dropped"):
        assert np.array_equal(results[name], expected[name]), name
    assert "S2" not in results
    assert int(estimate(unknown, inputs)["dropped"]) == 32
    with pytest.raises(InputError, match="no samples for pairs: design with second_order=True"):
        estimate(without, inputs, second_order=True)
    with pytest.raises(InputError, match="second_order is 'yes'"):
        estimate(without, inputs, second_order="yes")


@pytest.mark.parametrize("name", ["ishigami", "sobol_g"])
def test_indices_of_known_functions(name):
    known = getattr(functions, name)()
    outcomes = outcomes_of(known.inputs, 8192, model=lambda s: known.model(s)["y"], second_order=True)
    results = estimate(outcomes, known.inputs, resamples=100)
    assert results["S1"].values == pytest.approx(known.first, abs=0.015)
    assert results["ST"].values == pytest.approx(known.total, abs=0.015)
    assert results["S2"].values[UPPER] == pytest.approx(known.second[UPPER], abs=0.015)
    assert float(results["variance"]) == pytest.approx(known.variance, rel=0.01)
    assert float(results["mean"]) == pytest.approx(known.mean, rel=0.01)


def test_groups_of_the_ring_are_sums_over_their_elements():
    """For an outcome that is a sum, by hand: stiffnesses together are the sum of their single indices."""
    inputs = hipuq.models.ring().inputs(
        friction=cp.Uniform(0.0, 0.1),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
    )

    def additive(samples):
        relative = samples["spring_stiffness"] / 1.05e9 - 1
        return (relative * np.arange(1, 11)).sum("spring") + 50 * samples["friction"]

    weights = np.arange(1, 11) ** 2 * 0.2**2 / 12
    friction = 50**2 * 0.1**2 / 12
    total = weights.sum() + friction
    together = estimate(outcomes_of(inputs, 1024, model=additive), inputs)
    assert together["parameter"].values.tolist() == ["friction", "spring_stiffness"]
    expected = np.array([friction, weights.sum()]) / total
    assert together["S1"].values == pytest.approx(expected, abs=0.01)
    assert together["ST"].values == pytest.approx(expected, abs=0.01)
    single = estimate(outcomes_of(inputs, 1024, model=additive, groups=False), inputs)
    assert single["parameter"].values[:2].tolist() == ["friction", "spring_stiffness[1]"]
    assert single["S1"].values == pytest.approx(np.array([friction, *weights]) / total, abs=0.015)


def test_a_single_parameter_is_the_cause_of_everything():
    inputs = unit_inputs("x")
    results = estimate(outcomes_of(inputs, 64, second_order=True), inputs)
    assert results["S1"].values == pytest.approx([1.0], abs=0.05)
    assert results["ST"].values == pytest.approx([1.0], abs=0.05)
    assert results["S2"].shape == (1, 1)
    assert np.isnan(results["S2"]).all()


@pytest.mark.parametrize("scale", [1e-290, 1e-12, 1e300])
def test_units_do_not_matter(scale):
    inputs = unit_inputs("x1", "x2", "x3")
    outcomes = outcomes_of(inputs, 32, model=ishigami)
    scaled = estimate(outcomes.assign(y=outcomes["y"] * scale), inputs)
    plain = estimate(outcomes, inputs)
    for name in ("S1", "ST", "S1_low", "ST_high"):
        assert scaled[name].values == pytest.approx(plain[name].values, abs=1e-12)


# ------------------------------------------------------------------------------------ limits


@pytest.mark.parametrize("second_order", [False, True])
def test_resamples_are_estimates_of_resampled_blocks(second_order):
    """Each block once is the estimate itself; any other number is SALib's estimate of the repeated blocks."""
    inputs = unit_inputs("x1", "x2", "x3")
    outcomes = outcomes_of(inputs, 32, model=ishigami, second_order=second_order)
    table = outcomes["y"].values.reshape(32, -1)
    pairs = list(zip(*(part.tolist() for part in UPPER), strict=True)) if second_order else []
    times = np.concatenate([np.ones((1, 32)), *resampling.multiplicities(0, 32, 5)])
    found = resampling.resampled(standardised(table), 3, times, pairs)
    for row, numbers in zip(found, times, strict=True):
        repeated = table[np.repeat(np.arange(32), numbers.astype(int))]
        theirs = salib_analyze.analyze(
            problem(inputs, groups=False), repeated.ravel(), calc_second_order=second_order, seed=1
        )
        expected = [*theirs["S1"], *theirs["ST"], *(theirs["S2"][UPPER] if second_order else [])]
        assert row == pytest.approx(np.array(expected), abs=1e-12)


def test_resamples_do_not_depend_on_how_they_are_divided():
    whole = np.concatenate(list(resampling.multiplicities(7, 64, 50)))
    assert (whole.sum(axis=1) == 64).all()
    for chunk in (1, 64 * 7, 64 * 50):
        assert np.array_equal(np.concatenate(list(resampling.multiplicities(7, 64, 50, chunk))), whole)
    # Binomial: each block is drawn once on average, with a variance of 1 - 1/64.
    many = np.concatenate(list(resampling.multiplicities(8, 64, 2000)))
    assert many.mean(axis=0) == pytest.approx(np.ones(64), abs=0.12)
    assert many.var() == pytest.approx(1 - 1 / 64, rel=0.03)


def random_blocks(seed, n, inputs) -> xr.Dataset:
    """Return a design as hipuq makes it, but from independent points."""
    layout = hipuq.design("sobol", inputs, n, 0, second_order=True)
    count = len(inputs)
    width = 2 * count + 2
    a, b = np.random.default_rng(seed).random((2, n, 1, count))
    only = np.eye(count, dtype=bool)
    none, every = np.zeros((1, count), bool), np.ones((1, count), bool)
    points = np.where(np.concatenate([none, only, ~only, every]), b, a).reshape(n * width, count)
    return layout.assign({name: ("sample", points[:, j]) for j, name in enumerate(inputs)})


def test_limits_cover_analytic_values():
    """Of 200 independent designs about 95 % do, of Sobol points more: they err less than limits allow."""
    inputs = unit_inputs("x1", "x2", "x3")
    exact = np.array([1, 4, 9]) / 14
    covered = []
    for seed in range(200):
        samples = random_blocks(seed, 64, inputs)
        results = estimate(samples.assign(y=additive(samples)), inputs, rng=seed, resamples=400)
        inside = [
            (results[f"{name}_low"].values <= value) & (value <= results[f"{name}_high"].values)
            for name, value in (("S1", exact), ("ST", exact), ("S2", np.zeros((3, 3))))
        ]
        covered.append([*inside[0], *inside[1], *inside[2][UPPER]])
    share = np.mean(covered, axis=0)
    assert (share > 0.88).all()
    assert (share < 0.99).all()
    for seed in range(20):
        results = estimate(outcomes_of(inputs, 64, seed, additive), inputs)
        assert ((results["ST_low"] <= exact) & (exact <= results["ST_high"])).all()


def test_limits_are_percentiles_of_resamples():
    inputs = unit_inputs("x1", "x2", "x3")
    outcomes = outcomes_of(inputs, 32, model=ishigami)
    results = estimate(outcomes, inputs, resamples=50, confidence=0.8)
    seed = json.loads(results.attrs["options"])["estimate"]["resampling_seed"]
    (times,) = resampling.multiplicities(seed, 32, 50)
    drawn = resampling.resampled(standardised(outcomes["y"].values.reshape(32, -1)), 3, times)
    for end, level in (("low", 0.1), ("high", 0.9)):
        expected = np.quantile(drawn, level, axis=0)
        assert results[f"S1_{end}"].values == pytest.approx(expected[:3], abs=1e-12)
        assert results[f"ST_{end}"].values == pytest.approx(expected[3:], abs=1e-12)


def test_limits_belong_to_a_seed():
    """The design's by default, 0 too; whichever was taken is named and gives them again."""
    inputs = unit_inputs("x1", "x2", "x3")
    for seed in (0, 5):
        outcomes = outcomes_of(inputs, 32, seed, ishigami)
        one = estimate(outcomes, inputs)
        assert estimate(outcomes, inputs).equals(one)
        assert not estimate(outcomes, inputs, rng=9)["S1_low"].equals(one["S1_low"])
        assert estimate(outcomes, inputs, rng=9)["S1"].equals(one["S1"])
        assert one.attrs["seed"] == seed
    zero = estimate(outcomes, inputs, rng=0)
    assert estimate(outcomes, inputs, rng=0).equals(zero)
    bare = outcomes.drop_attrs(deep=False)
    free = estimate(bare, inputs)
    assert not estimate(bare, inputs)["S1_low"].equals(free["S1_low"])
    taken = json.loads(free.attrs["options"])["estimate"]["resampling_seed"]
    assert estimate(bare, inputs, rng=taken).equals(free)
    rng = np.random.default_rng(3)
    first, second = (estimate(outcomes, inputs, rng=rng) for _ in range(2))
    assert not first["S1_low"].equals(second["S1_low"])


def test_limits_are_narrower_for_less_confidence_and_more_points():
    inputs = unit_inputs("x1", "x2", "x3")

    def width(n, **options):
        results = estimate(outcomes_of(inputs, n, model=ishigami), inputs, resamples=500, **options)
        return (results["ST_high"] - results["ST_low"]).values

    assert (width(256, confidence=0.5) < 0.6 * width(256)).all()
    assert width(4096) == pytest.approx(width(256) / 4, rel=0.4)
    options = json.loads(estimate(outcomes_of(inputs, 8), inputs, confidence=0.9).attrs["options"])
    assert options["estimate"]["confidence"] == 0.9
    assert options["estimate"]["resamples"] == 20


# ------------------------------------------------------------------------------- convergence


def test_estimates_by_budget_are_those_of_the_first_blocks():
    inputs = unit_inputs("x1", "x2", "x3")
    outcomes = outcomes_of(inputs, 64, model=ishigami, second_order=True)
    results = estimate(outcomes, inputs)
    assert results["budget"].values.tolist() == [128, 256, 512]
    assert int(results["evaluations"]) == 512
    for budget in (128, 256, 512):
        part = estimate(outcomes.isel(sample=slice(0, budget)), inputs)
        for name in ("S1", "ST"):
            for end in ("", "_low", "_high"):
                by_budget = results[f"{name}_by_budget{end}"].sel(budget=budget)
                assert np.array_equal(by_budget, part[name + end]), (budget, name, end)
    few = estimate(outcomes.isel(sample=slice(0, 10 * 8)), inputs)
    assert few["budget"].values.tolist() == [80]


def test_indices_converge():
    inputs = unit_inputs("x1", "x2", "x3")
    results = estimate(outcomes_of(inputs, 1024, model=additive), inputs)
    error = abs(results["ST_by_budget"] - np.array([1, 4, 9]) / 14).max("parameter")
    assert float(error[-1]) < 0.1 * float(error[0])
