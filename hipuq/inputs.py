"""Inputs: which parameters are uncertain, and how."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from hipuq import schema
from hipuq.contact import ContactPatterns
from hipuq.distributions import Distribution, as_distribution, from_description
from hipuq.errors import InputError, unknown_name

Array = NDArray[np.float64]

# Quantiles at 0 and 1 may be infinite; designs can touch 0, and 1 by rounding.
_LOWEST, _HIGHEST = 2.0**-64, 1.0 - 2.0**-53


@dataclass(frozen=True)
class Nominal:
    """Nominal value of a model's parameter and the dims of its elements."""

    values: Array
    dims: tuple[str, ...]


@dataclass(frozen=True)
class Variation:
    """A distribution of the change of a nominal value. Made by `relative` and `shift`."""

    how: Literal["relative", "shift"]
    distribution: Distribution
    each: str | None
    nominal: Any


def relative(distribution: object, *, each: str | None = None, nominal: ArrayLike | None = None) -> Variation:
    """Vary a parameter around its nominal value: nominal value times (1 + draw).

    Parameters
    ----------
    distribution : object
        Distribution of the draw, such as ``cp.Uniform(-0.1, 0.1)`` for +-10 %.
    each : str, optional
        Dim of the elements: one independent draw for each of them. Without it one shared draw.
    nominal : float or array, optional
        The nominal value where no model knows it.

    Returns
    -------
    Variation
    """
    return Variation("relative", as_distribution(distribution, "relative distribution"), each, nominal)


def shift(distribution: object, *, each: str | None = None, nominal: ArrayLike | None = None) -> Variation:
    """Vary a parameter around its nominal value: nominal value plus draw.

    Parameters
    ----------
    distribution : object
        Distribution of the draw, in the unit of the parameter.
    each : str, optional
        Dim of the elements: one independent draw for each of them. Without it one shared draw.
    nominal : float or array, optional
        The nominal value where no model knows it.

    Returns
    -------
    Variation
    """
    return Variation("shift", as_distribution(distribution, "shift distribution"), each, nominal)


