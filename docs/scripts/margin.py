#!/usr/bin/env python
"""Make the figure and print the tables of docs/theory/margin.md.

python docs/scripts/margin.py

It takes about a minute.
"""

import sys
from itertools import pairwise
from pathlib import Path

import chaospy as cp
import flint
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator

import hipuq
from hipuq.cea import solve
from hipuq.cea.bounds import CERTIFICATE, DOUBLE, STRUCTURED
from hipuq.plots.style import BLACK, BLUE, BORDER, LINES

FIGURES = Path(__file__).parents[1] / "figures"
PRESETS = ("oberst2016", "oberst2016-calibrated")
DRAW = 5
"""Seed of the scattered ring of the figure."""

SCATTER = {
    "spring_stiffness": hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
    "contact_stiffness": hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"),
    "spring_angle": hipuq.shift(cp.Uniform(-1.0, 1.0), each="spring"),
    "contact_angle": hipuq.shift(cp.Uniform(-1.0, 1.0), each="oscillator"),
}
FRICTION = cp.Uniform(0.0, 0.1)


def table(head, rows):
    """Print a table in markdown."""
    for row in (head, ["---"] * len(head), *rows):
        print("| " + " | ".join(str(cell) for cell in row) + " |")
    print()


def along(model, sample, friction):
    """Return the outcomes of one sample along friction."""
    size = len(friction)
    rows = sample.isel(sample=np.zeros(size, int)).assign_coords(sample=np.arange(size))
    return hipuq.evaluate(model, rows.assign(friction=("sample", friction)), progress=False)


def squared_gaps(outcomes):
    """Return the signed squared gap of each pair of neighbours, mechanisms left out, [1/s^4].

    With l = s + i o the roots of a coalesced pair are o^2 - s^2 +- 2 i o s: the gap squared is -(4 o s)^2.
    Of a coalesced mode and another neighbour there is none: NaN.
    """
    omega, growth = 2 * np.pi * outcomes["frequency"].values, outcomes["growth_rate"].values
    rigid = int(outcomes["mechanisms"].values[0])
    omega, growth = omega[:, rigid:], growth[:, rigid:]
    gaps = np.square(np.diff(np.square(omega), axis=1))
    gaps[(growth[:, 1:] != 0) | (growth[:, :-1] != 0)] = np.nan
    pair = growth[:, 1:] > 0
    gaps[pair] = -np.square(4 * omega[:, 1:] * growth[:, 1:])[pair]
    return gaps


def scattered(model, seed, **inputs):
    """Return one draw of a ring, at full contact unless inputs say more."""
    return hipuq.design("monte_carlo", model.inputs(**SCATTER, **inputs), n=1, rng=seed)


def draw():
    """Draw margin and growth rate of one scattered ring along friction, undamped and damped."""
    friction = np.linspace(0.0, 0.1, 4001)
    models = [hipuq.models.ring("oberst2016", damping_ratio=ratio) for ratio in (0.0, 1e-3)]
    sample = scattered(models[0], DRAW)
    free, damped = (along(model, sample, friction) for model in models)
    boundaries = [hipuq.unstable_friction(model, sample, upper=0.1)["friction"].values for model in models]
    print("boundaries undamped", boundaries[0].round(5), "damped 0.1 %", boundaries[1].round(5))
    gaps = squared_gaps(free)
    margin = free["margin"].values
    rule = np.nanargmin(gaps, axis=1)
    scale = np.sqrt(np.nanmin(gaps, axis=1) / margin)
    change = np.flatnonzero(np.diff(rule))
    print("another neighbour rules from friction", friction[change + 1].round(4))
    mode = damped["growth_rate"].values.argmax(axis=1)
    change_damped = np.flatnonzero(np.diff(mode))
    print(
        "damped: mode of the largest growth",
        *(f"{friction[i]:.4f}: {mode[i] + 1}" for i in [0, *change_damped + 1]),
    )

    figure = Figure(figsize=(6.4, 7.6), layout="constrained")
    top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=[1.5, 1, 1])
    for number, (line, pair) in enumerate(zip(LINES, np.unique(rule), strict=False)):
        label = f"modes {pair + 1}, {pair + 2}"
        top.plot(friction, gaps[:, pair] / scale**2, label=label, linewidth=1.3, zorder=3 + number, **line)
    top.plot(friction, margin, color=BLACK, alpha=0.25, linewidth=5, label="margin", zorder=2)
    top.set_yscale("symlog", linthresh=1e-6, linscale=0.6)
    top.yaxis.set_major_locator(FixedLocator([-1e-3, -1e-4, -1e-5, -1e-6, 0.0, 1e-6, 1e-5, 1e-4]))
    top.set_ylim(-1e-3, 3e-4)
    top.set_ylabel("squared gap / squared mean [1]")
    top.legend(frameon=False, ncols=2, loc="lower left", fontsize="small")
    middle.plot(friction, free["growth_rate"].max("mode").values, color=BLUE)
    middle.set_ylabel("largest growth rate [1/s]")
    bottom.plot(friction, 1e4 * damped["margin"].values, color=BLUE)
    bottom.plot(friction[change_damped], 1e4 * damped["margin"].values[change_damped], "o", color=BLACK, ms=3)
    bottom.set_ylabel("margin [1e-4]")
    bottom.set_xlabel("friction coefficient [1]")
    titles = ("margin, undamped", "growth rate, undamped", "margin, damping ratio 0.1 %")
    for ax, letter, title in zip((top, middle, bottom), "abc", titles, strict=True):
        ax.axhline(0.0, color=BLACK, linewidth=0.6)
        for place in boundaries[ax is bottom]:
            ax.axvline(place, **BORDER)
        ax.set_title(f"({letter}) {title}", loc="left", fontsize="medium")
    figure.savefig(FIGURES / "margin.png", dpi=150)


