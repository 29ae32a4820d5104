"""A study that was cut off goes on to the results of one that was not, and never mixes two definitions."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from compare_studies import ANALYSES, BOTH, COMPARE

import hipuq
from hipuq.cli import main
from hipuq.differences import difference
from hipuq.errors import StoreError
from hipuq.models import CEAModel

TIMES = (
    "seconds",
    "model_seconds",
    "run_time",
    "model_time",
    "cost_ratio",
    "break_even",
)
"""What no two runs have in common."""

HEAD, HOFFMANN, INDICES, ONSET = BOTH.replace("replicates = 3", "replicates = 2").split("[[compare.problem]]")
SMALL = "[[compare.problem]]".join([HEAD, HOFFMANN, ONSET])
"""Two analyses and two problems, the least that can be cut off anywhere: results are slow to write."""

REHEARSALS = 3
"""Calls of the model before the first analysis: each contender's first, but for those that integrate."""


class Killed(BaseException):
    """In place of a signal."""


def write(folder: Path, text: str) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder


def run(folder: Path, text: str, **options) -> xr.DataTree:
    study = hipuq.load_study(write(folder, text), seed=options.pop("seed", None))
    return hipuq.run_study(study, folder / "out", progress=False, **options)


def kill_after(monkeypatch, calls: int) -> list[int]:
    """Let the model die when it is called once more; return how often it was called, as it counts."""
    counted = [0]
    whole = CEAModel.__call__

    def dies(self, samples, keep=None):
        counted[0] += 1
        if counted[0] > calls:
            raise Killed
        return whole(self, samples, keep)

    monkeypatch.setattr(CEAModel, "__call__", dies)
    return counted


def assert_same(one: xr.DataTree, other: xr.DataTree) -> None:
    """Assert that two results have the same groups in the same order, and the same bits but for times."""
    assert [path for path in one.groups] == [path for path in other.groups]
    for path in one.groups:
        a, b = (
            t[path].to_dataset(inherit=False).drop_vars([n for n in t[path].data_vars if n.startswith(TIMES)])
            for t in (one, other)
        )
        xr.testing.assert_equal(a, b)
        for name in a.data_vars:
            assert a[name].values.tobytes() == b[name].values.tobytes(), f"{path}/{name}"
        for key in {*a.attrs, *b.attrs} - {"history", "seconds"}:
            np.testing.assert_array_equal(a.attrs.get(key), b.attrs.get(key))


@pytest.fixture(scope="module")
def complete(tmp_path_factory) -> tuple[Path, xr.DataTree]:
    """Return the folder and the results of a run that nothing cut off."""
    folder = tmp_path_factory.mktemp("whole") / "study"
    return folder, run(folder, SMALL)


@pytest.fixture
def whole(complete) -> xr.DataTree:
    """Return the results of a run that nothing cut off."""
    return complete[1]


@pytest.fixture
def folder(complete, tmp_path) -> Path:
    """Return a folder of one's own with such a run in it."""
    return Path(shutil.copytree(complete[0], tmp_path / "study"))


def test_an_empty_folder_is_just_run(whole, tmp_path):
    assert_same(run(tmp_path / "study", SMALL, resume=True), whole)


@pytest.mark.parametrize("calls", [0, 1, 2, 3, 13])
def test_a_run_that_was_killed_goes_on_to_the_same_results(whole, tmp_path, calls):
    """At any place: in the first analysis, between two, at the first or a later run of a comparison."""
    folder = tmp_path / "study"
    with pytest.MonkeyPatch.context() as patched, pytest.raises(Killed):
        kill_after(patched, REHEARSALS + calls)
        run(folder, SMALL)
    said: list[str] = []
    assert_same(run(folder, SMALL, resume=True, say=said.append), whole)
    assert_same(hipuq.load_results(folder / "out"), whole)
    assert ("a: kept, complete in" in "\n".join(said)) == (calls >= 1)
    assert ("b: kept, complete in" in "\n".join(said)) == (calls >= 2)


