#!/usr/bin/env python
"""Make the figures and print the tables of docs/theory/false-flutter.md.

python docs/scripts/false_flutter.py

It takes about 90 seconds. Numbers that come from plain eigenvalues are rounding errors made visible:
another LAPACK gives others of the same size. Verdicts of hipuq should not change.
"""

import sys
import time
from pathlib import Path

import chaospy as cp
import numpy as np
from matplotlib.figure import Figure

import hipuq
from hipuq.plots.style import BLUE, BORDER, GREEN, ORANGE, VERMILLION

FIGURES = Path(__file__).parents[1] / "figures"
PRESETS = ("oberst2016", "oberst2016-calibrated")
COUNTS = (6, 7, 8, 9)
POINTS = 2000
"""Friction coefficients for each pattern: midpoints of equal parts of 0 to 0.1."""

EXAMPLE = {"contact_stiffness": 1.05e9 / 0.2283}
"""Contact stiffness of the example of one point, friction 0.0525 [N/m]."""

FRICTION = cp.Uniform(0.0, 0.1)

RULES = {
    "Re λ > 0": lambda w: (np.sqrt(-w).real > 0).any(axis=1),
    "Im w > 1e-6 abs(w)": lambda w: (w.imag > 1e-6 * np.abs(w)).any(axis=1),
    "Im w > 1e-5 max abs(w)": lambda w: (w.imag > 1e-5 * np.abs(w).max(axis=1, keepdims=True)).any(axis=1),
}
"""Whether any mode is unstable, read from w = -λ² of each sample, (samples, modes)."""


HIPUQ = "hipuq"
"""Name of the verdicts of hipuq with certify="auto"."""


def plain(matrices):
    """Return LAPACK's eigenvalues w of a batch, (samples, modes) complex."""
    return np.linalg.eigvals(matrices).astype(complex)


def squares(outcomes):
    """Return w [1/s^2] of modes that are all stable, from their frequencies."""
    return np.square(2 * np.pi * outcomes["frequency"].values)


def table(head, rows):
    """Print a table in markdown."""
    for row in (head, ["---"] * len(head), *rows):
        print("| " + " | ".join(str(cell) for cell in row) + " |")
    print()


def condition(matrix):
    """Return the largest condition number of the eigenvalues of a matrix, |x| |y| / |y^H x|."""
    _, right = np.linalg.eig(matrix)
    left = np.linalg.inv(right)
    return (np.linalg.norm(left, axis=1) * np.linalg.norm(right, axis=0)).max()


def integrated(preset, samples):
    """Return the outcomes of samples with friction integrated: every boundary found, no points."""
    exact = hipuq.integrate_friction(hipuq.models.ring(preset), FRICTION)
    outcomes = hipuq.evaluate(exact, samples, keep=["probability", "onset"], progress=False)
    if (outcomes["status"] != 0).any():
        raise ArithmeticError(f"{preset}: a sample is undecided")
    return outcomes


def sweep():
    """Draw and count false flutter below the first onset, calibrated preset, full contact."""
    model = hipuq.models.ring("oberst2016-calibrated", certify="always")
    contact = hipuq.ContactPatterns(in_contact=9).samples()
    onset = integrated("oberst2016-calibrated", contact)["onset"].item()
    friction = np.round(np.linspace(0.050, 0.054, 401), 5)
    samples = model.nominal(friction=friction)
    proved = hipuq.evaluate(model, samples, progress=False)
    count = proved["unstable_count"].values
    growth = proved["growth_rate"].max("mode").values
    w = plain(model.pencils(samples).reduced()[0])
    # A pair of conjugates is one growing and one decaying mode.
    plain_count, plain_growth = (w.imag > 0).sum(axis=1), np.sqrt(-w).real.max(axis=1)
    stable = count == 0
    false = stable & (plain_count > 0)
    print(
        f"Friction 0.050 to 0.054, {len(friction)} points; {stable.sum()} below the onset, certified stable"
    )
    print(f"first onset {onset:.7f}")
    print(f"LAPACK unstable in {false.sum()} of them, first at {friction[false].min():.5f}")
    print(f"always from {friction[(plain_count == 0)].max() + 1e-5:.5f} on")
    print(f"two pairs in {(plain_count[stable] == 2).sum()}")
    print(f"largest false growth rate {plain_growth[stable].max():.4f} 1/s")
    above = ~stable
    extra = above & (plain_count > count)
    print(f"above the onset: {above.sum()} points, LAPACK has a pair too many in {extra.sum()}")
    i = np.argmax(above)
    print(
        f"first certified unstable {friction[i]:.5f}, {growth[i]:.4f} 1/s; {growth[-1]:.4f} 1/s at the end\n"
    )

    figure = Figure(figsize=(6.4, 5.2), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True)
    mark = {"color": VERMILLION, "marker": "^", "linestyle": "none", "markersize": 3.5, "fillstyle": "none"}
    line = {"color": BLUE, "linewidth": 2.0}
    top.plot(friction, plain_count, label="LAPACK, double precision", **mark)
    top.step(friction, count, where="post", label="certified", zorder=3, **line)
    top.set_ylabel("unstable modes [1]")
    top.set_yticks([0, 1, 2])
    shown = plain_growth > 0
    bottom.semilogy(friction[shown], plain_growth[shown], **mark)
    bottom.semilogy(friction[above], growth[above], zorder=3, **line)
    bottom.set_ylabel("largest growth rate [1/s]")
    bottom.set_xlabel("friction coefficient [1]")
    for ax, letter in ((top, "a"), (bottom, "b")):
        ax.axvline(onset, **BORDER)
        ax.set_title(f"({letter})", loc="left", fontsize="medium")
    bottom.annotate(
        f"true onset {onset:.7f}", (onset, 0.5), (-6, 0), textcoords="offset points", ha="right", va="center"
    )
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    figure.savefig(FIGURES / "false-flutter.png", dpi=150)


