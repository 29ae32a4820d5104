"""What an estimate is made of: unknown samples, roles of outcomes, replicates, moments by block."""

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from scipy import stats

import hipuq
from hipuq.errors import InputError, SchemaError, UnknownNameError
from hipuq.estimation.reduction import moments

INPUTS = hipuq.Inputs(x=cp.Uniform(0, 1))


def estimated(values, *, dims=("sample",), coords=None, **attrs) -> xr.Dataset:
    outcomes = xr.Dataset({"y": (dims, np.asarray(values), attrs)}, coords=coords)
    return hipuq.estimate("monte_carlo", outcomes, INPUTS, of="y")


def triple(results: xr.Dataset, quantity: str = "probability") -> list[float]:
    return [float(results[quantity + end]) for end in ("", "_low", "_high")]


def test_unknown_samples_are_counted_both_ways():
    """3 of 8 known are true, 2 unknown: from 3 of 10 to 5 of 10, each with its own interval."""
    share, low, high = triple(estimated([1.0] * 3 + [0.0] * 5 + [np.nan] * 2))
    assert share == 3 / 8
    assert low == pytest.approx(stats.binomtest(3, 10).proportion_ci(method="wilson").low)
    assert high == pytest.approx(stats.binomtest(5, 10).proportion_ci(method="wilson").high)


def test_all_unknown_says_nothing():
    share, low, high = triple(estimated([np.nan] * 4, role="verdict"))
    assert np.isnan(share)
    assert (low, high) == (0.0, 1.0)


def test_an_unknown_mean_stays_unknown():
    mean, low, high = triple(estimated([np.nan] * 4, units="Hz"), "mean")
    assert np.isnan([mean, low, high]).all()


@pytest.mark.parametrize(
    ("values", "attrs", "quantity"),
    [
        ([0.0, 1.0, 1.0], {"role": "verdict"}, "probability"),
        ([True, False, True], {}, "probability"),
        ([0.0, 1.0, np.nan], {}, "probability"),
        ([0, 1, 1], {}, "probability"),
        ([0.25, 0.5, 1.0], {"role": "probability"}, "probability"),
        ([0.25, 0.5, 1.0], {}, "mean"),
        ([0.0, 1.0, 1.0], {"units": "1"}, "mean"),
        ([3, 4, 5], {}, "mean"),
    ],
)
def test_what_an_outcome_is(values, attrs, quantity):
    """By role, then type; a bare outcome of nothing but 0 and 1 is an event, one with a unit is not."""
    results = estimated(values, **attrs)
    known = np.asarray(values, dtype=float)
    assert float(results[quantity]) == pytest.approx(np.nanmean(known))
    assert ("variance" in results) is (quantity == "mean")
    other = {"probability": "mean", "mean": "probability"}[quantity]
    assert other not in results


def test_a_mean_has_a_t_interval_and_a_variance():
    values = np.random.default_rng(1).normal(3, 2, 50)
    results = estimated(values, units="Hz", long_name="frequency")
    low, high = stats.t.interval(0.95, 49, values.mean(), stats.sem(values))
    assert triple(results, "mean") == pytest.approx([values.mean(), low, high])
    assert float(results["variance"]) == pytest.approx(values.var(ddof=1))
    assert results["mean"].attrs["units"] == "Hz"


def test_probabilities_themselves_have_a_t_interval_within_0_and_1():
    values = np.array([0.0, 0.1, 0.9, 1.0, 1.0, 1.0])
    low, high = stats.t.interval(0.95, 5, values.mean(), stats.sem(values))
    assert high > 1
    assert triple(estimated(values, role="probability")) == pytest.approx([values.mean(), low, 1.0])


@pytest.mark.parametrize("role", ["verdict", "probability"])
def test_replicates_show_their_own_error(role):
    """The interval is that of the means of independent designs, t with their number less one."""
    rng = np.random.default_rng(2)
    values = rng.random((8, 16)).round() if role == "verdict" else rng.random((8, 16))
    results = estimated(
        values.ravel(), coords={"replicate": ("sample", np.repeat(np.arange(1, 9), 16))}, role=role
    )
    means = values.mean(axis=1)
    low, high = stats.t.interval(0.95, 7, means.mean(), stats.sem(means))
    if role == "verdict":
        # The p with (mean - p)^2 = t^2 p (1 - p) / draws, and half of one of 128 points more.
        p, ratio = (
            means.mean(),
            stats.t.ppf(0.975, 7) ** 2 * stats.sem(means) ** 2 / (means.mean() * (1 - means.mean())),
        )
        roots = np.roots([1 + ratio, -2 * p - ratio, p**2])
        low, high = roots.min() - 0.5 / 128, roots.max() + 0.5 / 128
    assert triple(results) == pytest.approx([values.mean(), low, high])


