"""The study of two coupled modes: each of its numbers against the closed form."""

from pathlib import Path

import numpy as np
import pytest
from closed_forms import ALPHA, BETA, GAMMA, hoffmann, hoffmann_scattered, hulten
from published import HOFFMANN_PROBABILITY, HULTEN_ONSETS, HULTEN_PROBABILITY

import hipuq

STUDY = Path(__file__).parents[1] / "studies" / "mode_coupling"


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mode_coupling")
    hipuq.run_study(hipuq.load_study(STUDY), folder, progress=False)
    return folder


@pytest.fixture(scope="module")
def tree(out):
    return hipuq.load_results(out)


def limits(results):
    """Return the interval of a probability, made twice as wide: one of 95 % may miss."""
    low, high = (results[f"probability_{end}"] for end in ("low", "high"))
    return low - (high - low) / 2, high + (high - low) / 2


def onset(damping_1, damping_2, first=100.0, second=75.0):
    """Return the damped onset of Hulten's model, from the Routh-Hurwitz criterion."""
    p, q = (2 * np.pi * first) ** 2, (2 * np.pi * second) ** 2
    a, b = damping_1 * np.sqrt(p), damping_2 * np.sqrt(q)
    cross = a * q + b * p
    return np.sqrt(((a + b) * (p + q + a * b) * cross - cross**2) / ((a + b) ** 2 * p * q) - 1)


def test_friction_alone_is_exact_where_it_is_integrated(tree):
    answer = hoffmann().probability
    assert answer == pytest.approx(HOFFMANN_PROBABILITY, abs=5e-11)
    found = tree["exact/probability"].to_dataset()
    for name in ("probability", "probability_low", "probability_high"):
        assert float(found[name]) == pytest.approx(answer, abs=1e-12)
    low, high = limits(tree["sampled/any_unstable"].to_dataset())
    assert low < answer < high < low + 0.1


def test_drivers_have_the_indices_of_the_closed_form(tree):
    answer = hoffmann_scattered()
    found = tree["drivers/any_unstable"].to_dataset()
    assert float(found["mean"]) == pytest.approx(answer.probability, abs=0.01)
    for name, known in (("S1", answer.first), ("ST", answer.total)):
        for parameter, value in known.items():
            low, high = (float(found[f"{name}_{end}"].sel(parameter=parameter)) for end in ("low", "high"))
            assert low - (high - low) / 2 < value < high + (high - low) / 2
            assert high - low < 0.1


def test_a_scattered_frequency_is_unstable_up_to_where_the_onset_is_friction(tree):
    found = tree["frequency/any_unstable"].to_dataset()
    friction = found["friction"].values
    answer = np.clip((75 * (friction + np.sqrt(friction**2 + 1)) - 90) / 20, 0, 1)
    assert answer[list(friction).index(0.3)] == pytest.approx(hulten().probability, abs=1e-12)
    assert hulten().probability == pytest.approx(HULTEN_PROBABILITY, abs=1e-12)
    # Even points: far better than the limits of some of them say.
    np.testing.assert_allclose(found["probability"], answer, atol=1e-3)
    low, high = limits(found)
    assert ((low < answer + 1e-12) & (answer < high + 1e-12)).all()


def test_damping_moves_the_onset_both_ways(tree):
    found = tree["damping/probability"].to_dataset()
    first, second = (found[name].values for name in ("damping_1", "damping_2"))
    answer = np.clip((0.3 - onset(first[:, None], second)) / 0.1, 0, 1)
    assert found["probability"].dims == ("damping_1", "damping_2")
    np.testing.assert_allclose(found["probability"], answer, rtol=0, atol=1e-9)
    undamped = HULTEN_ONSETS[0.0, 0.0]
    for (one, other), known in HULTEN_ONSETS.items():
        if one > 0:
            p = float(found["probability"].sel(damping_1=one, damping_2=other))
            assert 0.3 - 0.1 * p == pytest.approx(known, abs=1e-12)
    assert (answer > (0.3 - undamped) / 0.1).sum() == 28


def test_each_stored_verdict_is_that_of_the_closed_form(out):
    outcomes = hipuq.load_outcomes(out / "outcomes" / "drivers.zarr")
    k3 = outcomes["k3"].values
    above = outcomes["friction"].values > ALPHA / k3 + BETA + GAMMA * k3
    np.testing.assert_array_equal(outcomes["any_unstable"].values, above)
