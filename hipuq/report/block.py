"""A block of the first part of a report: what is said of one question, on the page and on a screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from hipuq.report.table import Table


@dataclass(frozen=True)
class Block:
    """What is said of one question.

    Attributes
    ----------
    key : str
        Its anchor on the page, and what its pictures name.
    title : str
    lines : list of str
        Sentences; the full stop at their end may be missing.
    tables : list of Table
    text : list of Table
        Tables of which the cells are sentences.
    items : list of str
        Sentences as a list.
    brief : sequence of str or Table
        The same where there is little room; nothing of a block that is not for there.
    """

    key: str
    title: str
    lines: list[str] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    text: list[Table] = field(default_factory=list)
    items: list[str] = field(default_factory=list)
    brief: Sequence[str | Table] = field(default_factory=list)


def turned(table: Table, title: str | None = None) -> Table:
    """Return a table with rows and columns exchanged, for a screen; its first column becomes the head."""
    columns = [table.columns[0], *(row[0] for row in table.rows)]
    rows = [[table.columns[i], *(row[i] for row in table.rows)] for i in range(1, len(table.columns))]
    return Table(table.title if title is None else title, columns, rows)
