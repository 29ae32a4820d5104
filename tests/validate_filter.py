#!/usr/bin/env python
"""Validate the error bounds of the eigenvalue kernel against exact arithmetic, at scale.

Draws ring matrices of both presets in three equal parts (nominal: all patterns of 6 to 9 contacts and
friction uniform on 0 to 0.1; scatter: the same with stiffness and angles scattered by 0.01 to 10 %;
near an onset: friction within 15 % of a certified first onset, half of them scattered by 0.001 to 1 %),
judges each by an exact characteristic polynomial, and prints how often plain eigenvalues and the
kernel are right. The constants in ``hipuq/cea/bounds.py`` rest on this table.

    python tests/validate_filter.py --samples 20000 --seed 1
"""

import argparse
import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

import oracle
import published

import hipuq
from hipuq.cea import Pencils, solve
from hipuq.cea.bounds import ZERO, norms
from hipuq.cea.undamped import _judge
from hipuq.models.oscillator_ring import FILTER

PARTS = ("nominal", "scatter", "near onset")
CHUNK = 250


def draw(part: str, preset: str, size: int, rng: np.random.Generator) -> Pencils:
    """Return ring pencils of one part of the mix."""
    model = hipuq.models.ring(preset)
    if part == "near onset":
        missing = rng.integers(0, 10, size)  # 0: none is missing
        contact = np.arange(1, 10) != missing[:, None]
        onsets = np.full(10, published.ONSETS[preset][0])
        if preset == "oberst2016":
            onsets[1:] = list(published.FIRST_ONSET_WITHOUT.values())
        friction = onsets[missing] * rng.uniform(0.85, 1.15, size)
        level = np.where(rng.random(size) < 0.5, 0.0, 10.0 ** rng.uniform(-5, -2, size))
    else:
        patterns = hipuq.ContactPatterns((6, 7, 8, 9))
        contact = patterns.patterns(patterns.ppf(rng.random(size)))
        friction = rng.uniform(0.0, 0.1, size)
        level = np.zeros(size) if part == "nominal" else 10.0 ** rng.uniform(-4, -1, size)

    def scattered(name: str) -> np.ndarray:
        value = model.parameters[name].nominal
        change = level[:, None] * rng.uniform(-1, 1, (size, len(value)))
        return value + 10 * change if name.endswith("angle") else value * (1 + change)

    names = ("spring_stiffness", "contact_stiffness", "contact_angle")
    values = {name: scattered(name) for name in names}
    return model.pencils(model.nominal(friction=friction, contact=contact, **values))


def judge(task: tuple[str, str, int, np.random.SeedSequence]) -> np.ndarray:
    """Return one row for each sample: exact, plain, cleared, verdict, growth of plain, as floats."""
    part, preset, size, seed = task
    pencils = draw(part, preset, size, np.random.default_rng(seed))
    matrices, _ = pencils.reduced()
    exact = [oracle.exact_unstable(matrix) for matrix in matrices]
    plain = [oracle.lapack_unstable(matrix) for matrix in matrices]
    norm = norms(matrices)[:, None]
    values = np.linalg.eigvals(matrices).astype(complex)
    radius = np.broadcast_to(FILTER * norm, values.shape)
    _, known = _judge(values, radius, ZERO * norm, pencils.mechanisms, 0.0)
    cleared = known.all(axis=1)
    verdict = solve(pencils).any_unstable
    largest = np.abs(values.imag).max(axis=1) / norm[:, 0]
    return np.stack([exact, plain, cleared, verdict, largest], axis=1).astype(float)


def row(label: str, data: np.ndarray) -> str:
    """Return one line of the table."""
    exact, plain, cleared, verdict, largest = data.T
    wrong = plain != exact
    known = ~np.isnan(verdict)
    cells = [
        f"{len(data):8d}",
        f"{int(wrong.sum()):8d}",
        f"{int((wrong & (cleared == 1)).sum()):8d}",
        f"{int((known & (verdict != exact)).sum()):8d}",
        f"{np.mean(cleared == 0):8.2%}",
        f"{np.mean(~known):9.2%}",
        f"{largest[wrong].max(initial=0.0):12.2e}",
    ]
    return f"{label:34s}" + " ".join(cells)


def main() -> int:
    """Run the validation; the exit status is 1 if a verdict that was given as known is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    cells = [(part, preset) for part in PARTS for preset in published.ONSETS]
    chunks = max(1, round(options.samples / len(cells) / CHUNK))
    size = -(-options.samples // (len(cells) * chunks))
    seeds = np.random.SeedSequence(options.seed).spawn(len(cells) * chunks)
    tasks = [(*cells[i % len(cells)], size, seed) for i, seed in enumerate(seeds)]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(options.jobs, mp_context=context) as pool:
        results = list(pool.map(judge, tasks))
    print(f"{'':34s} samples    plain  outside    after  flagged undecided  largest |Im w|")
    print(f"{'':34s}            wrong   filter   bounds                    / norm, wrong")
    for i, cell in enumerate(cells):
        print(row(" ".join(cell), np.concatenate(results[i :: len(cells)])))
    whole = np.concatenate(results)
    print(row("all", whole))
    exact, _, _, verdict, _ = whole.T
    return int((~np.isnan(verdict) & (verdict != exact)).any())


if __name__ == "__main__":
    raise SystemExit(main())
