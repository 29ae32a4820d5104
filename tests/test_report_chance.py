"""Whether contact patterns differ by more than chance gives: the test, and what is said of it."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats
from squeak_results import everything

from hipuq.report import chance
from hipuq.report.parts import by_count
from hipuq.report.reading import Reading


def results(hits, counts, known=64, of="any_unstable", confidence=0.95):
    """Return stratified results with hits per pattern, (pattern,) or (pattern, mode)."""
    hits = np.asarray(hits, np.float64)
    dims = ("pattern", "mode")[: hits.ndim]
    made = xr.Dataset(
        {"probability": (dims, hits / known), "known": ("pattern", np.full(len(hits), float(known)))},
        coords={"in_contact": ("pattern", counts), "pattern": np.arange(1, len(hits) + 1)},
        attrs={"of": of, "confidence": confidence},
    )
    return made.assign_coords(mode=[11, 12][: hits.shape[1]]) if hits.ndim == 2 else made


def test_the_statistic_is_that_of_scipy():
    hits, known = np.array([5.0, 9.0, 2.0, 7.0]), np.array([20.0, 25.0, 15.0, 30.0])
    statistic, mean, _ = chance.homogeneity(hits, known)
    there = stats.chi2_contingency(np.array([hits, known - hits]), correction=False)
    assert statistic == pytest.approx(there.statistic)
    assert mean == pytest.approx(3 * 90 / 89)


@pytest.mark.parametrize(("known", "share"), [(64, 0.3), (8, 0.05)])
def test_one_probability_is_rejected_as_often_as_the_level_says(known, share):
    """Also where few hits are expected in a pattern: mean and variance are those given the margins."""
    rng = np.random.default_rng(1)
    totals = np.full(36, known)
    found = [chance.homogeneity(rng.binomial(totals, share).astype(float), totals) for _ in range(1500)]
    parts = np.array([one for one in found if one is not None])
    assert parts[:, 0].mean() == pytest.approx(parts[:, 1].mean(), rel=0.03)
    assert parts[:, 0].var() == pytest.approx(parts[:, 2].mean(), rel=0.15)
    p = np.array([chance.chance_of(*one) for one in parts])
    assert (p < 0.05).mean() == pytest.approx(0.05, abs=0.02)


@pytest.mark.parametrize(
    ("hits", "known"), [([0, 0], [9, 9]), ([9, 9], [9, 9]), ([3], [9]), ([3, 0], [9, 0])]
)
def test_nothing_is_tested_where_nothing_can_differ(hits, known):
    assert chance.homogeneity(np.array(hits, float), np.array(known, float)) is None


def test_sampling_alone_is_called_so():
    tests = chance.tested(results([17, 24, 14, 20, 30], [8, 8, 8, 8, 9]))
    assert [(one.count, one.patterns) for one in tests] == [(8, 4)]
    text = chance.in_words(tests)
    assert text.startswith(
        "Between the 4 patterns of 8 the differences are no larger than chance gives (chi-sq"
    )
    assert text.endswith(f"p = {tests[0].p:.2g}): minimum and maximum are mostly sampling")
    assert "no larger than chance" in chance.caption(tests)
    assert "no more than by chance" in chance.in_short(tests)


def test_larger_differences_are_called_so_by_their_number():
    tests = chance.tested(results([1, 60, 5, 20, 22], [7, 7, 7, 8, 8]))
    assert chance.in_words(tests) == (
        "Between the 3 patterns of 7 the differences are larger than chance gives (chi-square test, "
        "p < 0.001); between the 2 patterns of 8 they are not"
    )
    assert "only of 7 in contact (1 of 2 chi-square tests" in chance.caption(tests)
    assert chance.in_short(tests) == "Patterns of 7 differ by more than chance gives (chi-square test)"


def test_groups_that_are_each_open_may_differ_together():
    hits = [13, 22, 14, 24, 15, 25, 13, 22]
    tests = chance.tested(results(hits, [5, 5, 6, 6, 7, 7, 8, 8]))
    assert not chance.apart(tests)
    assert chance.together(tests) < 0.05
    assert "are larger than chance gives" in chance.in_words(tests)
    assert chance.caption(tests) == ""


def test_modes_are_tested_together():
    tests = chance.tested(results([[0, 9], [30, 12], [1, 10]], [8, 8, 8], of="unstable"))
    assert [(one.count, one.mode) for one in tests] == [(8, 11), (8, 12)]
    assert "only of 8 in contact, mode 11 (1 of 2" in chance.caption(tests)


def test_exact_results_and_other_outcomes_are_not_tested():
    assert chance.tested(results([1, 60], [8, 8], confidence=1.0)) == []
    assert chance.tested(results([1, 60], [8, 8], of="probability")) == []
    assert chance.in_words([]) == chance.caption([]) == chance.in_short([]) == ""


def test_the_block_says_it():
    text = " ".join(by_count(Reading(everything())).lines)
    assert "of 8 the differences are" in text
