"""What a comparison keeps of its runs: a comparison that was cut off goes on to the same end."""

import json

import chaospy as cp
import numpy as np
import pytest
import xarray as xr

import hipuq
from hipuq import compare

INPUTS = hipuq.Inputs(a=cp.Uniform(0.0, 1.0), b=cp.Uniform(0.0, 1.0))
TIMES = ["seconds", "model_seconds", "run_time", "model_time", "cost_ratio", "break_even"]
CONTENDERS = {
    "random": {"method": "monte_carlo"},
    "chaos": {"method": "chaos", "options": {"degree": 2}, "replicates": 2},
}


def smooth(samples: xr.Dataset) -> xr.Dataset:
    """Return a smooth function of mean 1/3 + 1/4."""
    return xr.Dataset({"y": samples["a"] ** 2 + samples["a"] * samples["b"]})


def run(store=None, **changes):
    given = {"contenders": CONTENDERS, "budgets": [32, 64], "replicates": 4, "rng": 5, **changes}
    return compare(
        given.pop("model", smooth),
        given.pop("inputs", INPUTS),
        given.pop("contenders"),
        of="y",
        reference=given.pop("reference", 7 / 12),
        store=store,
        **given,
    )


def assert_same(one: xr.Dataset, other: xr.Dataset) -> None:
    """Assert that two comparisons are the same but for times."""
    xr.testing.assert_equal(one.drop_vars(TIMES), other.drop_vars(TIMES))
    assert {k: v for k, v in one.attrs.items() if k != "history"} == {
        k: v for k, v in other.attrs.items() if k != "history"
    }


@pytest.fixture(scope="module")
def whole():
    return run()


class Counted:
    """The model, which counts its calls, and dies at one of them."""

    __qualname__ = "smooth"

    def __init__(self, dies: int = 10**9) -> None:
        self.calls = 0
        self.dies = dies

    def __call__(self, samples: xr.Dataset) -> xr.Dataset:
        self.calls += 1
        if self.calls == self.dies:
            raise KeyboardInterrupt
        return smooth(samples)


@pytest.mark.parametrize("dies", [1, 3, 4, 9, 14])
def test_a_comparison_that_was_cut_off_goes_on(whole, tmp_path, dies):
    file = tmp_path / "runs.jsonl"
    with pytest.raises(KeyboardInterrupt):
        run(file, model=Counted(dies))
    done = [line for line in file.read_text().splitlines() if '"run"' in line]
    assert len(done) == max(dies - 3, 0)  # each contender has a run to warm up
    model = Counted()
    found = run(file, model=model, resume=True)
    assert_same(found, whole)
    # 8 and 4 runs in all, and those to warm up contenders that have any left
    assert 12 - len(done) < model.calls <= 12 - len(done) + 2
    again = Counted()
    assert_same(run(file, model=again, resume=True), whole)
    assert again.calls == 0


def test_a_line_that_was_cut_off_is_run_again(whole, tmp_path):
    file = tmp_path / "runs.jsonl"
    run(file)
    text = file.read_text()
    for cut in (1, 20, 150):
        file.write_text(text[:-cut])
        assert_same(run(file, resume=True), whole)
        assert len(file.read_text().splitlines()) == len(text.splitlines())


def test_without_resume_it_starts_anew(tmp_path):
    file = tmp_path / "runs.jsonl"
    run(file)
    model = Counted()
    run(file, model=model)
    assert model.calls == 14


def test_more_may_be_asked_for(tmp_path):
    """More replicates, budgets and contenders take what is there; a contender that is left out stays."""
    file = tmp_path / "runs.jsonl"
    run(file, contenders={"random": CONTENDERS["random"]}, budgets=[64])
    wider = {"budgets": [16, 32, 64], "replicates": 6}
    model = Counted()
    found = run(file, model=model, resume=True, **wider)
    # 18 and 6 runs, 2 to warm up; 4 were there
    assert model.calls == 18 + 6 + 2 - 4
    assert_same(found, run(**wider))
    narrow = Counted()
    run(file, model=narrow, contenders={"random": CONTENDERS["random"]}, resume=True)
    assert narrow.calls == 0
    other = {**CONTENDERS, "chaos": {"method": "chaos", "options": {"degree": 3}, "replicates": 2}}
    with pytest.raises(hipuq.HipuqError, match=r"runs of 'chaos' with estimate .*do not resume"):
        run(file, contenders=other, resume=True)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rng": 6}, "with seed 5, not 6"),
        ({"inputs": hipuq.Inputs(a=cp.Uniform(0.0, 2.0), b=cp.Uniform(0.0, 1.0))}, "'random' with inputs"),
        (
            {"contenders": {"random": {"method": "monte_carlo", "options": {"sampler": "sobol"}}}},
            "'random' with design",
        ),
        ({"reference": [1.0, 2.0]}, "the reference has"),
    ],
)
def test_runs_of_something_else_are_refused(tmp_path, changes, message):
    file = tmp_path / "runs.jsonl"
    run(file)
    before = file.read_bytes()
    with pytest.raises(hipuq.HipuqError, match=message):
        run(file, resume=True, **changes)
    assert file.read_bytes() == before


@pytest.mark.parametrize(
    "text",
    [
        "not ours\n",
        '{"definition": 3}\n',
        '{"run": {}}\n',
        "[]\n[]\n",
        "\x00\x01\n",
        json.dumps({"definition": {"hipuq_version": "9"}}) + "\n",
    ],
)
def test_files_of_others_are_refused(tmp_path, text):
    file = tmp_path / "runs.jsonl"
    file.write_text(text)
    with pytest.raises(hipuq.HipuqError, match=r"runs\.jsonl"):
        run(file, resume=True)
    assert file.read_text() == text


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(hipuq.HipuqError, match="cannot"):
        run(tmp_path)


def test_undefined_estimates_stay(tmp_path):
    """One replicate without an estimate leaves the error unknown, on disk too."""
    calls = []

    def sometimes(samples: xr.Dataset) -> xr.Dataset:
        calls.append(1)
        y = samples["a"] if len(calls) % 3 else samples["a"] * np.nan
        return xr.Dataset({"y": y})

    file = tmp_path / "runs.jsonl"
    given = {"contenders": {"random": {"method": "monte_carlo"}}, "replicates": 6, "reference": 0.5}
    found = run(file, model=sometimes, **given)
    assert np.isnan(found["estimate"]).sum() == 4
    assert np.isnan(found["rmse"]).all()
    assert np.isnan(found["rmse_ratio"]).all()
    again = run(file, model=sometimes, resume=True, **given)
    assert_same(again, found)
