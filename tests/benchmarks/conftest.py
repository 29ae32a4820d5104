"""Settings of the benchmarks: `make bench` runs them, with pytest.ini beside this, `make test` does not.

Every benchmark runs beside a reference, in turn within one run, because what else a machine does changes
from minute to minute; ratios are those within a round.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import table
from pairing import Against, Row

ROWS = pytest.StashKey[list[Row]]()
PEAKS = pytest.StashKey[list[tuple[str, int, float, float]]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("benchmarks of hipuq")
    group.addoption("--samples", type=int, default=100_000, help="samples of the evaluations")
    group.addoption("--rounds", type=int, default=5, help="rounds of every benchmark")
    group.addoption("--table", type=Path, help="page into which the table goes, such as docs/speed.md")


def pytest_configure(config: pytest.Config) -> None:
    config.stash[ROWS], config.stash[PEAKS] = [], []


@pytest.fixture
def against(benchmark: Any, request: pytest.FixtureRequest) -> Against:
    """Measure a subject against a reference, see `Against`."""
    return Against(benchmark, request.config.getoption("rounds"), request.config.stash[ROWS])


@pytest.fixture
def peaks(request: pytest.FixtureRequest) -> list[tuple[str, int, float, float]]:
    """Return the list of peaks of memory, to add to."""
    return request.config.stash[PEAKS]


@pytest.fixture
def samples(request: pytest.FixtureRequest) -> int:
    """Return the number of samples of the evaluations."""
    return int(request.config.getoption("samples"))


@pytest.fixture
def one_thread() -> Iterator[None]:
    """Hold BLAS to one thread."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        yield


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    rows, peaks = config.stash[ROWS], config.stash[PEAKS]
    if not (rows or peaks):
        return
    command = shlex.join(["python", "-m", "pytest", *config.invocation_params.args])
    text = table.markdown(rows, peaks, config.getoption("rounds"), command)
    terminalreporter.section("against references")
    terminalreporter.write_line(text)
    if page := config.getoption("table"):
        table.put(page, text)
