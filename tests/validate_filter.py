#!/usr/bin/env python
"""Validate what the eigenvalue kernel claims against exact arithmetic, at scale.

Draws ring matrices of both presets in parts: nominal with all patterns of 6 to 9 contacts and
friction uniform on 0 to 0.1; the same with stiffness and angles scattered; friction within 10 % of a
certified first onset, half of them scattered; rings of other sizes; damped rings and growth
thresholds. Judges each by the certificate, every 20th also by an independent exact characteristic
polynomial with isolated roots, and prints how often plain eigenvalues and each path of the kernel
are right. The constants in ``hipuq/cea`` rest on this table.

    python tests/validate_filter.py --samples 100000 --seed 1

Columns: wrong verdicts of plain eigenvalues; of those outside the filter radius; of the kernel
without the structured solver and the certificate, after bounds ("never"); of the structured solver;
of the whole ("auto"). Shares undecided by "never" and "auto". Largest |Im w| / norm (damped, or with
a threshold: distance from the threshold / norm) of a wrong plain verdict. Largest error of the
structured solver over eps * structured condition number.
"""

import argparse
import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import flint
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

import oracle
import published

import hipuq
from hipuq.cea import Pencils, solve
from hipuq.cea.bounds import STRUCTURED, ZERO, norms
from hipuq.cea.damped import _without_mechanisms
from hipuq.cea.eigenvalues import eigenvalues
from hipuq.cea.structured import SAFETY, structured_eigenvalues
from hipuq.cea.undamped import judge as judge_roots


@dataclass(frozen=True)
class Part:
    """A part of the mix: scatter (relative, or the decades it is drawn from) and what is special."""

    share: float
    scatter: float | tuple[float, float] = 0.0
    near_onset: bool = False
    oscillators: int = 9
    damped: bool = False
    threshold: float = 0.0


PARTS = {
    "nominal, 130 patterns": Part(16),
    "scatter 0.001 %": Part(12, 1e-5),
    "scatter 0.1 %": Part(8, 1e-3),
    "scatter 10 %": Part(8, 1e-1),
    "near onset": Part(30, (-5, -2), near_onset=True),
    "5 oscillators": Part(6, (-6, -2), oscillators=5),
    "15 oscillators": Part(4, (-6, -2), oscillators=15),
    "20 oscillators": Part(2, (-6, -2), oscillators=20),
    "damped": Part(4, (-6, -2), damped=True),
    "damped, threshold 50 / s": Part(4, (-6, -2), damped=True, threshold=50.0),
    "threshold 5 / s": Part(6, (-6, -2), threshold=5.0),
}
CHUNK = 200
EVERY = 20
"""One sample in so many is judged by the independent oracle too."""

COLUMNS = ("exact", "plain", "cleared", "never", "auto", "path", "distance", "error", "oracle", "counts")


def draw(part: Part, preset: str, size: int, rng: np.random.Generator) -> Pencils:
    """Return ring pencils of one part of the mix."""
    n = part.oscillators
    model = hipuq.models.ring(preset, oscillators=n)
    if part.near_onset:
        missing = rng.integers(0, 10, size)  # 0: none is missing
        contact = np.arange(1, 10) != missing[:, None]
        onsets = np.full(10, published.ONSETS[preset][0])
        if preset == "oberst2016":
            onsets[1:] = list(published.FIRST_ONSET_WITHOUT.values())
        friction = onsets[missing] * rng.uniform(0.9, 1.1, size)
    else:
        patterns = hipuq.ContactPatterns((n - 3, n - 2, n - 1, n) if n != 9 else (6, 7, 8, 9), oscillators=n)
        contact = patterns.patterns(patterns.ppf(rng.random(size)))
        # Onsets of other rings lie anywhere, the more oscillators the lower.
        friction = rng.uniform(0.0, 0.1, size) if n == 9 else 10.0 ** rng.uniform(-5, -1, size)
    if isinstance(part.scatter, tuple):
        level = np.where(rng.random(size) < 0.5, 0.0, 10.0 ** rng.uniform(*part.scatter, size))
    else:
        level = np.full(size, part.scatter)

    def scattered(name: str) -> np.ndarray:
        value = model.parameters[name].nominal
        change = level[:, None] * rng.uniform(-1, 1, (size, len(value)))
        return value + 10 * change if name.endswith("angle") else value * (1 + change)

    names = ("spring_stiffness", "contact_stiffness", "contact_angle")
    values = {name: scattered(name) for name in names}
    if part.damped:
        values["damping_ratio"] = 10.0 ** rng.uniform(-4, np.log10(2e-2), size)
    return model.pencils(model.nominal(friction=friction, contact=contact, **values))


