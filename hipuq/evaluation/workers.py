"""Who evaluates: threads, processes, any executor, a dask cluster; answers come in the order of the calls."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from hipuq.errors import HipuqError, InputError, ModelError
from hipuq.sampling import check_count
from hipuq.threads import one_thread

EXECUTORS = ("threads", "processes")
"""Executors by name."""

AHEAD = 4
"""Calls for each worker that are handed over and not yet back."""

LOOK = 5.0
"""Seconds after which a cluster is asked again how large it is."""

T = TypeVar("T")
K = TypeVar("K")


@dataclass(frozen=True)
class Workers:
    """What runs the calls.

    Attributes
    ----------
    executor : Executor
    count : callable
        Says how many calls run at a time now, as far as it can be told.
    """

    executor: Executor
    count: Callable[[], int]

    def in_order(self, calls: Iterable[tuple[K, Callable[..., T], tuple[Any, ...]]]) -> Iterator[tuple[K, T]]:
        """Yield what calls give, in their order.

        Parameters
        ----------
        calls : iterable of (key, function, arguments)
            Taken when there is room, so it may make the arguments when it is asked.

        Raises
        ------
        ModelError
            If it is the executor that fails.
        """
        waiting: deque[tuple[K, Future[T]]] = deque()
        try:
            for key, function, arguments in calls:
                waiting.append((key, self._submitted(function, arguments)))
                if len(waiting) >= AHEAD * self._count():
                    first, future = waiting.popleft()
                    yield first, _result(future)
            while waiting:
                first, future = waiting.popleft()
                yield first, _result(future)
        finally:
            for _, future in waiting:
                future.cancel()

    def _count(self) -> int:
        try:
            return self.count()
        except Exception as error:
            raise _broken(error) from error

    def now(self, function: Callable[..., T], *arguments: Any) -> T:
        """Return what one call gives."""
        return _result(self._submitted(function, arguments))

    def _submitted(self, function: Callable[..., T], arguments: tuple[Any, ...]) -> Future[T]:
        try:
            return self.executor.submit(function, *arguments)
        except Exception as error:
            raise _broken(error) from error


def _result(future: Future[T]) -> T:
    try:
        return future.result()
    except (HipuqError, MemoryError):
        raise
    except (Exception, CancelledError) as error:
        # What the model raises is an answer: this is of the executor.
        raise _broken(error) from error


def _broken(error: BaseException) -> ModelError:
    if isinstance(error, BrokenProcessPool):
        return ModelError(
            "a worker process ended before its time: it was killed, or the script that started it has no "
            "if __name__ == '__main__': around what it runs; samples that are complete in a store stay"
        )
    if isinstance(error, CancelledError):
        return ModelError(
            "the executor gave up: it was shut down, or the connection to the scheduler of its cluster is "
            "lost; samples that are complete in a store stay"
        )
    text = " ".join(str(error).split()) or "no more is known"
    return ModelError(f"the executor failed, {type(error).__name__}: {text[:300]}")


@contextmanager
def workers(executor: Any, n_jobs: int | None) -> Iterator[Workers]:
    """Give what runs the calls, with one BLAS thread each: the matrices are small.

    Parameters
    ----------
    executor : None, str, Executor or Client
        None and ``"threads"`` are threads here, ``"processes"`` processes; a client of dask gives its
        executor.
    n_jobs : int or None
        How many; all cores by default.

    Raises
    ------
    InputError
        If it is none of them.
    """
    jobs = (os.cpu_count() or 1) if n_jobs is None else check_count("n_jobs", n_jobs)
    if executor is None or executor in EXECUTORS:
        pool: Executor = _processes(jobs) if executor == "processes" else ThreadPoolExecutor(jobs)
        with _own(pool), one_thread():
            yield Workers(pool, lambda: jobs)
        return
    given = getattr(executor, "_max_workers", None)
    threads = given if isinstance(given, int) and given > 0 else jobs

    def count() -> int:
        return threads

    if callable(getattr(executor, "get_executor", None)):
        count, executor = _cores(executor), executor.get_executor()
    if not callable(getattr(executor, "submit", None)):
        raise InputError(
            f"executor is {executor!r}: it must be 'threads', 'processes', a concurrent.futures.Executor "
            "or a client of dask.distributed"
        )
    with one_thread():
        yield Workers(executor, count)


def _cores(client: Any) -> Callable[[], int]:
    """Return what says how many cores a cluster has: workers may come and go."""
    found, asked = 1, -LOOK

    def count() -> int:
        nonlocal found, asked
        if (now := time.monotonic()) - asked >= LOOK:
            found, asked = max(1, sum(client.ncores().values())), now
        return found

    return count


@contextmanager
def _own(pool: Executor) -> Iterator[None]:
    """Shut a pool down; what is queued is dropped, and after Ctrl-C what is running is not waited for."""
    wait = True
    try:
        yield
    except KeyboardInterrupt:
        wait = False
        raise
    finally:
        pool.shutdown(wait=wait, cancel_futures=True)


def _processes(jobs: int) -> ProcessPoolExecutor:
    # A fork would copy locks that other threads hold.
    method = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
    context = multiprocessing.get_context(method)
    return ProcessPoolExecutor(jobs, mp_context=context, initializer=_begin)


def check_travels(model: object) -> None:
    """Raise an InputError unless a model can be sent to another process."""
    main = sys.modules.get("__main__")
    if getattr(model, "__module__", "") == "__main__" and not hasattr(main, "__file__"):
        raise InputError(
            "the model is defined in a session, where another process does not find it: put it into a "
            "module, or take executor='threads'"
        )
    try:
        pickle.dumps(model)
    except Exception as error:
        raise InputError(
            f"the model cannot be sent to another process ({error}): define it at the top level of a "
            "module, or take executor='threads'"
        ) from error


def _begin() -> None:
    """Make a worker process end with the one that started it, and leave Ctrl-C to that."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)
