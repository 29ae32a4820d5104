"""What a comparison keeps of its runs: a comparison that was cut off goes on to the same end."""

import json

import chaospy as cp
import numpy as np
import pytest
import xarray as xr

import hipuq
from hipuq import compare
from hipuq.comparison.record import Record
from hipuq.errors import StoreError

INPUTS = hipuq.Inputs(a=cp.Uniform(0.0, 1.0), b=cp.Uniform(0.0, 1.0))
COSTS = ["cost_ratio", "cost_ratio_low", "cost_ratio_high", "break_even"]
TIMES = ["seconds", "model_seconds", "run_time", "model_time", *COSTS]
CONTENDERS = {
    "random": {"method": "monte_carlo"},
    "chaos": {"method": "chaos", "options": {"degree": 2}, "replicates": 2},
}


def smooth(samples: xr.Dataset) -> xr.Dataset:
    """Return a smooth function of mean 1/3 + 1/4."""
    return xr.Dataset({"y": samples["a"] ** 2 + samples["a"] * samples["b"]})


class Counted:
    """The model, which counts its calls, and dies at one of them."""

    label = "smooth"

    def __init__(self, dies: int = 10**9, function=smooth) -> None:
        self.calls = 0
        self.dies = dies
        self.function = function
        self.options: dict[str, object] = {"function": "smooth"}

    def __call__(self, samples: xr.Dataset) -> xr.Dataset:
        self.calls += 1
        if self.calls == self.dies:
            raise KeyboardInterrupt
        return self.function(samples)


