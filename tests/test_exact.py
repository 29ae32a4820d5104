"""Strata that leave nothing to chance: every level once, bounds by what is unknown alone, and studies."""

from pathlib import Path

import chaospy as cp
import numpy as np
import published
import pytest
import xarray as xr
from helpers import SMALL_STUDY
from scipy import stats

import hipuq
from hipuq.errors import InputError, StudyError
from hipuq.schema import is_exact

# 4 patterns of 3, 1 of 4; the counts have the probabilities 1/4 and 3/4.
PATTERNS = hipuq.ContactPatterns(in_contact=(3, 4), oscillators=4, weights=(1.0, 3.0))
INPUTS = hipuq.Inputs(contact=PATTERNS)
WEIGHT = np.array([1, 1, 1, 1, 12]) / 16


def levels_once(inputs, rng: int = 1, **options) -> xr.Dataset:
    """Return the design that takes every level once."""
    return hipuq.design("monte_carlo", inputs, 1, rng, stratify=True, **options)


def outcomes(y, **attrs) -> xr.Dataset:
    """Return the exact design with an outcome."""
    y = np.asarray(y, dtype=float)
    dims = ("sample", "mode")[: y.ndim]
    return levels_once(INPUTS).assign(y=(dims, y, attrs))


def estimate(given: xr.Dataset, of: str = "y") -> xr.Dataset:
    return hipuq.estimate("monte_carlo", given, INPUTS, of=of)


def test_the_design_is_every_level_once():
    samples = levels_once(INPUTS)
    assert samples["pattern"].values.tolist() == [1, 2, 3, 4, 5]
    assert samples["weight"].values == pytest.approx(WEIGHT, rel=1e-15)
    assert samples["in_contact"].values.tolist() == [3, 3, 3, 3, 4]
    assert np.array_equal(samples["contact"], PATTERNS.samples()["contact"])
    assert hipuq.methods.METHODS["monte_carlo"].evaluations(INPUTS, 1, stratify=True) == 5


def test_nothing_is_random():
    """No seed changes it."""
    one, two = (levels_once(INPUTS, rng) for rng in (0, 7))
    assert one.equals(two)


def test_rows_are_rows_of_the_same_design():
    whole = levels_once(INPUTS)
    for rows in (slice(0, 2), slice(3, 5), slice(4, None)):
        part = levels_once(INPUTS, rows=rows)
        assert part.equals(whole.isel(sample=rows))
    with pytest.raises(InputError, match="rows is"):
        levels_once(INPUTS, rows=slice(0, 6))


def test_probabilities_by_hand():
    y = np.array([0.1, 0.2, 0.4, 0.5, 0.8])
    found = estimate(outcomes(y, role="probability", long_name="probability of y"))
    assert found["probability"].values.tolist() == y.tolist()
    assert float(found["probability_overall"]) == pytest.approx(WEIGHT @ y, rel=1e-15)
    assert found["count"].values.tolist() == [3, 4]
    for name, expected in (
        ("mean", [0.3, 0.8]), ("min", [0.1, 0.8]), ("max", [0.5, 0.8]), ("weighted", [0.3, 0.8]),
    ):  # fmt: skip
        assert found[f"probability_{name}"].values == pytest.approx(expected, rel=1e-15), name
    for name in ("probability", "probability_mean", "probability_overall"):
        for end in ("low", "high"):
            assert found[f"{name}_{end}"].values == pytest.approx(found[name].values, rel=1e-15)
    assert found["probability"].attrs["long_name"] == "probability of y"
    assert (int(found["evaluations"]), int(found["undecided"])) == (5, 0)
    assert (found.attrs["of"], found.attrs["confidence"]) == ("y", 1.0)
    assert is_exact(found)


def test_weights_within_a_count():
    """Weights by pattern: the weighted mean of a count follows them, the plain one does not."""
    patterns = hipuq.ContactPatterns(in_contact=(1, 2), oscillators=2, weights=(1.0, 2.0, 5.0))
    inputs = hipuq.Inputs(contact=patterns)
    given = levels_once(inputs).assign(y=("sample", [0.3, 0.6, 0.5], {"role": "probability"}))
    found = hipuq.estimate("monte_carlo", given, inputs, of="y")
    assert found["probability_mean"].values == pytest.approx([0.45, 0.5], rel=1e-15)
    assert found["probability_weighted"].values == pytest.approx([0.5, 0.5], rel=1e-15)
    assert float(found["probability_overall"]) == pytest.approx((0.3 + 1.2 + 2.5) / 8, rel=1e-15)


