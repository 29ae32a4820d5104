"""One thread of BLAS: matrices are small here, more threads would wait for each other."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

# Reentrant: the garbage collector may end a generator that holds a context while this thread has the lock.
_lock = threading.RLock()
_open = 0
_limit: Any = None


@contextmanager
def one_thread() -> Iterator[None]:
    """Give a context in which BLAS takes one thread, in the whole process.

    Contexts may overlap in any order and in several threads: the first one that is entered limits, and the
    last one that is left brings back the number that was there before.
    """
    _enter()
    try:
        yield
    finally:
        _leave()


def _enter() -> None:
    global _open, _limit
    with _lock:
        if not _open:
            _take_over()
            _limit = _controller().limit(limits=1, user_api="blas")
        _open += 1


def _leave() -> None:
    global _open, _limit
    with _lock:
        _open -= 1
        if not _open:
            _take_over()
            _limit.restore_original_limits()
            _take_over()
            _limit = None


def _take_over() -> None:
    """Let any thread set the number: threadpoolctl may ignore all but the one that did so first."""
    for library in _controller().lib_controllers:
        if (clear := getattr(library, "clear_controlling_thread", None)) is not None:
            clear(force=True)


@cache
def _controller() -> Any:
    # To look through all libraries that are loaded takes milliseconds, so it is done once: both that have
    # a BLAS of their own must be there by then.
    import numpy.linalg
    import scipy.linalg
    from threadpoolctl import ThreadpoolController

    del numpy, scipy
    return ThreadpoolController()