def exact_margin(matrix, mechanisms):
    """Return the margin of an undamped matrix from exact roots."""
    with flint.ctx.workprec(200):
        entries = [flint.fmpq(*float(value).as_integer_ratio()) for value in matrix.ravel()]
        polynomial = flint.fmpq_mat(*matrix.shape, entries).charpoly().numer()
        roots = [ball for ball, times in polynomial.complex_roots() for _ in range(times)]
        roots = sorted(roots, key=lambda ball: abs(complex(ball)))[mechanisms:]
        scale = flint.arb(float(np.trace(matrix))) / len(roots)
        line = sorted((ball.real for ball in roots if ball.imag == 0), key=float)
        values = [-((2 * ball.imag / scale) ** 2) for ball in roots if ball.imag != 0]
        values += [((b - a) / scale) ** 2 for a, b in pairwise(line)]
        return min(float(value) for value in [*values, *(w / scale for w in line[:1])])


def accuracy():
    """Print how far the margin is from that of exact roots, by the path that gave it."""
    rows = {}
    for preset in PRESETS:
        model = hipuq.models.ring(preset)
        onset = hipuq.unstable_friction(model, upper=0.1)["friction"].values[0]
        rng = np.random.default_rng(0)
        wide = onset * rng.uniform(0.9, 1.1, 100)
        close = onset * (1 + rng.choice([-1, 1], 100) * 10 ** rng.uniform(-9, -3, 100))
        case = model.pencils(model.nominal(friction=np.concatenate([wide, close])))
        matrices, _ = case.reduced()
        exact = np.array([exact_margin(matrix, 0) for matrix in matrices])
        for certify in ("auto", "always"):
            spectra = solve(case, certify=certify)
            error = np.abs(spectra.margin / exact - 1)
            if not np.array_equal(np.sign(spectra.margin), np.sign(exact)):
                raise ArithmeticError(f"{preset}, {certify}: a margin has the wrong sign")
            for path in (DOUBLE, STRUCTURED, CERTIFICATE):
                rows.setdefault((certify, path), []).extend(error[spectra.decided_by == path])
    names = {DOUBLE: "double", STRUCTURED: "structured", CERTIFICATE: "certificate"}
    print("nominal rings of both presets near their first onset: relative error of the margin")
    table(
        ("certify", "decided by", "samples", "median", "largest"),
        [
            (certify, names[path], len(error), f"{np.median(error):.0e}", f"{max(error):.0e}")
            for (certify, path), error in rows.items()
            if error
        ],
    )


def nominal():
    """Print the margin of the nominal ring close below its onset."""
    model = hipuq.models.ring("oberst2016")
    onset = hipuq.unstable_friction(model, upper=0.1)["friction"].values[0]
    distance = np.array([1e-3, 1e-5, 1e-7, 3e-8, 1e-8, 3e-9, 1e-9])
    outcomes = model(model.nominal(friction=onset * (1 - distance)), ["margin"])
    print("nominal oberst2016, relative distance below the onset: margin")
    print(*(f"{d:.0e}: {m:.2e}" for d, m in zip(distance, outcomes["margin"].values, strict=True)), "\n")


def kinks(rings=100):
    """Print how the margin runs along friction in scattered rings with 6 to 9 in contact."""
    friction = np.linspace(0.0, 0.1, 1001)
    patterns = hipuq.ContactPatterns(in_contact=(6, 7, 8, 9))
    rows = []
    for preset in PRESETS:
        model = hipuq.models.ring(preset)
        boundaries, changes, wrong = [], [], []
        for seed in range(rings):
            outcomes = along(model, scattered(model, seed, contact=patterns), friction)
            rule = np.nanargmin(squared_gaps(outcomes), axis=1)
            margin, growth = outcomes["margin"].values, outcomes["growth_rate"].max("mode").values
            boundaries.append(np.count_nonzero(np.diff(outcomes["unstable_count"].values)))
            changes.append(np.count_nonzero(np.diff(rule)))
            fits = [fit(friction, target, degree) for target in (margin, -growth) for degree in (5, 10)]
            wrong.append([((values < 0) != (margin < 0)).mean() for values in fits])
        shares = [f"{share:.1%}" for share in np.mean(wrong, axis=0)]
        rows.append((f"`{preset}`", np.mean(boundaries), np.mean(changes), *shares))
    print(f"{rings} scattered rings along friction; share misclassified by polynomials in friction")
    fits = [f"{target}, degree {degree}" for target in ("margin", "growth rate") for degree in (5, 10)]
    table(("preset", "boundaries", "another neighbour rules", *fits), rows)


