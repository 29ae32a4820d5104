"""A lock on a folder that ends with the process that holds it, however that ends."""

from __future__ import annotations

import errno
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hipuq.errors import StoreError

_held: set[str] = set()
_guard = threading.Lock()


@contextmanager
def locked(folder: Path, shown: Path | None = None) -> Iterator[None]:
    """Hold the lock of a folder, which need not be there yet.

    A record lock of POSIX: a process forked from this one does not hold it, and the system takes it back
    when the process is gone. Within one process it would not exclude, so those held are known here.

    Parameters
    ----------
    folder : Path
    shown : Path, optional
        What errors name in its place.

    Raises
    ------
    StoreError
        If another run holds it, or the lock cannot be made.
    """
    try:
        import fcntl
    except ImportError as error:
        raise StoreError("stores of outcomes need a system with POSIX locks: Linux, macOS or WSL") from error

    file = folder.with_name(f".{folder.name}.hipuq-lock")
    key = str(file.resolve())
    with _guard:
        if key in _held:
            raise _busy(shown or folder)
        _held.add(key)
    try:
        descriptor = _opened(file, shown or folder, fcntl.lockf, fcntl.LOCK_EX | fcntl.LOCK_NB)
        try:
            yield
        finally:
            # Removed while it is held: who opened it before sees that it is gone.
            with suppress(OSError):
                file.unlink()
            os.close(descriptor)
    finally:
        with _guard:
            _held.discard(key)


def _opened(file: Path, folder: Path, lock: Callable[[int, int], None], flags: int) -> int:
    """Return the descriptor of a file that is locked and still has its name."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        while True:
            descriptor = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            try:
                lock(descriptor, flags)
                with suppress(FileNotFoundError):
                    if os.path.samestat(os.fstat(descriptor), os.stat(file)):
                        return descriptor
            except BaseException:
                os.close(descriptor)
                raise
            os.close(descriptor)
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN):
            raise _busy(folder) from error
        raise StoreError(f"cannot lock {folder}: {error.strerror}") from error


def _busy(folder: Path) -> StoreError:
    return StoreError(f"another run is writing to {folder}: wait until it ends, or take another folder")