def test_what_is_unknown_is_bounded():
    """Nothing is known of the second pattern: 0 to 1 there, and everywhere it goes in."""
    y = np.array([0.1, np.nan, 0.4, 0.5, 0.8])
    found = estimate(outcomes(y, role="probability"))
    assert np.isnan(found["probability"].values[1])
    assert found["known"].values.tolist() == [1, 0, 1, 1, 1]
    zero, one = (np.where(np.isnan(y), end, y) for end in (0.0, 1.0))
    assert found["probability_low"].values.tolist() == zero.tolist()
    assert found["probability_high"].values.tolist() == one.tolist()
    assert np.isnan(found["probability_overall"])
    assert float(found["probability_overall_low"]) == pytest.approx(WEIGHT @ zero, rel=1e-15)
    assert float(found["probability_overall_high"]) == pytest.approx(WEIGHT @ one, rel=1e-15)
    assert found["probability_mean_low"].values == pytest.approx([0.25, 0.8], rel=1e-15)
    assert found["probability_mean_high"].values == pytest.approx([0.5, 0.8], rel=1e-15)


def test_bounds_of_the_outcome_itself_are_taken():
    y = np.array([0.1, np.nan, 0.4, 0.5, 0.8])
    low, high = np.array([0.1, 0.2, 0.4, 0.5, 0.8]), np.array([0.1, 0.6, 0.4, 0.5, 0.9])
    given = outcomes(y, role="probability").assign(y_low=("sample", low), y_high=("sample", high))
    found = estimate(given)
    assert found["probability_low"].values.tolist() == low.tolist()
    assert found["probability_high"].values.tolist() == high.tolist()
    assert float(found["probability_overall_low"]) == pytest.approx(WEIGHT @ low, rel=1e-15)
    assert float(found["probability_overall_high"]) == pytest.approx(WEIGHT @ high, rel=1e-15)


def test_a_tail_that_is_cut_off_bounds_the_overall_probability():
    model = hipuq.models.ring("oberst2016", oscillators=4)
    exact = hipuq.integrate_friction(model, stats.norm(0.4, 0.1))
    inputs = exact.inputs(contact=PATTERNS)
    given = hipuq.evaluate(exact, levels_once(inputs), progress=False)
    found = hipuq.estimate("monte_carlo", given, inputs, of="probability")
    width = found["probability_overall_high"] - found["probability_overall_low"]
    assert float(width) == pytest.approx(2e-9, rel=1e-6)
    assert found["probability_overall_low"] <= found["probability_overall"]
    assert found["probability_overall"] <= found["probability_overall_high"]


def test_means_of_anything():
    y = np.array([1.0, 2.0, 3.0, 4.0, 10.0])
    found = estimate(outcomes(y, units="Hz", long_name="frequency"))
    assert found["mean"].attrs["units"] == "Hz"
    assert float(found["mean_overall"]) == pytest.approx(WEIGHT @ y, rel=1e-15)
    assert (found["mean_low"] == found["mean_high"]).all()


def test_an_outcome_by_mode():
    y = np.arange(10.0).reshape(5, 2) / 10
    given = outcomes(y, role="probability").assign_coords(mode=[1, 2])
    found = estimate(given)
    assert found["probability"].dims == ("pattern", "mode")
    assert found["probability_overall"].values == pytest.approx(WEIGHT @ y, rel=1e-15)
    assert found["probability_mean"].dims == ("count", "mode")


def test_outcomes_in_another_order_give_the_same():
    given = outcomes([0.1, 0.2, 0.4, 0.5, 0.8], role="probability")
    assert estimate(given.isel(sample=[3, 1, 4, 0, 2])).equals(estimate(given))


def test_infinite_outcomes_are_refused():
    infinite = outcomes([0.1, np.inf, 0.4, np.inf, 0.8], units="1")
    with pytest.raises(InputError, match=r"y is infinite in 2 samples \(40.00%\)"):
        estimate(infinite)