@dataclass(frozen=True, eq=False)
class Input:
    """One uncertain parameter.

    Attributes
    ----------
    name : str
        Name of the parameter.
    distribution : Distribution or ContactPatterns
        What is drawn.
    how : str
        ``"absolute"``, ``"relative"`` or ``"shift"``.
    dims : tuple of str
        Dims of the elements, empty for a number.
    nominal : (size,) array or float
        Nominal value of a relative or shifted one; its shape for an absolute one.
    each : bool
        Whether each element has a draw of its own.
    """

    name: str
    distribution: Distribution | ContactPatterns
    how: str
    dims: tuple[str, ...]
    nominal: Array
    each: bool

    @property
    def columns(self) -> int:
        """Number of columns of the unit cube that it takes."""
        return int(self.nominal.size) if self.each else 1

    def variables(self, u: Array) -> xr.Dataset:
        """Return the physical values at points of the unit cube, (samples, columns)."""
        if isinstance(self.distribution, ContactPatterns):
            return self.distribution.variables(self.name, self.distribution.ppf(u[:, 0]), "sample")
        draw = np.asarray(self.distribution.ppf(u if self.each else u[:, 0]), dtype=np.float64)
        shape = (len(u), *self.nominal.shape)
        draw = draw.reshape(len(u), -1) if self.nominal.ndim else draw.reshape(len(u))
        if self.how == "relative":
            values = self.nominal * (1 + draw)
        elif self.how == "shift":
            values = self.nominal + draw
        else:
            values = draw
        known = schema.PARAMETERS.get(self.name)
        attrs = known.attrs if known else {"long_name": self.name, "units": ""}
        coords = {
            dim: schema.index(dim, size)
            for dim, size in zip(self.dims, self.nominal.shape, strict=True)
            if dim in schema.COORDINATES
        }
        dims = ("sample", *self.dims)
        return xr.Dataset({self.name: (dims, np.broadcast_to(values, shape).copy(), attrs)}, coords)

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-able description."""
        if isinstance(self.distribution, ContactPatterns):
            return {"how": "contact_patterns", **self.distribution.to_dict()}
        return {
            "how": self.how,
            "distribution": dict(self.distribution.description),
            "dims": list(self.dims),
            "nominal": self.nominal.tolist(),
            "each": self.each,
        }

    @classmethod
    def from_dict(cls, name: str, data: Mapping[str, Any]) -> Input:
        """Return the input that `to_dict` describes."""
        if data["how"] == "contact_patterns":
            rest = {key: value for key, value in data.items() if key != "how"}
            return _contact(name, ContactPatterns(**rest))
        return cls(
            name,
            from_description(data["distribution"]),
            data["how"],
            tuple(data["dims"]),
            np.asarray(data["nominal"], dtype=np.float64),
            data["each"],
        )


class Inputs(Mapping[str, Input]):
    """Frozen mapping: name of an uncertain parameter -> its distribution.

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
    >>> hipuq.Inputs(x1=cp.Uniform(0, 1), x2=cp.Normal(0, 2)).dimension
    2
    """

    def __init__(self, /, **distributions: object) -> None:
        self._entries = {name: _entry(name, value, None) for name, value in distributions.items()}
        self._check()

    @classmethod
    def around(cls, distributions: Mapping[str, object], nominal: Mapping[str, Nominal]) -> Inputs:
        """Return inputs of a model that knows its nominal values and lengths."""
        inputs = cls.__new__(cls)
        inputs._entries = {name: _entry(name, value, nominal[name]) for name, value in distributions.items()}
        inputs._check()
        return inputs

    def _check(self) -> None:
        if not self._entries:
            raise InputError("there are no inputs: give at least one parameter a distribution")

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
    def discrete(self) -> list[str]:
        """Names of the inputs that have levels."""
        return [name for name, e in self._entries.items() if hasattr(e.distribution, "levels")]

    def levels(self, name: str) -> xr.Dataset:
        """Return the levels of a discrete input: its dim, coords and ``weight``.

        Raises
        ------
        InputError
            If the input is not discrete.
        """
        distribution = self[name].distribution
        if not isinstance(distribution, ContactPatterns):
            raise InputError(f"input {name!r} has no levels: discrete inputs are {self.discrete or 'none'}")
        return distribution.levels(name)

    def without(self, name: str) -> Inputs:
        """Return these inputs without one of them; it may leave none."""
        self[name]
        rest = Inputs.__new__(Inputs)
        rest._entries = {key: entry for key, entry in self._entries.items() if key != name}
        return rest

    def samples(self, u: Array) -> xr.Dataset:
        """Return the physical values at points of the unit cube.

        Parameters
        ----------
        u : (s, dimension) array
            In [0, 1], columns in the order of `groups`.

        Returns
        -------
        Dataset
            One variable for each input, over ``sample`` and its element dim.
        """
        points = np.clip(np.asarray(u, dtype=np.float64), _LOWEST, _HIGHEST)
        if points.ndim != 2 or points.shape[1] != self.dimension:
            raise InputError(f"points have the shape {points.shape}: they need {self.dimension} columns")
        parts: list[xr.Dataset] = []
        start = 0
        for entry in self._entries.values():
            parts.append(entry.variables(points[:, start : start + entry.columns]))
            start += entry.columns
        merged: dict[Any, Any] = {}
        for part in parts:
            merged.update(dict(part.variables))
        coords = {key for part in parts for key in part.coords}
        data = {key: value for key, value in merged.items() if key not in coords}
        return xr.Dataset(data, coords={key: merged[key] for key in coords})

    def to_json(self) -> str:
        """Return a JSON description, enough to rebuild the inputs."""
        return json.dumps({name: entry.to_dict() for name, entry in self._entries.items()})

    @classmethod
    def from_json(cls, text: str) -> Inputs:
        """Return the inputs that `to_json` describes.

        Raises
        ------
        InputError
            If the text is not such a description, or a distribution in it cannot be rebuilt.
        """
        inputs = cls.__new__(cls)
        try:
            data = json.loads(text)
            inputs._entries = {name: Input.from_dict(name, entry) for name, entry in data.items()}
        except (json.JSONDecodeError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"not a description of inputs: {error}") from error
        return inputs


def _contact(name: str, patterns: ContactPatterns) -> Input:
    return Input(name, patterns, "absolute", ("oscillator",), np.zeros(patterns.oscillators), False)


def _entry(name: str, value: object, known: Nominal | None) -> Input:
    """Return the input of one parameter; `known` is what the model says of it."""
    if isinstance(value, ContactPatterns):
        if known is not None and (known.dims != ("oscillator",) or name != "contact"):
            raise InputError(f"{name} cannot be a contact pattern: only contact can")
        if known is not None and known.values.shape != (value.oscillators,):
            raise InputError(
                f"contact patterns of {value.oscillators} oscillators do not fit a model of "
                f"{len(known.values)}: give ContactPatterns(..., oscillators={len(known.values)})"
            )
        return _contact(name, value)
    if not isinstance(value, Variation):
        shape = known.values if known else np.zeros(())
        return Input(
            name, as_distribution(value, name), "absolute", known.dims if known else (), shape, False
        )
    if value.nominal is None and known is None:
        raise InputError(f"{name} is {value.how} to a nominal value that nobody knows: give nominal=")
    nominal = known.values if known and value.nominal is None else np.asarray(value.nominal, np.float64)
    dims = known.dims if known else ((value.each,) if value.each and nominal.ndim else ())
    if known and nominal.shape not in ((), known.values.shape):
        raise InputError(f"nominal of {name} has the shape {nominal.shape}: it needs {known.values.shape}")
    if known:
        nominal = np.array(np.broadcast_to(nominal, known.values.shape))
    if nominal.ndim > 1 or (nominal.ndim == 1 and not dims):
        raise InputError(f"nominal of {name} has {nominal.ndim} dims: name that of its elements with each=")
    if value.each is not None and (value.each,) != dims:
        allowed = f"each={dims[0]!r}" if dims else "no each, it is one number"
        raise InputError(f"each is {value.each!r} for {name}: allowed is {allowed}")
    if not np.isfinite(nominal).all():
        raise InputError(f"nominal of {name} is {nominal.tolist()}: it must be finite")
    return Input(name, value.distribution, value.how, dims, nominal, value.each is not None)
