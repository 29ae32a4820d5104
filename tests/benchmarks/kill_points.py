"""Kill a small study at seeded points, resume it, and compare with a run that was not cut off.

    python tests/benchmarks/kill_points.py [POINTS] [SEED]

A point is an event of writing in the output folder: before a file is written, in the middle of it, after it;
the same for lines of a ledger and folders that are removed; before and after something is renamed, metadata
are gathered, results are saved. The process ends there by SIGKILL; at every second point one of the files
written last is cut in half first, as by a power cut. Points are drawn over two scenarios: a study from the
beginning, and one that is complete and gets more samples. Runs and resumed runs are processes of their own.
The exit code is 1 if any end differs.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import SALib.analyze.sobol  # noqa: F401
import xarray as xr
import zarr

import hipuq
import hipuq.store.blocks
import hipuq.store.ledger
from hipuq.store import save_results
from hipuq.study import Study, load_study, run_study

STUDY = """
title = "Killed"
seed = 3

[model]
name = "two_dof"
preset = "hoffmann2002"

[inputs]
friction = { distribution = "uniform", lower = 0.0, upper = 1.0 }
k3 = { distribution = "uniform", lower = 1.0, upper = 2.0 }

[report]
damping_samples = 0

[[analysis]]
name = "draws"
method = "monte_carlo"
n = 3000
of = "margin"

[[analysis]]
name = "causes"
method = "sobol"
n = 128
of = "probability"
integrate_friction = true
options = { resamples = 20 }