def test_nothing_is_evaluated_twice(monkeypatch, tmp_path):
    folder = tmp_path / "study"
    counted = kill_after(monkeypatch, 10_000)
    once = run(folder, BOTH)
    calls = counted[0]
    assert calls > 20
    said: list[str] = []
    again = run(folder, BOTH, resume=True, say=said.append)
    assert counted[0] == calls + REHEARSALS + 1
    assert [line.split(",")[0] for line in said[2:]] == [
        f"compare/{name}: complete" for name in ("hoffmann", "indices", "onset")
    ]
    assert_same(again, once)


def test_a_line_that_was_cut_off_is_done_again(whole, folder):
    file = folder / "out" / "compare" / "hoffmann.jsonl"
    text = file.read_text(encoding="utf-8")
    file.write_text(text[: len(text) // 2], encoding="utf-8")
    assert_same(run(folder, SMALL, resume=True), whole)
    assert len(file.read_text(encoding="utf-8").splitlines()) == len(text.splitlines())


def test_more_is_added_and_what_is_gone_is_left_out(whole, folder):
    first = whole
    more = SMALL.replace("budgets = [16, 32]", "budgets = [16, 32, 128]")
    more += '[[analysis]]\nname = "c"\nmethod = "monte_carlo"\nn = 8\nof = "margin"\n'
    second = run(folder, more, resume=True)
    assert list(second.children) == ["a", "b", "c", "compare"]
    assert second["compare/onset"]["budget"].values.tolist() == [16, 32, 128]
    np.testing.assert_array_equal(
        second["compare/onset"]["estimate"].values[:, :2], first["compare/onset"]["estimate"].values
    )
    third = run(folder, SMALL, resume=True)
    assert_same(third, first)
    assert list(json.loads(third.attrs["analyses"])) == ["a", "b"]


def test_an_analysis_with_a_new_name_is_run_in_its_place(tmp_path):
    """Its seed is that of its place; the file has both in the order of the study."""
    folder = tmp_path / "study"
    head = 'title = "Named"\n'
    first = run(folder, head + ANALYSES)
    second = run(folder, head + ANALYSES.replace('name = "a"', 'name = "again"'), resume=True)
    assert list(second.children) == ["again", "b"]
    assert list(hipuq.load_results(folder / "out").children) == ["again", "b"]
    xr.testing.assert_equal(
        second["again/margin"].to_dataset().drop_vars("seconds"),
        first["a/margin"].to_dataset().drop_vars("seconds"),
    )


def test_what_the_report_shows_is_made_again_where_it_changes(monkeypatch, tmp_path):
    folder = tmp_path / "study"
    text = f'title = "Shown"\n{ANALYSES}[report]\nfriction_sweep = [0.0, 0.8]\nfriction_points = 11\n'
    run(folder, text)
    counted = kill_after(monkeypatch, 10_000)
    run(folder, text, resume=True)
    assert counted[0] == 0
    found = run(folder, text.replace("friction_points = 11", "friction_points = 21"), resume=True)
    assert found["a/friction_sweep"].sizes["sample"] == 21
    assert counted[0] == 2
    stored = hipuq.load_results(folder / "out")
    assert stored["b/friction_sweep"].sizes["sample"] == 21
    assert list(stored["a"].children) == ["any_unstable", "margin", "verdicts", "friction_sweep"]
    assert "friction_sweep" not in run(folder, f'title = "Shown"\n{ANALYSES}', resume=True)["a"].children


OTHERS = [
    (
        "n = 24",
        "n = 12",
        "analysis 'a' in {} was made with n 24, the study asks for 12: run without --resume",
    ),
    ("n = 32", "n = 16", "analysis 'b' in {} was made with n 32"),
    ('of = "margin"', 'of = "any_unstable"', "analysis 'b' in {} was made with of[1] 'margin'"),
    ('of = ["any_unstable", "margin"]', 'of = "margin"', "was made with of ['any_unstable', 'margin']"),
    ("k1 = 12.0", "k1 = 13.0", "was made with model_options.nominal.k1 12.0, the study asks for 13.0"),
    ("upper = 0.1", "upper = 0.2", "was made with inputs.k3.distribution.kwargs.upper 0.1"),
    ('"latin_hypercube"', '"sobol"', "was made with options.design.sampler 'latin_hypercube'"),
    ('options = { sampler = "latin_hypercube" }', "", "the study asks for nothing"),
    ("seed = 5", "seed = 6", "was made with seed "),
]


@pytest.mark.parametrize(("old", "new", "message"), OTHERS)
def test_analyses_of_another_definition_are_refused(monkeypatch, tmp_path, old, new, message):
    folder = tmp_path / "study"
    text = f'title = "Changed"\nseed = 5\n{ANALYSES}'
    run(folder, text)
    before = (folder / "out" / "results.nc").read_bytes()
    counted = kill_after(monkeypatch, 0)
    with pytest.raises(StoreError) as caught:
        run(folder, text.replace(old, new, 1), resume=True)
    assert message.format(folder / "out") in str(caught.value)
    assert "choose another folder with --out" in str(caught.value)
    assert counted[0] == 0
    assert (folder / "out" / "results.nc").read_bytes() == before


def test_another_version_and_results_without_definitions_are_refused(monkeypatch, tmp_path):
    folder = tmp_path / "study"
    text = f'title = "Old"\n{ANALYSES}'
    tree = run(folder, text)
    with monkeypatch.context() as patched:
        patched.setattr("hipuq.study.resuming.__version__", "99.0")
        with pytest.raises(StoreError, match=r"was made with hipuq_version '.*', the study asks for '99\.0'"):
            run(folder, text, resume=True)
    del tree.attrs["analyses"]
    hipuq.save_results(tree, folder / "out" / "results.nc")
    with pytest.raises(StoreError, match="does not say how it was made: run without --resume"):
        run(folder, text, resume=True)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("seed = 5", "seed = 6", "has runs with seed"),
        (
            "upper = 0.1",
            "upper = 0.2",
            "has runs of 'integrated' with inputs|has runs of 'random' with inputs",
        ),
    ],
)
def test_runs_of_another_comparison_are_refused(tmp_path, old, new, message):
    folder = tmp_path / "study"
    run(folder, COMPARE)
    with pytest.raises(StoreError, match=message):
        run(folder, COMPARE.replace(old, new, 1), resume=True)


