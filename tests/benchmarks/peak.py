"""Print the peak memory of an evaluation [MiB], above what was there with the samples made (Linux only).

python tests/benchmarks/peak.py hipuq|numpy SAMPLES
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy_user
import problems

import hipuq


def resident(name: str) -> float:
    """Return a line of the status of this process, such as its largest resident memory [MiB]."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith(f"{name}:"))


def main(whose: str, n: int) -> None:
    """Evaluate and print."""
    model = problems.ring()
    dataset, arrays = problems.scattered(model, n)
    # What is loaded on first use is not part of it.
    few, fewer = problems.scattered(model, 8)
    hipuq.evaluate(model, few, n_jobs=2, progress=False)
    numpy_user.evaluate(fewer)
    # The peak starts again from what there is now.
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    before = resident("VmRSS")
    if whose == "hipuq":
        found: object = hipuq.evaluate(model, dataset, keep=["any_unstable"], n_jobs=2, progress=False)
    else:
        found = numpy_user.evaluate(arrays, everything=False)
    print(resident("VmHWM") - before)
    del found


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
