"""Fragility curves: probability of instability at each friction, over what was sampled."""

import chaospy as cp
import numpy as np
import pytest

import hipuq
from hipuq.errors import InputError, SchemaError


@pytest.fixture(scope="module")
def model():
    return hipuq.integrate_friction(hipuq.models.two_dof("hulten"), cp.Uniform(0.0, 1.0))


@pytest.fixture(scope="module")
def outcomes(model):
    """Undamped, the onset is |f1^2 - f2^2| / (2 f1 f2); f2 = 75 Hz."""
    inputs = model.inputs(frequency_1=cp.Uniform(90.0, 110.0))
    samples = hipuq.design("monte_carlo", inputs, n=400, rng=3)
    return hipuq.evaluate(model, samples, progress=False)


def closed_form(outcomes):
    f = outcomes["frequency_1"].values
    return np.abs(f**2 - 75.0**2) / (2 * f * 75.0)


def test_the_curve_is_the_share_of_onsets_below(outcomes):
    onset = closed_form(outcomes)
    assert outcomes["onset"].values == pytest.approx(onset, rel=1e-10)
    grid = np.linspace(0.0, 1.0, 101)
    curve = hipuq.fragility(outcomes, grid)
    assert curve["probability"].values == pytest.approx((onset[:, None] < grid).mean(axis=0), abs=1e-12)
    assert (curve["probability_low"] <= curve["probability"]).all()
    assert (curve["probability"] <= curve["probability_high"]).all()
    assert curve.attrs["confidence"] == 0.95
    assert int(curve["known"]) == 400
    # Friction is integrated by the same curve.
    fine = hipuq.fragility(outcomes, (np.arange(20_000) + 0.5) / 20_000)
    assert float(fine["probability"].mean()) == pytest.approx(float(outcomes["probability"].mean()), abs=5e-5)


def test_a_boundary_is_stable_and_an_end_of_the_range_is_none(model):
    outcome = hipuq.evaluate(model, model.nominal(), progress=False)
    onset = float(outcome["onset"][0])
    curve = hipuq.fragility(outcome, [0.0, onset, np.nextafter(onset, 1.0), 1.0])
    assert curve["probability"].values.tolist() == [0.0, 0.0, 1.0, 1.0]


def test_undecided_samples_widen_the_limits(outcomes):
    part = outcomes.copy(deep=True)
    part["status"][:100] = 1
    part["interval"][:100] = np.nan
    whole, less = (hipuq.fragility(each, [0.3], confidence=0.9) for each in (outcomes, part))
    known = (closed_form(outcomes)[100:] < 0.3).mean()
    assert float(less["probability"][0]) == pytest.approx(known, abs=1e-12)
    width = [float(each["probability_high"][0] - each["probability_low"][0]) for each in (whole, less)]
    assert width[1] > width[0] + 0.2
    assert int(less["known"]) == 300
    part["status"][:] = 1
    none = hipuq.fragility(part, [0.3])
    assert np.isnan(none["probability"].values).all()
    assert (float(none["probability_low"][0]), float(none["probability_high"][0])) == (0.0, 1.0)


def test_every_pattern_once_has_no_sampling_error():
    model = hipuq.integrate_friction(hipuq.models.ring("oberst2016"), cp.Uniform(0.0, 0.1))
    inputs = model.inputs(contact=hipuq.ContactPatterns(in_contact=(8, 9)))
    samples = hipuq.design("monte_carlo", inputs, n=1, rng=0, stratify="contact")
    outcomes = hipuq.evaluate(model, samples, keep=["onset", "interval"], progress=False)
    curve = hipuq.fragility(outcomes, np.linspace(0.0, 0.1, 51))
    assert curve["probability_low"].equals(curve["probability"].rename("probability_low"))
    assert curve.attrs["confidence"] == 1.0
    # Each number in contact is equally likely: the single pattern of nine weighs half.
    at = hipuq.fragility(outcomes, [0.0095])
    first = outcomes["onset"].values < 0.0095
    assert float(at["probability"][0]) == pytest.approx(outcomes["weight"].values @ first, abs=1e-12)


class Ramp:
    """A distribution of a user's own, which no description rebuilds."""

    def ppf(self, u):
        return 1.0 + 0.1 * np.sqrt(u)


def test_a_distribution_of_ones_own_beside_contact_patterns_is_drawn():
    model = hipuq.integrate_friction(hipuq.models.ring("oberst2016"), cp.Uniform(0.0, 0.1))
    inputs = model.inputs(
        contact=hipuq.ContactPatterns(in_contact=9),
        contact_stiffness=hipuq.relative(Ramp(), each="oscillator"),
    )
    samples = hipuq.design("monte_carlo", inputs, n=8, rng=0, stratify="contact")
    outcomes = hipuq.evaluate(model, samples, keep=["onset", "interval"], progress=False)
    curve = hipuq.fragility(outcomes, [0.02, 0.04])
    assert curve.attrs["confidence"] == 0.95
    assert (curve["probability_low"] < curve["probability_high"]).all()


@pytest.mark.parametrize(
    "grid", [[0.5, 0.4], [-0.1, 0.5], [0.5, 1.1], [0.5, np.nan], [0.5, 0.5], [[0.1, 0.2]]]
)
def test_a_grid_that_cannot_be_used_is_named(outcomes, grid):
    with pytest.raises(InputError, match="must ascend within the range that was swept"):
        hipuq.fragility(outcomes, grid)


def test_other_outcomes_are_refused(outcomes):
    with pytest.raises(SchemaError, match="integrate_friction"):
        hipuq.fragility(outcomes.drop_vars("interval"), [0.5])
    with pytest.raises(InputError, match="confidence is 2"):
        hipuq.fragility(outcomes, [0.5], confidence=2)
