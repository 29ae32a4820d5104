#!/usr/bin/env python
"""Make the figures and print the tables of docs/gallery/scatter.md.

hipuq run studies/scatter
python docs/scripts/scatter.py [results/scatter]

The first command makes the results that the second one reads. On two cores it takes a minute, the second
three.
"""

import sys
import time
from pathlib import Path

import chaospy as cp
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter
from pictures import put_figure
from scipy.stats import chi2

import hipuq
from hipuq.intervals import wilson
from hipuq.plots.style import BLUE, GREEN, PURPLE, VERMILLION

PRESET = "oberst2016"
DAMPING = 0.01
NORMAL = 1.959964
"""Half width of a 95 % interval in standard deviations."""

FRICTION = cp.Uniform(0.0, 0.1)
SCATTER = {
    "spring_stiffness": hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
    "contact_stiffness": hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"),
    "spring_angle": hipuq.shift(cp.Uniform(-1.0, 1.0), each="spring"),
    "contact_angle": hipuq.shift(cp.Uniform(-1.0, 1.0), each="oscillator"),
}
PATTERNS = hipuq.ContactPatterns(in_contact=(6, 7, 8, 9))

REPLICATES = 60
BUDGETS = (256, 1024, 4096, 16384)
SAMPLERS = {"latin_hypercube": "latin hypercube", "sobol": "Sobol points"}
CASES = {
    "": "sampled, undamped",
    "_integrated": "integrated, undamped",
    "_damped": "sampled, 1 %",
    "_integrated_damped": "integrated, 1 %",
}
"""Ends of the names of the analyses -> how friction is treated, damping ratio."""


def table(head, rows):
    """Print a table in markdown."""
    for row in (head, ["---"] * len(head), *rows):
        print("| " + " | ".join(str(cell) for cell in row) + " |")
    print()


def limits(value, low, high, digits=4):
    """Return an estimate with its limits as text."""
    return "{:.{d}f} ({:.{d}f} to {:.{d}f})".format(*(float(x) for x in (value, low, high)), d=digits)


def interval(results, name, digits=4):
    """Return an estimate of a results Dataset with its limits as text."""
    return limits(*(results[name + end] for end in ("", "_low", "_high")), digits)


def of(tree, analysis):
    """Return the results of the first outcome of an analysis."""
    return next(iter(tree[analysis].children.values())).to_dataset()


def probabilities(tree):
    """Print the probability of the four cases by all three methods."""
    rows = []
    for end, case in CASES.items():
        plain, sobol, chaos = (of(tree, f"{name}{end}") for name in ("monte_carlo", "sobol", "chaos"))
        samples = 2 * int(sobol["base_samples"])
        mean = float(sobol["mean"])
        if "events" in sobol:
            ends = wilson(np.array(mean * samples), np.array(float(samples)), 0.95)
        else:
            reach = NORMAL * float(np.sqrt(sobol["variance"] / samples))
            ends = mean - reach, mean + reach
        key = "probability" if "probability" in chaos and "pattern" not in chaos else "probability_overall"
        rows.append(
            [
                case,
                interval(plain, "probability"),
                f"{int(plain['evaluations']):,}",
                limits(mean, *ends),
                f"{samples:,}",
                interval(chaos, key),
                f"{int(chaos['evaluations']):,}",
            ]
        )
    print("P(unstable) with 95 % limits, and the samples it comes from")
    table(["friction, damping", "Monte Carlo", "of", "Sobol", "of", "chaos, mended", "of"], rows)


def budget(results, name, points, parameter):
    """Return an index with its limits from the first base points alone."""
    whole = int(results["base_samples"])
    place = int(np.flatnonzero(results["budget"].values * whole == results["budget"].values[-1] * points)[0])
    parts = [
        results[f"{name}_by_budget{end}"].sel(parameter=parameter)[place] for end in ("", "_low", "_high")
    ]
    return [float(part) for part in parts]