def test_without_resume_all_is_made_anew(monkeypatch, folder, tmp_path):
    """Runs of the old seed go with the old results, so that the new ones can be resumed."""
    with monkeypatch.context() as patched, pytest.raises(Killed):
        kill_after(patched, REHEARSALS + 1)
        run(folder, SMALL, seed=9)
    assert list(hipuq.load_results(folder / "out").children) == ["a"]
    assert not list((folder / "out" / "compare").iterdir())
    fresh = run(tmp_path / "other", SMALL, seed=9)
    resumed = run(folder, SMALL, seed=9, resume=True)
    assert resumed["a/margin"]["mean"].values == fresh["a/margin"]["mean"].values
    xr.testing.assert_equal(resumed["compare/onset/estimate"], fresh["compare/onset/estimate"])


def test_outcomes_of_a_killed_run_are_no_obstacle(tmp_path):
    """What was half written or half removed when the process died."""
    folder = tmp_path / "study"
    outcomes = folder / "out" / "outcomes"
    for half in (".a.zarr.hipuq-old", ".a.zarr.hipuq-replaced"):
        (outcomes / half / "margin").mkdir(parents=True)
        (outcomes / half / "margin" / "0").write_bytes(b"x")
    run(folder, f'title = "Half"\n{ANALYSES}', resume=True)
    assert {path.name for path in outcomes.iterdir()} == {"a.zarr", "b.zarr"}
    assert hipuq.load_outcomes(outcomes / "a.zarr").sizes["sample"] == 24


