#!/usr/bin/env python
"""Make the figures and print the tables of docs/gallery/method_comparison.md.

hipuq run studies/method_comparison
python docs/scripts/methods.py [results/method_comparison]
python docs/scripts/methods.py --more

The first command makes the results that the second one reads; it takes about 20 minutes on two cores, and
goes on with --resume if it is cut off. The second takes seconds, the third some minutes: it runs what the
study does not.
"""

import sys
import time
from pathlib import Path

import chaospy as cp
import numpy as np
from matplotlib.figure import Figure
from pictures import put_figure

import hipuq
from hipuq import plots
from hipuq.report.comparison import facts, remarks, tables
from hipuq.report.table import Table

REFERENCE = Path(__file__).parents[2] / "studies" / "method_comparison" / "reference.nc"
CLOSED_FORM = 0.4021698580326567
"""P of hoffmann, friction U(0, 0.8) and k3 scattered by 10 %."""


def in_markdown(table):
    """Print a table in markdown."""
    print(f"**{table.title}**\n")
    for row in (table.columns, ["---"] * len(table.columns), *table.rows):
        print("| " + " | ".join(" ".join(str(cell).split("\n")) for cell in row) + " |")
    print(f"\n{table.note}\n" if table.note else "")


def widths(race):
    """Return the median widths of intervals."""
    found = (race["high"] - race["low"]).median("replicate")
    found = found.median([dim for dim in found.dims if dim not in ("method", "budget")])
    rows = [
        [str(name), *(f"{value:.3g}" for value in found.loc[{"method": name}].values)]
        for name in race["method"].values
    ]
    return Table("Median width of intervals", ["contender", *map(str, race["budget"].values)], rows)


def panels(name, draw, races, width=7.0, height=5.6):
    """Write a figure of panels side by side, one for each comparison."""
    figure = Figure(figsize=(width * len(races), height), layout="constrained")
    for ax, letter, race in zip(figure.subplots(1, len(races)), "abc", races, strict=False):
        draw(race, ax)
        ax.set_title(f"({letter})", loc="left")
    put_figure(figure, f"methods-{name}")


def more():
    """Print what the study does not run: designs with and without replicates, larger populations."""
    model, friction = hipuq.models.ring("oberst2016"), cp.Uniform(0.0, 0.1)
    scatter = {
        "spring_stiffness": hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
        "contact_stiffness": hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"),
        "spring_angle": hipuq.shift(cp.Uniform(-1.0, 1.0), each="spring"),
        "contact_angle": hipuq.shift(cp.Uniform(-1.0, 1.0), each="oscillator"),
    }
    contenders = {
        f"{sampler} x{parts}": {"method": "monte_carlo", "options": {"sampler": sampler, "replicates": parts}}
        for sampler in ("sobol", "latin_hypercube")
        for parts in (1, 8)
    }
    race = hipuq.compare(
        model,
        model.inputs(friction=friction, **scatter),
        contenders,
        of="any_unstable",
        reference=float(hipuq.load_results(REFERENCE)["ring/any_unstable"]["probability"]),
        budgets=[16384],
        replicates=150,
        rng=77,
    )
    for name in contenders:
        found = race.loc[{"method": name, "budget": 16384}]
        print(name, *(f"{float(found[key]):.4f}" for key in ("rmse", "rmse_low", "rmse_high")))
    small = hipuq.models.two_dof("hoffmann2002")
    inputs = small.inputs(friction=cp.Uniform(0.0, 0.8), k3=hipuq.relative(cp.Uniform(-0.1, 0.1)))
    for population in (2**16, 2**20):
        options = {"n": 213, "of": "margin", "population": population, "progress": False}
        found = [hipuq.run(small, inputs, method="chaos", rng=seed, **options) for seed in range(20)]
        error = np.array([float(one["probability"]) for one in found]) - CLOSED_FORM
        print(f"population {population:,}: error {np.sqrt(np.mean(error**2)):.2g}")
    exact = hipuq.integrate_friction(model, friction)
    patterns = exact.inputs(contact=hipuq.ContactPatterns(in_contact=(6, 7, 8, 9)))
    started = time.perf_counter()
    hipuq.run(exact, patterns, method="monte_carlo", n=1, stratify=True, of="probability", progress=False)
    print(f"130 patterns, friction integrated: {time.perf_counter() - started:.1f} s")


def main():
    """Read the results, draw and print."""
    if sys.argv[1:] == ["--more"]:
        more()
        return
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results/method_comparison")
    tree = hipuq.load_results(folder)
    races = {str(name): node.to_dataset() for name, node in tree["compare"].children.items()}
    both = [races["hoffmann"], races["ring"]]
    panels("error", lambda race, ax: plots.error_over_cost(race, ax=ax), both)
    panels("time", lambda race, ax: plots.error_over_cost(race, ax=ax, cost="seconds"), both)
    panels("coverage", lambda race, ax: plots.coverage(race, ax=ax), both)
    others = [races["oberst2016"], races["ring_ST"]]
    panels("patterns-indices", lambda race, ax: plots.error_over_cost(race, ax=ax), others)
    for name, race in races.items():
        print(f"## {name}\n")
        print(". ".join(facts(race)) + ".\n")
        print("\n".join(f"- {line}" for line in remarks(race)) + "\n")
        for table in [*tables(race), widths(race)]:
            in_markdown(table)


if __name__ == "__main__":
    main()