def fit(x, y, degree):
    """Return the values of the polynomial fitted by least squares."""
    return np.polynomial.Chebyshev.fit(x, y, degree)(x)


def surrogates(size=8000):
    """Print what additive polynomials of degree 2 in all 39 inputs make of several targets."""
    for preset in PRESETS:
        model = hipuq.models.ring(preset)
        inputs = model.inputs(friction=FRICTION, **SCATTER)
        bases, outcomes = [], []
        for seed in (1, 2):
            samples = hipuq.design("monte_carlo", inputs, n=size, rng=seed)
            outcomes.append(hipuq.evaluate(model, samples, keep=["margin", "growth_rate"], progress=False))
            bases.append(basis(model, samples))
        margins = [one["margin"].values for one in outcomes]
        growths = [one["growth_rate"].max("mode").values for one in outcomes]
        unstable = margins[1] < 0
        sides = [np.quantile(np.abs(margins[1][side]), [0.1, 0.5, 0.9]) for side in (~unstable, unstable)]
        print(f"{preset}, 9 in contact: P = {unstable.mean():.3f}, 10, 50, 90 % quantiles of |margin|")
        print("stable", *(f"{q:.1e}" for q in sides[0]), "unstable", *(f"{q:.1e}" for q in sides[1]))
        targets = {
            "largest growth rate": [-growth for growth in growths],
            "margin": margins,
            "sign · abs(margin)^(1/2)": [np.sign(m) * np.sqrt(np.abs(m)) for m in margins],
            "sign · abs(margin)^(1/4)": [np.sign(m) * np.abs(m) ** 0.25 for m in margins],
            "sign": [np.sign(m) for m in margins],
        }
        rows = []
        for name, (train, test) in [*targets.items(), ("margin, with all products", margins)]:
            terms = [with_products(one) for one in bases] if "products" in name else bases
            predicted = terms[1] @ np.linalg.lstsq(terms[0], train, rcond=None)[0]
            q2 = 1 - np.mean(np.square(predicted - test)) / np.var(test)
            wrong = np.mean((predicted < 0) != unstable)
            explained = np.corrcoef(predicted, unstable)[0, 1] ** 2
            share = (predicted < 0).mean()
            rows.append((name, f"{q2:.2f}", f"{wrong:.1%}", f"{share:.3f}", f"{explained:.2f}"))
        table(("target", "Q2", "misclassified", "predicted P", "variance of the verdict explained"), rows)


def basis(model, samples):
    """Return 1, and the Legendre polynomials of degree 1 and 2 in each input, (samples, terms)."""
    columns = [samples["friction"].values[:, None] / 0.05 - 1]
    for name, variation in SCATTER.items():
        change = samples[name].values - model.parameters[name].nominal
        columns.append(change if variation.how == "shift" else 10 * change / model.parameters[name].nominal)
    x = np.concatenate(columns, axis=1)
    return np.concatenate([np.ones((len(x), 1)), x, 1.5 * x**2 - 0.5], axis=1)


def with_products(additive):
    """Return a basis with the products of every two inputs besides."""
    linear = additive[:, 1 : 1 + (additive.shape[1] - 1) // 2]
    first, second = np.triu_indices(linear.shape[1], 1)
    return np.concatenate([additive, linear[:, first] * linear[:, second]], axis=1)


def damped(size=4000):
    """Print in how many damped samples the lowest mode rules."""
    patterns = hipuq.ContactPatterns(in_contact=(6, 7, 8, 9))
    for preset in PRESETS:
        model = hipuq.models.ring(preset, damping_ratio=0.01)
        inputs = model.inputs(friction=FRICTION, contact=patterns, **SCATTER)
        samples = hipuq.design("monte_carlo", inputs, n=size, rng=3)
        outcomes = hipuq.evaluate(
            model, samples, keep=["growth_rate", "mechanisms", "margin"], progress=False
        )
        growth, rigid = outcomes["growth_rate"].values, outcomes["mechanisms"].values
        moving = np.where(np.arange(growth.shape[1]) >= rigid[:, None], growth, -np.inf)
        share, unstable = (moving.argmax(axis=1) == rigid).mean(), (outcomes["margin"].values < 0).mean()
        print(f"{preset}, damping ratio 1 %: the lowest mode rules in {share:.1%}; P = {unstable:.4f}")


def main():
    """Print all tables and write the figure."""
    draw()
    accuracy()
    nominal()
    kinks()
    surrogates()
    damped()
    return 0


if __name__ == "__main__":
    sys.exit(main())
