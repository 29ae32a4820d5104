"""Results as one screen of text, and the tables of an analysis in full."""

from __future__ import annotations

import xarray as xr
from rich.console import Console
from rich.markup import escape

from hipuq import schema
from hipuq.errors import check_name
from hipuq.friction import OF_ANY_MODE
from hipuq.report import comparison as methods
from hipuq.report.comparison_error import error_table
from hipuq.report.damping import damping_words, label
from hipuq.report.first_part import blocks
from hipuq.report.over_damping import cell, ends
from hipuq.report.partners import comparison
from hipuq.report.printing import printed
from hipuq.report.reading import DAMPING, Reading, probability_name
from hipuq.report.sensitivity import has_indices, remarks
from hipuq.report.summary import comparisons, estimates, headline, integrated, tables, trust
from hipuq.report.sweeps import assumed_words, sweep_table
from hipuq.report.table import listed

UNFOLDED = 10_000
"""Width of a pipe: what is read there line by line must neither be folded nor cut off."""


def show_results(
    tree: xr.DataTree,
    console: Console | None = None,
    *,
    analysis: str | None = None,
    everything: bool = False,
) -> None:
    """Print the results of a study: on one screen what a report begins with, and a line for each analysis.

    Parameters
    ----------
    tree : DataTree
        As from `hipuq.load_results`.
    console : rich Console, optional
        Where to print; by default standard output.
    analysis : str, optional
        The analysis to print in full, in place of the screen.
    everything : bool, default False
        Whether to print all analyses in full after the screen.

    Raises
    ------
    UnknownNameError
        If there is no such analysis.
    """
    screen = screen_for(console)
    reading = Reading(tree)
    if analysis is not None:
        _show_analysis(reading, check_name("analysis", analysis, reading.found), screen)
        return
    screen.print(f"[bold]{escape(str(tree.attrs.get('title', 'hipuq results')))}[/bold]")
    for block in blocks(reading):
        for i, part in enumerate(block.brief):
            if i == 0 and block.key != "squeak":
                screen.print(f"[bold]{escape(block.title)}[/bold]")
            if isinstance(part, str):
                screen.print(
                    f"[bold]{escape(part)}[/bold]" if i == 0 and block.key == "squeak" else escape(part)
                )
            else:
                screen.print(printed(part, screen.width))
    if not everything:
        _lines(reading, screen)
    for name in reading.found if everything else ():
        _show_analysis(reading, name, screen)
    races = dict(comparisons(tree))
    for problem, race in races.items():
        _show_comparison(problem, race, screen)
    if not reading.found and not races:
        screen.print("there are no results in it")


def _lines(reading: Reading, screen: Console) -> None:
    """Print a line for each analysis: what it is, what it assumes, what comes out."""
    # The probability of instability where there is one, else the first outcome.
    shown = [
        (name, found if (own := reading.squeak(name)) is None else (str(own.attrs["of"]), own))
        for name, groups in reading.found.items()
        if (found := next(estimates(groups), None))
    ]
    if shown:
        screen.print("[bold]Analyses[/bold] (in full with --analysis NAME, or --all)")
    # What is alike in all is told above.
    models = len({_bare(results) for _, (_, results) in shown}) > 1
    for name, (of, results) in shown:
        method = "exact" if schema.is_exact(results) else str(results.attrs["method"])
        # The label of the model says it too.
        told = [f"{method}, friction integrated" if integrated(results) and not models else method]
        over = [parameter.replace("_", " ") for parameter in reading.assumed[name]]
        whole = reading.swept_over(DAMPING).get(name) if reading.apart(name) else None
        if reading.at_one(name):
            told += [label(results) if models else "", of]
        elif whole is not None:
            told += [label(whole) if models else damping_words(whole), f"P {ends(whole)}"]
        else:
            told += [label(results) if models else damping_words(results), _short(results, of)]
        told += [f"swept over {listed(over)}"] if over else []
        screen.print(escape(f"{name}: {', '.join(filter(None, told))}"))


def _bare(results: xr.Dataset) -> str:
    """Return the model without what is integrated."""
    return str(results.attrs["model"]).removesuffix(", friction integrated")


def _short(results: xr.Dataset, of: str) -> str:
    """Return the result of an analysis in a few words."""
    if name := probability_name(results):
        return f"{'P' if of in OF_ANY_MODE else f'P of {of}'} {cell(results, name)}"
    if has_indices(results):
        return f"indices of {of}"
    return of


def _show_analysis(reading: Reading, analysis: str, screen: Console) -> None:
    """Print headlines, remarks and the first tables of an analysis."""
    for i, (of, results) in enumerate(estimates(reading.found[analysis])):
        if i == 0:
            exact = schema.is_exact(results)
            line = f"{label(results)}, {'exact' if exact else results.attrs['method']}"
            line += "" if exact else f", seed {results.attrs['seed']}"
            screen.print(f"\n[bold]{escape(analysis)}[/bold]: {escape(line)}")
            screen.print(trust(results))
            if words := assumed_words(reading, analysis):
                screen.print(escape(words))
        if (over := sweep_table(reading, analysis, of)) is not None:
            screen.print(printed(over, screen.width))
        indices = has_indices(results)
        if "mode" not in results.dims or indices:
            for line in filter(None, [headline(results), *remarks(results)]):
                screen.print(escape(line))
        for table in tables(results, reading.mode_names)[: 2 if indices else 1]:
            screen.print(printed(table, screen.width))
    if line := comparison(analysis, reading.found):
        screen.print(escape(line))


def _show_comparison(problem: str, race: xr.Dataset, screen: Console) -> None:
    """Print who is how far off, who wins, whose intervals fail and what pays."""
    screen.print(f"\n[bold]compare {escape(problem)}[/bold]: {escape(methods.label(race))}")
    for line in methods.facts(race):
        screen.print(escape(line))
    table = error_table(race, brief=True)
    screen.print(printed(table, screen.width))
    for line in filter(None, [table.note, *methods.summary(race)]):
        screen.print(escape(line))


def screen_for(console: Console | None) -> Console:
    """Return the console, or standard output; in a pipe nothing is folded."""
    if console is not None:
        return console
    piped = not Console().is_terminal
    return Console(highlight=False, soft_wrap=piped, width=UNFOLDED if piped else None)
