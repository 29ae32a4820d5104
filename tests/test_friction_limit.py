"""The friction limit: quantile of the onset, its interval, and what no friction keeps."""

import chaospy as cp
import numpy as np
import pytest
import xarray as xr

import hipuq
from hipuq import schema
from hipuq.errors import InputError, SchemaError
from hipuq.intervals import wilson


def outcomes_of(onset, weight=None, swept=(0.0, 1.0)) -> xr.Dataset:
    """Return outcomes with these onsets; NaN is undecided."""
    onset = np.asarray(onset, float)
    status = np.where(np.isnan(onset), schema.STATUS["undecided"], schema.STATUS["ok"]).astype(np.int8)
    attrs = {"long_name": "onset", "units": "1", "range": list(swept)}
    found = xr.Dataset({"onset": ("sample", onset, attrs), "status": ("sample", status)})
    return found if weight is None else found.assign_coords(weight=("sample", np.asarray(weight, float)))


def values(limits: xr.Dataset, end: str = "") -> list[float]:
    return limits[f"friction_limit{end}"].values.tolist()


def test_it_is_the_quantile_of_the_onset():
    onset = np.arange(1, 101) / 100
    limits = hipuq.friction_limit(outcomes_of(onset), [0.0, 0.03, 0.5, 0.995])
    # At the onset itself a configuration is still stable: 3 of 100 are unstable just below the fourth.
    assert values(limits) == [0.01, 0.04, 0.51, 1.0]
    assert limits["friction_limit"].attrs["range"] == [0.0, 1.0]
    assert limits.attrs["confidence"] == 0.95


def test_the_interval_is_where_wilson_limits_cross():
    onset = np.arange(1, 101) / 100
    low, high = wilson(np.arange(1.0, 101), np.full(100, 100.0), 0.95)
    limits = hipuq.friction_limit(outcomes_of(onset), 0.3)
    assert values(limits, "_low") == [onset[np.argmax(high > 0.3)]]
    assert values(limits, "_high") == [onset[np.argmax(low > 0.3)]]
    assert values(limits, "_low") < values(limits) < values(limits, "_high")


def test_too_few_samples_promise_no_friction():
    # With no event in 10 draws the share may still be 28 %: no lower limit for a target of 3 %.
    limits = hipuq.friction_limit(outcomes_of(np.full(10, 0.5)), 0.03)
    assert values(limits, "_low") == [-np.inf]
    assert values(limits) == [0.5]


def test_the_interval_holds_the_quantile():
    draws = np.random.default_rng(5).random((400, 200)) ** 2
    truth = 0.1**2
    held = 0
    for onset in draws:
        limits = hipuq.friction_limit(outcomes_of(onset), 0.1)
        held += values(limits, "_low")[0] <= truth <= values(limits, "_high")[0]
    assert 0.925 <= held / len(draws) <= 0.985


def test_never_and_from_the_start():
    assert values(hipuq.friction_limit(outcomes_of(np.full(50, np.inf)), 0.1)) == [np.inf]
    from_start = hipuq.friction_limit(outcomes_of(np.zeros(50)), 0.1)
    assert [values(from_start, end) for end in ("", "_low", "_high")] == [[-np.inf]] * 3


def test_unknown_onsets_widen_the_interval():
    onset = np.arange(1, 101) / 100
    some = onset.copy()
    some[:40] = np.nan
    known, open_ = (hipuq.friction_limit(outcomes_of(one), 0.45) for one in (onset, some))
    assert values(open_, "_low") == [-np.inf]
    assert values(open_, "_high")[0] > values(known, "_high")[0]
    nothing = hipuq.friction_limit(outcomes_of(np.full(3, np.nan)), 0.5)
    # Nothing is known, which is not the same as exceeded from the start.
    assert np.isnan(values(nothing)).all()
    assert values(nothing, "_low") == [-np.inf]
    assert values(nothing, "_high") == [np.inf]


def test_samples_count_by_their_weight():
    limits = hipuq.friction_limit(outcomes_of([0.1, 0.2], weight=[0.1, 0.9]), [0.05, 0.2])
    assert values(limits) == [0.1, 0.2]


