"""Every boundary of all 130 published patterns: proved, and the model's own verdicts right on both sides."""

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