def run(store=None, **changes):
    given = {"contenders": CONTENDERS, "budgets": [32, 64], "replicates": 4, "rng": 5, **changes}
    return compare(
        given.pop("model", None) or Counted(),
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


DEEP = "[" * 100_000 + "]" * 100_000


def changed(line: str, **changes: object) -> str:
    """Return a line with some of what it says replaced; ... leaves it out."""
    ((kind, content),) = json.loads(line).items()
    content |= changes
    return json.dumps({kind: {k: v for k, v in content.items() if v is not ...}}) + "\n"


DAMAGED = [
    (2, lambda line: "", "line 2 of .*no labels come before it"),
    (2, lambda line: '{"labels": {}}\n', "line 2 of .*name of the labels is None"),
    (2, lambda line: '{"labels": []}\n', "line 2 of .*labels are no mapping"),
    (2, lambda line: '{"labels": ' + DEEP + "}\n", "line 2 of .*too deep"),
    (2, lambda line: changed(line, coords=...), "line 2 of .*coords of the labels"),
    (2, lambda line: changed(line, dims=["parameter"]), "line 2 of .*dims and coords"),
    (2, lambda line: changed(line, dims=[3], coords={"3": [1]}), "line 2 of .*dims and coords"),
    (2, lambda line: changed(line, dims=["d"], coords={"d": 1}), "line 2 of .*along d"),
    (2, lambda line: changed(line, dims=["d"], coords={"d": [[1]]}), "line 2 of .*along d"),
    (2, lambda line: changed(line, dims=["d"], coords={"d": [1, 1]}), "line 2 of .*along d"),
    (2, lambda line: changed(line, dims=["d"], coords={"d": [2**64]}), "line 2 of .*along d"),
    (2, lambda line: changed(line, dims=["budget"], coords={"budget": [1]}), "line 2 of .*dims"),
    (2, lambda line: changed(line, dims=["d"], coords={"d": ["x"]}), "line 3 of .*of shape .1,."),
    (2, lambda line: changed(line, contender="other"), "line 2 of .*no contender 'other'"),
    (2, lambda line: line + changed(line, units="m"), "line 3 of .*other labels"),
    (1, lambda line: changed(line, contenders=[]), "line 1 of .*no contenders"),
    (1, lambda line: changed(line, contenders={"chaos": 1}), "line 1 of .*no contenders"),
    (1, lambda line: changed(line, seed=json.loads("[" * 300 + "]" * 300)), "line 1 of .*too deep"),
    (1, lambda line: line + line, "line 2 of .*first line"),
    (4, lambda line: changed(line, estimate=[0.5]), "line 4 of .*estimate is .0.5., not a number"),
    (4, lambda line: changed(line, estimate="0.5"), "line 4 of .*estimate is '0.5', not a number"),
    (4, lambda line: changed(line, estimate=True), "line 4 of .*estimate is True"),
    (4, lambda line: changed(line, low=None), "line 4 of .*low is None"),
    (4, lambda line: changed(line, high=10**400), "line 4 of .*too large"),
    (4, lambda line: changed(line, high={}), "line 4 of .*high is {}"),
    (4, lambda line: changed(line, estimate=json.loads("[" * 300 + "]" * 300)), "line 4 of .*too deep"),
    (4, lambda line: changed(line, evaluations=np.inf), "line 4 of .*evaluations is inf"),
    (4, lambda line: changed(line, evaluations=np.nan), "line 4 of .*evaluations is nan"),
    (4, lambda line: changed(line, evaluations=-1), "line 4 of .*evaluations is -1"),
    (4, lambda line: changed(line, evaluations=10**30), "line 4 of .*evaluations is 10000"),
    (4, lambda line: changed(line, evaluations="8"), "line 4 of .*evaluations is '8'"),
    (4, lambda line: changed(line, jobs=0), "line 4 of .*jobs is 0"),
    (4, lambda line: changed(line, budget=True), "line 4 of .*budget is True"),
    (4, lambda line: changed(line, replicate=0.5), "line 4 of .*replicate is 0.5"),
    (4, lambda line: changed(line, seconds=-1.0), "line 4 of .*seconds is -1.0"),
    (4, lambda line: changed(line, seconds=0), "line 4 of .*no run takes no time"),
    (4, lambda line: changed(line, model_seconds=np.nan), "line 4 of .*model_seconds is nan"),
    (4, lambda line: changed(line, seconds=10**400), "line 4 of .*too large"),
    (4, lambda line: changed(line, seconds=np.inf), "line 4 of .*seconds is inf"),
    (4, lambda line: changed(line, jobs=...), "line 4 of .*a run has contender, budget"),
    (4, lambda line: changed(line, more=1), "line 4 of .*a run has contender, budget"),
    (4, lambda line: changed(line, contender="other"), "line 4 of .*no contender 'other'"),
    (4, lambda line: changed(line, contender=["random"]), "line 4 of .*no contender"),
    (4, lambda line: line + changed(line, estimate=0.9), "line 5 of .*says otherwise of the same run"),
    (4, lambda line: '{"run": 3}\n', "line 4 of .*a run has"),
    (4, lambda line: '{"run": {}, "labels": {}}\n', "line 4 of .*none of definition, labels, run"),
    (4, lambda line: line[:20] + "\n", "line 4 of .*not JSON"),
    (14, lambda line: changed(line, evaluations=-1).strip(), "line 14 of .*evaluations is -1"),
]


@pytest.fixture(scope="module")
def runs(tmp_path_factory) -> list[str]:
    """Return the lines of a comparison: definition, labels, twelve runs."""
    file = tmp_path_factory.mktemp("runs") / "runs.jsonl"
    run(file)
    return file.read_text().splitlines(keepends=True)


@pytest.mark.parametrize(("number", "change", "message"), DAMAGED)
def test_damaged_lines_are_named(runs, tmp_path, number, change, message):
    file = tmp_path / "runs.jsonl"
    lines = list(runs)
    lines[number - 1] = change(lines[number - 1])
    file.write_text("".join(lines))
    before = file.read_bytes()
    with pytest.raises(StoreError, match=message) as caught:
        run(file, resume=True)
    assert "runs.jsonl" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500
    assert file.read_bytes() == before


def test_runs_of_a_contender_that_the_file_does_not_define_are_refused(runs, tmp_path):
    """They are not taken for those of the contender that has the name now."""
    file = tmp_path / "runs.jsonl"
    definition = json.loads(runs[0])
    del definition["definition"]["contenders"]["chaos"]
    file.write_text(json.dumps(definition) + "\n" + "".join(runs[1:]))
    with pytest.raises(StoreError, match="the definition has no contender 'chaos'"):
        run(file, resume=True)


def test_what_is_said_twice_is_taken_once(whole, runs, tmp_path):
    file = tmp_path / "runs.jsonl"
    file.write_text("".join([*runs[:5], *runs[1:]]))
    assert_same(run(file, resume=True), whole)
    assert file.read_text().splitlines(keepends=True) == runs


def test_a_run_of_another_size_is_replaced(whole, runs, tmp_path):
    """As when a budget allowed less: the file has the new one alone, and can be read again."""
    file = tmp_path / "runs.jsonl"
    file.write_text("".join([*runs[:3], changed(runs[3], n=3), *runs[4:]]))
    assert_same(run(file, resume=True), whole)
    assert len(file.read_text().splitlines()) == len(runs)
    assert_same(run(file, resume=True), whole)


def test_a_record_takes_the_definition_of_its_file(runs, tmp_path):
    file = tmp_path / "runs.jsonl"
    file.write_text("".join(runs))
    record = Record.read(file, None)
    assert len(record.runs) == 12
    assert record.definition == json.loads(runs[0])["definition"]
    assert not Record.read(tmp_path / "none", None).runs


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
    model = Counted(function=sometimes)
    found = run(file, model=model, **given)
    assert np.isnan(found["estimate"]).sum() == 4
    assert np.isnan(found["rmse"]).all()
    assert np.isnan(found["rmse_ratio"]).all()
    again = run(file, model=model, resume=True, **given)
    assert_same(again, found)
