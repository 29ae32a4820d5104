"""Unstable friction of one configuration: the table, the command that prints it, and what it refuses."""

import numpy as np
import published
import pytest
from test_cli import call

import hipuq
from hipuq.errors import InputError


@pytest.mark.parametrize("preset", published.ONSETS)
def test_boundaries_and_intervals_of_full_contact(preset):
    model = hipuq.models.ring(preset)
    found = hipuq.unstable_friction(model, upper=0.1)
    assert found["friction"].values == pytest.approx(published.ONSETS[preset], rel=1e-6)
    assert found["change"].values.tolist() == [1, 1, 1, 1]
    assert found["unstable_above"].values.tolist() == [1, 2, 3, 4]
    assert found["certified"].all()
    assert found["start"].values.tolist() == [float(found["friction"][0])]
    assert found["end"].values.tolist() == [0.1]
    assert float(found["unknown"]) == 0
    for name, values in found.variables.items():
        assert values.attrs["long_name"] and values.attrs["units"], name


def test_intervals_by_mode_are_those_of_the_verdicts():
    """Modes are numbered by frequency at each friction: looked at on a grid, away from the ends."""
    model = hipuq.models.ring("oberst2016", contact=[1, 0, 1, 1, 1, 1, 1, 1, 1])
    found = hipuq.unstable_friction(model, upper=0.03)
    grid = np.linspace(0.0, 0.03, 301)[1:-1]
    start, end = found["mode_start"].values, found["mode_end"].values
    ends = np.concatenate([start, end])
    grid = grid[np.abs(grid[:, None] - ends).min(axis=1) > 1e-9]
    unstable = model(model.nominal(friction=grid), ["unstable"])["unstable"].values
    expected = np.zeros_like(unstable)
    for mode, low, high in zip(found["mode_number"].values, start, end, strict=True):
        expected[(low < grid) & (grid < high), mode - 1] = 1
    assert np.array_equal(unstable, expected)
    assert -1 in found["change"].values


def test_a_range_without_a_boundary():
    model = hipuq.models.two_dof("hulten")
    stable = hipuq.unstable_friction(model, upper=0.2)
    assert (stable.sizes["boundary"], stable.sizes["interval"]) == (0, 0)
    unstable = hipuq.unstable_friction(model, lower=0.3, upper=0.4)
    assert unstable.sizes["boundary"] == 0
    assert (unstable["start"].values, unstable["end"].values) == ([0.3], [0.4])


def test_damping_and_threshold_count():
    damping = (0.02, 0.06)
    model = hipuq.models.two_dof("hulten", damping_1=damping[0], damping_2=damping[1])
    (onset,) = hipuq.unstable_friction(model, upper=1.0)["friction"].values
    assert onset == pytest.approx(published.HULTEN_ONSETS[damping], rel=1e-11)
    model = hipuq.models.two_dof("hulten", growth_threshold=50.0)
    (later,) = hipuq.unstable_friction(model, upper=1.0)["friction"].values
    assert later > published.HULTEN_ONSETS[0.0, 0.0]
    beside = model(model.nominal(friction=later * np.array([1 - 1e-6, 1 + 1e-6])))
    assert beside["any_unstable"].values.tolist() == [0, 1]


def test_what_cannot_be_used_is_named():
    model = hipuq.models.ring("oberst2016")
    for lower, upper in ((0.0, 0.0), (0.0, -0.1), (0.1, 0.05), (-0.1, 0.1), (0.0, np.nan), (0.0, np.inf)):
        with pytest.raises(InputError, match="ascend from 0"):
            hipuq.unstable_friction(model, lower=lower, upper=upper)
    with pytest.raises(InputError, match="exactly one sample, not 2"):
        hipuq.unstable_friction(model, model.nominal(friction=[0.0, 0.1]), upper=0.1)
    with pytest.raises(hipuq.HipuqError, match="mass is -1"):
        hipuq.unstable_friction(model, model.nominal(mass=-1.0), upper=0.1)


def test_the_command_prints_the_tables(monkeypatch, capsys):
    code, said, _ = call(monkeypatch, capsys, "onset", "--max", 0.012)
    assert code == 0
    assert "0.009497272469" in said and "0.01045690728" in said
    assert "certified" in said and "end of the range" in said
    code, said, _ = call(monkeypatch, capsys, "onset", "--max", 0.005)
    assert code == 0 and "stable throughout" in said
    arguments = ("--model", "two_dof", "--preset", "hulten", "--set", "damping_1=0.02", "--max", 1)
    code, said, _ = call(monkeypatch, capsys, "onset", *arguments)
    assert code == 0 and "two_dof(hulten)" in said
    code, said, _ = call(monkeypatch, capsys, "onset", "--contact", "1,3,4,5,6,7,8,9", "--max", 0.01)
    assert code == 0 and f"{published.FIRST_ONSET_WITHOUT[2]:.9f}" in said


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--max", 0], "ascend from 0"),
        (["--max", -1], "ascend from 0"),
        (["--max", "nan"], "ascend from 0"),
        (["--model", "rong"], "did you mean 'ring'"),
        (["--preset", "oberst2015"], "did you mean 'oberst2016'"),
        (["--contact", "0,1"], "oscillators 1 to 9"),
        (["--contact", "1,1"], "oscillators 1 to 9"),
        (["--contact", "one"], "numbers with commas"),
        (["--set", "mass"], "parameter=value"),
        (["--set", "mas=1"], "did you mean 'mass'"),
        (["--set", "mass=-1"], "above 0 kg"),
        (["--set", "mass=1,2"], "shape"),
        (["--set", "friction=0.1"], "whole range of friction"),
        (["--growth-threshold", -1], "growth_threshold is -1"),
        (["--model", "two_dof", "--contact", "1"], "unknown parameter 'contact'"),
    ],
)
def test_a_bad_call_is_one_line(monkeypatch, capsys, arguments, message):
    code, said, wrong = call(monkeypatch, capsys, "onset", *arguments)
    assert code == 1 and said == ""
    assert message in wrong and wrong.count("\n") == 1
