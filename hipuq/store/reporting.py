"""What can be wrong with a file, in one line: what the libraries raise, and what no file of ours is."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hipuq.errors import StoreError

LINE_MAXIMUM = 400
"""Most characters of a message about what stands in a file."""

# What h5py, zarr and xarray were seen to raise about files that are broken.
_RAISED = (
    OSError,
    ValueError,
    LookupError,
    TypeError,
    RuntimeError,
    AttributeError,
    AssertionError,
    SystemError,
)


def one_line(text: str) -> str:
    """Return a message as one line of limited length, whatever a file has put into it.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
        Without line breaks and control characters; of a long one beginning and end, which say what is wrong
        and the way out.
    """
    half = LINE_MAXIMUM // 2
    if len(text) > 20 * LINE_MAXIMUM:
        text = f"{text[: 10 * LINE_MAXIMUM]}{text[-10 * LINE_MAXIMUM :]}"
    line = " ".join("".join(one if one.isprintable() else " " for one in text).split())
    return line if len(line) <= LINE_MAXIMUM else f"{line[: half - 3]} ... {line[2 - half :]}"


def check_plain_file(file: Path, most: int) -> None:
    """Raise unless a path is a file of limited size: reading a pipe or a device may never end.

    Parameters
    ----------
    file : Path
        Links are followed.
    most : int
        Largest size [byte].

    Raises
    ------
    OSError
        If there is nothing.
    StoreError
        If it is something else than a file, or larger.
    """
    found = file.stat()
    if not stat.S_ISREG(found.st_mode):
        raise StoreError(f"{file} is not a file but {_kind(found.st_mode)}")
    if found.st_size > most:
        raise StoreError(f"{file} has {found.st_size:,} bytes: at most {most:,} are read")


def _kind(mode: int) -> str:
    kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
    return kinds.get(stat.S_IFMT(mode), "a device")


@contextmanager
def reported(action: str, path: Path) -> Iterator[None]:
    """Turn what the libraries raise about a file into one line."""
    try:
        yield
    except StoreError:
        raise
    except (*_RAISED, MemoryError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error).splitlines()
        first = why if isinstance(why, str) else (why[0] if why else type(error).__name__)
        raise StoreError(f"cannot {action} {path}: {one_line(first)}") from error
