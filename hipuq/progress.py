"""Progress of a long run: a bar on a terminal, elsewhere a line in the log every minute."""

from __future__ import annotations

import itertools
import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

LOGGER = logging.getLogger("hipuq")

LOG_EVERY = 60.0
"""Seconds from one line in the log to the next."""

DURATIONS = (("d", 86400), ("h", 3600), ("min", 60), ("s", 1))
"""Unit -> seconds, the longest first."""

Clock = Callable[[], float]


class Advance(Protocol):
    """Counts what is done."""

    def __call__(self, count: int, **tally: int) -> None:
        """Count `count` more as done, and what they were: ``advance(64, failed=3, undecided=1)``."""


@contextmanager
def progress_bar(
    what: str, size: int, wanted: bool | None, *, done: int = 0, clock: Clock = time.monotonic
) -> Iterator[Advance]:
    """Give a function that shows how far a run is.

    Parameters
    ----------
    what : str
        What is counted.
    size : int
        How many there are.
    wanted : bool or None
        True for a bar, False for nothing; None gives a bar on a terminal, and elsewhere a line a minute to
        the logger ``hipuq``.
    done : int, default 0
        How many were there before, in a run that goes on; they do not count for the rate.
    clock : callable, optional
        Gives the time [s].

    Yields
    ------
    Advance
        ``advance(count, **tally)``; the tallies are added up, and shown where they are not 0.
    """
    state = Progress(what, size, done, clock)
    if wanted is False:
        yield state.advance
    elif wanted or sys.stderr.isatty():
        with _bar(state) as advance:
            yield advance
    else:
        yield _logged(state)


class Progress:
    """How far a run is, in words.

    Parameters
    ----------
    what : str
        What is counted.
    size : int
        How many there are.
    done : int
        How many were there before.
    clock : callable
        Gives the time [s].
    """

    def __init__(self, what: str, size: int, done: int, clock: Clock) -> None:
        self.what = what
        self.size = size
        self.count = done
        self.tally: dict[str, int] = {}
        self._before = done
        self._clock = clock
        self._started = self._last = clock()

    def advance(self, count: int, **tally: int) -> None:
        """Count `count` more as done, and add up the tallies."""
        if count:
            self.count += count
            self._last = self._clock()
        for name, number in tally.items():
            # Not in place: the thread that draws a bar may be reading it.
            self.tally = {**self.tally, name: self.tally.get(name, 0) + number}

    def words(self, percent: bool = False) -> str:
        """Return a line such as ``1,200 of 10,000, 31.2/s, 4 min 41 s remaining, 3 failed``."""
        share = f" ({1000 * self.count // self.size / 10:.1f} %)" if percent and self.size else ""
        parts = [f"{self.count:,} of {self.size:,}{share}"]
        taken, seconds = self.count - self._before, self._last - self._started
        if taken > 0 and seconds > 0:
            # The rate is known from the last advance; since then the remaining time runs down.
            left = (self.size - self.count) * seconds / taken - (self._clock() - self._last)
            parts += [in_words(taken / seconds), f"{duration(max(left, 0.0))} remaining"]
        return ", ".join([*parts, *(f"{number:,} {name}" for name, number in self.tally.items() if number)])

    def __str__(self) -> str:
        return self.words()


@contextmanager
def _bar(state: Progress) -> Iterator[Advance]:
    """Give a function that advances a bar, which is drawn anew some times a second."""
    from rich import progress
    from rich.console import Console
    from rich.table import Column

    # Where the terminal is narrow the bar gets short first, then the words take a second line.
    columns = (
        progress.TextColumn("{task.description}", markup=False),
        progress.BarColumn(bar_width=None, table_column=Column(ratio=1)),
        progress.TextColumn("{task.fields[state]}", markup=False, table_column=Column()),
    )
    with progress.Progress(*columns, console=Console(stderr=True), transient=True, expand=True) as bar:
        task = bar.add_task(state.what, total=state.size, completed=state.count, state=state)

        def advance(count: int, **tally: int) -> None:
            state.advance(count, **tally)
            bar.update(task, completed=state.count)

        yield advance


def _logged(state: Progress) -> Advance:
    """Return a function that advances, and writes a line to the log if the last one is a minute old."""
    clock = state._clock
    next_line = clock() + LOG_EVERY

    def advance(count: int, **tally: int) -> None:
        nonlocal next_line
        state.advance(count, **tally)
        now = clock()
        if now >= next_line:
            next_line = now + LOG_EVERY
            LOGGER.info("%s: %s", state.what, state.words(percent=True))

    return advance


def in_words(rate: float) -> str:
    """Return a rate [1/s] in the unit in which it is at least 1: ``31,200/s``, ``2.5/min``, ``0.2/h``."""
    for unit, seconds in (("s", 1), ("min", 60), ("h", 3600)):
        if rate * seconds >= 1 or unit == "h":
            break
    value = float(f"{rate * seconds:.3g}")
    return f"{value:,.0f}/{unit}" if value >= 100 else f"{value:g}/{unit}"


def duration(seconds: float) -> str:
    """Return a time [s] in its two largest units: ``41 s``, ``4 min 41 s``, ``3 h 5 min``, ``2 d 0 h``."""
    left = round(seconds)
    for (unit, size), (smaller, part) in itertools.pairwise(DURATIONS):
        if left >= size:
            return f"{left // size} {unit} {left % size // part} {smaller}"
    return f"{left} s"


class _Stderr(logging.Handler):
    """Writes to what is the standard error at the time."""

    def emit(self, record: logging.LogRecord) -> None:
        print(self.format(record), file=sys.stderr, flush=True)


def log_to_stderr() -> None:
    """Write what the logger ``hipuq`` says to the standard error, with the time: as the command line does.

    Called again it changes nothing.
    """
    if any(isinstance(handler, _Stderr) for handler in LOGGER.handlers):
        return
    handler = _Stderr()
    handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
    LOGGER.addHandler(handler)
    LOGGER.setLevel(logging.INFO)