def test_another_uncertain_input_is_left_to_chance():
    """One draw for each level: limits of a sample, not of what is unknown."""
    inputs = hipuq.Inputs(contact=PATTERNS, x=cp.Uniform(0, 1))
    given = levels_once(inputs).assign(y=lambda samples: samples["x"].assign_attrs(role="probability"))
    found = hipuq.estimate("monte_carlo", given, inputs, of="y")
    assert not is_exact(found)
    assert found.attrs["confidence"] == 0.95


def test_results_survive_the_disk(tmp_path):
    found = estimate(outcomes([0.1, np.nan, 0.4, 0.5, 0.8], role="probability"))
    hipuq.save_results(found, tmp_path / "results.nc")
    xr.testing.assert_identical(hipuq.load_results(tmp_path / "results.nc").to_dataset(), found)


def test_certified_means_in_one_call():
    exact = hipuq.integrate_friction(hipuq.models.ring("oberst2016"), cp.Uniform(0.0, 0.1))
    inputs = exact.inputs(contact=hipuq.ContactPatterns(in_contact=(8, 9)))
    found = hipuq.run(
        exact, inputs, method="monte_carlo", n=1, of="probability", stratify=True, progress=False
    )
    expected = published.PROBABILITY_ANY_UNSTABLE["oberst2016"]
    assert found["count"].values.tolist() == list(expected)
    assert found["probability_mean"].values == pytest.approx(list(expected.values()), abs=5e-9)
    assert float(found["probability_overall"]) == pytest.approx(sum(expected.values()) / 2, abs=5e-9)


STUDY = (
    SMALL_STUDY
    + """
[[analysis]]
name = "a"
method = "monte_carlo"
n = 1
integrate_friction = true
options = { stratify = "contact" }
of = ["probability", "probability_by_mode"]
[report]
damping_samples = 0
"""
)


def write(folder: Path, text: str) -> Path:
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder


def test_a_study_integrates_friction(tmp_path):
    study = hipuq.load_study(write(tmp_path, STUDY))
    (analysis,) = (one for one in study.analyses if not one.implied)
    assert (analysis.n, analysis.evaluations, list(analysis.inputs)) == (1, 10, ["contact"])
    tree = hipuq.run_study(study, tmp_path / "out", progress=False)
    mean = tree["a/probability"]["probability_mean"].values
    expected = published.PROBABILITY_ANY_UNSTABLE["oberst2016"]
    assert mean == pytest.approx([expected[8], expected[9]], abs=5e-9)
    assert tree["a/probability_by_mode"]["probability"].sizes == {"pattern": 10, "mode": 18}
    xr.testing.assert_identical(tree, hipuq.load_results(tmp_path / "out"))
    stored = hipuq.load_outcomes(tmp_path / "out" / "outcomes" / "a.zarr")
    again = hipuq.estimate("monte_carlo", stored.load(), analysis.inputs, of="probability")
    assert again.drop_vars("seconds").equals(tree["a/probability"].to_dataset().drop_vars("seconds"))


def test_a_study_integrates_friction_for_sampled_patterns(tmp_path):
    text = (
        STUDY.replace("n = 1\n", "n = 4\n")
        .replace('options = { stratify = "contact" }\n', "")
        .replace('["probability", "probability_by_mode"]', '"probability"')
    )
    study = hipuq.load_study(write(tmp_path, text))
    tree = hipuq.run_study(study, tmp_path / "out", progress=False)
    assert 0.88 < float(tree["a/probability"]["probability"]) < 0.91


def test_studies_that_cannot_integrate_are_refused(tmp_path):
    head, tail = SMALL_STUDY.split("[inputs.friction]")
    contact = "[inputs.contact]" + tail.split("[inputs.contact]")[1]
    analysis = STUDY.removeprefix(SMALL_STUDY)
    cases = {
        "needs the distribution": head + contact + analysis,
        "apply = 'absolute'": STUDY.replace("upper = 0.1", 'upper = 0.1\napply = "relative"'),
        "unknown outcome in of 'margin'": STUDY.replace('"probability_by_mode"', '"margin"'),
    }
    for message, text in cases.items():
        assert text != STUDY
        with pytest.raises(StudyError, match=message) as caught:
            hipuq.load_study(write(tmp_path, text))
        assert "analysis 'a'" in str(caught.value)