def example():
    """Print the example of one point: LAPACK's pairs and their error."""
    proved = hipuq.models.ring(certify="always", **EXAMPLE)
    decided = hipuq.models.ring(**EXAMPLE)
    sample = proved.nominal(friction=0.0525)
    exact, outcomes = proved(sample), decided(sample)
    w = plain(proved.pencils(sample).reduced()[0])[0]
    true = squares(exact)[0]
    pairs = w.imag > 0
    print("kc/k = 1/0.2283, friction 0.0525, full contact")
    print(f"LAPACK: {pairs.sum()} pairs, largest growth rate {np.sqrt(-w).real.max():.4f} 1/s")
    print(f"largest Im w / |w| {(w.imag / np.abs(w)).max():.1e}")
    print(f"largest error / max w {np.abs(w[np.argsort(w.real)] - true).max() / true.max():.1e}")
    print(f"certified unstable modes {exact['unstable_count'].item():.0f}")
    print("frequencies [Hz]", " ".join(f"{f:.5f}" for f in exact["frequency"].values[0, -4:]))
    print(f"structured solver: {outcomes['unstable_count'].item():.0f} unstable modes,")
    error = np.abs(squares(outcomes) - true).max() / true.max()
    print(f"largest difference from the certified w / max w {error:.0e}\n")


def clusters():
    """Print gaps, condition numbers and LAPACK's errors on the way to the first onset."""
    model = hipuq.models.ring("oberst2016-calibrated")
    friction = np.array([0.0510, 0.0515, 0.0520, 0.0525, 0.0530])
    samples = model.nominal(friction=friction)
    matrices = model.pencils(samples).reduced()[0]
    # Decided by the structured solver, which is as good as exact for this purpose.
    outcomes = model(samples)
    true = squares(outcomes)
    w = np.sort_complex(plain(matrices))
    rows = []
    for i, mu in enumerate(friction):
        scale = true[i].max()
        gap = np.diff(true[i]).min() / scale
        spread = np.ptp(outcomes["frequency"].values[i, -4:])
        error = np.abs(w[i] - true[i]).max() / scale
        pairs = (w[i].imag > 0).sum()
        rows.append(
            [
                f"{mu:.4f}",
                f"{1e3 * spread:.1f}",
                f"{gap:.0e}",
                f"{condition(matrices[i]):.0e}",
                f"{error:.0e}",
                pairs,
            ]
        )
    table(["mu", "last four modes within [mHz]", "smallest gap / w", "condition", "error / w", "pairs"], rows)


def mechanisms():
    """Print what rounding makes of the zero eigenvalues, at friction below every onset."""
    rows = []
    for preset, friction in zip(PRESETS, (0.003, 0.015), strict=True):
        for count in (6, 7):
            model = hipuq.models.ring(preset)
            patterns = hipuq.ContactPatterns(count).samples()
            samples = patterns.assign(friction=("sample", np.full(patterns.sizes["sample"], friction)))
            matrices = model.pencils(samples).reduced()[0]
            zeros = 8 - count
            w = plain(matrices)
            w = np.take_along_axis(w, np.argsort(np.abs(w), axis=1), axis=1)
            norm = np.linalg.norm(matrices, axis=(1, 2))[:, None]
            split = (w[:, :zeros].imag != 0).any(axis=1)
            root = np.sqrt(-w[:, :zeros])
            unstable = (root.real > 0).any(axis=1)
            rows.append(
                [
                    preset,
                    count,
                    zeros,
                    f"{(np.abs(w[:, :zeros]) / norm).max():.0e}",
                    f"{(np.abs(w[:, zeros]) / norm[:, 0]).min():.0e}",
                    f"{unstable.sum()} of {len(w)}",
                    f"{split.sum()} of {len(w)}",
                    f"{root.real.max():.1e}",
                    f"{np.nansum(model(samples)['any_unstable']):.0f}",
                ]
            )
    head = ["preset", "contacts", "zeros", "zeros / norm", "next / norm"]
    head += ["Re λ > 0", "complex pair", "largest Re λ [1/s]", "hipuq"]
    table(head, rows)