def stability(tree):
    """Print indices after 1024 and 4096 base points."""
    held = []
    for outcome in ("any_unstable", "margin"):
        results = tree[f"sobol/{outcome}"].to_dataset()
        order = results["parameter"].values[np.argsort(-results["ST"].values)]
        rows = []
        for parameter in order:
            row = [parameter]
            for name in ("S1", "ST"):
                early, late = (budget(results, name, points, parameter) for points in (1024, 4096))
                held.append(early[1] <= late[0] <= early[2])
                row += [limits(*early, 3), limits(*late, 3)]
            rows.append(row)
        print(f"{outcome}: Sobol indices with 95 % limits from n base points")
        table(["parameter", "S1, n = 1024", "S1, n = 4096", "ST, n = 1024", "ST, n = 4096"], rows)
        print(f"sum of S1 {float(results['S1'].sum()):.2f}, of ST {float(results['ST'].sum()):.2f}\n")
    print(f"estimates at 4096 inside the interval at 1024: {sum(held)} of {len(held)}\n")
    rows = {}
    for analysis in ("sobol_damped", "sobol_integrated", "sobol_integrated_damped"):
        results = of(tree, analysis)
        if reason := results["ST"].attrs.get("undefined"):
            print(f"{analysis}: {reason}")
            continue
        for parameter in tree["sobol/margin"].to_dataset()["parameter"].values:
            cells = ["", ""]
            if parameter in results["parameter"]:
                cells = [interval(results.sel(parameter=parameter), name, 2) for name in ("S1", "ST")]
            rows.setdefault(parameter, [parameter]).extend(cells)
        print(analysis, "base points", int(results["base_samples"]), end=", ")
        print(f"sum of S1 {float(results['S1'].sum()):.2f}, of ST {float(results['ST'].sum()):.2f}")
        if "events" in results:
            print("events", int(results["events"]))
    cases = [f"{name} {case}" for case in ("damped", "integrated") for name in ("S1", "ST")]
    table(["parameter", *cases], rows.values())


def replicated(designs=20, points=1024):
    """Print sums of indices, and how often intervals hold, from independent Sobol designs."""
    model = hipuq.models.ring(PRESET)
    inputs = model.inputs(friction=FRICTION, contact=PATTERNS, **SCATTER)
    found = {"any_unstable": [], "margin": []}
    for seed in range(designs):
        samples = hipuq.design("sobol", inputs, n=points, rng=seed, second_order=True)
        outcomes = hipuq.evaluate(model, samples, keep=list(found), progress=False)
        for outcome, results in found.items():
            results.append(hipuq.estimate("sobol", outcomes, inputs, of=outcome, resamples=400))
    print(f"{designs} independent designs of {points} base points: mean and standard error")
    rows = []
    for outcome, results in found.items():
        results = xr.concat(results, "design", coords="minimal", compat="override", join="override")
        s1, st = results["S1"], results["ST"]
        s2 = (
            results["S2"]
            .where(np.tri(s1.sizes["parameter"], k=-1).astype(bool))
            .sum(["parameter", "parameter_2"])
        )
        sums = [s1.sum("parameter"), s2, 1 - s1.sum("parameter") - s2]
        held = [
            (results[f"{name}_low"] <= part.mean("design")) & (part.mean("design") <= results[f"{name}_high"])
            for name, part in (("S1", s1), ("ST", st))
        ]
        cells = [f"{float(x.mean()):.3f} ± {float(x.std(ddof=1)) / designs**0.5:.3f}" for x in sums]
        rows.append([outcome, *cells, *(f"{float(part.mean()):.1%} of {part.size}" for part in held)])
        pairs = results["S2"].mean("design")
        error = results["S2"].std("design", ddof=1) / designs**0.5
        for i, j in np.argwhere(np.tri(len(pairs), k=-1)):
            if pairs[i, j] > 3 * error[i, j]:
                names = pairs["parameter"].values[[i, j]]
                print(
                    f"{outcome}: S2 of {', '.join(names)} {float(pairs[i, j]):.3f} ± {float(error[i, j]):.3f}"
                )
    head = [
        "outcome",
        "sum of S1",
        "sum of S2",
        "three and more",
        "S1 intervals hold the mean",
        "ST intervals",
    ]
    table(head, rows)


def as_number(outcomes):
    """Return outcomes with the verdict once more as a number like any other, whose mean is mended."""
    verdict = outcomes["any_unstable"]
    attrs = {"long_name": "verdict as a number", "units": "1"}
    return outcomes.assign(number=("sample", verdict.values.astype(np.float64), attrs))


