"""Numbers of a comparison against answers by hand."""

import numpy as np
import pytest

from hipuq.comparison.costs import costs
from hipuq.comparison.statistics import Cells, errors, ranks, rates
from hipuq.intervals import wilson


def cells(
    estimate, *, low=None, high=None, reference=0.0, exact=True, evaluations=None, seconds=1.0, model=0.5
):
    """Return cells of estimates over (method, budget, replicate, ...); rows of NaN were not run."""
    estimate = np.asarray(estimate, float)
    reference = np.asarray(reference, float)
    shape = estimate.shape[:3]
    ran = ~np.isnan(estimate.reshape(*shape, -1)).all(axis=-1)
    nothing = np.full_like(estimate, np.nan)
    return Cells(
        estimate,
        nothing if low is None else np.asarray(low, float),
        nothing if high is None else np.asarray(high, float),
        np.broadcast_to(np.asarray(seconds, float), shape),
        np.broadcast_to(np.asarray(model, float), shape),
        np.full(shape[:2], 10) if evaluations is None else np.asarray(evaluations),
        ran.sum(axis=2),
        reference,
        exact,
    )


def stream(i, j):
    return np.random.default_rng([i, j])


def test_bias_and_error_by_hand():
    found, resampled = errors(cells([[[1.0, 2.0, 6.0]]], reference=2.0), stream, 0.95)
    assert found["bias"][0, 0] == pytest.approx(1.0)
    assert found["bias_error"][0, 0] == pytest.approx(np.sqrt(7.0 / 3.0))
    assert found["rmse"][0, 0] == pytest.approx(np.sqrt(17.0 / 3.0))
    assert "rmse_overall" not in found
    # 27 resamples of three are alike: a tenth of them are of one replicate alone
    assert set(np.round(resampled[:, 0, 0] ** 2 * 3).astype(int)) <= {
        a + b + c for a in (0, 1, 16) for b in (0, 1, 16) for c in (0, 1, 16)
    }
    assert resampled.min() == 0.0
    assert resampled.max() == pytest.approx(4.0)


def test_limits_of_the_error_hold_it():
    """Of normal errors the bootstrap limits hold the standard deviation nearly as often as they say."""
    rng = np.random.default_rng(3)
    estimate = rng.normal(size=(200, 1, 60))
    found, _ = errors(cells(estimate), stream, 0.9)
    held = (found["rmse_low"] <= 1.0) & (found["rmse_high"] >= 1.0)
    assert 0.82 < held.mean() < 0.96


def test_coverage_counts_intervals():
    low, high = [[[0.0, 1.5, 3.0, np.nan]]], [[[2.0, 2.5, 4.0, np.nan]]]
    given = cells([[[1.0, 2.0, 3.5, 2.0]]], low=low, high=high, reference=2.0)
    found, _ = errors(given, stream, 0.95)
    assert found["coverage"][0, 0] == pytest.approx(2 / 3)
    assert found["intervals"].tolist() == [[3]]
    both = wilson(np.array(2.0), np.array(3.0), 0.95)
    np.testing.assert_allclose([found["coverage_low"][0, 0], found["coverage_high"][0, 0]], both)


@pytest.mark.parametrize(("exact", "held"), [(True, 1.0), (False, 0.0)])
def test_rounding_is_forgiven_against_an_exact_reference(exact, held):
    ends = np.full((1, 1, 2), 2.0 + 1e-11)
    found, _ = errors(cells(ends, low=ends, high=ends, reference=2.0, exact=exact), stream, 0.95)
    assert found["coverage"][0, 0] == held
    far = ends + 1e-9
    found, _ = errors(cells(far, low=far, high=far, reference=2.0, exact=exact), stream, 0.95)
    assert found["coverage"][0, 0] == 0.0


def test_over_other_dims():
    estimate = np.array([[[[1.0, 0.0], [0.0, 3.0]]]])
    given = cells(estimate, low=estimate - 0.5, high=estimate + 0.5, reference=[0.0, 0.0])
    found, resampled = errors(given, stream, 0.95)
    assert found["rmse"][0, 0] == pytest.approx([np.sqrt(1 / 2), np.sqrt(9 / 2)])
    assert found["rmse_overall"][0, 0] == pytest.approx(np.sqrt(10 / 4))
    assert found["coverage"][0, 0].tolist() == [0.5, 0.5]
    assert found["coverage_overall"][0, 0] == 0.5
    # runs agree: of as many trials as runs, not as numbers
    assert found["coverage_overall_low"][0, 0] == pytest.approx(wilson(np.array(1.0), np.array(2.0), 0.95)[0])
    assert set(np.round(resampled.ravel() ** 2 * 4)) <= {2.0, 10.0, 18.0}