def means(preset):
    """Print the mean probability by rule and count, and return it, (rules + 1, counts)."""
    model = hipuq.models.ring(preset)
    patterns = hipuq.ContactPatterns(COUNTS).samples()
    friction = (np.arange(POINTS) + 0.5) / POINTS * 0.1
    names = [*RULES, HIPUQ]
    verdicts, transposed, paths = [], [], np.zeros(3, int)
    for contact in patterns["contact"].values:
        samples = model.nominal(friction=friction, contact=contact)
        matrices = model.pencils(samples).reduced()[0]
        outcomes = hipuq.evaluate(model, samples, keep=["any_unstable"], progress=False)
        if (outcomes["status"] != 0).any():
            raise ArithmeticError(f"{preset}: a sample is undecided")
        paths += np.bincount(outcomes["decided_by"].values, minlength=3)
        w = plain(matrices)
        verdicts.append([*(rule(w) for rule in RULES.values()), outcomes["any_unstable"].values == 1])
        # The same eigenvalues in exact arithmetic.
        w = plain(matrices.transpose(0, 2, 1))
        transposed.append([rule(w) for rule in RULES.values()])
    verdict = np.array(verdicts)
    truth = verdict[:, -1:]
    false, missed = (verdict & ~truth).sum(axis=(0, 2)), (~verdict & truth).sum(axis=(0, 2))
    by_count = [patterns["in_contact"].values == count for count in COUNTS]
    mean, other = (
        np.stack([part[rows].mean(axis=(0, 2)) for rows in by_count], axis=1)
        for part in (verdict, np.array(transposed))
    )
    print(f"{preset}: {truth.size} samples, {(~truth).sum()} stable; decided by double precision, the")
    print(f"structured solver, the certificate: {paths}")
    rows = [
        [name, *(f"{p:.4f}" for p in mean[i]), f"{false[i]:,}", f"{missed[i]:,}"]
        for i, name in enumerate(names)
    ]
    probability = integrated(preset, patterns)["probability"].values
    exact = np.array([probability[part].mean() for part in by_count])
    rows.append(["friction integrated exactly", *(f"{p:.10f}" for p in exact), "", ""])
    table(["rule", *(f"{count} contacts" for count in COUNTS), "false flutter", "missed flutter"], rows)
    for name, change in zip(RULES, other - mean[:-1], strict=True):
        print(f"{name}: read from the transposed matrix the means change by", change.round(4))
    print(f"hipuq at the points less the exact integral: {(mean[-1] - exact).round(5)}\n")
    return mean


def draw_means(by_preset):
    """Draw the mean probability over the number in contact, by rule."""
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    styles = (
        {"color": VERMILLION, "marker": "^", "linestyle": "--"},
        {"color": ORANGE, "marker": "s", "linestyle": "-."},
        {"color": GREEN, "marker": "x", "linestyle": ":"},
        {"color": BLUE, "marker": "o", "linestyle": "-", "fillstyle": "none", "markersize": 9},
    )
    axes = figure.subplots(1, 2)
    for ax, letter, (preset, mean) in zip(axes, "ab", by_preset.items(), strict=True):
        for name, values, style in zip([*RULES, HIPUQ], mean, styles, strict=True):
            ax.plot(COUNTS, values, label=name if letter == "a" else None, **style)
        ax.set_title(f"({letter}) {preset}", loc="left", fontsize="medium")
        ax.set_xticks(COUNTS)
        ax.set_xlabel("oscillators in contact [1]")
    axes[0].set_ylabel("mean probability of instability [1]")
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    figure.savefig(FIGURES / "false-flutter-probability.png", dpi=150)


def costs():
    """Print the time for one sample on one core, 1000 at a time: easy ones, and ones close to an onset."""
    rows = []
    models = {c: hipuq.models.ring("oberst2016-calibrated", certify=c) for c in ("never", "auto", "always")}
    for label, low, high in (("0.06 to 0.1", 0.06, 0.1), ("0.0507 to 0.0530", 0.0507, 0.0530)):
        samples = models["auto"].nominal(friction=np.linspace(low, high, 1000))
        matrices = models["auto"].pencils(samples).reduced()[0]
        seconds = []
        for call in (
            lambda matrices=matrices: plain(matrices),
            *(
                lambda model=model, samples=samples: model(samples, keep=["any_unstable"])
                for model in models.values()
            ),
        ):
            started = time.perf_counter()
            call()
            seconds.append(time.perf_counter() - started)
        rows.append([label, *(f"{one:.2g}" for one in seconds)])
    table(["friction", "eigvals [ms]", *(f"{name} [ms]" for name in models)], rows)


def main():
    """Print all tables and write both figures."""
    sweep()
    example()
    means_by_preset = {preset: means(preset) for preset in PRESETS}
    draw_means(means_by_preset)
    mechanisms()
    clusters()
    costs()
    return 0


if __name__ == "__main__":
    sys.exit(main())