[[analysis]]
name = "surrogate"
method = "chaos"
n = 64
of = "margin"
options = { correction = 128, degree = 2, held_out = 0.2, population = 2048 }
"""

LARGER = STUDY.replace("n = 3000", "n = 5000")


RECENT = 4
"""A power cut takes one of so many files that were written last: they need not reach the disk in order."""


class Countdown:
    """Events of writing in a folder until the process ends itself; without a number they are counted."""

    def __init__(self, folder: Path, left: int | None = None, torn: bool = False) -> None:
        self.folder, self.left, self.torn = folder, left, torn
        # Shared, so that who forks a process knows how many there were.
        self.seen = multiprocessing.Value("l", 0)

    def event(self) -> None:
        with self.seen.get_lock():
            self.seen.value += 1
            if self.seen.value != self.left:
                return
            files = [path for path in self.folder.rglob("*") if path.is_file()]
            if self.torn and files:
                recent = sorted(files, key=lambda path: path.stat().st_mtime_ns)[-RECENT:]
                lost = recent[self.left % len(recent)]
                os.truncate(lost, lost.stat().st_size // 2)
            os.kill(os.getpid(), signal.SIGKILL)

    def around(self, owner: object, name: str, half: Callable[..., None] | None = None) -> None:
        """Make events of the begin and the end of a function of a path, and of the middle.

        What `half` does must not matter once the function has done the whole.
        """
        function: Callable[..., object] = getattr(owner, name)

        def counted(path: object, *args: object, **kwargs: object) -> object:
            inside = not isinstance(path, str | Path) or Path(path).is_relative_to(self.folder)
            if inside:
                self.event()
                if half is not None:
                    half(path, *args)
                    self.event()
            result = function(path, *args, **kwargs)
            if inside:
                self.event()
            return result

        setattr(owner, name, counted)


def half_file(path: Path, data: str | bytes, *_: object) -> None:
    data = data.encode() if isinstance(data, str) else data
    with path.open("wb") as stream:
        stream.write(data[: len(data) // 2])


def half_folder(path: str | Path, *_: object) -> None:
    files = sorted(file for file in Path(path).rglob("*") if file.is_file())
    for file in files[: len(files) // 2]:
        file.unlink()


def half_lines(countdown: Countdown) -> None:
    """Let lines of a ledger be written in two parts, with an event between them."""

    def add_unit(folder: Path, unit: hipuq.store.ledger.Unit) -> None:
        line = b"\n" + unit.line().encode() + b"\n"
        with (folder / hipuq.store.ledger.LINES).open("ab", buffering=0) as stream:
            stream.write(line[: len(line) // 2])
            countdown.event()
            stream.write(line[len(line) // 2 :])

    hipuq.store.blocks.add_unit = add_unit
    countdown.around(hipuq.store.blocks, "add_unit")


def run(study: Study, out: Path, countdown: Countdown | None = None, *, resume: bool) -> None:
    if countdown is not None:
        half_lines(countdown)
        for name in ("save_results", "add_results"):
            countdown.around(sys.modules["hipuq.study.running"], name)
        countdown.around(zarr, "consolidate_metadata")
        countdown.around(os, "replace")
        countdown.around(Path, "rename")
        countdown.around(Path, "write_bytes", half_file)
        countdown.around(Path, "write_text", half_file)
        countdown.around(shutil, "rmtree", half_folder)
    run_study(study, out, resume=resume, progress=False, n_jobs=2)


def in_a_process(action: Callable[[], object]) -> int:
    """Return how a process that does something ended: 0, or the signal."""
    child = os.fork()
    if not child:
        code = 1
        try:
            action()
            code = 0
        except Exception as error:
            print(f"{type(error).__name__}: {error}", flush=True)
        finally:
            os._exit(code)
    return os.waitpid(child, 0)[1]


@dataclass
class Scenario:
    """A study; output that a run goes on from, if any; output of a run from the beginning, not cut off."""

    name: str
    study: Study
    begun: Path | None
    whole: Path

    def run(self, out: Path, countdown: Countdown) -> int:
        """Return how a run ended."""
        shutil.rmtree(out, ignore_errors=True)
        if self.begun is not None:
            shutil.copytree(self.begun, out)
        return in_a_process(lambda: run(self.study, out, countdown, resume=self.begun is not None))

    def events(self, out: Path) -> int:
        """Return the number of events of a run, whose output is left."""
        countdown = Countdown(out)
        assert self.run(out, countdown) == 0, f"{self.name} cannot be run"
        return countdown.seen.value

    def differs(self, out: Path, place: int, torn: bool) -> str:
        """Return in what a run that is killed at an event and resumed differs from one that was not."""
        killed = self.run(out, Countdown(out, place, torn))
        ended = in_a_process(lambda: run(self.study, out, resume=True))
        if killed != signal.SIGKILL or ended != 0:
            return f"ended with {killed}, {ended}"
        told = out.with_name("why")
        compared = in_a_process(lambda: told.write_text(differences(contents(self.whole), contents(out))))
        return told.read_text() if compared == 0 else "cannot be read"


def differences(one: dict[str, xr.Dataset], other: dict[str, xr.Dataset]) -> str:
    names = sorted(one.keys() | other.keys())
    return ", ".join(
        name for name in names if name not in one or name not in other or not one[name].identical(other[name])
    )


def contents(out: Path) -> dict[str, xr.Dataset]:
    """Return all that a run has written, without what differs from run to run."""
    found = {name: node.to_dataset(inherit=False) for name, node in hipuq.load_results(out).subtree_with_keys}
    for store in sorted((out / "outcomes").iterdir()):
        found[store.name] = hipuq.load_outcomes(store).load()
    for name, dataset in found.items():
        dataset = dataset.drop_vars("seconds", errors="ignore").copy()
        for key in ("history", "seconds"):
            dataset.attrs.pop(key, None)
        found[name] = dataset
    return found


def main(points: int, seed: int) -> int:
    draw = random.Random(seed)
    with tempfile.TemporaryDirectory() as name:
        top = Path(name)
        # What this loads no process of a run has to load again.
        flag = xr.Dataset({"flag": ("x", [True])}, attrs={"hipuq_version": hipuq.__version__})
        save_results(flag, top / "flag.nc")
        hipuq.load_results(top / "flag.nc")
        studies = []
        for text in (STUDY, LARGER):
            (top / "study.toml").write_text(text)
            studies.append(load_study(top))
        new = Scenario("new", studies[0], None, top / "small")
        more = Scenario("more samples", studies[1], new.whole, top / "large")
        events = {new.name: new.events(new.whole), more.name: more.events(top / "cut")}
        assert in_a_process(lambda: run(more.study, more.whole, resume=False)) == 0
        every = [(one, place + 1) for one in (new, more) for place in range(events[one.name])]
        chosen = sorted(draw.sample(range(len(every)), min(points, len(every))))
        wrong = 0
        for number, (one, place) in enumerate(every[k] for k in chosen):
            torn = bool(number % 2)
            why = one.differs(top / "cut", place, torn)
            wrong += bool(why)
            words = f"{one.name}, event {place} of {events[one.name]}{', torn' if torn else ''}"
            print(f"{words}: {why or 'the same'}", flush=True)
        print(f"{len(chosen) - wrong} of {len(chosen)} resumed runs ended as one that was not cut off")
        return int(wrong > 0)


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:]]
    sys.exit(main(*(given + [50, 0][len(given) :])))