def test_coverage_over_other_dims_has_the_scatter_of_the_runs():
    """Runs of 40 intervals each that hold together or not at all are 30 trials; independent ones are 1200."""
    rng = np.random.default_rng(1)
    width = {}
    for name, shape in (("together", (30, 1)), ("apart", (30, 40))):
        held = np.broadcast_to(rng.uniform(size=shape) < 0.9, (30, 40))
        low = np.where(held, -1.0, 1.0)[None, None]
        given = cells(np.zeros((1, 1, 30, 40)), low=low, high=low + 2.0, reference=np.zeros(40))
        found, _ = errors(given, stream, 0.95)
        share, *ends = (float(found[f"coverage_overall{end}"][0, 0]) for end in ("", "_low", "_high"))
        assert share == pytest.approx(held.mean())
        assert ends[0] < 0.9 < ends[1]
        width[name] = ends[1] - ends[0]
        if name == "together":
            trials = np.ptp(wilson(np.array(30 * share), np.array(30.0), 0.95))
    assert width["together"] == pytest.approx(trials, rel=0.1)
    assert width["apart"] == pytest.approx(2 * 1.96 * np.sqrt(0.09 / 1200), rel=0.3)


def test_what_was_not_run_is_unknown():
    estimate = np.full((2, 2, 3), np.nan)
    estimate[0] = 1.0
    estimate[1, 0, :2] = 2.0
    found, resampled = errors(cells(estimate), stream, 0.95)
    assert np.isnan(found["rmse"]).tolist() == [[False, False], [False, True]]
    ratio = ranks(found["rmse"], resampled, 0.95)["rmse_ratio"]
    np.testing.assert_equal(ratio, [[1.0, 1.0], [2.0, np.nan]])


def test_the_lowest_error_is_told_apart_or_not():
    rng = np.random.default_rng(0)
    scale = np.array([1.0, 1.05, 3.0])[:, None, None]
    found, resampled = errors(cells(scale * rng.normal(size=(3, 1, 50))), stream, 0.95)
    made = ranks(found["rmse"], resampled, 0.95)
    ratio, low, high = (made[f"rmse_ratio{end}"][:, 0] for end in ("", "_low", "_high"))
    best = int(ratio.argmin())
    assert best in (0, 1)
    assert ratio[best] == low[best] == high[best] == 1.0
    other = 1 - best
    assert low[other] < 1.0 < high[other]
    assert low[2] > 1.5
    assert high[2] < 6.0


def test_an_error_of_zero_wins():
    found, resampled = errors(cells([[[0.0, 0.0]], [[0.0, 1.0]], [[0.0, 0.0]]]), stream, 0.95)
    made = ranks(found["rmse"], resampled, 0.95)
    assert made["rmse_ratio"][:, 0].tolist() == [1.0, np.inf, 1.0]


def test_rates_are_slopes():
    n = np.array([[10, 100, 1000, 10000], [10, 100, 0, 0], [4, 8, 16, 32]])
    rmse = np.array([[1.0, 0.1**0.5, 0.1, 0.1**1.5], [1.0, 0.5, np.nan, np.nan], [8.0, 4.0, 2.0, 1.0]])
    resampled = rmse * np.random.default_rng(0).uniform(0.9, 1.1, (1000, 1, 1))
    found = rates(rmse, resampled, n, 0.95)
    np.testing.assert_allclose(found["rate"], [-0.5, np.nan, -1.0])
    # a common factor changes no slope
    np.testing.assert_allclose(found["rate_low"], [-0.5, np.nan, -1.0])
    zero = rates(np.zeros((1, 4)), np.zeros((1000, 1, 4)), n[:1], 0.95)
    assert np.isnan(zero["rate"]).all()


def spread(rmse):
    """Return resampled errors: those of all contenders within 10 %, each by itself."""
    return rmse * np.random.default_rng(2).uniform(0.9, 1.1, (1000, *rmse.shape))


def test_costs_by_hand():
    """Plain runs: 1 ms and 10 us for each evaluation, 4 us of it the model; error 1 at 100 evaluations."""
    n = np.array([[100, 400], [50, 100], [100, 400], [10, 10]])
    whole, model = 1e-3 + 1e-5 * n, 4e-6 * n
    whole[1], model[1] = [5e-3, 6e-3], [2e-4, 4e-4]
    rmse = np.array([[1.0, 0.5], [0.25, 0.05], [2.0, 0.5], [0.0, np.nan]])
    estimate = np.broadcast_to(rmse[:, :, None], (4, 2, 3)).copy()
    given = cells(
        estimate,
        evaluations=n,
        seconds=np.repeat(whole[:, :, None], 3, 2),
        model=np.repeat(model[:, :, None], 3, 2),
    )
    found = costs(given, rmse, spread(rmse), 0, [True, True, True, False], 0.9)
    np.testing.assert_allclose(found["run_time"][0], whole[0])
    np.testing.assert_allclose(found["baseline_evaluations"][0], [100, 400])
    np.testing.assert_allclose(found["cost_ratio"][0], [1.0, 1.0])
    # errors of 1/4 and 1/20 take the baseline 1600 and 40,000 evaluations
    np.testing.assert_allclose(found["baseline_evaluations"][1], [1600, 40000])
    np.testing.assert_allclose(found["cost_ratio"][1], [5e-3 / 17e-3, 6e-3 / 401e-3])
    # beside the model: 4.8 ms against 1 ms + 6 us for each of 1600
    assert found["break_even"][1, 0] == pytest.approx(0.0)
    # twice the error at as many evaluations: never
    assert found["break_even"][2, 0] == np.inf
    assert found["break_even"][2, 1] == np.inf
    assert np.isnan(found["break_even"][0]).all()
    # another model, error 0
    assert np.isnan(found["break_even"][3]).all()
    assert found["baseline_evaluations"][3, 0] == np.inf
    assert found["cost_ratio"][3, 0] == 0.0
    assert np.isnan(found["cost_ratio"][3, 1])
    # limits of the ratio of two uniform errors squared, each within 10 %
    low, high = found["baseline_evaluations_low"], found["baseline_evaluations_high"]
    assert low[0].tolist() == high[0].tolist() == [100, 400]
    assert 1600 * 0.9**2 / 1.1**2 < low[1, 0] < 1500 < 1700 < high[1, 0] < 1600 * 1.1**2 / 0.9**2
    assert low[3, 0] == np.inf


