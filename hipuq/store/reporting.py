"""What the libraries raise about files, in one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hipuq.errors import StoreError


@contextmanager
def reported(action: str, path: Path) -> Iterator[None]:
    """Turn what the libraries raise about a file into one line."""
    try:
        yield
    except StoreError:
        raise
    except (OSError, ValueError, KeyError, TypeError, RuntimeError, AttributeError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error).splitlines()
        first = why if isinstance(why, str) else (why[0] if why else type(error).__name__)
        raise StoreError(f"cannot {action} {path}: {first}") from error