def chaos_of_study(tree, folder):
    """Print what the expansions of the study are worth, and what their indices say."""
    rows = []
    for analysis, outcome in (
        ("chaos", "any_unstable"),
        ("chaos", "margin"),
        ("chaos_damped", "any_unstable"),
        ("chaos_integrated", "probability"),
        ("chaos_integrated_damped", "probability"),
    ):
        results = tree[f"{analysis}/{outcome}"].to_dataset()
        degree = results["degree"].values
        levels = "pattern" in results
        wrong = interval(results, "misclassified", 3) if "misclassified" in results else ""
        alone = "probability_surrogate_overall"
        rows.append(
            [
                f"{analysis}, {outcome}",
                f"{int(results['samples_used'].sum()):,}",
                f"{degree.min()} to {degree.max()}",
                f"{float(results['loo_overall' if levels else 'loo']):.2f}",
                f"{float(results['q2']):.2f}",
                wrong,
                f"{float(results[alone]):.4f}" if alone in results else "",
                "yes" if int(results["trusted"]) else "no",
            ]
        )
    head = [
        "expansion of",
        "fitted to",
        "degree",
        "leave-one-out",
        "Q2",
        "misclassified",
        "P alone",
        "trusted",
    ]
    table(head, rows)
    chaos, sobol = (tree[f"{name}/any_unstable"].to_dataset() for name in ("chaos", "sobol"))
    share = float(chaos["variance_overall"] / sobol["variance"])
    s1, st = (float(chaos[name].sel(parameter="friction")) for name in ("S1", "ST"))
    print(f"variance of the surrogate / of the verdict {share:.3f}; friction: S1 {s1:.3f} ST {st:.3f} of the")
    print(f"surrogate, which is S1 {s1 * share:.3f} ST {st * share:.3f} of the verdict")
    damped, p = of(tree, "chaos_damped"), float(of(tree, "monte_carlo_damped")["probability"])
    noise = float((damped["weight"] * p * (1 - p) / damped["samples_used"]).sum())
    print("damped: indices undefined,", damped["S1"].attrs["undefined"], end=", ")
    print(f"variance of the surrogate {float(damped['variance_overall']):.1e}, of pure chance {noise:.1e}")
    plain = tree["monte_carlo/any_unstable"].to_dataset()
    rows = [
        [
            "plain Monte Carlo",
            int(plain["evaluations"]),
            interval(plain, "probability"),
            width(plain, "probability"),
        ]
    ]
    name = "probability_overall"
    rows.append(
        ["chaos, corrected in strata", int(chaos["evaluations"]), interval(chaos, name), width(chaos, name)]
    )
    name = "mean_corrected"
    fitted = int(chaos["samples_used"].sum())
    outcomes = hipuq.load_outcomes(folder / "outcomes" / "chaos.zarr")
    outcomes = as_number(outcomes.isel(sample=outcomes["round"].values == 0))
    used = outcomes.sizes["sample"]
    inputs = hipuq.models.ring(PRESET).inputs(friction=FRICTION, contact=PATTERNS, **SCATTER)
    mended = hipuq.estimate("chaos", outcomes, inputs, of="number", population=1024)
    rows.append(["chaos as control variate", used, interval(mended, name), width(mended, name)])
    for count in (int(chaos["evaluations"]), used, used - fitted, 4096):
        p = float(plain["probability"])
        rows.append(["plain with as many", count, "", f"{2 * NORMAL * (p * (1 - p) / count) ** 0.5:.4f}"])
    table(["undamped", "evaluations", "P", "width"], rows)
    damped, plain = of(tree, "chaos_damped"), of(tree, "monte_carlo_damped")
    p, count = float(plain["probability"]), int(damped["evaluations"])
    print("damped: width", width(damped, "probability_overall"), "of", count, end=", ")
    print("plain with as many", f"{2 * NORMAL * (p * (1 - p) / count) ** 0.5:.4f}", end=", ")
    print("with 4096", f"{2 * NORMAL * (p * (1 - p) / 4096) ** 0.5:.4f}\n")


def width(results, name):
    """Return the width of an interval as text."""
    return f"{float(results[f'{name}_high'] - results[f'{name}_low']):.4f}"


