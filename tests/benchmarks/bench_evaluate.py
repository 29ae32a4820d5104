"""Evaluation of samples and the study of all contact patterns, on two threads, and the memory they take."""

import subprocess
import sys
from pathlib import Path

import chaospy as cp
import numpy as np
import numpy_user
import problems
import pytest

import hipuq

THREADS = 2
DRAWS = 1000
"""Draws of friction for each pattern in the study of Oberst et al. (2016)."""

LOOPED = 0.05
"""Share of the draws that the plain loop does."""


def same_verdicts(found, expected):
    """Check that few verdicts differ: tolerances are wrong near an onset."""
    differ = found["any_unstable"].values != expected["any_unstable"]
    assert differ.sum() <= max(5, 1e-4 * differ.size), f"{differ.sum()} of {differ.size} verdicts differ"


def same_modes(found, expected):
    """Check verdicts and, where they agree, frequencies."""
    same_verdicts(found, expected)
    same = found["any_unstable"].values == expected["any_unstable"]
    off = np.abs(found["frequency"].values - expected["frequency"])[same]
    assert np.quantile(off, 0.999) < 1e-6 * expected["frequency"].max()


@pytest.mark.parametrize("keep", [None, ["any_unstable"]], ids=["all outcomes", "any_unstable"])
def bench_evaluate(against, samples, keep):
    model = problems.ring()
    dataset, arrays = problems.scattered(model, samples)
    against(
        f"evaluate, ring of 39 inputs, {'all outcomes' if keep is None else 'any_unstable alone'}",
        lambda: hipuq.evaluate(model, dataset, keep=keep, n_jobs=THREADS, progress=False),
        lambda: numpy_user.evaluate(arrays, everything=keep is None, threads=THREADS),
        against="NumPy in blocks, two threads",
        unit="sample",
        units=samples,
        check=same_modes if keep is None else same_verdicts,
    )


def bench_evaluate_damped(against, samples):
    model, n = problems.ring(damping_ratio=0.01), samples // 10
    dataset, arrays = problems.scattered(model, n)
    against(
        "evaluate, the same with 1 % modal damping, all outcomes",
        lambda: hipuq.evaluate(model, dataset, n_jobs=THREADS, progress=False),
        lambda: numpy_user.evaluate(arrays, damping_ratio=0.01, threads=THREADS),
        against="NumPy in blocks, two threads",
        unit="sample",
        units=n,
        check=same_modes,
    )


def patterns():
    return hipuq.ContactPatterns(in_contact=(6, 7, 8, 9)).samples()


def same_probability(found, expected):
    """Check the mean over the patterns; the loop is a twentieth of a study, and its tolerance errs."""
    assert abs(found.mean() - expected.mean()) < 0.03


def bench_study_exact(against):
    model = hipuq.integrate_friction(problems.ring(), cp.Uniform(0.0, 0.1))
    contact = patterns()
    against(
        "130 contact patterns, friction integrated exactly",
        lambda: hipuq.evaluate(model, contact, n_jobs=THREADS, progress=False)["probability"].values,
        lambda: numpy_user.seed_study(contact["contact"].values, int(DRAWS * LOOPED), 1),
        against=f"plain loop, {DRAWS} draws each, extrapolated from {LOOPED:.0%}",
        part=LOOPED,
        check=same_probability,
    )


def bench_study_sampled(against):
    model = problems.ring()
    inputs = model.inputs(
        friction=cp.Uniform(0.0, 0.1), contact=hipuq.ContactPatterns(in_contact=(6, 7, 8, 9))
    )
    dataset = hipuq.design("monte_carlo", inputs, n=DRAWS, rng=1, stratify="contact")
    contact = patterns()["contact"].values
    against(
        f"130 contact patterns, {DRAWS} draws of friction each",
        lambda: hipuq.evaluate(model, dataset, n_jobs=THREADS, progress=False)["any_unstable"].values,
        lambda: numpy_user.seed_study(contact, int(DRAWS * LOOPED), 1),
        against=f"plain loop, one thread, extrapolated from {LOOPED:.0%}",
        part=LOOPED,
        check=same_probability,
    )


def bench_memory(benchmark, samples, peaks):
    """Peak of a process of its own each."""

    def peak(whose):
        script = Path(__file__).parent / "peak.py"
        done = subprocess.run(
            [sys.executable, script, whose, str(samples)], capture_output=True, text=True, check=True
        )
        return float(done.stdout)

    both = [peak("numpy"), benchmark.pedantic(peak, ("hipuq",))]
    benchmark.extra_info["peak_MiB"] = {"numpy": both[0], "hipuq": both[1]}
    peaks.append(("evaluate, ring of 39 inputs, any_unstable alone", samples, both[1], both[0]))