def test_times_of_the_baseline_are_carried_on_below_and_beyond():
    """1 ms and 10 us for each evaluation, for an error above that of the smallest run and one below all."""
    n = np.array([[100, 400], [100, 400]])
    whole = np.array([1e-3 + 1e-5 * n[0], [1e-3, 1e-3]])
    rmse = np.array([[1.0, 0.5], [2.0, 0.1]])
    estimate = np.broadcast_to(rmse[:, :, None], (2, 2, 2)).copy()
    given = cells(estimate, evaluations=n, seconds=np.repeat(whole[:, :, None], 2, 2), model=0.0)
    found = costs(given, rmse, spread(rmse), 0, [True, True], 0.9)
    np.testing.assert_allclose(found["baseline_evaluations"][1], [25, 10_000])
    np.testing.assert_allclose(found["cost_ratio"][1], [1e-3 / 1.25e-3, 1e-3 / 0.101])


def test_a_baseline_that_hardly_ever_errs_has_wide_limits():
    """7 of 8 replicates are exact: a third of the resamples have no error at all."""
    rng = np.random.default_rng(3)
    estimate = np.stack([np.array([[1.0] + [0.0] * 7]), rng.normal(size=(1, 8))])
    seconds = np.full((2, 1, 8), 1e-3)
    given = cells(estimate, evaluations=[[16], [16]], seconds=seconds, model=0.0)
    found, resampled = errors(given, stream, 0.95)
    assert (resampled[:, 0, 0] == 0).mean() == pytest.approx((7 / 8) ** 8, abs=0.05)
    made = costs(given, found["rmse"], resampled, 0, [True, True], 0.95)
    assert made["baseline_evaluations_low"][1, 0] == 0.0
    assert 0.0 < made["baseline_evaluations"][1, 0] < made["baseline_evaluations_high"][1, 0]
    low, middle, high = (made[f"cost_ratio{end}"][:, 0] for end in ("_low", "", "_high"))
    assert low[0] == middle[0] == high[0] == 1.0
    assert low[1] < middle[1] < high[1] == np.inf


def test_times_of_a_baseline_without_an_error_count():
    """Its error is unknown with 100 evaluations, its time is not."""
    n = np.array([[100, 400], [100, 400]])
    rmse = np.array([[np.nan, 0.5], [1.0, 0.5]])
    estimate = np.ones((2, 2, 2))
    whole = np.repeat(np.array([[1e-3, 4e-3], [1e-3, 4e-3]])[:, :, None], 2, 2)
    given = cells(estimate, evaluations=n, seconds=whole, model=0.0)
    found = costs(given, rmse, spread(rmse), 0, [True, True], 0.9)
    np.testing.assert_allclose(found["cost_ratio"][1], [1.0, 1.0])
    assert np.isnan(found["baseline_evaluations"][0, 0])


def test_a_surrogate_pays_where_the_model_is_slow():
    n = np.array([[100, 400], [100, 400]])
    model = 1e-6 * n
    whole = model + np.array([[1e-4, 4e-4], [0.2, 0.2]])
    rmse = np.array([[1.0, 0.5], [0.5, 0.25]])
    estimate = np.broadcast_to(rmse[:, :, None], (2, 2, 2)).copy()
    given = cells(
        estimate,
        evaluations=n,
        seconds=np.repeat(whole[:, :, None], 2, 2),
        model=np.repeat(model[:, :, None], 2, 2),
    )
    found = costs(given, rmse, spread(rmse), 0, [True, True], 0.9)
    # saves 300 evaluations and their 0.4 ms for 200 ms; then 1200 and 1.6 ms
    np.testing.assert_allclose(found["break_even"][1], [(0.2 - 4e-4) / 300, (0.2 - 1.6e-3) / 1200])
    np.testing.assert_allclose(found["cost_ratio"][1], whole[1] / (8e-4, 3.2e-3))
