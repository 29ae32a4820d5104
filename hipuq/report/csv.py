"""Tables as CSV (RFC 4180) to compute with: limits in columns of their own, plain numbers."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from decimal import Decimal

from hipuq.report.table import MISSING, NEVER, Table

WORDS = ("none", "the whole range", NEVER, MISSING, "-")
"""Words that stand for a number."""

NUMBER = r"[-+]?(?:\d{1,3}(?:,\d{3})+|\d+)(?:\.\d+)?(?:[eE][-+]?\d+)?"

VALUE = rf"{NUMBER}(?: ?%)?|{'|'.join(WORDS)}"

PLAIN = re.compile(VALUE)

BETWEEN = re.compile(rf"(?:bounds )?(?P<low>{VALUE}) to (?P<high>{VALUE})")

LIMITED = re.compile(rf"(?P<value>{VALUE}) \(?(?:bounds )?(?P<low>{VALUE}) to (?P<high>{VALUE})\)?")

MARK = re.compile(rf"^({NUMBER}) \*(?= |$)")
"""A number with the mark of the best, which its value tells too."""

ENDS = ("low", "high")


def csv_text(table: Table) -> str:
    """Return a table as CSV.

    Parameters
    ----------
    table : Table

    Returns
    -------
    str
        A column of cells such as ``0.69 (0.68 to 0.70)``, or with the limits in a line below, becomes three,
        one of cells such as ``0.1 to 0.2`` two, ``8,192`` becomes ``8192`` and ``5 %`` becomes ``0.05``;
        words stay, the mark of the best goes.
    """
    columns = []
    for i, heading in enumerate(table.columns):
        columns += _split(heading, [MARK.sub(r"\1", " ".join(row[i].split())) for row in table.rows])
    stream = io.StringIO(newline="")
    csv.writer(stream).writerows(zip(*columns, strict=True))
    return stream.getvalue()


def _split(heading: str, cells: Sequence[str]) -> list[list[str]]:
    """Return the columns of a column: its heading and cells, and those of its limits."""
    heading = " ".join(heading.split())
    told = [cell for cell in cells if cell]
    if _all(LIMITED, told):
        parts = [_parts(LIMITED, cell, ("value", *ENDS)) for cell in cells]
        heads = [heading, *(f"{heading} {end}" for end in ENDS)]
    elif _all(BETWEEN, told):
        parts = [_parts(BETWEEN, cell, ENDS) for cell in cells]
        heads = [f"{heading} {end}" for end in ENDS]
    else:
        return [[heading, *map(_plain, cells)]]
    return [list(column) for column in zip(heads, *parts, strict=True)]


def _all(form: re.Pattern[str], cells: Sequence[str]) -> bool:
    """Say whether cells have a form, but for single values."""
    fits = [bool(form.fullmatch(cell)) for cell in cells]
    return any(fits) and all(
        fit or PLAIN.fullmatch(cell) is not None for fit, cell in zip(fits, cells, strict=True)
    )


def _parts(form: re.Pattern[str], cell: str, names: Sequence[str]) -> list[str]:
    """Return the parts of a cell; a single value is its own, or both ends of a range."""
    found = form.fullmatch(cell)
    if found is None:
        return [_plain(cell) if len(names) == len(ENDS) or not i else "" for i in range(len(names))]
    # A sign of per cent after the last number is that of all.
    share = "%" in cell
    return [_plain(found[name] + (" %" if share and "%" not in found[name] else "")) for name in names]


def _plain(cell: str) -> str:
    """Return a number without separators, per cent as a share; other cells as they are."""
    text = cell.removesuffix("%").rstrip()
    if not re.fullmatch(NUMBER, text):
        return cell
    text = text.replace(",", "")
    return f"{Decimal(text) / 100:f}" if cell.endswith("%") else text
