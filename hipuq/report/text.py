"""Results as one screen of text."""

from __future__ import annotations

import json
import textwrap

import xarray as xr
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from hipuq import schema
from hipuq.report import comparison as methods
from hipuq.report.comparison_error import error_table
from hipuq.report.partners import comparison, groups_of
from hipuq.report.sensitivity import has_indices, remarks
from hipuq.report.summary import comparisons, estimates, headline, tables, trust
from hipuq.report.table import Table


def show_results(tree: xr.DataTree, console: Console | None = None) -> None:
    """Print the results of a study.

    Parameters
    ----------
    tree : DataTree
        As from `hipuq.load_results`.
    console : rich Console, optional
        Where to print; by default standard output.
    """
    screen = screen_for(console)
    screen.print(f"[bold]{escape(str(tree.attrs.get('title', 'hipuq results')))}[/bold]")
    names = json.loads(tree.attrs.get("report", "{}")).get("mode_names", {})
    found = groups_of(tree)
    for analysis in found:
        for i, (_, results) in enumerate(estimates(tree, analysis)):
            if i == 0:
                exact = schema.is_exact(results)
                line = f"{results.attrs['model']}, {'exact' if exact else results.attrs['method']}"
                line += "" if exact else f", seed {results.attrs['seed']}"
                screen.print(f"\n[bold]{escape(analysis)}[/bold]: {escape(line)}")
                screen.print(trust(results))
            indices = has_indices(results)
            if "mode" not in results.dims or indices:
                for line in filter(None, [headline(results), *remarks(results)]):
                    screen.print(escape(line))
            for table in tables(results, names)[: 2 if indices else 1]:
                screen.print(printed(table))
        if line := comparison(analysis, found):
            screen.print(escape(line))
    races = dict(comparisons(tree))
    for problem, race in races.items():
        _show_comparison(problem, race, screen)
    if not found and not races:
        screen.print("there are no results in it")


def _show_comparison(problem: str, race: xr.Dataset, screen: Console) -> None:
    """Print who is how far off, who wins, whose intervals fail and what pays."""
    screen.print(f"\n[bold]compare {escape(problem)}[/bold]: {escape(methods.label(race))}")
    for line in methods.facts(race):
        screen.print(escape(line))
    table = error_table(race, brief=True)
    screen.print(printed(table))
    for line in filter(None, [table.note, *methods.summary(race)]):
        screen.print(escape(line))


def screen_for(console: Console | None) -> Console:
    """Return the console, or standard output; in a pipe lines must not be folded."""
    return Console(highlight=False, soft_wrap=not Console().is_terminal) if console is None else console


def printed(table: Table) -> RichTable:
    """Return a table as it is printed."""
    made = RichTable(title=escape(table.title), title_justify="left", title_style="none", box=None)
    for i, column in enumerate(table.columns):
        heading = "\n".join(textwrap.wrap(column, 10, break_long_words=False))
        made.add_column(escape(heading), justify="left" if i == 0 else "right", no_wrap=True)
    for row in table.rows:
        made.add_row(*map(escape, row))
    return made
