"""Tables as they are printed on a screen: as many columns as it has room for, no word broken."""

from __future__ import annotations

import textwrap
from typing import Literal

import numpy as np
from rich.markup import escape
from rich.table import Table as RichTable

from hipuq.report.table import Table

GAP = 2
"""Blanks that stand around a cell."""

HEADING = 10
"""Width from which on a heading goes on in the next line."""


def printed(table: Table, width: int) -> RichTable:
    """Return a table as it is printed.

    Parameters
    ----------
    table : Table
    width : int
        Characters in a line. Columns that may go do so where there is no room for all; the others are
        folded between words.
    """
    table = narrowed(table, width)
    title = escape(table.title) if table.title else None
    made = RichTable(title=title, title_justify="left", title_style="none", box=None)
    for i, (column, size) in enumerate(zip(table.columns, _widths(table, width), strict=True)):
        justify: Literal["left", "right"] = "left" if i == 0 else "right"
        made.add_column(escape(_heading(column)), justify=justify, overflow="fold", width=size)
    for row in table.rows:
        made.add_row(*map(escape, row))
    return made


def narrowed(table: Table, width: int) -> Table:
    """Return a table with as many columns as a line has room for: those to keep, and others evenly."""
    if not table.keep:
        return table
    needed = [max(sizes) + GAP for sizes in _sizes(table)]
    whole = len(table.columns)
    for size in range(whole, len(table.keep) - 1, -1):
        kept = {*table.keep}
        for place in np.linspace(0, whole - 1, size).round().astype(int).tolist():
            if len(kept) < size:
                kept.add(place)
        if sum(needed[i] for i in kept) <= width or size == len(table.keep):
            chosen = sorted(kept)
            rows = [[row[i] for i in chosen] for row in table.rows]
            return Table(table.title, [table.columns[i] for i in chosen], rows, table.note)
    return table


def _heading(column: str) -> str:
    return "\n".join(textwrap.wrap(column, HEADING, break_long_words=False))


def _texts(table: Table) -> list[list[str]]:
    """Return heading and cells of each column."""
    return [[_heading(head), *(row[i] for row in table.rows)] for i, head in enumerate(table.columns)]


def _sizes(table: Table) -> list[list[int]]:
    """Return the widths of heading and cells of each column."""
    return [[max(map(len, text.splitlines()), default=0) for text in column] for column in _texts(table)]


def _widths(table: Table, width: int) -> list[int]:
    """Return the width of each column: the widest are made narrower as far as their words allow."""
    made = [max(sizes) for sizes in _sizes(table)]
    least = [
        max((len(word) for text in column for word in text.split()), default=0) for column in _texts(table)
    ]
    while sum(made) + GAP * len(made) > width:
        free = [i for i in range(len(made)) if made[i] > least[i]]
        if not free:
            break
        made[max(free, key=lambda i: made[i])] -= 1
    return made
