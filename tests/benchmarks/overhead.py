"""What a store and xarray cost beside the bare kernel, and what a second process gains.

    python tests/benchmarks/overhead.py [SAMPLES] [REPEATS]

The bare kernel is assembly and solution of the same samples from NumPy arrays, in the same blocks, on two
threads; nothing of it is kept. Against it stand `evaluate` into a store, with the samples given and with a
design by rows, all outcomes and two of them. Everything runs in turn, once for each repeat; what is printed
is the median of the ratios within a repeat, and all of them. The start of processes is counted in.
"""

from __future__ import annotations

import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import chaospy as cp
import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

import hipuq
from hipuq.cea import solve

THREADS = 2
KEPT = ["any_unstable", "margin"]


def problem(n: int) -> tuple[hipuq.models.CEAModel, object, xr.Dataset]:
    model = hipuq.models.ring("oberst2016")
    inputs = model.inputs(
        friction=cp.Uniform(0.0, 0.1),
        contact=hipuq.ContactPatterns(in_contact=(6, 7, 8, 9)),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
        contact_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"),
    )
    design = hipuq.lazy_design("monte_carlo", inputs, n, rng=1)
    return model, design, design.rows(0, n)


def bare_kernel(model: hipuq.models.CEAModel, samples: xr.Dataset) -> Callable[[], None]:
    values = {name: np.ascontiguousarray(own.values, np.float64) for name, own in samples.data_vars.items()}
    size = samples.sizes["sample"]

    def one(start: int) -> None:
        rows = slice(start, min(start + model.block, size))
        count = rows.stop - rows.start
        block = {
            name: values[name][rows]
            if name in values
            else np.broadcast_to(own.nominal, (count, *own.nominal.shape))
            for name, own in model.parameters.items()
        }
        solve(
            model.compact(block) or model.assemble(block),
            growth_threshold=model.growth_threshold,
            certify=model.certify,
        )

    def run() -> None:
        with threadpool_limits(1, "blas"), ThreadPoolExecutor(THREADS) as pool:
            list(pool.map(one, range(0, size, model.block)))

    return run


def main(n: int, repeats: int) -> None:
    model, design, samples = problem(n)
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "outcomes.zarr"

        def evaluation(given: object, **options: object) -> Callable[[], None]:
            def run() -> None:
                shutil.rmtree(store, ignore_errors=True)
                hipuq.evaluate(model, given, store=store, progress=False, **options)

            return run

        runs = {
            "bare kernel": bare_kernel(model, samples),
            "store, samples given": evaluation(samples, n_jobs=THREADS),
            "store, design by rows": evaluation(design, n_jobs=THREADS),
            "store, design by rows, two outcomes": evaluation(design, n_jobs=THREADS, keep=KEPT),
            "one process": evaluation(design, executor="processes", n_jobs=1, keep=KEPT),
            "two processes": evaluation(design, executor="processes", n_jobs=2, keep=KEPT),
        }
        seconds: dict[str, list[float]] = {name: [] for name in runs}
        for _ in range(repeats):
            for name, run in runs.items():
                began = time.perf_counter()
                run()
                seconds[name].append(time.perf_counter() - began)
    print(f"{n:,} samples, {THREADS} threads, hipuq {hipuq.__version__}")
    for name, own in seconds.items():
        ratios = [a / b for a, b in zip(own, seconds["bare kernel"], strict=True)]
        told = ", ".join(f"{ratio:.3f}" for ratio in ratios)
        print(
            f"{name}: {statistics.median(own):.1f} s, {statistics.median(ratios):.3f} of the kernel ({told})"
        )
    gains = [a / b for a, b in zip(seconds["one process"], seconds["two processes"], strict=True)]
    told = ", ".join(f"{gain:.2f}" for gain in gains)
    print(f"two processes are {statistics.median(gains):.2f} times as fast as one ({told})")


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:]]
    main(*(given + [1_000_000, 3][len(given) :]))