def root(values, power):
    """Return a power of the absolute values, with their sign."""
    return np.sign(values) * np.abs(values) ** power


def targets(size=8192):
    """Print what expansions in 39 inputs make of several targets, on as many held-out samples."""
    free, damped = (hipuq.models.ring(PRESET, damping_ratio=ratio) for ratio in (0.0, DAMPING))
    inputs = free.inputs(friction=FRICTION, **SCATTER)
    samples = hipuq.design("chaos", inputs, n=size, rng=1, held_out=1.0)
    keep = ["any_unstable", "margin", "frequency", "growth_rate"]
    outcomes = hipuq.evaluate(free, samples, keep=keep, progress=False)
    for name, power in (("half", 0.5), ("quarter", 0.25)):
        margin = outcomes["margin"]
        outcomes[name] = ("sample", root(margin.values, power), margin.attrs)
    other = hipuq.evaluate(damped, samples, keep=["any_unstable", "margin"], progress=False)
    linear, additive = {"degree": 1}, {"degree": 2, "interaction": 1}
    high = {"degree": 6, "interaction": 1}
    products, sparse = {"degree": 2}, {"fit": "sparse", "degree": 3, "q": 0.75}
    names = ("degree 1", "additive, degree 2", "additive, degree 6", "products of two", "sparse, degree 3")
    bases = dict(zip(names, (linear, additive, high, products, sparse), strict=True))
    rows = []
    for label, source, target, chosen in (
        ("verdict", outcomes, "any_unstable", names),
        ("margin", outcomes, "margin", names),
        ("sign · abs(margin)^(1/2)", outcomes, "half", (names[1], names[4])),
        ("sign · abs(margin)^(1/4)", outcomes, "quarter", (names[1], names[4])),
        ("verdict, 1 % damping", other, "any_unstable", (names[1], names[4])),
        ("margin, 1 % damping", other, "margin", (names[1], names[4])),
    ):
        for basis in chosen:
            results = hipuq.estimate("chaos", source, inputs, of=target, population=2**14, **bases[basis])
            row = [label, basis, int(results["terms"]), f"{float(results['q2']):.2f}"]
            row += [
                f"{float(results['misclassified']):.1%}",
                f"{float(results['probability_surrogate']):.3f}",
            ]
            rows.append(row)
    true = outcomes["any_unstable"].values
    print(f"nine in contact, {size:,} samples fitted, {size:,} held out")
    print(f"P = {true.mean():.4f} undamped, {other['any_unstable'].values.mean():.4f} with 1 % damping")
    rows += gaps(outcomes, inputs, {name: bases[name] for name in names[1:4:2]})
    table(["target", "polynomial", "terms", "Q2", "misclassified", "P by the surrogate"], rows)
    control = hipuq.estimate(
        "chaos", as_number(outcomes), inputs, of="number", population=1024, **bases[names[1]]
    )
    print(
        "undamped verdict, additive surrogate of degree 2 as control variate:",
        interval(control, "mean_corrected"),
    )
    print(f"width {width(control, 'mean_corrected')}", end=", ")
    print(f"of {2 * size} plain samples {2 * NORMAL * float(true.std()) / (2 * size) ** 0.5:.4f}\n")


def gaps(outcomes, inputs, bases):
    """Return rows of the table for one expansion for each gap between neighbours, the minimum taken."""
    omega, growth = 2 * np.pi * outcomes["frequency"].values, outcomes["growth_rate"].values
    roots = np.square(omega) - np.square(growth) + 2j * omega * growth
    roots = roots / roots.real.mean(axis=1, keepdims=True)
    roots = np.take_along_axis(roots, np.argsort(roots.real, axis=1, kind="stable"), axis=1)
    step = np.diff(roots.real, axis=1)
    pair = (roots.imag[:, 1:] != 0) & (roots.imag[:, :-1] != 0) & (np.abs(step) < 1e-9)
    squared = np.where(pair, -np.square(2 * roots.imag[:, 1:]), np.square(step))
    if not np.array_equal(squared.min(axis=1) < 0, outcomes["any_unstable"].values == 1):
        raise ArithmeticError("the smallest gap has another sign than the verdict")
    rows = []
    source = outcomes.assign(gap=(("sample", "pair"), squared, {"long_name": "gap", "units": "1"}))
    for basis, options in bases.items():
        results = hipuq.estimate("chaos", source, inputs, of="gap", population=1024, **options)
        said = results["predicted"].min("pair").values < 0
        true = results["true"].min("pair").values < 0
        q2 = results["q2"].values[(squared < 0).mean(axis=0) > 0.01]
        row = ["each gap, minimum taken", basis, int(results["terms"].max())]
        rows.append(
            [*row, f"{q2.min():.2f} to {q2.max():.2f}", f"{(said != true).mean():.1%}", f"{said.mean():.3f}"]
        )
    return rows


