"""Inputs: which parameters are uncertain, and how."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.contact import ContactPatterns
from hipuq.errors import InputError, SchemaError, unknown_name
from hipuq.uncertain import HIGHEST, LOWEST, Input, as_input
from hipuq.variation import Nominal

Array = NDArray[np.float64]


class Inputs(Mapping[str, Input]):
    """Frozen mapping from the names of uncertain parameters to their distributions.

    Made by ``model.inputs(...)``, which knows nominal values and lengths, or directly for a plain
    function as a model.

    Parameters
    ----------
    **distributions
        Parameter name = a chaospy or scipy distribution, an object with ``ppf``, `relative` or
        `shift` with ``nominal=``, or `ContactPatterns`.

    Raises
    ------
    InputError
        If there is none, or one cannot be used.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> inputs = hipuq.Inputs(x1=cp.Uniform(0, 1), x2=cp.Normal(0, 2))
    >>> inputs.dimension, list(inputs)
    (2, ['x1', 'x2'])
    >>> inputs.samples([[0.5, 0.5], [0.1, 0.975]])["x2"].values.round(4)
    array([0.    , 3.9199])
    """

    def __init__(self, /, **distributions: object) -> None:
        self._entries = {name: as_input(name, value, None) for name, value in distributions.items()}
        self._check()

    @classmethod
    def around(cls, distributions: Mapping[str, object], nominal: Mapping[str, Nominal]) -> Inputs:
        """Return inputs of a model that knows its nominal values and lengths.

        Parameters
        ----------
        distributions : mapping
            Parameter name -> a distribution, `relative`, `shift` or `ContactPatterns`.
        nominal : mapping
            Parameter name -> its nominal value and the dims of its elements.

        Returns
        -------
        Inputs
            In the order of `distributions`.

        Raises
        ------
        InputError
            If there is no distribution, or one cannot be used for its parameter.
        """
        inputs = cls.__new__(cls)
        inputs._entries = {
            name: as_input(name, value, nominal[name]) for name, value in distributions.items()
        }
        inputs._check()
        return inputs

    def _check(self) -> None:
        if not self._entries:
            raise InputError("there are no inputs: give at least one parameter a distribution")
        lengths: dict[str, tuple[str, int]] = {}
        for name, entry in self._entries.items():
            if name in schema.COORDINATES:
                raise InputError(
                    f"an input cannot be called {name!r}: designs keep their books under that name"
                )
            for dim, length in zip(entry.dims, entry.nominal.shape, strict=True):
                other, known = lengths.setdefault(dim, (name, length))
                if dim == "sample" or known != length:
                    raise InputError(
                        f"dim {dim!r} of {name} has length {length}, that of {other} has {known}"
                    )
        if len(self.discrete) > 1:
            raise InputError(f"there are several contact patterns, {self.discrete}: one is possible")

    def __getitem__(self, name: str) -> Input:
        if name not in self._entries:
            raise unknown_name("input", name, self._entries)
        return self._entries[name]

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Inputs):
            return NotImplemented
        return self.to_json() == other.to_json()

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        lines = []
        for name, entry in self._entries.items():
            source = getattr(entry.distribution, "source", entry.distribution)
            each = f" for each of {entry.columns}" if entry.each else ""
            lines.append(f"  {name}: {entry.how} {source!r}{each}")
        return "\n".join(["<hipuq inputs>", *lines])

    @property
    def dimension(self) -> int:
        """Number of columns of the unit cube."""
        return sum(entry.columns for entry in self._entries.values())

    @property
    def groups(self) -> list[str]:
        """Name of the parameter that each column of the unit cube belongs to."""
        return [name for name, entry in self._entries.items() for _ in range(entry.columns)]

    @property
    def elements(self) -> list[str]:
        """Name of each column of the unit cube: ``spring_stiffness[3]``, numbered from 1.

        A parameter that has one column keeps its name.
        """
        return [
            name if entry.columns == 1 else f"{name}[{i + 1}]"
            for name, entry in self._entries.items()
            for i in range(entry.columns)
        ]

    @property
    def discrete(self) -> list[str]:
        """Names of the inputs that have levels."""
        return [name for name, e in self._entries.items() if hasattr(e.distribution, "levels")]

    def levels(self, name: str) -> xr.Dataset:
        """Return the levels of a discrete input: its dim, coords and ``weight``.

        Parameters
        ----------
        name : str
            Name of the input.

        Returns
        -------
        Dataset
            As from `ContactPatterns.levels`: ``contact(pattern, oscillator)`` under the input's name,
            ``weight(pattern)``, and the coord ``in_contact(pattern)``.

        Raises
        ------
        UnknownNameError
            If there is no such input.
        InputError
            If the input is not discrete.
        """
        distribution = self[name].distribution
        if not isinstance(distribution, ContactPatterns):
            raise InputError(f"input {name!r} has no levels: discrete inputs are {self.discrete or 'none'}")
        return distribution.levels(name)

    def without(self, name: str) -> Inputs:
        """Return these inputs without one of them; it may leave none.

        Parameters
        ----------
        name : str
            Name of the input to leave out.

        Returns
        -------
        Inputs
            The others, in the same order.

        Raises
        ------
        UnknownNameError
            If there is no such input.
        """
        self[name]
        rest = Inputs.__new__(Inputs)
        rest._entries = {key: entry for key, entry in self._entries.items() if key != name}
        return rest

    def samples(self, u: Array) -> xr.Dataset:
        """Return the physical values at points of the unit cube.

        Parameters
        ----------
        u : (s, dimension) array
            Probabilities from 0 to 1 [1], columns in the order of `groups`.

        Returns
        -------
        Dataset
            One variable for each input, over ``sample`` and its element dim, in the units of the schema; a
            name that it does not have keeps the unit of its distribution.

        Raises
        ------
        InputError
            If the points do not have as many columns as there are draws.
        """
        points = np.clip(np.asarray(u, dtype=np.float64), LOWEST, HIGHEST)
        if points.ndim != 2 or points.shape[1] != self.dimension:
            raise InputError(f"points have the shape {points.shape}: they need {self.dimension} columns")
        return _merged(entry.variables(part) for entry, part in self._columns(points))

    def from_draws(self, draws: Array) -> xr.Dataset:
        """Return the physical values that draws stand for; inputs with levels have none.

        Parameters
        ----------
        draws : (s, dimension) array
            Values of the distributions, columns in the order of `groups`: [1] of a relative one, in the
            unit of the parameter of others.

        Returns
        -------
        Dataset
            As from `samples`: one variable for each input, over ``sample`` and its element dim.

        Raises
        ------
        InputError
            If an input has levels.
        """
        for name in self.discrete:
            raise InputError(f"{name} is a contact pattern: it has levels, no draws")
        return _merged(entry.from_draws(part) for entry, part in self._columns(draws))

    def to_draws(self, samples: xr.Dataset) -> Array:
        """Return the draws that samples come from, the inverse of `from_draws`.

        Parameters
        ----------
        samples : Dataset
            A variable for each input, over ``sample``, and its element dim if it has one; others are ignored.

        Returns
        -------
        (s, dimension) array
            Values of the distributions, columns in the order of `groups`: [1] of a relative one, in the
            unit of the parameter of others.

        Raises
        ------
        SchemaError
            If a variable is missing or has other dims.
        InputError
            If draws cannot be told from the values, or an input has levels.
        """
        draws = [np.empty((samples.sizes["sample"], 0))]
        for name, entry in self._entries.items():
            if name not in samples:
                raise SchemaError(f"samples do not hold the input {name!r}: they hold {[*samples.data_vars]}")
            dims = set(samples[name].dims)
            if dims not in ({"sample"}, {"sample", *entry.dims}):
                raise SchemaError(
                    f"samples variable {name!r} has the dims {samples[name].dims}: "
                    f"it needs {('sample', *entry.dims)}"
                )
            values = samples[name].transpose("sample", ...).values
            if values.ndim > 1 and values.shape[1:] != entry.nominal.shape:
                raise SchemaError(
                    f"samples variable {name!r} has {values.shape[1]} elements: "
                    f"the inputs have {entry.nominal.size}"
                )
            draws.append(entry.to_draws(values))
        return np.concatenate(draws, axis=1)

    def _columns(self, points: Array) -> Iterator[tuple[Input, Array]]:
        """Yield each input with its columns of `points`."""
        start = 0
        for entry in self._entries.values():
            yield entry, points[:, start : start + entry.columns]
            start += entry.columns

    def to_json(self) -> str:
        """Return a JSON description, enough to rebuild the inputs.

        Returns
        -------
        str
            JSON, as `from_json` takes it.
        """
        return json.dumps({name: entry.to_dict() for name, entry in self._entries.items()})

    @classmethod
    def from_json(cls, text: str) -> Inputs:
        """Return the inputs that `to_json` describes.

        Parameters
        ----------
        text : str
            JSON, such as the attribute ``inputs`` of samples, outcomes and results.

        Returns
        -------
        Inputs
            Equal to those described.

        Raises
        ------
        InputError
            If the text is not such a description, or a distribution in it cannot be rebuilt.
        """
        inputs = cls.__new__(cls)
        try:
            data = json.loads(text)
            inputs._entries = {name: Input.from_dict(name, entry) for name, entry in data.items()}
        except InputError:
            raise
        except (KeyError, TypeError, ValueError, OverflowError, AttributeError, RecursionError) as error:
            raise InputError(f"not a description of inputs: {error}") from error
        # What `without` leaves may be none.
        if inputs._entries:
            inputs._check()
        return inputs


def _merged(parts: Iterable[xr.Dataset]) -> xr.Dataset:
    """Return variables and coords of several Datasets as one."""
    data: dict[Any, Any] = {}
    coords: dict[Any, Any] = {}
    for part in parts:
        data.update(part.data_vars.variables)
        coords.update(part.coords.variables)
    return xr.Dataset(data, coords=coords)
