"""Eigenvalues of stacks of small real matrices: the compiled kernel, or LAPACK where it is missing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.pencils import Array
from hipuq.compiled.library import kernel

LARGEST_SIZE = 64
"""Above this size LAPACK, whose blocks fit caches better, is not slower; ``docs/speed.md``."""


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
    compiled = kernel()
    if compiled is None or n > LARGEST_SIZE or not matrices.size:
        return np.asarray(np.linalg.eigvals(matrices), np.complex128)
    matrices = np.ascontiguousarray(matrices, np.float64)
    if not np.isfinite(matrices).all():
        raise np.linalg.LinAlgError("Array must not contain infs or NaNs")
    values = np.empty((s, n), np.complex128)
    failed = np.empty(s, np.bool_)
    if compiled.eigenvalues(s, n, matrices.ctypes.data, values.ctypes.data, failed.ctypes.data):
        raise MemoryError("no memory for the compiled kernel")
    if failed.any():
        values[failed] = np.linalg.eigvals(matrices[failed])
    return values
