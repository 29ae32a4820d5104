"""Springs in a plane as blocks of two rows and columns, and where these stand, for the compiled kernel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hipuq.cea import Entries
from hipuq.cea.entries import rows_apart
from hipuq.cea.pencils import Array


def sample_last(values: Array) -> Array:
    """Return values (s, size) as (size, s), or (size, 1) where one sample stands for all."""
    return np.ascontiguousarray(values[:1].T if values.strides[0] == 0 else values.T)


def dyads(stiffness: Array, row: tuple[Array, Array], column: tuple[Array, Array]) -> Array:
    """Return stiffness times unit vector times unit vector transposed, (2, 2, size, s).

    Unit vectors are given by their cosines and sines, (size, s) or (size, 1), as the stiffness is.
    """
    made = rows_apart((2, 2, *np.broadcast_shapes(stiffness.shape, row[0].shape, column[0].shape)))
    for x, y in np.ndindex(2, 2):
        np.multiply(row[x], column[y], out=made[x, y])
        made[x, y] *= stiffness
    return made


def at_blocks(blocks: Array, places: Sequence[tuple[int, int]], first: int = 0) -> Entries:
    """Return blocks (2, 2, size, s), from the `first` on, as entries at these block rows and columns."""
    size = blocks.shape[2]
    return Entries.at(
        blocks.reshape(4 * size, -1),
        [
            ((2 * x + y) * size + first + k, 2 * i + x, 2 * j + y)
            for k, (i, j) in enumerate(places)
            for x, y in np.ndindex(2, 2)
        ],
    )