def test_the_command_says_how_to_go_on(monkeypatch, capsys, tmp_path):
    folder = write(tmp_path / "study", f'title = "Cut"\n{ANALYSES}')

    def interrupted(self, samples, keep=None):
        raise KeyboardInterrupt

    arguments = ["hipuq", "run", str(folder), "--out", str(tmp_path / "out"), "--jobs", "1"]
    monkeypatch.setattr(sys, "argv", arguments)
    with monkeypatch.context() as patched:
        patched.setattr(CEAModel, "__call__", interrupted)
        with pytest.raises(SystemExit) as caught:
            main()
    assert caught.value.code == 130
    assert capsys.readouterr().err.strip().endswith("go on with --resume")
    for said in ("a: 24 evaluations", "a: kept, complete in"):
        monkeypatch.setattr(sys, "argv", [*arguments, "--resume"])
        with pytest.raises(SystemExit) as caught:
            main()
        assert not caught.value.code
        assert said in capsys.readouterr().out
    monkeypatch.setattr(sys, "argv", [*arguments, "--resume", "--seed", "7"])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 1
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "was made with seed" in line


def test_a_resume_that_fails_leaves_no_less_than_there_was(whole, folder):
    """Old results of a comparison stay until there are new ones; what the study no longer has is told."""
    first = whole
    more = SMALL.replace("budgets = [16, 32]", "budgets = [16, 32, 128]")
    with pytest.MonkeyPatch.context() as patched, pytest.raises(Killed):
        kill_after(patched, REHEARSALS)
        run(folder, more, resume=True)
    stored = hipuq.load_results(folder / "out")
    assert stored.groups == first.groups
    xr.testing.assert_identical(stored["compare"], first["compare"])
    # The first problem is complete, the next ones are not.
    with pytest.MonkeyPatch.context() as patched, pytest.raises(Killed):
        kill_after(patched, REHEARSALS + 2 + 2 * 2 + 1)
        run(folder, more, resume=True)
    stored = hipuq.load_results(folder / "out")
    assert stored["compare/hoffmann"]["budget"].values.tolist() == [16, 32, 128]
    assert stored["compare/onset"]["budget"].values.tolist() == [16, 32]
    said: list[str] = []
    last = run(folder, more, resume=True, say=said.append)
    assert last["compare/onset"]["budget"].values.tolist() == [16, 32, 128]
    assert not [line for line in said if ": dropped from" in line]
    assert_same(hipuq.load_results(folder / "out"), last)


def test_what_is_dropped_is_told(tmp_path):
    folder = tmp_path / "study"
    head, *_, last = BOTH.split("[[compare.problem]]")
    text = f"{BOTH}[report]\nfriction_sweep = [0.0, 0.8]\nfriction_points = 11\n"
    run(folder, text)
    said: list[str] = []
    less = head + "[[compare.problem]]" + last[: last.index('[[analysis]]\nname = "b"')]
    found = run(folder, less, resume=True, say=said.append)
    file = folder / "out" / "results.nc"
    assert [line for line in said if ": dropped from" in line] == [
        f"{name}: dropped from {file}, the study no longer has it"
        for name in ("b", "a/friction_sweep", "compare/hoffmann", "compare/indices")
    ]
    assert list(found.children) == ["a", "compare"]
    assert list(found["compare"].children) == ["onset"]


def test_results_of_another_seed_are_not_carried_over(tmp_path):
    """Without the runs nothing else says that they are."""
    folder = tmp_path / "study"
    run(folder, COMPARE)
    for file in (folder / "out" / "compare").iterdir():
        file.unlink()
    said: list[str] = []
    with pytest.MonkeyPatch.context() as patched, pytest.raises(Killed):
        kill_after(patched, REHEARSALS + 4)
        run(folder, COMPARE, seed=9, resume=True, say=said.append)
    assert any(line.endswith("results.nc, it was made with another seed") for line in said)


def test_what_no_result_has_shows_before_the_first_analysis(tmp_path):
    folder = tmp_path / "study"
    said: list[str] = []
    for old, new, message in (
        ('quantity = "ST"', 'quantity = "STT"', r"problem 'indices': .*'sobol' have no 'STT'"),
        ('of = "margin"\nquantity = "ST"\n', 'of = "margin"\nquantity = "mean"\n', "problem 'indices': "),
    ):
        assert old in BOTH
        text = BOTH.replace(old, new, 1)
        with pytest.raises(hipuq.HipuqError, match=message) as caught:
            run(folder, text, say=said.append)
        assert "\n" not in str(caught.value)
        assert not said
        assert not (folder / "out" / "results.nc").exists()


