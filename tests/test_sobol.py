"""Sobol indices: SALib's design and estimates bit for bit, analytic values, honest limits and gaps."""

import json
import math

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from SALib.analyze import sobol as salib_analyze
from SALib.sample import sobol as salib_sample

import hipuq
from hipuq.errors import InputError, SchemaError
from hipuq.estimation.indices import elements, undefined
from hipuq.saltelli import resampling
from hipuq.saltelli.decomposition import standardised
from hipuq.sampling import spawn

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


def matrix_of(samples) -> np.ndarray:
    """Return the values of all parameters, columns in order."""
    size = samples.sizes["sample"]
    return np.concatenate([v.values.reshape(size, -1) for v in samples.data_vars.values()], axis=1)


def problem(inputs, *, groups) -> dict:
    names = elements(inputs)
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


def outcomes_of(inputs, n, seed=0, model=rough, **options) -> xr.Dataset:
    samples = hipuq.design("sobol", inputs, n, seed, **options)
    return samples.assign(y=model(samples).drop_attrs())


# ------------------------------------------------------------------------------- the design


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
    assert results["parameter"].values.tolist() == (list(inputs) if groups else elements(inputs))
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


def ishigami(samples):
    x1, x2, x3 = (samples[name] for name in ("x1", "x2", "x3"))
    return np.sin(x1) + 7 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1)


def test_indices_of_the_ishigami_function():
    """E(1 + b x^4) = 1 + b pi^4/5 and E(1 + b x^4)^2 = 1 + 2b pi^4/5 + b^2 pi^8/9 give the variances."""
    a, b = 7, 0.1
    first = 0.5 * (1 + b * math.pi**4 / 5) ** 2
    second = a**2 / 8
    both = 0.5 * (1 + 2 * b * math.pi**4 / 5 + b**2 * math.pi**8 / 9) - first
    total = first + second + both
    inputs = hipuq.Inputs(**dict.fromkeys(("x1", "x2", "x3"), cp.Uniform(-math.pi, math.pi)))
    outcomes = outcomes_of(inputs, 8192, model=ishigami, second_order=True)
    results = estimate(outcomes, inputs, resamples=100)
    assert results["S1"].values == pytest.approx(np.array([first, second, 0]) / total, abs=0.015)
    assert results["ST"].values == pytest.approx(np.array([first + both, second, both]) / total, abs=0.015)
    assert results["S2"].values[UPPER] == pytest.approx(np.array([0, both, 0]) / total, abs=0.015)
    assert float(results["variance"]) == pytest.approx(total, rel=0.01)
    assert float(results["mean"]) == pytest.approx(a / 2, rel=0.01)


def test_indices_of_the_g_function():
    """The product of (|4 x_i - 2| + a_i) / (1 + a_i): each factor has mean 1, variance 1/3/(1 + a_i)^2."""
    a = np.array([0.0, 1.0, 4.5])
    parts = 1 / 3 / (1 + a) ** 2
    total = np.prod(1 + parts) - 1

    def g(samples):
        product = 1.0
        for i, values in enumerate(samples.data_vars.values()):
            product = product * (abs(4 * values - 2) + a[i]) / (1 + a[i])
        return product

    inputs = unit_inputs("x1", "x2", "x3")
    results = estimate(outcomes_of(inputs, 8192, model=g, second_order=True), inputs, resamples=100)
    others = np.prod(1 + parts) / (1 + parts)
    assert results["S1"].values == pytest.approx(parts / total, abs=0.015)
    assert results["ST"].values == pytest.approx(parts * others / total, abs=0.015)
    products = np.outer(parts, parts)[UPPER]
    assert results["S2"].values[UPPER] == pytest.approx(products / total, abs=0.015)


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


# ----------------------------------------------------------------------------------- limits


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


def additive(samples):
    return samples["x1"] + 2 * samples["x2"] + 3 * samples["x3"]


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


# ------------------------------------------------------- what is missing, unknown or certain


