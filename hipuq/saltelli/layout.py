"""Saltelli's design (Comput. Phys. Commun. 145 (2002) 280): which rows it has, outcomes as a table.

Each base point is one of a matrix A and one of a matrix B, and gives a block of rows: that of A; of AB,
A with the columns of one parameter from B, for each parameter; for indices of pairs of BA, B with the
columns of one from A; and that of B. This is the order in which SALib has them too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import InputError, SchemaError
from hipuq.estimation.reduction import read, slices
from hipuq.inputs import Inputs

Array = NDArray[np.float64]
Numbers = NDArray[np.integer[Any]]


@dataclass(frozen=True)
class Layout:
    """The rows of a block.

    Attributes
    ----------
    names : tuple of str
        The parameters, or their elements.
    second_order : bool
        Whether there are rows BA.
    """

    names: tuple[str, ...]
    second_order: bool

    @classmethod
    def of(cls, inputs: Inputs, groups: bool, second_order: bool) -> Layout:
        """Return the layout of a design of all elements of a parameter together, or of each alone."""
        names = tuple(inputs) if check_flag("groups", groups) else tuple(inputs.elements)
        return cls(names, check_flag("second_order", second_order))

    @property
    def matrices(self) -> list[str]:
        """Matrix of each row."""
        mixed = [f"{kind}:{name}" for kind in ("AB", "BA")[: 1 + self.second_order] for name in self.names]
        return ["A", *("_".join(name.split()) for name in mixed), "B"]

    @property
    def width(self) -> int:
        """Number of rows."""
        return (1 + self.second_order) * len(self.names) + 2

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Pairs of parameters that have an index, none without second order."""
        j, k = np.triu_indices(len(self.names) if self.second_order else 0, 1)
        return list(zip(j.tolist(), k.tolist(), strict=True))

    @property
    def attrs(self) -> dict[str, Any]:
        """Attributes of the coord ``matrix``, a CF flag."""
        flags = {
            "flag_values": np.arange(self.width, dtype=np.int16),
            "flag_meanings": " ".join(self.matrices),
        }
        return schema.COORDINATES["matrix"].attrs | flags

    def points(self, base: Array, matrix: Numbers, owner: Numbers) -> Array:
        """Return rows of the design as points of the unit cube.

        Parameters
        ----------
        base : (rows, 2 columns) array
            The base point of each row, A beside B.
        matrix : (rows,) array of int
            The matrix of each row.
        owner : (columns,) array of int
            The parameter that each column belongs to, a number from 0.

        Returns
        -------
        (rows, columns) array
        """
        count = len(self.names)
        # AB takes one parameter from B, BA all but one, B all but none; 0 is A, which takes none.
        but_for = (matrix > count)[:, None]
        parameter = np.where(matrix > count, matrix - count, matrix)[:, None] - 1
        parameter = np.where(matrix[:, None] == self.width - 1, -1, parameter)
        from_b = (owner == parameter) != but_for
        return np.where(from_b, base[:, len(owner) :], base[:, : len(owner)])

    def table(self, values: xr.DataArray, outcomes: xr.Dataset) -> tuple[Array, NDArray[np.int64]]:
        """Return outcomes by block and matrix, in whatever order they come.

        Parameters
        ----------
        values : DataArray
            An outcome, ``sample`` first.
        outcomes : Dataset
            With ``block`` and ``matrix``.

        Returns
        -------
        table : (outputs, blocks, width) array
            By ascending number of the block. NaN where a sample is missing or unknown.
        samples : (blocks,) array of int
            Samples of each block.

        Raises
        ------
        SchemaError
            If there are two samples for one place.
        """
        size, outputs = values.sizes["sample"], int(np.prod(values.shape[1:], dtype=int))
        named = [np.unique(_whole_numbers(outcomes, "block", rows)) for rows in slices(size)]
        blocks = np.unique(np.concatenate(named))
        table = np.full((outputs, len(blocks) * self.width), np.nan)
        filled = np.zeros(len(blocks) * self.width, np.int32)
        for rows in slices(size):
            block, matrix = (_whole_numbers(outcomes, name, rows) for name in ("block", "matrix"))
            place = np.searchsorted(blocks, block) * self.width + matrix
            np.add.at(filled, place, 1)
            table[:, place] = read(values, rows).reshape(-1, outputs).T
        by_block = filled.reshape(len(blocks), self.width)
        if filled.max() > 1:
            where, twice = np.argwhere(by_block > 1)[0]
            raise SchemaError(
                f"block {blocks[where]} has several samples of the matrix {self.matrices[twice]!r}: the "
                "outcomes are of more than one design; analyse each by itself"
            )
        return table.reshape(outputs, len(blocks), self.width), by_block.sum(axis=1, dtype=np.int64)


def check_flag(name: str, value: object) -> bool:
    """Return an option that is True or False.

    Raises
    ------
    InputError
        If it is anything else.
    """
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    raise InputError(f"{name} is {value!r}: it must be True or False")


def layout_of(outcomes: xr.Dataset, inputs: Inputs) -> Layout:
    """Return the layout of the design that outcomes are of, from the coord ``matrix``.

    Its attribute ``flag_meanings`` names it. Where that was lost, the number of matrices tells.

    Raises
    ------
    SchemaError
        If the outcomes do not say which samples of the design they are, or are of other inputs.
    """
    for name in ("block", "matrix"):
        if name not in outcomes.variables:
            raise SchemaError(
                f"the outcomes have no coord {name!r}: Sobol indices need outcomes of a design of the method "
                "'sobol'; keep the coords block(sample) and matrix(sample) that it has"
            )
    size = outcomes.sizes.get("sample", 0)
    last = max(int(_whole_numbers(outcomes, "matrix", rows).max()) for rows in slices(size))
    both = (False, True)
    layouts = list(dict.fromkeys(Layout.of(inputs, not alone, pairs) for alone in both for pairs in both))
    meanings = outcomes["matrix"].attrs.get("flag_meanings")
    if meanings is None:
        layouts = [layout for layout in layouts if layout.width == last + 1]
        if len(layouts) > 1:
            raise SchemaError(
                f"the {last + 1} matrices of the outcomes may be for pairs of parameters or for "
                "single elements: keep the attributes that 'matrix' has in the design"
            )
        told = f"matrix is {last} at most"
    else:
        layouts = [layout for layout in layouts if " ".join(layout.matrices) == meanings]
        told = f"their matrices are {_shortened(str(meanings))}"
    if not layouts or last >= layouts[0].width:
        raise SchemaError(
            f"the outcomes are of other inputs than {', '.join(inputs)}: {told}; give those of the design"
        )
    return layouts[0]


def _whole_numbers(outcomes: xr.Dataset, name: str, rows: slice) -> NDArray[np.int64]:
    """Return some of a coord over the samples as integers.

    Raises
    ------
    SchemaError
        If it is not one of integers from 0.
    """
    given = outcomes[name]
    if given.dims == ("sample",) and given.dtype.kind in "iuf":
        numbers = read(given, rows)
        if (numbers >= 0).all() and (numbers == np.floor(numbers)).all() and np.isfinite(numbers).all():
            return numbers.astype(np.int64)
    raise SchemaError(
        f"{name!r} of the outcomes must hold an integer from 0 for each sample, as in the design; "
        f"it has the dims {given.dims} and holds {given.dtype}"
    )


def _shortened(text: str, length: int = 80) -> str:
    return text if len(text) <= length else f"{text[: length - 4]} ..."