def exact_growing(stiffness: np.ndarray, damping: np.ndarray, threshold: float) -> int:
    """Return how many roots l of ``l**2 + l D + A`` have a real part above the threshold, exactly.

    Roots near zero are mechanisms, and no root may lie on the border.
    """
    n = len(stiffness)
    rate = 2.0 ** round(np.log2(np.sqrt(np.linalg.norm(stiffness))))

    def whole(value: float) -> flint.fmpq:
        return flint.fmpq(*float(value).as_integer_ratio())

    companion = flint.fmpq_mat(2 * n, 2 * n)
    for i in range(n):
        companion[i, n + i] = 1
        for j in range(n):
            companion[n + i, j] = whole(-stiffness[i, j] / rate**2)
            companion[n + i, n + j] = whole(-damping[i, j] / rate)
    shift = threshold / rate
    for i in range(2 * n):
        companion[i, i] -= whole(shift)
    growing = 0
    for root, times in companion.charpoly().numer().complex_roots():
        if abs(complex(root) + shift) > 1e-6:
            if not (root.real > 0 or root.real < 0):
                raise ArithmeticError(f"the root {root} lies on the border")
            growing += times * bool(root.real > 0)
    return growing


def plain_verdicts(pencils: Pencils, threshold: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what the eigenvalues say, whether the filter clears it, and how far it is from changing."""
    matrices, damping = pencils.reduced()
    mechanisms = pencils.mechanisms
    s = len(matrices)
    verdict, cleared, distance = np.empty(s, bool), np.empty(s, bool), np.empty(s)
    if damping is None:
        norm = norms(matrices)[:, None]
        values = eigenvalues(matrices)
        radius = np.broadcast_to((pencils.filter_radius or np.inf) * norm, values.shape)
        rigid, known = judge_roots(values, radius, ZERO * norm, mechanisms, threshold)
        growth = np.where(rigid, 0.0, np.abs(np.sqrt(-values).real)).max(axis=1)
        verdict = growth > threshold
        if threshold == 0:
            distance = np.abs(values.imag).max(axis=1, where=~rigid, initial=0.0) / norm[:, 0]
        else:
            distance = np.abs(growth - threshold) / np.sqrt(norm[:, 0])
        return verdict, known.all(axis=1), distance
    for m in np.unique(mechanisms):
        rows = np.flatnonzero(mechanisms == m)
        part, drag, _ = _without_mechanisms(matrices[rows], damping[rows], int(m))
        n = part.shape[1]
        rate = np.sqrt(norms(part))[:, None]
        states = np.zeros((len(rows), 2 * n, 2 * n))
        states[:, :n, n:] = np.eye(n)
        states[:, n:, :n] = -part / np.square(rate)[:, :, None]
        states[:, n:, n:] = -drag / rate[:, :, None]
        above = eigenvalues(states).real - threshold / rate
        norm = norms(states)
        verdict[rows] = (above > 0).any(axis=1)
        cleared[rows] = (np.abs(above) > (pencils.filter_radius or np.inf) * norm[:, None]).all(axis=1)
        distance[rows] = np.abs(above.max(axis=1)) / norm
    return verdict, cleared, distance


def structured_error(matrix: np.ndarray) -> float:
    """Return the largest error of the structured solver over eps * structured condition number."""
    exact = np.array([complex(ball) for ball, _ in oracle.exact_roots(matrix)])
    start = eigenvalues(matrix[None])[0]
    values, radius = structured_eigenvalues(matrix[None], start[None], 2)
    elastic = np.abs(values[0]) > oracle.RIGID * np.abs(exact).max()
    error = np.abs(values[0][:, None] - exact).min(axis=1)
    return float((error / (radius[0] / SAFETY))[elastic].max())


def judge(task: tuple[str, str, int, np.random.SeedSequence]) -> np.ndarray:
    """Return one row for each sample, with the entries of `COLUMNS`."""
    name, preset, size, seed = task
    part = PARTS[name]
    pencils = draw(part, preset, size, np.random.default_rng(seed))
    matrices, damping = pencils.reduced()
    spectra = {
        certify: solve(pencils, growth_threshold=part.threshold, certify=certify)
        for certify in ("never", "auto", "always")
    }
    proved = spectra["always"]
    plain, cleared, distance = plain_verdicts(pencils, part.threshold)
    error = np.zeros(size)
    agrees = np.full(size, np.nan)
    for i in range(0, size, EVERY):
        if part.threshold == 0 and not part.damped:
            flutter, divergence = oracle.exact_counts(matrices[i])
            count = flutter // 2 + divergence
            error[i] = structured_error(matrices[i])
        else:
            drag = np.zeros_like(matrices[i]) if damping is None else damping[i]
            growing = exact_growing(matrices[i], drag, part.threshold)
            # A growing complex pair l is one mode; without divergence all growing ones are such.
            count = growing // 2
        if not np.isnan(proved.any_unstable[i]):
            agrees[i] = proved.unstable_count[i] == count
    counts = np.zeros(size)
    for certify in ("never", "auto"):
        both = ~np.isnan(spectra[certify].unstable_count) & ~np.isnan(proved.unstable_count)
        counts += both & (spectra[certify].unstable_count != proved.unstable_count)
    never, auto = spectra["never"], spectra["auto"]
    return np.stack(
        [
            proved.any_unstable,
            plain,
            cleared,
            never.any_unstable,
            auto.any_unstable,
            auto.decided_by,
            distance,
            error,
            agrees,
            counts,
        ],
        axis=1,
    ).astype(float)


def faults(data: np.ndarray) -> dict[str, int]:
    """Return how many verdicts that were given as known are wrong, by path."""
    exact, plain, cleared, never, auto, path, _, error, agrees, counts = data.T
    known = ~np.isnan(exact)
    wrong = {
        "filter": known & (plain != exact) & (cleared == 1),
        "never": known & ~np.isnan(never) & (never != exact),
        "structured": known & (path == STRUCTURED) & (auto != exact),
        "auto": known & ~np.isnan(auto) & (auto != exact),
        "count": counts > 0,
        "oracle": agrees == 0,
        "bound": error > SAFETY,
    }
    return {name: int(which.sum()) for name, which in wrong.items()}


def row(label: str, data: np.ndarray) -> str:
    """Return one line of the table."""
    exact, plain, _, never, auto, path, distance, error, agrees, _ = data.T
    wrong = ~np.isnan(exact) & (plain != exact)
    bad = faults(data)
    cells = [
        f"{len(data):7d}",
        f"{int(wrong.sum()):7d}",
        *(f"{bad[name]:7d}" for name in ("filter", "never", "structured", "auto", "count")),
        f"{np.isnan(never).mean():8.3%}",
        f"{np.isnan(auto).mean():8.3%}",
        f"{(path == STRUCTURED).mean():8.3%}",
        f"{distance[wrong].max(initial=0.0):9.1e}",
        f"{error.max():9.3f}",
        f"{int((~np.isnan(agrees)).sum()):6d}",
        f"{bad['oracle']:6d}",
    ]
    return f"{label:46s}" + " ".join(cells)


def main() -> int:
    """Run the validation; the exit status is 1 if anything that was given as known is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1))
    options = parser.parse_args()
    whole = sum(part.share for part in PARTS.values())
    tasks = []
    for name, part in PARTS.items():
        for preset in published.ONSETS:
            size = max(1, round(options.samples * part.share / whole / len(published.ONSETS)))
            tasks += [(name, preset, min(CHUNK, size - i)) for i in range(0, size, CHUNK)]
    seeds = np.random.SeedSequence(options.seed).spawn(len(tasks))
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(options.jobs, mp_context=context) as pool:
        results = list(pool.map(judge, [(*task, seed) for task, seed in zip(tasks, seeds, strict=True)]))
    print(f"{'':46s}samples   plain  filter   never struct.    auto  counts", end=" ")
    print("undecided undec.  decided   largest structured oracle oracle")
    print(f"{'':46s}          wrong   wrong   wrong   wrong   wrong   wrong", end=" ")
    print("   never    auto  struct.  distance error/cond checks  wrong")
    for name in PARTS:
        for preset in published.ONSETS:
            own = [data for task, data in zip(tasks, results, strict=True) if task[:2] == (name, preset)]
            print(row(f"{name}, {preset}", np.concatenate(own)))
    everything = np.concatenate(results)
    print(row("all", everything))
    print(f"not decided by the certificate: {int(np.isnan(everything[:, 0]).sum())}")
    return int(any(faults(everything).values()))


if __name__ == "__main__":
    raise SystemExit(main())