def assert_same(one, other, *, but=()) -> None:
    """Assert that results are the same to the last bit, apart from some."""
    names = [name for name in one.data_vars if name not in but]
    for name in names:
        assert np.array_equal(one[name], other[name], equal_nan=True), name


def test_order_and_labels_of_samples_do_not_matter():
    inputs = unit_inputs("x1", "x2", "x3")
    outcomes = outcomes_of(inputs, 32, second_order=True)
    order = np.random.default_rng(0).permutation(outcomes.sizes["sample"])
    shuffled = outcomes.isel(sample=order).drop_vars("sample")
    assert_same(estimate(shuffled, inputs), estimate(outcomes, inputs))
    # The coords as data, without a word about them, or as floats are as good.
    plain = shuffled.reset_coords(["block", "matrix"]).drop_attrs().assign_attrs(seed=0)
    assert_same(estimate(plain.astype(float), inputs), estimate(outcomes, inputs))


@pytest.mark.parametrize("how", ["unknown", "failed", "missing"])
def test_a_dropped_block_is_as_if_it_had_not_been_there(how):
    inputs = grouped_inputs()
    outcomes = outcomes_of(inputs, 32, second_order=True)
    bad = [11, 100, 101]
    hit = outcomes.assign(y=outcomes["y"].copy())
    if how == "unknown":
        hit["y"][bad] = np.nan
    elif how == "failed":
        status = np.zeros(outcomes.sizes["sample"], np.int8)
        status[bad] = hipuq.schema.STATUS["failed"]
        hit["status"] = ("sample", status)
    else:
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
    assert results["S1"].attrs["undefined"] == (
        f"{events} events and {128 - events} non-events among the samples of A and B, at least 50 of each "
        'are needed: take more samples, or analyse of="margin"'
    )
    # Without a least number of events, it is still seen.
    anyway = estimate(outcomes_of(inputs, 64, model=lambda s: s["x1"] > 2), inputs, minimum_events=0)
    assert anyway["S1"].attrs["undefined"] == ("the outcome does not vary: it is 0 in all samples of A and B")


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
        graded = estimate(outcomes.assign(y=outcomes["y"].astype(float).assign_attrs(attrs)), inputs)
        assert graded["S1"].values == pytest.approx(enough["S1"].values)
        assert "events" not in graded


def test_limits_need_resamples_that_vary():
    """An outcome that differs in one block of 16 is constant in every third resample or so."""
    inputs = unit_inputs("x1", "x2")
    outcomes = outcomes_of(inputs, 16)
    values = np.where(outcomes["block"] == 3, outcomes["y"], 2.5)
    results = estimate(outcomes.assign(y=("sample", values)), inputs)
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


@pytest.mark.parametrize("scale", [1e-290, 1e-12, 1e300])
def test_units_do_not_matter(scale):
    inputs = unit_inputs("x1", "x2", "x3")
    outcomes = outcomes_of(inputs, 32, model=ishigami)
    scaled = estimate(outcomes.assign(y=outcomes["y"] * scale), inputs)
    plain = estimate(outcomes, inputs)
    for name in ("S1", "ST", "S1_low", "ST_high"):
        assert scaled[name].values == pytest.approx(plain[name].values, abs=1e-12)


# ------------------------------------------------------------------- dims, labels, convergence


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


# ----------------------------------------------------------------------------- odd outcomes


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
    fails("y has the dim 'parameter', which its indices have: rename it", outcomes.assign(y=parameters))
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


def test_a_single_parameter_is_the_cause_of_everything():
    inputs = unit_inputs("x")
    results = estimate(outcomes_of(inputs, 64, second_order=True), inputs)
    assert results["S1"].values == pytest.approx([1.0], abs=0.05)
    assert results["ST"].values == pytest.approx([1.0], abs=0.05)
    assert results["S2"].shape == (1, 1)
    assert np.isnan(results["S2"]).all()


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