def test_it_is_exact_where_nothing_is_drawn():
    ring = hipuq.models.ring("oberst2016-calibrated")
    exact = hipuq.integrate_friction(ring, cp.Uniform(0.0, 0.1))
    inputs = exact.inputs(contact=hipuq.ContactPatterns(in_contact=(9,)))
    samples = hipuq.design("monte_carlo", inputs, n=1, rng=0, stratify="contact")
    outcomes = hipuq.evaluate(exact, samples, keep=["onset", "interval"])
    limits = hipuq.friction_limit(outcomes, 0.03)
    assert limits.attrs["confidence"] == 1.0
    onset = float(outcomes["onset"][0])
    assert [values(limits, end) for end in ("", "_low", "_high")] == [[onset]] * 3
    # The fragility curve says the same to within its grid.
    curve = hipuq.fragility(outcomes, np.linspace(0.0, 0.1, 101))
    from_curve = hipuq.friction_limit(curve, 0.03)
    assert values(from_curve)[0] <= onset < values(from_curve)[0] + 0.001


def test_a_sweep_over_friction_is_a_curve():
    ring = hipuq.models.ring("oberst2016-calibrated", damping_ratio=0.01)
    inputs = ring.inputs(contact_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"))
    over = {"friction": np.linspace(0.0, 0.6, 7)}
    curve = hipuq.sweep(ring, inputs, over, method="monte_carlo", n=64, of="any_unstable", rng=1)
    limit = values(hipuq.friction_limit(curve, 0.1))[0]
    below = curve["probability"].sel(friction=slice(None, limit))
    assert float(below.max()) <= 0.1 < float(curve["probability"].isel(friction=below.size))


def test_an_unknown_probability_of_a_curve_is_not_below():
    parts = {"probability": [0.0, np.nan, 0.5], "probability_low": [0.0, 0.0, 0.4]}
    parts["probability_high"] = [0.05, 1.0, 0.6]
    curve = xr.Dataset(
        {name: ("friction", own) for name, own in parts.items()}, {"friction": [0.1, 0.2, 0.3]}
    )
    limits = hipuq.friction_limit(curve, [0.1, 0.9])
    assert np.isnan(values(limits)).all()
    assert values(limits, "_low") == [0.1, 0.1]
    assert values(limits, "_high") == [0.3, np.inf]
    nothing = hipuq.friction_limit(curve * np.nan, 0.1)
    assert np.isnan(values(nothing)).all()
    assert [values(nothing, end) for end in ("_low", "_high")] == [[-np.inf], [np.inf]]


def test_the_interval_of_a_curve_ends_where_it_must_be_exceeded():
    """Between two frictions of a grid the limit may be anywhere: the upper end is the later one."""
    probability = np.array([0.0, 0.05, 0.5, 1.0])
    parts = {
        "": probability,
        "_low": np.maximum(probability - 0.02, 0),
        "_high": np.minimum(probability + 0.02, 1),
    }
    data = {f"probability{end}": ("friction", own) for end, own in parts.items()}
    limits = hipuq.friction_limit(xr.Dataset(data, {"friction": [0.0, 0.1, 0.2, 0.4]}), 0.1)
    assert [values(limits, end) for end in ("", "_low", "_high")] == [[0.1], [0.1], [0.2]]


@pytest.mark.parametrize("target", [1.0, -0.1, np.nan, [], [[0.1]], "abc", ["a"], 0.5j, {0.1}])
def test_a_target_is_a_probability_below_one(target):
    with pytest.raises(InputError, match="from 0 to below 1"):
        hipuq.friction_limit(outcomes_of([0.1]), target)


def test_what_has_no_onset_is_told():
    with pytest.raises(SchemaError, match="needs 'onset' over sample"):
        hipuq.friction_limit(xr.Dataset({"margin": ("sample", [1.0])}), 0.1)
    with pytest.raises(SchemaError, match="not NoneType"):
        hipuq.friction_limit(None, 0.1)
    with pytest.raises(SchemaError, match="the outcomes are empty"):
        hipuq.friction_limit(outcomes_of([]), 0.1)
    bare = xr.Dataset({f"probability{end}": ("friction", [0.0, 1.0]) for end in ("", "_low", "_high")})
    with pytest.raises(SchemaError, match="needs the coord 'friction'"):
        hipuq.friction_limit(bare, 0.1)
    with pytest.raises(SchemaError, match="over which range"):
        hipuq.friction_limit(xr.Dataset({"onset": ("sample", [1.0])}), 0.1)
