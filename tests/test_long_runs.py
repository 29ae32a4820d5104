"""Studies in long runs: cut off within an analysis, extended, with failures, in processes, one at a time."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr

import hipuq
from hipuq.cli import main
from hipuq.errors import ModelError, StoreError
from hipuq.models import CEAModel
from hipuq.store.lock import locked
from hipuq.study.running import RUN

STUDY = """
title = "Long"
seed = 5

[model]
name = "two_dof"
preset = "hoffmann2002"

[inputs.friction]
distribution = "uniform"
lower = 0.0
upper = 1.0

[inputs.k3]
distribution = "uniform"
lower = 1.0
upper = 2.0

[[analysis]]
name = "draws"
method = "monte_carlo"
n = 4096
of = "any_unstable"
"""

SWEPT = (
    STUDY.replace("n = 4096", "n = 1500\nover = { damping_1 = [0.0, 0.1] }")
    .replace("hoffmann2002", "hulten")
    .replace("k3", "frequency_2")
    .replace("lower = 1.0\nupper = 2.0", "lower = 500.0\nupper = 600.0")
)


def run(folder: Path, text: str = STUDY, **options) -> xr.DataTree:
    folder.mkdir(exist_ok=True)
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return hipuq.run_study(hipuq.load_study(folder), folder / "out", progress=False, **options)


def results(tree: xr.DataTree) -> xr.Dataset:
    found = tree["draws/any_unstable"].to_dataset(inherit=False).drop_vars("seconds")
    return found.drop_attrs()


def watched(monkeypatch, fails=lambda samples: samples["friction"].values < 0, last=None) -> list[int]:
    """Let the model fail for some samples, stop after some; return how many it has seen, as it counts."""
    seen, whole = [0], CEAModel.__call__

    def call(self, samples, keep=None):
        if last is not None and seen[0] >= last:
            raise KeyboardInterrupt
        if fails(samples).any():
            raise ArithmeticError("no\nsolution")
        seen[0] += samples.sizes["sample"]
        return whole(self, samples, keep)

    monkeypatch.setattr(CEAModel, "__call__", call)
    return seen


def command(monkeypatch, capsys, *arguments: object) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "argv", ["hipuq", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        main()
    said = capsys.readouterr()
    return int(caught.value.code or 0), said.out, said.err


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return results(run(tmp_path_factory.mktemp("whole") / "study"))


def test_an_analysis_goes_on_where_it_was_cut_off(whole, monkeypatch, capsys, tmp_path):
    with monkeypatch.context() as patched:
        watched(patched, last=2048)
        with pytest.raises(KeyboardInterrupt, match="2,048 of 4,096 samples are in"):
            run(tmp_path / "study", n_jobs=1)
    folder = tmp_path / "study"
    dry = ("run", folder, "--out", folder / "out", "--resume", "--dry-run")
    code, said, _ = command(monkeypatch, capsys, *dry)
    assert code == 0
    assert "draws: would go on, 2,048 of 4,096 samples are in" in said
    with monkeypatch.context() as patched:
        seen = watched(patched)
        xr.testing.assert_identical(results(run(folder, resume=True)), whole)
    assert seen == [2048]
    larger = STUDY.replace("n = 4096", "n = 6000")
    with monkeypatch.context() as patched:
        seen = watched(patched)
        extended = run(folder, larger, resume=True)
    assert seen == [6000 - 4096]
    xr.testing.assert_identical(results(extended), results(run(tmp_path / "other", larger)))
    with pytest.raises(StoreError, match=r"'draws' in .* was made with n 6000, the study asks for 4096"):
        run(folder, resume=True)


def test_a_sweep_goes_on_between_its_values(monkeypatch, tmp_path):
    with monkeypatch.context() as patched:
        watched(patched, last=2048)
        with pytest.raises(KeyboardInterrupt, match="2,048 of 3,000 samples are in"):
            run(tmp_path / "study", SWEPT, n_jobs=1)
    with monkeypatch.context() as patched:
        seen = watched(patched)
        resumed = run(tmp_path / "study", SWEPT, resume=True)
    assert seen == [3000 - 2048]
    expected = run(tmp_path / "other", SWEPT)
    xr.testing.assert_identical(results(resumed), results(expected))
    for damping in (0.0, 0.1):
        outcomes = hipuq.load_outcomes(tmp_path / "study" / "out" / "outcomes" / "draws.zarr")
        own = outcomes.isel(sample=outcomes["damping_1"].values == damping)
        assert results(expected)["probability"].sel(damping_1=damping) == own["any_unstable"].mean()


def test_failures_are_told_and_too_many_end_the_command(monkeypatch, capsys, tmp_path):
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "study.toml").write_text(STUDY.replace("4096", "2000"), encoding="utf-8")
    arguments = ("run", folder, "--out", tmp_path / "out", "--jobs", 1)
    with monkeypatch.context() as patched:
        watched(patched, lambda samples: samples["friction"].values > 0.9)
        code, said, err = command(patched, capsys, *arguments, "--max-failed", 0.05)
        assert code == 1
        (line,) = err.strip().splitlines()
        assert "samples failed, more than max_failed = 0.05 allows of 2,000" in line
        assert "ArithmeticError: no solution" in line
        code, _, err = command(patched, capsys, *arguments, "--resume", "--on-error", "raise")
        assert code == 1
        assert "its inputs are friction=0.9" in err
        code, said, _ = command(patched, capsys, *arguments, "--resume")
        assert code == 0
    found = hipuq.load_results(tmp_path / "out")["draws/any_unstable"]
    failed = int(found["failed"])
    assert 150 < failed < 250
    assert f"{failed:,} failed (sample " in said
    assert float(found["probability_high"] - found["probability_low"]) > failed / 2000
    code, said, _ = command(monkeypatch, capsys, "show", tmp_path / "out")
    assert f"{failed:,} failed" in said


def test_results_that_were_cut_off_are_made_again(whole, tmp_path):
    """As by a power cut: outcomes are there, so nothing is lost."""
    run(tmp_path / "study")
    file = tmp_path / "study" / "out" / "results.nc"
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    said: list[str] = []
    xr.testing.assert_identical(results(run(tmp_path / "study", resume=True, say=said.append)), whole)
    assert "results.nc is cut off: it is now results.nc.damaged, and made again from the outcomes" in said[0]
    file.write_text("not mine")
    with pytest.raises(StoreError, match="cannot read"):
        run(tmp_path / "study", resume=True)
    assert file.read_text() == "not mine"


def test_processes_give_the_same_bits(whole, tmp_path):
    xr.testing.assert_identical(results(run(tmp_path / "study", executor="processes", n_jobs=2)), whole)


def test_one_run_in_a_folder_at_a_time(whole, tmp_path):
    (tmp_path / "study").mkdir()
    with (
        locked(tmp_path / "study" / "out" / RUN),
        pytest.raises(StoreError, match="another run is writing to"),
    ):
        run(tmp_path / "study")
    with pytest.raises(ModelError, match="the executor failed, RuntimeError: no more"):
        run(tmp_path / "study", executor=Broken())
    xr.testing.assert_identical(results(run(tmp_path / "study")), whole)


class Broken:
    """An executor that takes nothing."""

    def submit(self, *arguments):
        raise RuntimeError("no more")


def test_options_of_the_command_are_checked(monkeypatch, capsys, tmp_path):
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    for words, message in (
        (("--on-error", "stop"), "'stop': allowed are mark, raise"),
        (("--max-failed", 2), "max_failed is 2.0: it must be a share"),
        (("--processes", "--dask", "tcp://127.0.0.1:1"), "--processes and --dask exclude each other"),
        (("--dask", "nowhere"), "there is no dask scheduler at 'nowhere'"),
    ):
        monkeypatch.setattr("hipuq.cli.CONNECT", 1.0)
        code, _, err = command(monkeypatch, capsys, "run", folder, "--out", tmp_path / "out", *words)
        assert code == 1
        (line,) = err.strip().splitlines()
        assert message in line
    assert not (tmp_path / "out" / "results.nc").exists()


def test_resumed_runs_end_as_one_that_was_not_cut_off():
    """A few of the points at which the script kills a study; it does fifty by default."""
    script = Path(__file__).parent / "benchmarks" / "kill_points.py"
    done = subprocess.run(
        [sys.executable, str(script), "4", "1"], capture_output=True, text=True, timeout=250, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.endswith("4 of 4 resumed runs ended as one that was not cut off\n")


def test_control_c_leaves_a_store_that_goes_on(tmp_path):
    """The signal itself, to a command with worker processes, which say nothing of it."""
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "study.toml").write_text(STUDY.replace("4096", "3000000"), encoding="utf-8")
    arguments = ["run", str(folder), "--out", str(tmp_path / "out"), "--processes", "--jobs", "1"]
    store = tmp_path / "out" / "outcomes" / "draws.zarr"
    with subprocess.Popen(
        [sys.executable, "-m", "hipuq", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # What runs in the background of a shell ignores the signal, and so would the command.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        while not (store / "hipuq.jsonl").exists():
            assert process.poll() is None
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate()
    assert process.returncode == 130
    # Old releases of libraries warn while they are imported.
    (line,) = (line for line in err.splitlines() if "Warning" not in line and not line.startswith("  "))
    assert line.startswith("hipuq: interrupted: ")
    assert line.endswith(f" of 3,000,000 samples are in {store}; go on with --resume")
    assert "Traceback" not in err
