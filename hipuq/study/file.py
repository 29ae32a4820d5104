"""Study files: read, and their form checked; an error is one line that names the place."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, ValidationError, field_validator, model_validator

from hipuq.errors import StoreError, StudyError, unknown_name
from hipuq.evidence import LITERATURE
from hipuq.store.reporting import check_plain_file, one_line
from hipuq.study.compare_tables import (
    CompareTable,
    ContenderTable,
    ExactTable,
    ProblemTable,
    ResultsTable,
)
from hipuq.study.tables import AnalysisTable, InputTable, ReportTable, Table, Words

MAXIMUM_BYTES = 1_000_000

MAXIMUM_DEPTH = 20
"""Most tables and lists within each other."""

COMPARE = "compare"
"""Group of the comparisons in the results; no analysis may have its name."""


class StudyFile(Table):
    """A whole study file.

    Attributes
    ----------
    title, description : str
        For people.
    seed : int
        Seed of all randomness.
    model : dict
        ``name``, ``preset`` and options of the model; needed where an analysis or a problem has none.
    inputs : dict
        Parameter -> its distribution.
    analysis : list
        The analyses, in order.
    compare : CompareTable or None
        Methods compared on problems with a known answer.
    report : ReportTable
        What the report tells first, and what it shows at nominal values.
    """

    title: Words = Field(min_length=1)
    description: str = ""
    seed: int = Field(default=0, ge=0, lt=2**63)
    model: dict[str, Any] = Field(default_factory=dict)
    inputs: dict[str, InputTable] = Field(default_factory=dict)
    analysis: list[AnalysisTable] = Field(default_factory=list)
    compare: CompareTable | None = None
    report: ReportTable = ReportTable()

    @field_validator("analysis", mode="before")
    @classmethod
    def _list(cls, value: Any) -> Any:
        if isinstance(value, dict):
            raise ValueError("write [[analysis]], with two brackets: there may be several")
        return value

    @model_validator(mode="after")
    def _whole(self) -> StudyFile:
        names = [entry.name for entry in self.analysis]
        if not names and self.compare is None:
            raise ValueError("there is nothing to run: give at least one [[analysis]], or [compare]")
        # Two names that differ in case alone would be one file on some systems.
        lower = [name.lower() for name in names]
        twice = [name for name in names if lower.count(name.lower()) > 1]
        if twice:
            raise ValueError(f"the name {min(twice)!r} is given to two analyses")
        if COMPARE in names:
            raise ValueError(f"no analysis can be called {COMPARE!r}: comparisons are kept under that name")
        if LITERATURE in names:
            raise ValueError(f"no analysis can be called {LITERATURE!r}: what is published is kept there")
        return self


def read_study_file(file: Path) -> tuple[str, StudyFile]:
    """Read a study file and check its form.

    Parameters
    ----------
    file : Path

    Returns
    -------
    text : str
        As it is in the file.
    table : StudyFile

    Raises
    ------
    StudyError
        One line that names the file and the key.
    """
    try:
        check_plain_file(file, MAXIMUM_BYTES)
        text = file.read_text(encoding="utf-8")
        data = tomllib.loads(text)
        _check_values(data)
    except StoreError as error:
        raise StudyError(f"cannot read the study: {error}; give a study folder or its study.toml") from error
    except OSError as error:
        raise StudyError(
            f"cannot read the study {file}: {error.strerror}; give a study folder or its study.toml"
        ) from error
    except (ValueError, RecursionError) as error:
        raise refused(f"{file} is not a TOML file: ", error) from error
    try:
        return text, StudyFile.model_validate(data)
    except ValidationError as error:
        raise refused(f"{file}, ", _first_line(error, data)) from error


def refused(place: str, why: object) -> StudyError:
    """Return the error of a study file that cannot be used: one line, whatever the file holds.

    Parameters
    ----------
    place : str
        The file and where in it, as the message begins.
    why : object
        What is wrong there.

    Returns
    -------
    StudyError
    """
    return StudyError(f"{place}{one_line(str(why))}")


def _check_values(value: Any, depth: int = 0) -> None:
    """Raise a ValueError for what TOML does not have, but tomllib takes, and for what nobody writes."""
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise ValueError(f"the integer {str(value)[:20]}... does not fit into 64 bits")
    if depth > MAXIMUM_DEPTH:
        raise ValueError(f"it has more than {MAXIMUM_DEPTH} tables and lists within each other")
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    for part in parts:
        _check_values(part, depth + 1)


_NAMED: dict[tuple[str, ...], tuple[str, type[BaseModel]]] = {
    ("analysis",): ("analysis", AnalysisTable),
    ("compare", "contenders"): ("contender", ContenderTable),
    ("compare", "problem"): ("problem", ProblemTable),
}
"""Place of tables that have names -> what one of them is called, and its form."""

_SINGLE: dict[str, type[BaseModel]] = {"compare": CompareTable, "report": ReportTable}

_REFERENCES: dict[str, type[BaseModel]] = {"exact": ExactTable, "results": ResultsTable}


def _first_line(error: ValidationError, data: dict[str, Any]) -> str:
    """Return the first problem as one line, with the near match of an unknown key."""
    # A key that is not known explains one that is missing.
    first = min(error.errors(), key=lambda one: one["type"] != "extra_forbidden")
    unknown = first["type"] == "extra_forbidden"
    where, table, place = _table_at(first["loc"], data)
    if len(place) > 1 and place[0] == "reference":
        # After it comes the form that it was taken for.
        table = _REFERENCES.get(place[1], table)
        where = f"reference of the {where}" if unknown else where
        place = ["reference", *place[2:]]
    if unknown:
        return str(unknown_name(f"key in the {where}", place[-1], table.model_fields))
    message = first["msg"].removeprefix("Value error, ")
    shown = "" if first["type"] in ("missing", "value_error") else f", not {str(first['input'])[:60]!r}"
    more = len(error.errors()) - 1
    rest = f" (and {more} more)" if more else ""
    key = ".".join(part for part in place if part != "[key]")
    before = ", ".join(part for part in (where if where != "study file" else "", key) if part)
    return f"{before}: {message}{shown}{rest}" if before else f"{message}{rest}"


def _table_at(loc: tuple[int | str, ...], data: dict[str, Any]) -> tuple[str, type[BaseModel], list[str]]:
    """Return the table that a place in the file belongs to, in words, its form, and the place in it."""
    place = [str(part) for part in loc]
    for path, (kind, table) in _NAMED.items():
        depth = len(path)
        if tuple(place[:depth]) == path and len(place) > depth:
            return f"{kind} {_name(data, loc[: depth + 1])}", table, place[depth + 1 :]
    if len(place) > 1 and place[0] in _SINGLE:
        return f"table {place[0]!r}", _SINGLE[place[0]], place[1:]
    return "study file", StudyFile, place


def _name(data: dict[str, Any], loc: tuple[int | str, ...]) -> str:
    """Return the name of a table as it is given, or what number it is."""
    last = loc[-1]
    if isinstance(last, str):
        return repr(last)
    entry: Any = data
    for part in loc:
        entry = entry[part]
    name = entry.get("name") if isinstance(entry, dict) else None
    return repr(name[:60]) if isinstance(name, str) and name else str(last + 1)