def test_replicates_that_agree_fall_back_to_the_pooled_interval():
    """Equal means do not prove that the error is zero."""
    values = np.tile([0.0, 0.0, 0.0, 1.0], 8)
    results = estimated(values, coords={"replicate": ("sample", np.repeat(np.arange(1, 9), 4))})
    low, high = stats.binomtest(8, 32).proportion_ci(method="wilson")
    assert triple(results) == pytest.approx([0.25, low, high])


@pytest.mark.parametrize("replicates", [3, 5, 7, 8, 10])
@pytest.mark.parametrize("modes", [0, 3])
def test_rounding_is_no_scatter_of_replicates(replicates, modes):
    """The mean of equal shares of 1/10 is not 1/10 to the last bit; limits are those of the pooled sample."""
    n = 10 * replicates
    values = np.tile([1.0] + [0.0] * 9, replicates)
    dims = ("sample", "mode") if modes else ("sample",)
    values = np.repeat(values[:, None], modes, axis=1) if modes else values
    replicate = {"replicate": ("sample", np.repeat(np.arange(1, replicates + 1), 10))}
    results = estimated(values, dims=dims, coords=replicate, role="verdict")
    expected = stats.binomtest(replicates, n).proportion_ci(method="wilson")
    for end in ("low", "high"):
        np.testing.assert_allclose(results[f"probability_{end}"], getattr(expected, end), rtol=1e-9)


def test_outcomes_over_modes_are_estimated_mode_by_mode():
    values = np.array([[0, 1, np.nan], [0, 1, 1.0], [1, 1, np.nan]])
    results = estimated(values, dims=("sample", "mode"), coords={"mode": [1, 2, 3]}, role="verdict")
    assert results["probability"].dims == ("mode",)
    assert results["probability"].values == pytest.approx([1 / 3, 1, 1])
    assert results["known"].values.tolist() == [3, 3, 1]
    assert results["mode"].values.tolist() == [1, 2, 3]


def test_infinite_values_are_refused_with_their_share():
    with pytest.raises(InputError, match=r"y is infinite in 2 samples \(50.00%\)"):
        estimated([1.0, np.inf, -np.inf, 2.0], units="1")


def test_missing_outcomes_are_named():
    outcomes = xr.Dataset({"margin": ("sample", [1.0])})
    with pytest.raises(UnknownNameError, match="did you mean 'margin'"):
        hipuq.estimate("monte_carlo", outcomes, INPUTS, of="margn")
    with pytest.raises(SchemaError, match="needs the dim 'sample'"):
        hipuq.estimate("monte_carlo", xr.Dataset({"y": ("x", [1.0])}), INPUTS, of="y")
    with pytest.raises(SchemaError, match="must hold numbers"):
        hipuq.estimate("monte_carlo", xr.Dataset({"y": ("sample", ["a"])}), INPUTS, of="y")
    with pytest.raises(SchemaError, match="is empty"):
        hipuq.estimate("monte_carlo", xr.Dataset({"y": ("sample", np.zeros(0))}), INPUTS, of="y")


def test_counts_of_status_are_reported():
    outcomes = xr.Dataset(
        {"y": ("sample", [0.0, 1.0, np.nan, np.nan]), "status": ("sample", np.array([0, 0, 1, 2], np.int8))}
    )
    results = hipuq.estimate("monte_carlo", outcomes, INPUTS, of="y")
    assert [int(results[name]) for name in ("evaluations", "undecided", "failed")] == [4, 1, 1]


