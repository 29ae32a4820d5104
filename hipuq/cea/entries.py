"""Matrices of a batch by their entries, at places that all samples share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.pencils import Array, as_doubles
from hipuq.errors import InputError

Places = NDArray[np.int32]


@dataclass(frozen=True)
class Entries:
    """Numbers and where they stand; the matrices hold 0 elsewhere, and sums where places meet.

    Attributes
    ----------
    values : (m, s) or (m, 1) array
        Numbers, in the unit of the matrix, the sample last; one column holds for all samples.
    source, row, column : (p,) array of int32
        Place p holds ``values[source[p]]`` at (row[p], column[p]).

    Raises
    ------
    InputError
        If the values are not a matrix, or a place lies outside.
    """

    values: Array
    source: Places
    row: Places
    column: Places

    def __post_init__(self) -> None:
        # The compiled kernel reads by address: types and places must be right.
        object.__setattr__(self, "values", as_doubles(self.values))
        for name in ("source", "row", "column"):
            object.__setattr__(self, name, np.require(getattr(self, name), np.int32, ["C", "A"]))
        places = self.source, self.row, self.column
        if self.values.ndim != 2 or {part.shape for part in places} != {(self.source.size,)}:
            raise InputError(
                f"entries need values (m, samples) and places of one length: they have {self.values.shape} "
                f"and {[part.shape for part in places]}"
            )
        least = min(int(part.min(initial=0)) for part in places)
        most, count = int(self.source.max(initial=-1)), len(self.values)
        if least < 0 or most >= count:
            raise InputError(
                f"places of entries must lie from 0 on and take one of {count} values: {least}, {most}"
            )

    @property
    def reach(self) -> int:
        """Largest row or column, -1 where there is none."""
        return int(max(self.row.max(initial=-1), self.column.max(initial=-1)))

    @classmethod
    def whole(cls, matrices: Array) -> Entries:
        """Return all entries of matrices, without a copy.

        Parameters
        ----------
        matrices : (s, n, n) array
            Of s samples, in the unit of the matrix.

        Returns
        -------
        Entries
            Of n * n places; its values are a view of the matrices.
        """
        s, n = matrices.shape[:2]
        row, column = np.indices((n, n), np.int32).reshape(2, -1)
        values = matrices.reshape(s, n * n).T
        return cls(values, np.arange(n * n, dtype=np.int32), row.copy(), column.copy())

    @classmethod
    def at(cls, values: Array, places: Sequence[tuple[int, int, int]]) -> Entries:
        """Return entries from places (source, row, column).

        Parameters
        ----------
        values : (m, s) or (m, 1) array
            Numbers, in the unit of the matrix.
        places : sequence of three int
            Value, row and column of each place.

        Returns
        -------
        Entries
            Sums where places meet.
        """
        source, row, column = np.array(places, np.int32).reshape(-1, 3).T.copy()
        return cls(values, source, row, column)

    def of(self, samples: NDArray[np.intp] | slice) -> Entries:
        """Return the entries of some samples.

        Parameters
        ----------
        samples : (k,) array of int or slice
            Which samples.

        Returns
        -------
        Entries
            At the same places; values that hold for all samples stay as they are.
        """
        values = self.values if self.values.shape[1] == 1 else self.values[:, samples]
        return Entries(values, self.source, self.row, self.column)


def rows_apart(shape: tuple[int, ...]) -> Array:
    """Return an array to be filled whose rows along the last axis lie apart by no power of two.

    The kernel reads the same samples of all rows at once: at a distance of a power of two they would
    fall into the same few places of the processor's caches and push each other out.
    """
    return np.empty((*shape[:-1], shape[-1] + 8 if shape[-1] > 1 else 1))[..., : shape[-1]]


def dense(entries: Sequence[Entries], samples: int, size: int) -> Array:
    """Return the matrices.

    Parameters
    ----------
    entries : sequence of Entries
    samples, size : int

    Returns
    -------
    (samples, size, size) array
    """
    matrices = np.zeros((samples, size, size))
    for part in entries:
        for source, row, column in zip(part.source, part.row, part.column, strict=True):
            matrices[:, row, column] += part.values[source]
    return matrices
