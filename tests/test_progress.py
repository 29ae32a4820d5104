"""Progress of a run: a bar on a terminal, a log line a minute elsewhere, nothing where nobody wants it."""

import io
import logging
import sys
import time

import pytest

from hipuq import progress
from hipuq.progress import duration, in_words, log_to_stderr, progress_bar


class Clock:
    """A clock that is set by hand."""

    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def terminal(monkeypatch):
    """A function that makes the standard error a terminal; pytest would undo that before the test begins."""

    def made(columns=120):
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setenv("COLUMNS", str(columns))
        monkeypatch.delenv("NO_COLOR", raising=False)
        monkeypatch.setattr(sys, "stderr", Terminal())
        return sys.stderr

    return made


@pytest.fixture
def lines(caplog):
    """A function that gives the lines in the log so far."""
    caplog.set_level(logging.INFO, logger="hipuq")
    return lambda: caplog.messages


@pytest.fixture(autouse=True)
def logger():
    """The logger as a library finds it; the command line may have been called in this process before."""
    handlers, level = list(progress.LOGGER.handlers), progress.LOGGER.level
    progress.LOGGER.handlers.clear()
    progress.LOGGER.setLevel(logging.NOTSET)
    yield progress.LOGGER
    progress.LOGGER.handlers[:] = handlers
    progress.LOGGER.setLevel(level)


def test_bar(terminal, clock):
    shown = terminal()
    with progress_bar("samples", 10_000_000, None, clock=clock) as advance:
        clock.now += 40.0
        advance(1_234_000, failed=2, undecided=1)
        clock.now += 0.5
        advance(567, failed=1, strange=0)
    text = shown.getvalue()
    assert "samples" in text and "━" in text
    assert "1,234,567 of 10,000,000, 30,500/s, 4 min 48 s remaining, 3 failed, 1 undecided" in text
    assert "strange" not in text
    assert text.endswith("\x1b[2K")  # and is gone at the end


@pytest.mark.parametrize("width", [40, 80])
def test_narrow_terminal_loses_no_word(terminal, clock, width):
    shown = terminal(width)
    with progress_bar("samples", 10_000_000, None, clock=clock) as advance:
        clock.now += 40.0
        advance(1_234_567, failed=3, undecided=1)
    words = shown.getvalue().split()
    for part in ("1,234,567 of 10,000,000, 30,900/s, 4 min 44 s remaining, 3 failed, 1 undecided").split():
        assert part in words


def test_wanted_bar_needs_no_terminal_to_count(clock, lines, capsys):
    with progress_bar("samples", 10, True, clock=clock) as advance:
        clock.now += 100.0
        advance(10)
    assert lines() == []
    assert "\x1b" not in capsys.readouterr().err


def test_brackets_are_text_not_markup(terminal, clock):
    shown = terminal()
    with progress_bar("[red]samples", 2, None, clock=clock) as advance:
        advance(1)
    assert "[red]samples" in shown.getvalue()


def test_log_line_every_minute(lines, clock):
    with progress_bar("samples", 10_000_000, None, clock=clock) as advance:
        clock.now += 59.9
        advance(600_000)
        assert lines() == []
        clock.now += 0.1
        advance(600_000, failed=3)
        clock.now += 30.0
        advance(0)
        clock.now += 29.0
        advance(1)
        assert lines() == [
            "samples: 1,200,000 of 10,000,000 (12.0 %), 20,000/s, 7 min 20 s remaining, 3 failed"
        ]
        clock.now += 3600.0
        advance(7_799_999)
    assert lines()[1:] == [
        "samples: 9,000,000 of 10,000,000 (90.0 %), 2,420/s, 6 min 53 s remaining, 3 failed"
    ]


def test_share_is_never_rounded_up_to_the_whole(lines, clock):
    with progress_bar("samples", 100_000, None, clock=clock) as advance:
        clock.now += 60.0
        advance(99_999)
    assert lines()[0].startswith("samples: 99,999 of 100,000 (99.9 %), ")


def test_resumed_run_counts_only_its_own_for_the_rate(lines, terminal, clock, monkeypatch):
    shown = terminal()
    with progress_bar("samples", 1000, None, done=900, clock=clock) as advance:
        advance(0, failed=4)  # of the run before
        clock.now += 60.0
        advance(30, failed=1)
    assert "930 of 1,000, 30/min, 2 min 20 s remaining, 5 failed" in shown.getvalue()
    monkeypatch.setattr(shown, "isatty", lambda: False)
    with progress_bar("samples", 1000, None, done=900, clock=clock) as advance:
        clock.now += 60.0
        advance(0)
        assert lines() == ["samples: 900 of 1,000 (90.0 %)"]
        clock.now += 60.0
        advance(30)
    assert lines()[1:] == ["samples: 930 of 1,000 (93.0 %), 15/min, 4 min 40 s remaining"]


def test_remaining_time_runs_down_between_advances(clock):
    state = progress.Progress("samples", 10, 0, clock)
    clock.now += 100.0
    state.advance(5)
    clock.now += 40.0
    assert str(state) == "5 of 10, 3/min, 1 min 0 s remaining"
    clock.now += 1000.0
    assert str(state) == "5 of 10, 3/min, 0 s remaining"


def test_nothing_if_not_wanted(lines, terminal, clock):
    shown = terminal()
    with progress_bar("samples", 10, False, clock=clock) as advance:
        clock.now += 1000.0
        advance(10, failed=1)
    assert lines() == []
    assert shown.getvalue() == ""


@pytest.mark.parametrize("tty", [True, False])
def test_nothing_to_do(lines, terminal, clock, monkeypatch, tty):
    shown = terminal()
    monkeypatch.setattr(shown, "isatty", lambda: tty)
    with progress_bar("samples", 0, None, clock=clock) as advance:
        clock.now += 100.0
        advance(0)
    assert ("0 of 0" in shown.getvalue()) == tty
    assert lines() == ([] if tty else ["samples: 0 of 0"])


def test_quick_advances_are_cheap(terminal):
    terminal()
    with progress_bar("samples", 10_000, None) as advance:
        started = time.perf_counter()
        for _ in range(10_000):
            advance(1, failed=0)
        assert time.perf_counter() - started < 0.5


@pytest.mark.parametrize(
    ("rate", "words"),
    [
        (31_234.5, "31,200/s"),
        (1_234_567.0, "1,230,000/s"),
        (99.96, "100/s"),
        (1.0, "1/s"),
        (0.5, "30/min"),
        (0.01, "36/h"),
        (1e-5, "0.036/h"),
    ],
)
def test_rate_in_words(rate, words):
    assert in_words(rate) == words


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0.0, "0 s"),
        (59.7, "1 min 0 s"),
        (281.0, "4 min 41 s"),
        (11_700.0, "3 h 15 min"),
        (190_000.0, "2 d 4 h"),
    ],
)
def test_duration_in_words(seconds, words):
    assert duration(seconds) == words


def test_log_to_stderr_once_and_where_it_is_now(logger, monkeypatch):
    log_to_stderr()
    log_to_stderr()
    for _ in range(2):
        shown = io.StringIO()
        monkeypatch.setattr(sys, "stderr", shown)
        logger.info("samples: 1 of 2")
        logger.debug("nobody asked")
        when, _, what = shown.getvalue().partition(" ")
        assert what == "samples: 1 of 2\n"
        assert [len(part) for part in when.split(":")] == [2, 2, 2]


def test_a_library_says_nothing_by_itself(logger, clock, capfd):
    with progress_bar("samples", 2, None, clock=clock) as advance:
        clock.now += 100.0
        advance(1)
    assert capfd.readouterr().err == ""
