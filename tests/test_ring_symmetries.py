"""Metamorphic tests of the ring: changes of the input that must not change the answer.

Samples are scattered by 5 % and spread over friction, so that about half of them are unstable. Where
either side is undecided nothing is compared; a second assertion keeps such samples few.
"""

import numpy as np
import pytest
import xarray as xr

import hipuq

SIZE = 400
N = 9


def scattered(seed: int) -> dict:
    """Return physical values of every parameter, (SIZE, elements)."""
    rng = np.random.default_rng(seed)

    def near(value, n):
        return value * (1 + 0.05 * rng.uniform(-1, 1, (SIZE, n)))

    contact_angle = 180 + 22.5 * np.arange(N) + rng.normal(0, 1, (SIZE, N))
    return {
        "friction": rng.uniform(0.0, 0.15, SIZE),
        "contact": rng.random((SIZE, N)) < 0.95,
        "mass": near(22.22, N),
        "spring_stiffness": near(1.05e9, N + 1),
        "contact_stiffness": near(4.6e9, N),
        "spring_angle": 78.75 + 22.5 * np.arange(N + 1) + rng.normal(0, 1, (SIZE, N + 1)),
        "contact_angle": contact_angle,
        "friction_angle": contact_angle + 90,
    }


def outcomes_of(values: dict) -> xr.Dataset:
    model = hipuq.models.ring()
    return model(model.nominal(**values))


def assert_same(one: xr.Dataset, other: xr.Dataset, scale: float = 1.0) -> None:
    """Assert same verdicts and frequencies times `scale` where both sides are decided."""
    verdicts = one["any_unstable"].values, other["any_unstable"].values
    decided = ~np.isnan(verdicts[0]) & ~np.isnan(verdicts[1])
    assert decided.mean() > 0.97
    assert 0.1 < verdicts[0][decided].mean() < 0.9
    assert np.array_equal(verdicts[0][decided], verdicts[1][decided])
    for name in ("frequency", "growth_rate"):
        a, b = scale * one[name].values[decided], other[name].values[decided]
        largest = scale * 2 * np.pi * one["frequency"].values.max()
        assert b == pytest.approx(a, rel=1e-9, abs=1e-9 * largest)
    assert np.array_equal(one["mechanisms"], other["mechanisms"])


@pytest.mark.parametrize("angle", [17.0, -90.0, 201.3])
def test_turning_everything_changes_nothing(angle):
    values = scattered(1)
    turned = {name: value + angle if name.endswith("angle") else value for name, value in values.items()}
    assert_same(outcomes_of(values), outcomes_of(turned))


@pytest.mark.parametrize(("a", "b"), [(4.0, 1.0), (1e-9, 1e-3), (2.7, 0.4)])
def test_stiffness_and_mass_scale_frequencies(a, b):
    """Stiffness times a and mass times b: every eigenvalue times sqrt(a / b)."""
    values = scattered(2)
    factor = {"mass": b, "spring_stiffness": a, "contact_stiffness": a}
    scaled = {name: value * factor[name] if name in factor else value for name, value in values.items()}
    assert_same(outcomes_of(values), outcomes_of(scaled), scale=np.sqrt(a / b))


def test_a_mirror_turns_friction_round():
    """Reflection x -> -x: the order of the oscillators and the sense of sliding are reversed."""
    values = scattered(3)
    mirrored = {name: value[:, ::-1] for name, value in values.items() if name != "friction"}
    for name in ("spring_angle", "contact_angle"):
        mirrored[name] = 180 - mirrored[name]
    # A reflected tangent is the opposite of the reflected normal + 90 degrees.
    mirrored["friction_angle"] = mirrored["contact_angle"] + 90
    mirrored["friction"] = -values["friction"]
    assert_same(outcomes_of(values), outcomes_of(mirrored))


def test_turning_friction_by_180_degrees_is_its_sign():
    values = scattered(4)
    other = values | {"friction": -values["friction"], "friction_angle": values["friction_angle"] + 180}
    assert_same(outcomes_of(values), outcomes_of(other))


def test_a_free_oscillator_does_not_feel_its_contact():
    """Stiffness and angle of a contact that is open must not matter, to the last bit."""
    values = scattered(5)
    free = ~values["contact"]
    other = values | {"contact_stiffness": np.where(free, 1e9, values["contact_stiffness"])}
    one, two = outcomes_of(values), outcomes_of(other)
    assert free.any()
    assert one.drop_vars("contact_stiffness", errors="ignore").equals(two)
