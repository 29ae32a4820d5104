#!/usr/bin/env python
"""Make the figures and print the tables of docs/methods.md.

hipuq run studies/method_comparison
python docs/methods.py [results/method_comparison]

The first command makes the results that the second one reads; it takes a quarter of an hour on two cores and
goes on with --resume if it is cut off. The second takes seconds.
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import hipuq
from hipuq import plots
from hipuq.report.comparison import facts, remarks, tables

FIGURES = Path(__file__).parent / "figures"


def in_markdown(table):
    """Print a table in markdown."""
    print(f"**{table.title}**\n")
    for row in (table.columns, ["---"] * len(table.columns), *table.rows):
        print("| " + " | ".join(" ".join(str(cell).split("\n")) for cell in row) + " |")
    print(f"\n{table.note}\n" if table.note else "")


def panels(name, draw, races, width=7.0, height=5.6):
    """Write a figure of panels side by side, one for each comparison."""
    figure = Figure(figsize=(width * len(races), height), layout="constrained")
    for ax, letter, race in zip(figure.subplots(1, len(races)), "abc", races, strict=False):
        draw(race, ax)
        ax.set_title(f"({letter})", loc="left")
    figure.savefig(FIGURES / f"methods-{name}.png", dpi=110)


def main():
    """Read the results, draw and print."""
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
        for table in tables(race):
            in_markdown(table)


if __name__ == "__main__":
    main()
