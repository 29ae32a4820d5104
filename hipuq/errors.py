"""Errors of hipuq: each is a `HipuqError` and the built-in that fits."""

from collections.abc import Iterable
from difflib import get_close_matches


class HipuqError(Exception):
    """Base of every error that hipuq raises on purpose."""


class InputError(HipuqError, ValueError):
    """A value that cannot be used: the message names it, the allowed ones and the way out."""


class UnknownNameError(InputError):
    """A name that is none of the known ones."""


class SchemaError(InputError):
    """A Dataset that does not follow the schema."""


class StudyError(InputError):
    """A study file that cannot be used."""


class ModelError(HipuqError, RuntimeError):
    """A model that failed on samples it was given."""


class StoreError(HipuqError, OSError):
    """A file or folder that cannot be read or written."""


def check_name(kind: str, name: object, allowed: Iterable[str]) -> str:
    """Return a name that is one of the `allowed` ones.

    Parameters
    ----------
    kind : str
        What the name stands for, such as ``"parameter"``.
    name : object
        The name that was given.
    allowed : iterable of str
        The names that exist.

    Returns
    -------
    str
        The name.

    Raises
    ------
    UnknownNameError
        If it is none of them.
    """
    names = list(allowed)
    if not isinstance(name, str) or name not in names:
        raise unknown_name(kind, name, names)
    return name


def unknown_name(kind: str, name: object, allowed: Iterable[str]) -> UnknownNameError:
    """Return the error for a name that is none of the `allowed` ones.

    Parameters
    ----------
    kind : str
        What the name stands for, such as ``"parameter"``.
    name : object
        The name that was given.
    allowed : iterable of str
        The names that exist.

    Returns
    -------
    UnknownNameError
        Its message gives the nearest allowed name, if one is near, and all of them.
    """
    names = list(allowed)
    near = get_close_matches(str(name), names, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return UnknownNameError(f"unknown {kind} {name!r}: {hint}allowed are {', '.join(names)}")