@pytest.mark.parametrize("block", [3, 50, 1000])
def test_moments_are_those_of_numpy(block):
    """By group and element, with missing values, whatever the size of the blocks."""
    rng = np.random.default_rng(3)
    values = rng.normal(1e6, 1.0, (200, 4))
    values[rng.random((200, 4)) < 0.2] = np.nan
    values[:, 3] = np.nan
    groups = rng.integers(0, 5, 200)
    groups[groups == 4] = 0  # one group stays empty
    found = moments(xr.DataArray(values, dims=("sample", "mode")), groups, 5, block=block)
    for group in range(5):
        part = values[groups == group]
        known = (~np.isnan(part)).sum(axis=0)
        assert found.size[group] == len(part)
        assert found.known[group].tolist() == known.tolist()
        for column in range(4):
            present = part[~np.isnan(part[:, column]), column]
            if len(present):
                assert found.mean[group, column] == pytest.approx(present.mean(), rel=1e-14)
                assert found.squares[group, column] == pytest.approx(present.var() * len(present), rel=1e-8)
            else:
                assert np.isnan(found.mean[group, column])
                assert np.isnan(found.variance[group, column])


def test_filled_moments_are_those_of_the_filled_values():
    values = np.array([0.2, np.nan, 0.9, np.nan, 0.4])
    array = xr.DataArray(values, dims="sample")
    for filler in (0.0, 1.0):
        filled = np.where(np.isnan(values), filler, values)
        found = moments(array, np.zeros(5, np.intp), 1).with_unknown(filler)
        assert found.mean == pytest.approx(filled.mean())
        assert found.squares == pytest.approx(filled.var() * 5)


def stratified(values: np.ndarray, weights) -> xr.Dataset:
    """Return results of verdicts (level, draw) over the 4 patterns of 1 or 3 of 3 oscillators."""
    levels, draws = values.shape
    patterns = hipuq.ContactPatterns((1, 3), oscillators=3, weights=weights)
    inputs = hipuq.Inputs(contact=patterns, x=cp.Uniform(0, 1))
    outcomes = xr.Dataset(
        {"y": ("sample", values.ravel(), {"role": "verdict"})},
        coords={
            "pattern": ("sample", np.repeat(np.arange(1, levels + 1), draws)),
            "weight": ("sample", np.repeat(patterns.weight[:levels], draws)),
        },
    )
    return hipuq.estimate("monte_carlo", outcomes, inputs, of="y")


def test_strata_without_weight_do_not_spoil_the_whole():
    """A level of weight 0 that was never drawn is unknown, and the overall estimate is not."""
    values = np.random.default_rng(1).integers(0, 2, (3, 40)).astype(float)
    results = stratified(values, (1.0, 0.0))
    assert np.isnan(results["probability"].values[3])
    share, low, high = triple(results, "probability_overall")
    assert share == pytest.approx(values.mean())
    assert low < share < high


def test_unknown_samples_of_all_strata_count_the_same_way():
    """They may all be stable, or all unstable: their shares add up, they do not average out."""
    values = np.tile([0.0, 1.0, np.nan, np.nan], (4, 10))
    results = stratified(values, None)
    for quantity in ("probability_overall", "probability_mean"):
        low, high = results[f"{quantity}_low"].values, results[f"{quantity}_high"].values
        assert (low < 0.25).all() and (high > 0.75).all()
        assert (low > 0.0).all() and (high < 1.0).all()


def test_intervals_of_strata_add_up_in_squares():
    """Equal independent strata of equal weight: the half-width shrinks with the root of their number."""
    values = np.tile([0.0, 1.0], (4, 200))
    results = stratified(values, (0.75, 0.25))
    half = float(results["probability_high"][0] - results["probability"][0])
    overall = float(results["probability_overall_high"] - results["probability_overall"])
    # Wilson's limits of the four together are a little further off than those of one in squares.
    assert half / 2 < overall < 1.01 * half / 2


def test_outcomes_of_other_strata_are_refused():
    """Pattern 1 of 8 and 9 in contact is not pattern 1 of 6 to 9."""
    model = hipuq.models.ring()
    inputs, other = (
        model.inputs(friction=cp.Uniform(0, 0.1), contact=hipuq.ContactPatterns(in_contact=counts))
        for counts in ((8, 9), (6, 7, 8, 9))
    )
    samples = hipuq.design("monte_carlo", inputs, n=2, rng=0, stratify="contact")
    outcomes = hipuq.evaluate(model, samples, keep=["any_unstable"])
    with pytest.raises(SchemaError, match="another contact"):
        hipuq.estimate("monte_carlo", outcomes, other, of="any_unstable")