def spread(values, about=None):
    """Return the root mean square error of replicates and its 95 % limits."""
    size = len(values)
    about = values.mean() if about is None else about
    free = size - 1
    error = np.sqrt(np.sum(np.square(values - about)) / free)
    low, high = error * np.sqrt(free / chi2.ppf([0.975, 0.025], free))
    return error, low, high


def samplers():
    """Print the error of random, latin hypercube and Sobol points; return that of the last two by budget."""
    model = hipuq.models.ring(PRESET)
    inputs = model.inputs(friction=FRICTION, **SCATTER)
    most = BUDGETS[-1]
    means = {sampler: {} for sampler in SAMPLERS}
    for sampler in SAMPLERS:
        # The first points of a Sobol design are a smaller one; those of a latin hypercube are not.
        for count in BUDGETS if sampler == "latin_hypercube" else (most,):
            options = {"sampler": sampler, "replicates": REPLICATES}
            samples = hipuq.design("monte_carlo", inputs, n=REPLICATES * count, rng=count, **options)
            outcomes = hipuq.evaluate(model, samples, keep=["any_unstable"], progress=False)
            verdict = outcomes["any_unstable"].values.reshape(REPLICATES, count)
            for part in BUDGETS if count == most and sampler != "latin_hypercube" else (count,):
                means[sampler][part] = verdict[:, :part].mean(axis=1)
    whole = np.array([means[sampler][most] for sampler in SAMPLERS])
    # Weighted by how well each is known.
    weight = 1 / whole.var(axis=1, ddof=1)
    truth = float((weight * whole.mean(axis=1)).sum() / weight.sum())
    print(f"nine in contact, undamped, {REPLICATES} replicates of each: P = {truth:.5f} ", end="")
    print(f"± {float(1 / np.sqrt(REPLICATES * weight.sum())):.5f} (one standard error)")
    errors = {name: {n: spread(part, truth) for n, part in found.items()} for name, found in means.items()}
    rows = [["random (exact)"] + [f"{exact(truth, n):.4f}" for n in BUDGETS] + ["1"]]
    for sampler, label in SAMPLERS.items():
        row = [limits(*errors[sampler][n]) for n in BUDGETS]
        worth = (exact(truth, most) / np.array(errors[sampler][most])) ** 2
        rows.append([label, *row, limits(worth[0], worth[2], worth[1], 1)])
    print("root mean square error of P with 95 % limits")
    table(["points", *(f"n = {n:,}" for n in BUDGETS), f"a point is worth, n = {most:,}"], rows)
    # The designs of a latin hypercube are independent of each other.
    ratios = [np.square((means["latin_hypercube"][n] - truth) / exact(truth, n)) for n in BUDGETS]
    free = REPLICATES * len(BUDGETS)
    ends = chi2.ppf([0.025, 0.975], free) / np.sum(ratios)
    print("latin hypercube, all n together: a point is worth", limits(free / np.sum(ratios), *ends, 1), "\n")
    return errors, truth


def exact(p, n):
    """Return the standard error of n random verdicts."""
    return np.sqrt(p * (1 - p) / n)


def milliseconds(ratio, **inputs):
    """Return the CPU time that a sample takes on one core [ms], friction sampled and integrated."""
    model = hipuq.models.ring(PRESET, damping_ratio=ratio)
    whole = hipuq.integrate_friction(model, FRICTION)
    cases = (
        (model, model.inputs(friction=FRICTION, **inputs), "any_unstable", 4096),
        (whole, whole.inputs(**inputs), "probability", 128),
    )
    found = []
    for case, own, keep, count in cases:
        samples = hipuq.design("monte_carlo", own, n=count, rng=9)
        times = []
        for _ in range(4):
            started = time.process_time()
            hipuq.evaluate(case, samples, keep=[keep], n_jobs=1, progress=False)
            times.append(1e3 * (time.process_time() - started) / count)
        found.append(min(times))
    return found


