"""Eigenvalues of stacks of small real matrices: the compiled kernel, or LAPACK where it is missing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.pencils import Array
from hipuq.compiled.binding import kernel

LARGEST_SIZE = 64
"""Largest matrix that the compiled kernel takes: a block of eight such fits the second cache of most
processors."""


def kernel_for(size: int) -> Any:
    """Return the compiled kernel, None where it is missing or LAPACK is to do matrices of this size."""
    return kernel() if size <= LARGEST_SIZE else None


def finite(matrices: Array) -> Array:
    """Return matrices as the kernel takes them.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a value is not finite.
    """
    if not np.isfinite(matrices).all():
        raise np.linalg.LinAlgError("Array must not contain infs or NaNs")
    return np.ascontiguousarray(matrices, np.float64)


def eigenvalues(matrices: Array) -> NDArray[np.complex128]:
    """Return the eigenvalues of a stack of matrices.

    Each matrix is solved by itself, so results do not depend on the stack that it is in. Both ways are
    backward stable: eigenvalues are exact for a matrix that differs by a small multiple of the rounding
    of its norm.

    Parameters
    ----------
    matrices : (s, n, n) array

    Returns
    -------
    (s, n) complex array
        Complex pairs are exact conjugates, side by side, the one above the real line first.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a value is not finite, or the iteration does not end.
    """
    s, n = matrices.shape[:2]
    compiled = kernel_for(n)
    if compiled is None:
        return np.asarray(np.linalg.eigvals(matrices), np.complex128)
    matrices = finite(matrices)
    values = np.empty((s, n), np.complex128)
    failed = np.empty(s, np.bool_)
    if compiled.eigenvalues(s, n, matrices.ctypes.data, values.ctypes.data, failed.ctypes.data):
        raise MemoryError("no memory for the compiled kernel")
    if failed.any():
        values[failed] = np.linalg.eigvals(matrices[failed])
    return values