def call(monkeypatch, capsys, *arguments: object) -> tuple[int, str, str]:
    """Return exit code, standard output and standard error of a call."""
    monkeypatch.setattr(sys, "argv", ["hipuq", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        main()
    said = capsys.readouterr()
    code = caught.value.code
    return (code if isinstance(code, int) else int(code is not None)), said.out, said.err


def test_a_dry_run_tells_what_would_be_kept_and_refuses_what_a_run_refuses(
    monkeypatch, capsys, folder, tmp_path
):
    out = folder / "out"
    file = out / "compare" / "hoffmann.jsonl"
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    file.write_text("".join(lines[:-2]), encoding="utf-8")
    before = {path: path.read_bytes() for path in (out / "results.nc", file)}
    dry = ("run", folder, "--out", out, "--resume", "--dry-run")
    code, said, _ = call(monkeypatch, capsys, *dry)
    assert code == 0
    for line in (
        f"  a: would be kept, complete in {out}",
        f"  b: would be kept, complete in {out}",
        "  compare/hoffmann: 8 of 10 runs would be kept",
        "  compare/onset: 4 of 4 runs would be kept",
    ):
        assert line in said.splitlines()
    code, _, err = call(monkeypatch, capsys, *dry, "--seed", 6)
    assert code == 1
    assert "runs with seed" in err
    write(folder, SMALL.replace("n = 24", "n = 48"))
    code, said, _ = call(monkeypatch, capsys, *dry)
    assert code == 0
    store = out / "outcomes" / "a.zarr"
    assert f"  a: would go on, 24 of 24 samples are in {store}, 48 asked for" in said.splitlines()
    write(folder, SMALL.replace("n = 24", "n = 12"))
    code, _, err = call(monkeypatch, capsys, *dry)
    assert code == 1
    assert "was made with n 24, the study asks for 12" in err
    write(folder, SMALL.replace('[[analysis]]\nname = "b"', '[[analysis]]\nname = "c"'))
    code, said, _ = call(monkeypatch, capsys, *dry)
    assert code == 0
    assert "  b: would be dropped, the study no longer has it" in said.splitlines()
    assert {path: path.read_bytes() for path in before} == before
    code, said, _ = call(
        monkeypatch, capsys, "run", folder, "--out", tmp_path / "none", "--resume", "--dry-run"
    )
    assert "compare/hoffmann: 0 of 10 runs would be kept" in said
    assert not (tmp_path / "none").exists()


def test_definitions_too_deep_to_read_are_refused(tmp_path):
    folder = tmp_path / "study"
    tree = run(folder, f'title = "Deep"\n{ANALYSES}')
    tree.attrs["analyses"] = '{"a":' * 3000 + "1" + "}" * 3000
    hipuq.save_results(tree, folder / "out" / "results.nc")
    with pytest.raises(StoreError, match="does not say how it was made"):
        run(folder, f'title = "Deep"\n{ANALYSES}', resume=True)


@pytest.mark.parametrize(
    ("here", "there", "found"),
    [
        ({"a": 1, "b": [1, 2]}, {"b": [1, 2], "a": 1}, None),
        ({"a": 1}, {"a": 1.0}, None),
        ({"a": 1}, {"a": True}, ("a", "1", "True")),
        ({"a": {"b": [1, {"c": 2}]}}, {"a": {"b": [1, {"c": 3}]}}, ("a.b[2].c", "2", "3")),
        ({"a": [1]}, {"a": [1, 2]}, ("a", "[1]", "[1, 2]")),
        ({}, {"a": None}, ("a", "nothing", "None")),
        ({"a": "x" * 100}, {"a": ""}, ("a", "'" + "x" * 56 + "...", "''")),
    ],
)
def test_difference_names_the_first_place(here, there, found):
    assert difference(here, there) == found