def integrated(folder):
    """Print what a sample with friction integrated is worth and costs; return both for the undamped ring."""
    rng = np.random.default_rng(1)
    rows, found = [], []
    for ratio, (blocks, size) in ((0.0, (16, 64)), (DAMPING, (16, 128))):
        model = hipuq.models.ring(PRESET, damping_ratio=ratio)
        whole = hipuq.integrate_friction(model, FRICTION)
        inputs = whole.inputs(**SCATTER)
        options = {"sampler": "latin_hypercube", "replicates": blocks}
        samples = hipuq.design("monte_carlo", inputs, n=blocks * size, rng=5, **options)
        outcomes = hipuq.evaluate(whole, samples, keep=["probability"], progress=False)
        p = outcomes["probability"].values
        cost = milliseconds(ratio, **SCATTER)
        error, low, high = spread(p.reshape(blocks, size).mean(axis=1))
        chance = p.std(ddof=1) / size**0.5
        ends = (chance / np.array([error, high, low])) ** 2
        row = [f"nine, {ratio:.0%}", len(p), f"{p.mean():.4f}", f"{p.std(ddof=1):.3f}", worth(p, rng)]
        rows.append(
            [
                *row,
                f"{cost[0]:.4f}",
                f"{cost[1]:.1f}",
                f"{cost[1] / cost[0]:.0f}",
                limits(*ends, 1),
            ]
        )
        found.append((p.std(ddof=1), cost[1] / cost[0], error, size))
        for basis in ({"degree": 1}, {"fit": "sparse", "degree": 2}):
            results = hipuq.estimate("chaos", outcomes, inputs, of="probability", population=1024, **basis)
            used, q2 = int(results["samples_used"]), float(results["q2"])
            print(f"integrated, {ratio:.0%} damping, {used} samples fitted, {basis}: Q2 {q2:.2f}")
    for end, name, ratio in (("", "6 to 9, 0%", 0.0), ("_damped", "6 to 9, 1%", DAMPING)):
        outcomes = hipuq.load_outcomes(folder / "outcomes" / f"monte_carlo_integrated{end}.zarr")
        p = outcomes["probability"].values
        cost = milliseconds(ratio, contact=PATTERNS, **SCATTER)
        row = [f"{name} (study)", len(p), f"{p.mean():.4f}", f"{p.std(ddof=1):.3f}", worth(p, rng)]
        rows.append([*row, f"{cost[0]:.4f}", f"{cost[1]:.1f}", f"{cost[1] / cost[0]:.0f}", ""])
    print("\nfriction integrated; plain and integrated: CPU time of a sample on one core [ms]")
    head = ["contacts, damping", "samples", "P", "standard deviation", "worth plain samples"]
    table([*head, "plain", "integrated", "cost ratio", "latin hypercube: a sample is worth"], rows)
    return found[0]


def worth(p, rng, resamples=2000):
    """Return how many verdicts a sample with friction integrated is worth, with bootstrap limits."""
    draws = p[rng.integers(len(p), size=(resamples, len(p)))]
    values = draws.mean(axis=1) * (1 - draws.mean(axis=1)) / draws.var(axis=1, ddof=1)
    low, high = np.quantile(values, [0.025, 0.975])
    return limits(p.mean() * (1 - p.mean()) / p.var(ddof=1), low, high, 1)


