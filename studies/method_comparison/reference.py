#!/usr/bin/env python
"""Make the known answers of the ring that methods are compared on: its probability and its Sobol indices.

python studies/method_comparison/reference.py [--out reference.nc] [--runs 128] [--points 65536] ...

Nine oscillators in contact, undamped; friction, stiffnesses and angles scattered, 39 numbers. There is no
closed form, so independent runs of scrambled Sobol points are pooled: each is unbiased, and how they
scatter tells the error of their mean. About 12 million evaluations, 10 minutes on two cores; give smaller
sizes to try it. The file that comes with the study is the one that the default sizes make.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import chaospy as cp
import numpy as np
import xarray as xr
from scipy.special import stdtrit

import hipuq
from hipuq import schema
from hipuq.estimation.results import ENDS
from hipuq.sampling import seed_of, spawn
from hipuq.store import save_results

PRESET = "oberst2016"
OF = "any_unstable"
SEED = 20160821
CONFIDENCE = 0.95

PROBABILITY, INDICES, CHECK = 0, 1, 2
"""First keys of the seeds of what is run."""


def inputs_of(model):
    """Return the inputs of the problem, the same as in study.toml."""
    return model.inputs(
        friction=cp.Uniform(0.0, 0.1),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
        contact_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"),
        spring_angle=hipuq.shift(cp.Uniform(-1.0, 1.0), each="spring"),
        contact_angle=hipuq.shift(cp.Uniform(-1.0, 1.0), each="oscillator"),
    )


def seed_for(*key):
    """Return the seed of one run."""
    return seed_of(np.random.SeedSequence(SEED, spawn_key=key))


def runs_of(model, inputs, method, n, first, runs, jobs, check=0, **options):
    """Yield results of independent runs, with how many verdicts exact arithmetic confirmed and denied."""
    exact = hipuq.models.ring(PRESET, certify="always")
    design = {key: options[key] for key in ("sampler", "replicates") if key in options}
    estimate = {key: options[key] for key in options if key not in design}
    started = time.perf_counter()
    for k in range(runs):
        samples = hipuq.design(method, inputs, n=n, rng=seed_for(first, k), **design)
        outcomes = hipuq.evaluate(model, samples, keep=[OF], n_jobs=jobs, progress=False)
        results = hipuq.estimate(method, outcomes, inputs, of=OF, **estimate)
        agree = differ = 0
        # As many of each run as make up the number wanted.
        count = (k + 1) * check // runs - k * check // runs
        if count:
            rows = np.sort(spawn(SEED, CHECK, k).choice(samples.sizes["sample"], count, replace=False))
            proved = hipuq.evaluate(exact, samples.isel(sample=rows), keep=[OF], n_jobs=jobs, progress=False)
            same = proved[OF].values == outcomes[OF].values[rows]
            agree, differ = int(same.sum()), int((~same).sum())
        passed = time.perf_counter() - started
        print(
            f"{method}, run {k + 1} of {runs}, {passed:.0f} s, {passed / (k + 1) * runs:.0f} s in all",
            flush=True,
        )
        yield results, agree, differ


def pooled(values):
    """Return mean over the first axis, its standard error and its t limits."""
    runs = len(values)
    mean, error = values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(runs)
    reach = stdtrit(runs - 1, 0.5 + CONFIDENCE / 2) * error
    return mean, error, mean - reach, mean + reach


def summed(found):
    """Return counts and seconds over all runs as variables."""
    variables = {
        name: ((), sum(int(one[name]) for one in found), dict(found[0][name].attrs))
        for name in ("evaluations", "undecided", "failed")
    }
    seconds = sum(float(one["seconds"]) for one in found)
    return variables | {"seconds": ((), seconds, dict(found[0]["seconds"].attrs))}


def dataset(found, names, action, runs, **attrs):
    """Return the pooled estimates of `names` with their standard errors, and where they come from."""
    data = summed(found)
    for name in names:
        like = found[0][name]
        mean, error, low, high = pooled(np.stack([one[name].values for one in found]))
        for (end, text), part in zip(ENDS.items(), (mean, low, high), strict=True):
            data[name + end] = (like.dims, part, like.attrs | {"long_name": like.attrs["long_name"] + text})
        label = "standard_error" if len(names) == 1 else f"{name}_standard_error"
        text = f"{like.attrs['long_name']}, standard error"
        data[label] = (like.dims, error, like.attrs | {"long_name": text})
    coords = {dim: found[0][dim] for dim in found[0][names[0]].dims}
    before = {key: value for key, value in found[0].attrs.items() if key != "history"}
    options = json.loads(before["options"])
    options["estimate"].pop("resampling_seed", None)  # each run has its own
    results = schema.stamp(
        xr.Dataset(data, coords).drop_attrs(deep=False),
        action,
        seed=SEED,
        options=options | {"reference": {"runs": runs}},
        like=before,
    )
    return results.assign_attrs(of=OF, confidence=CONFIDENCE, **attrs)


def told(results, names):
    """Print estimates with their limits and counts."""
    print(f"\n{results.attrs['method']}: {int(results['evaluations']):,} evaluations, ", end="")
    print(f"{int(results['undecided'])} undecided, {int(results['failed'])} failed")
    for name in names:
        for place in np.ndindex(results[name].shape):
            label = "".join(
                f" of {results[dim].values[i]}" for dim, i in zip(results[name].dims, place, strict=True)
            )
            error = results["standard_error" if len(names) == 1 else f"{name}_standard_error"].values[place]
            ends = [float(results[name + end].values[place]) for end in ENDS]
            print(
                f"{name}{label} = {ends[0]:.6f} ({ends[1]:.6f} to {ends[2]:.6f}), standard error {error:.1e}"
            )


def main():
    """Run, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("reference.nc"))
    parser.add_argument("--runs", type=int, default=128, help="runs of the probability")
    parser.add_argument("--points", type=int, default=2**16, help="Sobol points of each")
    parser.add_argument("--index-runs", type=int, default=16, help="runs of the indices")
    parser.add_argument(
        "--base-points", type=int, default=2**15, help="base points of each, 7 evaluations for one"
    )
    parser.add_argument(
        "--checked", type=int, default=20_000, help="verdicts proved again by exact arithmetic"
    )
    parser.add_argument("--jobs", type=int, default=None, help="threads, default all cores")
    chosen = parser.parse_args()
    model = hipuq.models.ring(PRESET, certify="auto")
    inputs = inputs_of(model)
    command = " ".join(["python studies/method_comparison/reference.py", *sys.argv[1:]])

    options = {"sampler": "sobol", "replicates": 1, "check": chosen.checked}
    parts = list(
        runs_of(model, inputs, "monte_carlo", chosen.points, PROBABILITY, chosen.runs, chosen.jobs, **options)
    )
    found, agree, differ = zip(*parts, strict=True)
    checks = {"checked": sum(agree) + sum(differ), "denied": sum(differ)}
    ring = dataset(found, ["probability"], command, chosen.runs, **checks)
    told(ring, ["probability"])
    print(
        f"proved again by exact arithmetic: {checks['checked']:,} verdicts, {checks['denied']} of them denied"
    )
    p, error = float(ring["probability"]), float(ring["standard_error"])
    spread = error * np.sqrt(chosen.runs)
    random = np.sqrt(p * (1 - p) / chosen.points)
    print(f"error of a run of {chosen.points:,} points (root mean square): ", end="")
    print(f"{spread:.1e} scrambled Sobol, {random:.1e} random")
    for count in (64, 256, 1024, 4096, 16384):
        whole = np.sqrt(p * (1 - p) / count)
        times = f"{whole / error:.0f} times that of the reference"
        print(f"error of {count:,} random evaluations: {whole:.5f}, {times}")

    parts = list(
        runs_of(
            model, inputs, "sobol", chosen.base_points, INDICES, chosen.index_runs, chosen.jobs, resamples=2
        )
    )
    found = [one for one, _, _ in parts]
    indices = dataset(found, ["S1", "ST"], command, chosen.index_runs)
    told(indices, ["S1", "ST"])

    tree = xr.DataTree.from_dict({f"ring/{OF}": ring, f"ring_indices/{OF}": indices})
    tree.attrs = schema.stamp(xr.Dataset(), command, model=model.label, seed=SEED).attrs
    save_results(tree, chosen.out)
    print(f"\n{chosen.out}: {chosen.out.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
