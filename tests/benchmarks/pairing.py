"""A subject and its reference measured in turn in one run, and what a row of the table needs of it."""

from __future__ import annotations

import resource
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any, TypeVar

S = TypeVar("S")
R = TypeVar("R")


@dataclass
class Laps:
    """Wall and CPU time of every round [s], for one unit of the work."""

    seconds: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)

    def take(self, work: Callable[[], object], units: float) -> None:
        """Run `work`, which does so many units, once."""
        began, cpu = time.perf_counter(), _cpu()
        result = work()
        self.seconds.append((time.perf_counter() - began) / units)
        self.cpu.append((_cpu() - cpu) / units)
        # To free what came of it is no part of the work.
        del result


def _cpu() -> float:
    """Return the CPU time of this process and of those that it started and that have ended [s]."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


@dataclass(frozen=True)
class Row:
    """One benchmark: what is measured, in which unit, against what."""

    name: str
    unit: str
    reference: str
    own: Laps
    other: Laps

    def ratios(self, of: str) -> tuple[float, float, float]:
        """Return how many times as fast it is as its reference: median, least, most over the rounds."""
        pairs = zip(getattr(self.other, of), getattr(self.own, of), strict=True)
        ratios = [other / own for other, own in pairs]
        return statistics.median(ratios), min(ratios), max(ratios)


class Against:
    """The fixture `against`: run subject and reference in turn, note what they take."""

    def __init__(self, benchmark: Any, rounds: int, rows: list[Row]) -> None:
        self.benchmark, self.rounds, self.rows = benchmark, rounds, rows

    def __call__(
        self,
        name: str,
        subject: Callable[[], S],
        reference: Callable[[], R],
        *,
        against: str,
        unit: str = "run",
        units: int = 1,
        part: float = 1.0,
        check: Callable[[S, R], object] | None = None,
    ) -> None:
        """Measure.

        Parameters
        ----------
        name, against : str
            Subject and reference in words.
        subject, reference : callable
            They do the same work, without arguments.
        unit : str
            What the times are for, such as ``"sample"``.
        units : int
            How many of them a call of the subject does.
        part : float
            Share of them that the reference does; its times are extrapolated.
        check : callable, optional
            Called with both results before anything is measured: an AssertionError if they disagree.
        """
        # A first call of both, not measured: it fills caches.
        found, expected = subject(), reference()
        if check is not None:
            check(found, expected)
        del found, expected
        row = Row(name, unit, against, Laps(), Laps())
        self.benchmark.pedantic(
            lambda: row.own.take(subject, units),
            setup=lambda: row.other.take(reference, units * part),
            rounds=self.rounds,
        )
        self.benchmark.extra_info |= asdict(row)
        self.rows.append(row)
