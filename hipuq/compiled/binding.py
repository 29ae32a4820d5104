"""Finds the compiled library and declares what is in it, as `kernel.h` does."""

from __future__ import annotations

import ctypes
import os
import sys
import warnings
from ctypes import POINTER, Structure, c_double, c_int, c_int64, c_uint64, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

from hipuq.compiled.sources import digest
from hipuq.errors import InputError

SWITCH = "HIPUQ_KERNEL"
LAPACK = "lapack"
TARGETS = ("avx512", "avx2", "baseline")
"""Instruction sets, the best one first."""

FILE = "_kernel" + {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


class Term(Structure):
    """Entries of the matrices of all samples; strides count doubles."""

    _fields_ = (
        ("values", c_void_p),
        ("source", c_void_p),
        ("row", c_void_p),
        ("column", c_void_p),
        ("places", c_int64),
        ("row_stride", c_int64),
        ("sample_stride", c_int64),
        ("times_friction", c_int64),
    )


class Batch(Structure):
    """Undamped pencils of a batch."""

    _fields_ = (
        ("samples", c_int64),
        ("size", c_int64),
        ("terms", c_int64),
        ("term", POINTER(Term)),
        ("friction", c_void_p),
        ("mass", c_void_p),
        ("friction_stride", c_int64),
        ("mass_row_stride", c_int64),
        ("mass_sample_stride", c_int64),
        ("mechanisms", c_void_p),
    )


class Bounds(Structure):
    """Bounds of the errors of eigenvalues over the norm."""

    _fields_ = (("filter_radius", c_double), ("rounding", c_double), ("zero", c_double))


class Modes(Structure):
    """Where outcomes go."""

    _fields_ = (
        ("frequency", c_void_p),
        ("growth_rate", c_void_p),
        ("unstable", c_void_p),
        ("margin", c_void_p),
        ("open", c_void_p),
    )


class Kernel(Structure):
    """The functions for one instruction set."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("lanes", c_int),
        ("eigenvalues", ctypes.CFUNCTYPE(c_int, c_int64, c_int64, c_void_p, c_void_p, c_void_p)),
        (
            "conditioned",
            ctypes.CFUNCTYPE(c_int, c_int64, c_int64, c_void_p, c_void_p, c_void_p, c_void_p),
        ),
        ("undamped", ctypes.CFUNCTYPE(c_int, POINTER(Batch), c_double, POINTER(Bounds), POINTER(Modes))),
        ("degrees", ctypes.CFUNCTYPE(None, c_int64, c_void_p, c_void_p, c_void_p)),
    )


@cache
def kernel() -> Any:
    """Return the kernel that `SWITCH` names, by default the best one for this processor.

    Returns
    -------
    Kernel or None
        None where the library is missing or LAPACK is asked for.

    Raises
    ------
    InputError
        If `SWITCH` names no kernel or one that cannot run here, or the library is of other sources.
    """
    wanted = os.environ.get(SWITCH, "")
    if wanted not in ("", LAPACK, *TARGETS):
        raise InputError(f"{SWITCH} is {wanted!r}: it must be empty, {LAPACK!r} or one of {TARGETS}")
    if wanted == LAPACK:
        return None
    path = Path(__file__).with_name(FILE)
    try:
        library = ctypes.CDLL(str(path))
    except OSError as error:
        if wanted:
            raise InputError(
                f"{SWITCH} is {wanted!r}, but the compiled library is missing: {error}"
            ) from None
        if path.exists():
            told = f"LAPACK does the work of {FILE}, which does not load: {error}"
            warnings.warn(told, RuntimeWarning, stacklevel=2)
        return None
    there = digest(path.parent)
    if there is not None and _made_of(library) != there:
        raise InputError(
            f"the compiled library {FILE} was compiled from other sources: install hipuq again, "
            f"or set {SWITCH}={LAPACK}"
        )
    choose = library.hipuq_kernel
    choose.argtypes, choose.restype = [ctypes.c_char_p], POINTER(Kernel)
    found = choose(wanted.encode())
    if not found:
        raise InputError(f"{SWITCH} is {wanted!r}: this library or processor has no such kernel")
    return found.contents


def _made_of(library: ctypes.CDLL) -> int | None:
    """Return the digest of the sources of a library, None if it is too old to have one."""
    try:
        function = library.hipuq_sources
    except AttributeError:
        return None
    function.restype = c_uint64
    return int(function())


def kernel_name() -> str:
    """Return the name of the kernel in use, which bits may depend on: an instruction set, or LAPACK's."""
    compiled = kernel()
    return LAPACK if compiled is None else compiled.name.decode()
