"""Kill a small study at seeded points, resume it, and compare with a run that was not cut off.

    python tests/benchmarks/kill_points.py [POINTS] [SEED]

A point is an event of writing: before an array of a unit is written, after it, in the middle of a line of a
ledger, between units, while metadata are written, between analyses, while results are written. The process
ends there by SIGKILL; at every second point the file written last is cut in half first, as by a power cut.
Runs and resumed runs are processes of their own. The exit code is 1 if any end differs.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import xarray as xr
import zarr

import hipuq
import hipuq.store.blocks
import hipuq.store.ledger
import hipuq.store.results
from hipuq.study import load_study, run_study

STUDY = """
title = "Killed"
seed = 3

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
n = 5000
of = ["any_unstable", "margin"]

[[analysis]]
name = "causes"
method = "sobol"
n = 1024
of = "margin"
options = { resamples = 20 }
"""


class Countdown:
    """Events until the process ends itself; without a number they are counted."""

    def __init__(self, left: int | None, torn: bool, folder: Path) -> None:
        self.left, self.torn, self.folder, self.seen = left, torn, folder, 0

    def event(self) -> None:
        self.seen += 1
        if self.seen != self.left:
            return
        files = [path for path in self.folder.rglob("*") if path.is_file()]
        if self.torn and files:
            last = max(files, key=lambda path: path.stat().st_mtime_ns)
            os.truncate(last, last.stat().st_size // 2)
        os.kill(os.getpid(), signal.SIGKILL)

    def around(self, owner: object, name: str) -> None:
        """Make events of the begin and the end of a function."""
        function: Callable[..., object] = getattr(owner, name)

        def counted(*args: object, **kwargs: object) -> object:
            self.event()
            result = function(*args, **kwargs)
            self.event()
            return result

        setattr(owner, name, counted)


def half_lines(countdown: Countdown) -> None:
    """Let lines of the ledger be written in two parts, with an event between them."""

    def add_unit(folder: Path, unit: hipuq.store.ledger.Unit) -> None:
        line = b"\n" + unit.line().encode() + b"\n"
        with (folder / hipuq.store.ledger.LINES).open("ab", buffering=0) as stream:
            stream.write(line[: len(line) // 2])
            countdown.event()
            stream.write(line[len(line) // 2 :])

    hipuq.store.blocks.add_unit = add_unit


def run(study: Path, out: Path, countdown: Countdown, *, resume: bool) -> None:
    half_lines(countdown)
    countdown.around(zarr.Array, "__setitem__")
    countdown.around(zarr, "consolidate_metadata")
    countdown.around(hipuq.store.blocks, "files_of")
    for name in ("save_results", "add_results"):
        countdown.around(sys.modules["hipuq.study.running"], name)
    run_study(load_study(study), out, resume=resume, progress=False, n_jobs=2)


def in_a_process(action: Callable[[], None]) -> int:
    """Return how a process that does something ended: 0, or the number of a signal."""
    child = os.fork()
    if not child:
        code = 1
        try:
            action()
            code = 0
        finally:
            os._exit(code)
    return os.waitpid(child, 0)[1]


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
        study = top / "killed" / "study.toml"
        study.parent.mkdir()
        study.write_text(STUDY)
        told = top / "events"

        def counted() -> None:
            countdown = Countdown(None, False, top / "whole")
            run(study, top / "whole", countdown, resume=False)
            told.write_text(str(countdown.seen))

        assert in_a_process(counted) == 0
        events, wrong = int(told.read_text()), 0
        places = sorted(draw.sample(range(1, events + 1), min(points, events)))
        for number, place in enumerate(places):
            out, torn = top / "cut", bool(number % 2)
            shutil.rmtree(out, ignore_errors=True)
            killed = in_a_process(
                lambda out=out, place=place, torn=torn: run(
                    study, out, Countdown(place, torn, out), resume=False
                )
            )
            ended = in_a_process(lambda out=out: run(study, out, Countdown(None, False, out), resume=True))
            why = "" if killed == signal.SIGKILL and ended == 0 else f"ended with {killed}, {ended}; "
            if not why:
                why = in_another(top / "whole", out, top / "why")
            wrong += bool(why)
            print(f"event {place} of {events}{', torn' if torn else ''}: {why or 'the same'}", flush=True)
        print(f"{len(places) - wrong} of {len(places)} resumed runs ended as one that was not cut off")
        return int(wrong > 0)


def in_another(whole: Path, cut: Path, told: Path) -> str:
    """Compare two outputs in a process of its own; return in what they differ."""

    def compared() -> None:
        one, other = contents(whole), contents(cut)
        differ = [name for name in one if name not in other or not one[name].identical(other[name])]
        told.write_text(", ".join(differ) + ("" if one.keys() == other.keys() else " names differ"))

    return told.read_text() if in_a_process(compared) == 0 else "cannot be read"


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:]]
    sys.exit(main(*(given + [50, 0][len(given) :])))
