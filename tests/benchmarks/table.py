"""The table of the benchmarks in Markdown, with the machine that they ran on."""

from __future__ import annotations

import os
import platform
import statistics
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np
from pairing import Laps, Row

from hipuq.compiled.binding import kernel

BEGIN, END = "<!-- measured -->", "<!-- measured: end -->"
"""Lines of a page between which the table stands."""

PACKAGES = ("hipuq", "numpy", "scipy", "xarray", "chaospy", "numpoly", "SALib")


def machine() -> str:
    """Return processor, cores and operating system."""
    lines = Path("/proc/cpuinfo")
    names = [line.partition(":")[2].strip() for line in _lines(lines) if line.startswith("model name")]
    name = names[0] if names else platform.processor() or platform.machine()
    return f"{name}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}"


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines() if path.exists() else []


def versions() -> str:
    """Return the versions of Python, of the packages and of NumPy's BLAS, and which kernel runs."""
    compiled = kernel()
    own = "LAPACK in place of the kernel" if compiled is None else f"kernel for {compiled.name.decode()}"
    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    named = [f"{name} {version(name)}" for name in PACKAGES]
    return ", ".join(
        [f"Python {platform.python_version()}", *named, f"{blas['name']} {blas['version']}", own]
    )


def markdown(rows: list[Row], peaks: list[tuple[str, int, float, float]], rounds: int, command: str) -> str:
    """Return what was measured.

    Parameters
    ----------
    rows : list of Row
    peaks : list of tuple
        Name, number of samples, and memory of subject and reference [MiB].
    rounds : int
    command : str
        What repeats it.

    Returns
    -------
    str
    """
    day = datetime.now(UTC).date().isoformat()
    text = [f"{day}, {machine()}.", f"{versions()}.", f"Rounds: {rounds}. Command: `{command}`", ""]
    head = ["what", "for one", "time", "CPU time", "reference", "its time", "its CPU time"]
    body = [
        [row.name, row.unit, *_both(row.own), row.reference, *_both(row.other), *_ratios(row)] for row in rows
    ]
    text += _table([*head, "times as fast", "in CPU time"], body)
    if peaks:
        text.append("")
        found = [
            [name, f"{n:,}", f"{own:.0f} MiB", f"{other:.0f} MiB", f"{other / own:.2f}"]
            for name, n, own, other in peaks
        ]
        text += _table(["what", "samples", "memory at most", "of the reference", "reference / own"], found)
    return "\n".join(text) + "\n"


def _table(head: list[str], body: list[list[str]]) -> list[str]:
    return ["| " + " | ".join(cells) + " |" for cells in (head, ["---"] * len(head), *body)]


def _both(laps: Laps) -> list[str]:
    return [_time(statistics.median(values)) for values in (laps.seconds, laps.cpu)]


def _time(seconds: float) -> str:
    """Return a time with three digits in the unit that suits it."""
    unit, factor = ("s", 1.0) if seconds >= 1 else ("ms", 1e3) if seconds >= 1e-3 else ("µs", 1e6)
    return f"{seconds * factor:.3g} {unit}"


def _ratios(row: Row) -> list[str]:
    """Return how many times as fast: the median and, over the rounds, the least and the most."""
    return ["{:.3g} ({:.3g} to {:.3g})".format(*row.ratios(of)) for of in ("seconds", "cpu")]


def put(page: Path, text: str) -> None:
    """Put the table into a page, between the lines that mark its place.

    Raises
    ------
    ValueError
        If the page does not have both lines.
    """
    whole = page.read_text(encoding="utf-8")
    before, begin, rest = whole.partition(BEGIN + "\n")
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"{page} lacks the lines {BEGIN} and {END}: the table goes between them")
    page.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")
