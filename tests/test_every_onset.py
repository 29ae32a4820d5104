"""Every boundary of all 130 published patterns: proved, and the model's own verdicts right on both sides."""

import chaospy as cp
import numpy as np
import published
import pytest

import hipuq
from hipuq.cea.onset import boundaries


@pytest.mark.parametrize("preset", published.ONSETS)
def test_verdicts_beside_every_onset(preset):
    """At a relative distance of 1e-6 the numbers of unstable modes are what the boundaries say."""
    model = hipuq.models.ring(preset)
    patterns = hipuq.ContactPatterns(in_contact=(6, 7, 8, 9)).samples()
    found = boundaries(model.pencils(patterns), 0.0, 0.1)
    assert all(one.certified for own in found for one in own)
    rows, friction, expected = [], [], []
    for i, own in enumerate(found):
        for k, one in enumerate(own):
            rows += [i, i]
            friction += [one.friction * (1 - 1e-6), one.friction * (1 + 1e-6)]
            before = sum(earlier.direction for earlier in own[:k])
            expected += [before, before + one.direction]
    samples = patterns[["contact"]].isel(sample=rows).drop_vars(["sample", "pattern", "in_contact"])
    samples = samples.assign(friction=("sample", np.array(friction)))
    outcomes = hipuq.evaluate(model, samples, keep=["unstable_count"], progress=False)
    assert np.array_equal(outcomes["unstable_count"].values, expected)
    assert (outcomes["status"] == 0).all()


# Scattered rings in which a window lies well inside a cell of the first grid: seed, size of the
# design, sample, range of friction, a friction inside the window.
HIDDEN = [(2, 400, 217, 1.0, 0.056), (2, 400, 172, 1.0, 0.00725), (1, 512, 286, 0.1, 0.0804)]


def scattered(n, seed):
    model = hipuq.models.ring("oberst2016")
    inputs = model.inputs(
        contact=hipuq.ContactPatterns(in_contact=(6, 7, 8, 9)),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
        contact_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"),
        contact_angle=hipuq.shift(cp.Normal(0.0, 0.5), each="oscillator"),
    )
    return model, hipuq.design("monte_carlo", inputs, n=n, rng=seed)


@pytest.mark.parametrize("upper", [0.1, 1.0])
def test_every_window_of_scattered_rings_that_a_fine_grid_shows(upper):
    """From 40 scattered rings, at 250 frictions each: unstable exactly inside the boundaries."""
    model, samples = scattered(40, 5)
    found = boundaries(model.pencils(samples), 0.0, upper)
    grid = np.linspace(0.0, upper, 251)[1:]
    repeated = samples.isel(sample=np.repeat(np.arange(40), 250)).drop_vars("sample")
    repeated = repeated.assign(friction=("sample", np.tile(grid, 40)))
    count = hipuq.evaluate(model, repeated, keep=["unstable_count"], progress=False)["unstable_count"]
    expected = [
        [sum(one.direction for one in own if one.friction < friction) for friction in grid] for own in found
    ]
    assert np.array_equal(count.values.reshape(40, 250), expected)


@pytest.mark.parametrize("case", HIDDEN)
def test_windows_that_a_coarse_grid_hides(case):
    seed, n, sample, upper, friction = case
    model, samples = scattered(n, seed)
    one = samples.isel(sample=[sample])
    found = hipuq.unstable_friction(model, one, upper=upper)
    assert ((found["start"] < friction) & (friction < found["end"])).any()
    verdict = model(one.assign(friction=("sample", [friction])))["any_unstable"]
    assert float(verdict[0]) == 1
