"""Peak memory and time of an evaluation into a store and of the estimates on it.

    python tests/benchmarks/memory.py 10000000 [--store FOLDER] [--executor processes] [--jobs 2]

Samples of the ring of oberst2016 with uncertain friction, contact and stiffness; `any_unstable` and `margin`
are kept. Evaluation and estimates run in a process of their own each, so that neither hides the peak of the
other. Memory is the resident peak of that process and of the largest one that it started (Linux only).
"""

import argparse
import contextlib
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import chaospy as cp

import hipuq
from hipuq.occurring import verdict_counts

OUTCOMES = ("any_unstable", "margin")
STAGES = ("evaluate", "estimate")


def inputs_of(model) -> hipuq.Inputs:
    """Return the inputs of the benchmark: 21 numbers and the contact pattern."""
    return model.inputs(
        friction=cp.Uniform(0.0, 0.1),
        contact=hipuq.ContactPatterns(in_contact=(6, 7, 8, 9)),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
        contact_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"),
    )


def evaluate(n: int, store: Path, executor: str | None, jobs: int | None) -> None:
    model = hipuq.models.ring("oberst2016")
    design = hipuq.lazy_design("monte_carlo", inputs_of(model), n, rng=1)
    hipuq.evaluate(model, design, keep=OUTCOMES, store=store, executor=executor, n_jobs=jobs, progress=False)


def estimate(store: Path) -> None:
    inputs = inputs_of(hipuq.models.ring("oberst2016"))
    outcomes = hipuq.load_outcomes(store)
    counts = verdict_counts(outcomes)
    print(", ".join(f"{int(counts['samples'].sel(status=name))} {name}" for name in counts["status"].values))
    for of in OUTCOMES:
        results = hipuq.estimate("monte_carlo", outcomes, inputs, of=of)
        name = "probability" if "probability" in results else "mean"
        low, value, high = (float(results[f"{name}{end}"]) for end in ("_low", "", "_high"))
        print(f"{name} of {of}: {value:.6g} ({low:.6g} to {high:.6g})")


def peaks(root: int) -> dict[int, float]:
    """Return the peak memory so far of a process and of all that come from it, [MiB] by number."""
    parents, found = {}, {}
    for path in Path("/proc").glob("[0-9]*/status"):
        with contextlib.suppress(OSError):
            lines = dict(line.split(":", 1) for line in path.read_text().splitlines())
            # One that has ended has no memory.
            if "VmHWM" in lines:
                number = int(lines["Pid"])
                parents[number], found[number] = int(lines["PPid"]), int(lines["VmHWM"].split()[0]) / 1024
    family = {root}
    while more := {number for number, parent in parents.items() if parent in family} - family:
        family |= more
    return {number: found[number] for number in family if number in found}


def watched(command: list[str]) -> tuple[float, float]:
    """Run a command; return its peak memory and that of the largest process it started [MiB]."""
    largest: dict[int, float] = {}
    with subprocess.Popen(command) as process:
        while process.poll() is None:
            largest |= peaks(process.pid)
            time.sleep(0.05)
        if process.returncode:
            sys.exit(process.returncode)
    own = largest.pop(process.pid)
    return own, max(largest.values(), default=0.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("n", type=int, help="number of samples")
    parser.add_argument("--store", type=Path, help="folder to keep the store in; else a temporary one")
    parser.add_argument("--executor", help="threads or processes")
    parser.add_argument("--jobs", type=int, help="number of threads or processes")
    parser.add_argument("--stage", choices=STAGES, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.stage:
        start = time.perf_counter()
        if args.stage == "evaluate":
            evaluate(args.n, args.store, args.executor, args.jobs)
        else:
            estimate(args.store)
        seconds = time.perf_counter() - start
        print(f"{args.stage}: {seconds:.1f} s, {1e6 * seconds / args.n:.2f} us a sample", flush=True)
        return
    print(f"{args.n} samples, hipuq {hipuq.__version__}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        store = args.store or Path(folder) / "outcomes.zarr"
        given = [sys.executable, __file__, *sys.argv[1:], "--store", str(store), "--stage"]
        for stage in STAGES:
            own, child = watched([*given, stage])
            print(f"{stage}: peak {own:.0f} MiB, largest process started {child:.0f} MiB", flush=True)
        size = sum(path.stat().st_size for path in store.rglob("*") if path.is_file())
        print(f"store: {size / 2**20:.1f} MiB, {size / args.n:.1f} bytes a sample")


# The workers of a process pool import this file again.
if __name__ == "__main__":
    main()