def draw_indices(tree):
    """Draw the grouped indices of four cases."""
    figure = Figure(figsize=(9.6, 6.6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    order = ["friction", "contact_stiffness", "spring_stiffness", "contact", "contact_angle", "spring_angle"]
    cases = {
        "sobol/any_unstable": "verdict, undamped",
        "sobol/margin": "margin, undamped",
        "sobol_damped/any_unstable": "verdict, 1 % damping",
        "sobol_integrated/probability": "friction integrated, undamped",
    }
    for ax, letter, (path, title) in zip(axes.flat, "abcd", cases.items(), strict=True):
        results = tree[path].to_dataset()
        hipuq.plots.index_bars(
            results, ax=ax, parameters=[name for name in order if name in results["parameter"]]
        )
        titled(ax, f"({letter}) {title}, n = {int(results['base_samples']):,}")
        ax.set_xlim(-0.35, 1.35)
        if "friction" in results["parameter"]:  # Else its rows are not those of its neighbour.
            ax.label_outer()
        legend = ax.get_legend_handles_labels()
        ax.get_legend().remove()
    figure.legend(*legend, loc="outside lower center", ncols=3, frameon=False)
    put_figure(figure, "scatter-indices")


def draw_surrogate(tree):
    """Draw predicted against true values of the verdict and of the margin."""
    figure = Figure(figsize=(9.6, 6.1), layout="constrained")
    titles = {"any_unstable": "(a) verdict", "margin": "(b) margin"}
    for ax, (outcome, title) in zip(figure.subplots(1, 2), titles.items(), strict=True):
        results = tree[f"chaos/{outcome}"].to_dataset()
        hipuq.plots.predicted_against_true(results, ax=ax)
        name = title.split()[1]
        ax.set_xlabel(f"true {name}{', spread sideways' * (name == 'verdict')} [1]")
        ax.set_ylabel(f"predicted {name} [1]")
        titled(ax, f"{title}: Q2 = {float(results['q2']):.2f}")
    put_figure(figure, "scatter-surrogate")


def titled(ax, text):
    """Put a short title in place of a figure's own."""
    ax.set_title("")
    ax.set_title(text, loc="left", fontsize="medium")


def draw_convergence(tree, errors, truth, whole):
    """Draw the error of P over evaluations, and total-order indices over evaluations."""
    figure = Figure(figsize=(9.6, 5.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    reach = np.array([200.0, 150_000.0])
    left.plot(reach, exact(truth, reach), color=BLUE, label="random (exact)")
    styles = {
        "latin_hypercube": {"color": VERMILLION, "marker": "^", "linestyle": "--"},
        "sobol": {"color": GREEN, "marker": "s", "linestyle": "-."},
    }
    for place, (sampler, style) in enumerate(styles.items()):
        # Side by side, so that bars can be told apart.
        x = np.array(BUDGETS) * 1.08 ** (place - 0.5)
        middle, low, high = np.array([errors[sampler][n] for n in BUDGETS]).T
        bars = [middle - low, high - middle]
        left.errorbar(x, middle, bars, label=SAMPLERS[sampler], capsize=3, markersize=5, **style)
    deviation, ratio, error, size = whole
    at = {"color": PURPLE, "linestyle": "none", "markersize": 8}
    label = f"friction integrated, {size} random"
    left.plot(size * ratio, deviation / size**0.5, marker="D", fillstyle="none", label=label, **at)
    label = f"friction integrated, {size} latin hyp."
    left.plot(size * ratio, error, marker="v", label=label, **at)
    left.set_xscale("log")
    left.set_yscale("log")
    left.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    left.yaxis.set_major_locator(FixedLocator([0.001, 0.002, 0.005, 0.01, 0.02, 0.05]))
    left.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    left.yaxis.set_minor_formatter(NullFormatter())
    left.set_ylim(0.001, 0.06)
    left.set_xlabel("evaluations, or as many as take the same time [1]")
    left.set_ylabel("root mean square error of the probability [1]")
    left.grid(linewidth=0.4, alpha=0.5)
    titled(left, "(a) error of P, nine in contact, undamped")
    hipuq.plots.convergence(tree["sobol/any_unstable"].to_dataset(), ax=right, quantity="ST")
    right.set_xlim(left=600)
    titled(right, "(b) total-order indices of the verdict, 95 % limits")
    for ax in (left, right):
        below = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.14), "ncols": 2}
        ax.legend(frameon=False, fontsize="small", **below)
    put_figure(figure, "scatter-convergence")


def main():
    """Print all tables and write the figures."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results/scatter")
    tree = hipuq.load_results(folder)
    probabilities(tree)
    stability(tree)
    replicated()
    chaos_of_study(tree, folder)
    targets()
    errors, truth = samplers()
    whole = integrated(folder)
    draw_indices(tree)
    draw_surrogate(tree)
    draw_convergence(tree, errors, truth, whole)
    return 0


if __name__ == "__main__":
    sys.exit(main())
