"""Runs that were done, one line each in a file, so that a comparison that was cut off goes on."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from hipuq.comparison.lines import checked_contenders, checked_labels, checked_run, read_line, short
from hipuq.errors import StoreError

Key = tuple[str, int, int]
"""Contender, budget, number of the replicate from 0."""


REST = "do not resume, or take another folder"


@dataclass(frozen=True)
class Run:
    """What one run of a contender gave.

    Attributes
    ----------
    contender : str
    budget, replicate : int
        The replicate from 0.
    n, evaluations : int
        Size of the design, model runs.
    seconds, model_seconds : float
        Of the run, and of the model's evaluations in it [s].
    jobs : int
        Threads it was timed with.
    estimate, low, high : float or nested list of float
        NaN where there is none.
    """

    contender: str
    budget: int
    replicate: int
    n: int
    evaluations: int
    seconds: float
    model_seconds: float
    jobs: int
    estimate: Any
    low: Any
    high: Any

    @property
    def key(self) -> Key:
        """What tells it from other runs."""
        return self.contender, self.budget, self.replicate


@dataclass
class Record:
    """Runs and how their numbers are labelled, in memory and, where there is a file, on disk too.

    Attributes
    ----------
    file : Path or None
    definition : mapping
        What the runs belong to, JSON-able; ``"contenders"`` maps names to their own definitions.
    runs : dict
    labels : dict
        Dims, coords and attributes of what is compared; empty before the first run.
    """

    file: Path | None
    definition: Mapping[str, Any]
    runs: dict[Key, Run] = field(default_factory=dict)
    labels: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def opened(cls, file: Path | None, definition: Mapping[str, Any], resume: bool) -> Record:
        """Return a record that is ready for more runs.

        Parameters
        ----------
        file : Path or None
            Made anew; with `resume` the runs in it are kept.
        definition : mapping
        resume : bool

        Raises
        ------
        StoreError
            If the file cannot be read or written, or its runs belong to something else.
        """
        made = cls.read(file, definition) if resume else cls(file, json.loads(json.dumps(definition)))
        made._write()
        return made

    @classmethod
    def read(cls, file: Path | None, definition: Mapping[str, Any] | None) -> Record:
        """Return a record with the runs that a file holds, none if there is no file; nothing is written.

        Parameters
        ----------
        file : Path or None
        definition : mapping or None
            None takes that of the file.

        Raises
        ------
        StoreError
            If it cannot be read, or its runs belong to something else.
        """
        made = cls(file, json.loads(json.dumps(definition or {})))
        try:
            if file is not None and file.exists():
                made._read(file)
        except StoreError:
            raise
        except (OSError, UnicodeDecodeError) as error:
            raise StoreError(f"cannot read the runs in {file}: {error}") from error
        return made

    def label(self, labels: Mapping[str, Any]) -> None:
        """Keep how numbers are labelled."""
        self.labels = dict(labels)
        self._append("labels", self.labels)

    def add(self, run: Run) -> None:
        """Keep a run."""
        again = run.key in self.runs
        self.runs[run.key] = run
        if again:  # in another size: one of them stays
            self._write()
        else:
            self._append("run", asdict(run))

    def _write(self) -> None:
        """Write the file as a whole: a line that was cut off goes, a new contender is entered."""
        if self.file is None:
            return
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            part = self.file.with_name(self.file.name + ".part")
            with part.open("w", encoding="utf-8") as lines:
                lines.write(_line("definition", self.definition))
                if self.labels:
                    lines.write(_line("labels", self.labels))
                lines.writelines(_line("run", asdict(run)) for run in self.runs.values())
            part.replace(self.file)
        except OSError as error:
            raise StoreError(f"cannot write {self.file}: {error.strerror}") from error

    def _append(self, kind: str, content: Mapping[str, Any]) -> None:
        if self.file is None:
            return
        try:
            with self.file.open("a", encoding="utf-8") as lines:
                lines.write(_line(kind, content))
        except OSError as error:
            raise StoreError(f"cannot write {self.file}: {error.strerror}") from error

    def _read(self, file: Path) -> None:
        lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
        known: set[str] = set()
        for number, line in enumerate(lines, 1):
            try:
                kind, found = read_line(line)
                if (number == 1) != (kind == "definition"):
                    raise ValueError("the definition is the first line, and no other")
                if kind == "definition":
                    known = self._check(found, file)
                elif kind == "labels":
                    self._take_labels(found, known)
                else:
                    self._take(found, known)
            except json.JSONDecodeError as error:
                # What was being written when the process died; anything else is not ours.
                if number == len(lines) and number > 1 and not line.endswith("\n"):
                    continue
                raise _not_ours(number, file, "it is not JSON") from error
            except RecursionError as error:
                raise _not_ours(number, file, "it is too deep") from error
            except (ValueError, TypeError, OverflowError) as error:
                raise _not_ours(number, file, error) from error

    def _take(self, found: Any, known: set[str]) -> None:
        """Enter a run from the file."""
        if not self.labels:
            raise ValueError("no labels come before it")
        shape = tuple(len(self.labels["coords"][dim]) for dim in self.labels["dims"])
        run = Run(**checked_run(found, [one.name for one in fields(Run)], shape, known))
        before = self.runs.setdefault(run.key, run)
        # As text: NaN is not equal to itself.
        if before is not run and _line("run", asdict(before)) != _line("run", asdict(run)):
            raise ValueError("a line before it says otherwise of the same run")

    def _take_labels(self, found: Any, known: set[str]) -> None:
        """Enter labels from the file."""
        labels = checked_labels(found, known)
        if self.labels and self.labels != labels:
            raise ValueError("a line before it has other labels")
        self.labels = labels

    def _check(self, found: Any, file: Path) -> set[str]:
        """Raise a StoreError if runs of another definition are in the file; return the file's contenders."""
        theirs = checked_contenders(found)
        if not self.definition:
            self.definition = found
        for key, value in self.definition.items():
            if key != "contenders" and found.get(key) != value:
                raise StoreError(
                    f"{file} has runs with {key} {short(found.get(key))}, not {short(value)}: {REST}"
                )
        for name, own in self.definition["contenders"].items():
            other = theirs.get(name, own)
            differ = [key for key in {*own, *other} if own.get(key) != other.get(key)]
            if differ:
                key = min(differ)
                raise StoreError(
                    f"{file} has runs of {name!r} with {key} {short(other.get(key))}, not "
                    f"{short(own.get(key))}: {REST}"
                )
        # Runs of contenders that are left out now stay, with what they belong to.
        self.definition = {**self.definition, "contenders": {**theirs, **self.definition["contenders"]}}
        return set(theirs)


def _not_ours(number: int, file: Path, why: object) -> StoreError:
    return StoreError(f"line {number} of {file} is not of a comparison, {why}: {REST}")


def _line(kind: str, content: Any) -> str:
    return json.dumps({kind: content}) + "\n"
