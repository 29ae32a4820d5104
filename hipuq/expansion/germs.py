"""Germs of all inputs: samples to points of the standard variables and back, and their polynomials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.errors import InputError
from hipuq.expansion.polynomials import HIGHEST_DEGREE, orthonormal
from hipuq.expansion.variable import Germ, germ_of
from hipuq.inputs import Inputs
from hipuq.uncertain import Input

Array = NDArray[np.float64]

NODES_MAXIMUM = 1_000_000
"""Most nodes of a tensor quadrature."""


@dataclass(frozen=True, eq=False)
class Germs:
    """The standard variables that the polynomials of an expansion are functions of.

    Attributes
    ----------
    inputs : Inputs
        The inputs, none of them with levels.
    columns : tuple of Germ
        The germ of each column.
    elements : tuple of str
        Name of each column: that of its parameter, with the number of the element from 1 where
        elements have draws of their own, as ``spring_stiffness[3]``.
    parameters : tuple of str
        Name of the parameter of each column.
    largest : (d,) array of int
        Highest degree that each column allows.
    """

    inputs: Inputs
    columns: tuple[Germ, ...]
    elements: tuple[str, ...]
    parameters: tuple[str, ...]
    largest: NDArray[np.int64]

    @classmethod
    def of(cls, inputs: Inputs) -> Germs:
        """Return the germs of inputs.

        Raises
        ------
        InputError
            If an input has levels: expansions are made for each of them.
        """
        columns: list[Germ] = []
        for entry in inputs.values():
            columns += [germ_of(entry.drawn)] * entry.columns
        largest = np.array([column.largest for column in columns], np.int64)
        return cls(inputs, tuple(columns), tuple(inputs.elements), tuple(inputs.groups), largest)

    def values(self, samples: xr.Dataset) -> Array:
        """Return the germs of physical values.

        Parameters
        ----------
        samples : Dataset
            A variable for each input; others are ignored.

        Returns
        -------
        (s, d) array

        Raises
        ------
        SchemaError
            If a variable is missing or has other dims.
        InputError
            If a value is not a number or lies outside its distribution by more than rounding.
        """
        draws = self.inputs.to_draws(samples)
        germs = np.empty_like(draws)
        for i, column in enumerate(self.columns):
            rounding = _rounding(self.inputs[self.parameters[i]], draws[:, i])
            try:
                germs[:, i] = column.values(draws[:, i], rounding)
            except InputError as error:
                raise InputError(
                    f"{self.elements[i]}: {error}; samples must be drawn from these inputs"
                ) from None
        return germs

    def samples(self, germs: Array) -> xr.Dataset:
        """Return the physical values of germs (s, d), the inverse of `values`."""
        points = np.asarray(germs, dtype=np.float64)
        draws = np.empty_like(points)
        for i, column in enumerate(self.columns):
            draws[:, i] = column.to_draw(points[:, i])
        return self.inputs.from_draws(draws)

    def univariate(self, germs: Array, degree: int) -> Array:
        """Return the orthonormal polynomials of each column.

        Parameters
        ----------
        germs : (s, d) array
        degree : int
            Highest degree.

        Returns
        -------
        (d, degree + 1, s) array
            NaN for degrees that a column does not allow.
        """
        x = np.ascontiguousarray(np.asarray(germs, dtype=np.float64).T)
        if not self.columns:
            return np.empty((0, degree + 1, x.shape[1]))
        return orthonormal(x, np.array([column.recurrence(degree) for column in self.columns]))

    def nodes(self, n: int) -> tuple[Array, Array]:
        """Return the Gauss quadrature of n nodes of each column.

        The nodes of a discrete input are its levels; the rest of its n are repeated with weight 0.

        Returns
        -------
        nodes, weights : (d, n) array

        Raises
        ------
        InputError
            If a discrete input has more than n levels.
        """
        nodes, weights = np.empty((2, len(self.columns), n))
        for i, column in enumerate(self.columns):
            try:
                nodes[i], weights[i] = column.nodes(n)
            except InputError as error:
                raise InputError(f"{self.elements[i]}: {error}; take more nodes or another fit") from None
        return nodes, weights

    def grid(self, n: int) -> tuple[Array, Array]:
        """Return the tensor quadrature of n nodes for each column, without the nodes of weight 0.

        Returns
        -------
        germs : (s, d) array
            The last column runs fastest.
        weights : (s,) array
            They add up to 1.

        Raises
        ------
        InputError
            If there are more than `NODES_MAXIMUM` nodes, or a discrete input has more than n levels.
        """
        if n > HIGHEST_DEGREE:
            raise InputError(f"{n} quadrature nodes for each input are too many, at most {HIGHEST_DEGREE}")
        nodes, weights = self.nodes(n)
        counts = (weights > 0).sum(axis=1)
        if counts.prod(dtype=np.float64) > NODES_MAXIMUM:
            raise InputError(
                f"{n} quadrature nodes for each of {len(counts)} inputs are {float(n) ** len(counts):.3g}, "
                f"more than {NODES_MAXIMUM}: take fewer, or fit by least squares or sparse regression"
            )
        germs, product = np.zeros((1, 0)), np.ones(1)
        for i, count in enumerate(counts):
            added = np.tile(nodes[i, :count], len(germs))
            germs = np.column_stack([np.repeat(germs, count, axis=0), added])
            product = np.repeat(product, count) * np.tile(weights[i, :count], len(product))
        return germs, product


def _rounding(entry: Input, draws: Array) -> float:
    """Return how far rounding may move the draws of an input when they are told from its values."""
    size = {"absolute": 0.0, "relative": 1.0, "shift": np.abs(entry.nominal).max(initial=0.0)}[entry.how]
    known = draws[np.isfinite(draws)]
    return float(8 * np.finfo(np.float64).eps * (size + np.abs(known).max(initial=0.0)))
