"""The command line: what it prints and writes, and that an error is one line without a traceback."""

import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr
from helpers import SMALL_STUDY

from hipuq.cli import main

SMALL = (
    SMALL_STUDY
    + """
[[analysis]]
name = "small"
method = "monte_carlo"
n = 8
of = ["unstable", "any_unstable"]
options = { stratify = "contact" }
[report]
friction_sweep = [0.0, 0.1]
friction_points = 21
shape_friction = 0.1
mode_shapes = [18]
pairs = [[17, 18]]
damping_samples = 0
"""
)


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("studies") / "small"
    folder.mkdir()
    (folder / "study.toml").write_text(SMALL, encoding="utf-8")
    return folder


def call(monkeypatch, capsys, *arguments: object) -> tuple[int, str, str]:
    """Return exit code, standard output and standard error of a call."""
    monkeypatch.setattr(sys, "argv", ["hipuq", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        main()
    said = capsys.readouterr()
    code = caught.value.code
    return (code if isinstance(code, int) else int(code is not None)), said.out, said.err


def test_run_show_and_report(monkeypatch, capsys, study, tmp_path):
    out = tmp_path / "out"
    code, said, _ = call(monkeypatch, capsys, "run", study, "--out", out, "--jobs", 1)
    assert code == 0
    assert "80 evaluations" in said
    assert {path.name for path in out.iterdir()} == {"outcomes", "results.nc", "figures", "report.html"}
    names = {path.name for path in (out / "figures").iterdir()}
    assert {"small-occurrence.png", "small-mode_shapes.png", "small-lock_in.png"} <= names
    page = (out / "report.html").read_text(encoding="utf-8")
    code, said, _ = call(monkeypatch, capsys, "show", out)
    assert code == 0
    assert "80 evaluations" in said
    (out / "report.html").unlink()
    code, _, _ = call(monkeypatch, capsys, "report", out / "results.nc")
    assert code == 0
    assert (out / "report.html").read_text(encoding="utf-8") == page


def test_dry_run_counts_and_writes_nothing(monkeypatch, capsys, study, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, said, _ = call(monkeypatch, capsys, "run", study, "--dry-run")
    assert code == 0
    assert "in all 80 evaluations" in said
    assert not list(tmp_path.iterdir())


def test_output_goes_under_the_current_folder(monkeypatch, capsys, study, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, _, _ = call(monkeypatch, capsys, "run", study / "study.toml", "--seed", 0)
    assert code == 0
    tree = xr.open_datatree(tmp_path / "results" / "small" / "results.nc", engine="h5netcdf")
    assert tree.attrs["seed"] == 0
    tree.close()


def test_lists(monkeypatch, capsys):
    _, said, _ = call(monkeypatch, capsys, "list", "models")
    assert "oberst2016-calibrated" in said
    assert "hulten" in said
    _, said, _ = call(monkeypatch, capsys, "list", "methods")
    lines = dict(line.split(": ", 1) for line in said.splitlines())
    assert set(lines) == {"monte_carlo", "sobol", "chaos"}
    assert "stratify=False" in lines["monte_carlo"]
    # An option of one stage alone, and one of several with another default in each.
    for name, option in (
        ("chaos", "correction=0"),
        ("chaos", "held_out=0.2"),
        ("sobol", "second_order=False"),
    ):
        assert lines[name].count(f"{option.split('=')[0]}=") == 1
        assert option in lines[name].partition("options ")[2].split(", ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "nowhere"], "cannot read the study"),
        (["run", "STUDY", "--jobs", "0"], "--jobs is 0"),
        (["run", "STUDY", "--seed", "-1"], "seed is -1"),
        (["run", "STUDY", "--out", "/dev/null/x"], "choose another folder with --out"),
        (["show", "nowhere"], "there are no results"),
        (["show", "STUDY/study.toml"], "cannot read"),
        (["report", "nowhere"], "there are no results"),
        (["list", "metods"], "did you mean 'methods'"),
    ],
)
def test_an_error_is_one_line(monkeypatch, capsys, study, arguments, message):
    given = [str(argument).replace("STUDY", str(study)) for argument in arguments]
    code, _, err = call(monkeypatch, capsys, *given)
    assert code == 1
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert "Traceback" not in err


def test_debug_shows_the_traceback(monkeypatch, study):
    monkeypatch.setattr(sys, "argv", ["hipuq", "--debug", "run", "nowhere"])
    with pytest.raises(Exception, match="cannot read the study"):
        main()


def test_the_installed_command_and_the_module_say_help():
    script = Path(sys.executable).with_name("hipuq")
    for command in ([str(script)], [sys.executable, "-m", "hipuq"]):
        done = subprocess.run([*command, "--help"], capture_output=True, text=True, check=True)
        for name in ("run", "report", "show", "list"):
            assert name in done.stdout
