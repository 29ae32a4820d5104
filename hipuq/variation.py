"""One uncertain parameter: its distribution, and how it applies to a nominal value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from hipuq import schema
from hipuq.contact import ContactPatterns
from hipuq.distributions import Distribution, as_distribution, from_description
from hipuq.errors import InputError

Array = NDArray[np.float64]


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
        return self.from_draws(self.draws(u))

    @property
    def drawn(self) -> Distribution:
        """Distribution of a draw.

        Raises
        ------
        InputError
            If it is a contact pattern, which is a level and no number.
        """
        if isinstance(self.distribution, ContactPatterns):
            raise InputError(f"{self.name} is a contact pattern: it has levels, no draws")
        return self.distribution

    def draws(self, u: Array) -> Array:
        """Return the draws at points of the unit cube, both (samples, columns).

        Raises
        ------
        InputError
            If it is a contact pattern.
        """
        draws = np.asarray(self.drawn.ppf(u if self.each else u[:, 0]), dtype=np.float64)
        return draws.reshape(len(u), self.columns)

    def from_draws(self, draws: Array) -> xr.Dataset:
        """Return the physical values that draws (samples, columns) stand for."""
        values = self._applied(draws)
        known = schema.PARAMETERS.get(self.name)
        attrs = known.attrs if known else {"long_name": self.name, "units": ""}
        coords = {
            dim: schema.index(dim, size)
            for dim, size in zip(self.dims, self.nominal.shape, strict=True)
            if dim in schema.COORDINATES
        }
        return xr.Dataset({self.name: (("sample", *self.dims), values, attrs)}, coords)

    def _applied(self, draws: Array) -> Array:
        draw = draws if self.nominal.ndim else draws[:, 0]
        if self.how == "relative":
            values = self.nominal * (1 + draw)
        elif self.how == "shift":
            values = self.nominal + draw
        else:
            values = draw
        return np.broadcast_to(values, (len(draws), *self.nominal.shape)).copy()

    def to_draws(self, values: Array) -> Array:
        """Return the draws that physical values come from, the inverse of `from_draws`.

        Parameters
        ----------
        values : (samples,) or (samples, size) array
            One number for all elements, or one for each.

        Returns
        -------
        (samples, columns) array

        Raises
        ------
        InputError
            If the draw cannot be told from the values (relative to a nominal value of 0), or elements
            that share a draw have values of different ones.
        """
        nominal = np.atleast_1d(self.nominal)
        x = np.asarray(values, dtype=np.float64)
        x = np.broadcast_to(x[:, None] if x.ndim == 1 else x, (len(x), nominal.size))
        if not self.each:
            # Of the elements that share a draw take the one that it can be told from best.
            size = np.abs(nominal)
            best = int(np.argmax(size) if self.how == "relative" else np.argmin(size))
            x, nominal = x[:, best : best + 1], nominal[best : best + 1]
        if self.how == "relative":
            if not nominal.all():
                raise InputError(
                    f"{self.name} is relative to a nominal value of 0, which no draw changes: "
                    "take shift, or leave it out"
                )
            draws = x / nominal - 1
        else:
            draws = x - nominal if self.how == "shift" else x
        draws = np.array(draws)
        if not self.each and np.ndim(values) > 1:
            self._check_shared(np.asarray(values, dtype=np.float64), draws)
        return draws

    def _check_shared(self, values: Array, draws: Array) -> None:
        again = self._applied(draws)
        with np.errstate(invalid="ignore"):
            wrong = np.abs(again - values) > 1e-6 * np.abs(again).max(initial=0.0)
        if wrong.any():
            bad = int(np.argmax(wrong.any(axis=1)))
            raise InputError(
                f"the elements of {self.name} share one draw, but not those of sample {bad}: "
                "were these samples made for other inputs?"
            )

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


def _contact(name: str, patterns: ContactPatterns) -> Input:
    return Input(name, patterns, "absolute", ("oscillator",), np.zeros(patterns.oscillators), False)


def as_input(name: str, value: object, known: Nominal | None) -> Input:
    """Return the input of one parameter.

    Parameters
    ----------
    name : str
        Name of the parameter.
    value : object
        A distribution, `relative`, `shift` or `ContactPatterns`.
    known : Nominal or None
        What the model says of it; None without a model.

    Returns
    -------
    Input

    Raises
    ------
    InputError
        If it cannot be used for this parameter.
    """
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
    try:
        nominal = known.values if known and value.nominal is None else np.asarray(value.nominal, np.float64)
    except (TypeError, ValueError):
        raise InputError(f"nominal of {name} is {value.nominal!r}: it must be numbers") from None
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
