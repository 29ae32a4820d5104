"""Runs that were done, one line each in a file, so that a comparison that was cut off goes on."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hipuq.errors import StoreError

Key = tuple[str, int, int]
"""Contender, budget, number of the replicate from 0."""


KINDS = ("definition", "labels", "run")
"""Kinds of lines; the first one is the definition."""


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
    estimate: Any
    low: Any
    high: Any

    def __post_init__(self) -> None:
        numbers = (self.budget, self.replicate, self.n, self.evaluations, self.seconds, self.model_seconds)
        shapes = {np.asarray(part, np.float64).shape for part in (self.estimate, self.low, self.high)}
        if not isinstance(self.contender, str) or len(shapes) != 1:
            raise TypeError("not a run")
        if not all(isinstance(one, (int, float)) for one in numbers):
            raise TypeError("not a run")

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
        if file is None:
            return made
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            # Written as a whole: a line that was cut off goes, a new contender is entered.
            part = file.with_name(file.name + ".part")
            with part.open("w", encoding="utf-8") as lines:
                lines.write(_line("definition", made.definition))
                if made.labels:
                    lines.write(_line("labels", made.labels))
                lines.writelines(_line("run", asdict(run)) for run in made.runs.values())
            part.replace(file)
        except OSError as error:
            raise StoreError(f"cannot write {file}: {error.strerror}") from error
        return made

    @classmethod
    def read(cls, file: Path | None, definition: Mapping[str, Any]) -> Record:
        """Return a record with the runs that a file holds, none if there is no file; nothing is written.

        Raises
        ------
        StoreError
            If it cannot be read, or its runs belong to something else.
        """
        made = cls(file, json.loads(json.dumps(definition)))
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
        self.runs[run.key] = run
        self._append("run", asdict(run))

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
        for number, line in enumerate(lines, 1):
            try:
                content = json.loads(line)
                ((kind, found),) = content.items()
                if (number == 1) != (kind == "definition") or kind not in KINDS:
                    raise ValueError(kind)
                if kind == "definition":
                    self._check(found, file)
                elif kind == "labels":
                    self.labels = found
                else:
                    run = Run(**found)
                    self.runs[run.key] = run
            except (ValueError, TypeError, AttributeError) as error:
                # What was being written when the process died; anything else is not ours.
                if number == len(lines) and number > 1 and not line.endswith("\n"):
                    continue
                raise StoreError(f"line {number} of {file} is not a run of a comparison") from error

    def _check(self, found: Mapping[str, Any], file: Path) -> None:
        """Raise a StoreError if runs of another definition are in the file."""
        rest = "do not resume, or take another folder"
        for key, value in self.definition.items():
            if key != "contenders" and found.get(key) != value:
                raise StoreError(
                    f"{file} has runs with {key} {_short(found.get(key))}, not {_short(value)}: {rest}"
                )
        for name, own in self.definition["contenders"].items():
            other = found.get("contenders", {}).get(name, own)
            differ = [key for key in {*own, *other} if own.get(key) != other.get(key)]
            if differ:
                key = min(differ)
                raise StoreError(
                    f"{file} has runs of {name!r} with {key} {_short(other.get(key))}, not "
                    f"{_short(own.get(key))}: {rest}"
                )
        # Runs of contenders that are left out now stay, with what they belong to.
        both = {**found.get("contenders", {}), **self.definition["contenders"]}
        self.definition = {**self.definition, "contenders": both}


def _short(value: Any) -> str:
    """Return a value as text that fits into a line."""
    text = repr(value)
    return text if len(text) <= 120 else text[:117] + "..."


def _line(kind: str, content: Any) -> str:
    return json.dumps({kind: content}) + "\n"
