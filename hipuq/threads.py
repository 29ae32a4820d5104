"""One thread of BLAS: matrices are small here, more threads would wait for each other."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from typing import Any


def one_thread() -> AbstractContextManager[Any]:
    """Return a context in which BLAS takes one thread, in the whole process."""
    limits: AbstractContextManager[Any] = _controller().limit(limits=1, user_api="blas")
    return limits


@cache
def _controller() -> Any:
    # To look through all libraries that are loaded takes milliseconds, so it is done once: both that have
    # a BLAS of their own must be there by then.
    import numpy.linalg
    import scipy.linalg
    from threadpoolctl import ThreadpoolController

    del numpy, scipy
    return ThreadpoolController()
