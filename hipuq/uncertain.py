"""One uncertain parameter: its distribution, and how it applies to a nominal value."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.contact import CONTACT_PATTERNS, ContactPatterns
from hipuq.distributions import Distribution, as_distribution, from_description
from hipuq.errors import InputError
from hipuq.variation import UNWARNED, Nominal, Variation

Array = NDArray[np.float64]

# Ends of what designs draw: quantiles at 0 and 1 may be infinite, and designs can touch 0, and 1 by rounding.
LOWEST, HIGHEST = 2.0**-64, 1.0 - 2.0**-53

HOW = ("absolute", "relative", "shift")
"""How a distribution applies to a nominal value."""

_PROBES = np.array([LOWEST, 1e-9, 1e-3, 0.1, 0.5, 0.9, 0.999, 1 - 1e-9, HIGHEST])


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
    labels : mapping or None
        ``long_name`` and ``units`` of a parameter that the schema does not know.
    """

    name: str
    distribution: Distribution | ContactPatterns
    how: str
    dims: tuple[str, ...]
    nominal: Array
    each: bool
    labels: Mapping[str, Any] | None = None

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
        attrs = known.attrs if known else self.labels or {"long_name": self.name, "units": ""}
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
            return {"how": CONTACT_PATTERNS, **self.distribution.to_dict()}
        described: dict[str, Any] = {
            "how": self.how,
            "distribution": dict(self.distribution.description),
            "dims": list(self.dims),
            "nominal": self.nominal.tolist(),
            "each": self.each,
        }
        return described | ({"labels": dict(self.labels)} if self.labels else {})

    @classmethod
    @UNWARNED
    def from_dict(cls, name: str, data: Mapping[str, Any]) -> Input:
        """Return the input that `to_dict` describes.

        Raises
        ------
        InputError
            If something in the description cannot be used.
        """
        how = data["how"]
        if how == CONTACT_PATTERNS:
            rest = {key: value for key, value in data.items() if key != "how"}
            return _contact(name, ContactPatterns(**rest))
        if how not in HOW:
            raise InputError(f"{name} is {how!r}: it must be one of {', '.join(HOW)}, or {CONTACT_PATTERNS}")
        dims, each = data["dims"], data["each"]
        if not isinstance(dims, list) or not all(isinstance(dim, str) and dim for dim in dims):
            raise InputError(f"dims of {name} are {dims!r}: they must be a list of names")
        nominal = _numbers(name, data["nominal"])
        if nominal.ndim != len(dims) or nominal.ndim > 1:
            raise InputError(f"nominal of {name} has {nominal.ndim} dims, and {len(dims)} names of them")
        if not isinstance(each, bool) or (each and (how == "absolute" or not dims)):
            raise InputError(f"each of {name} is {each!r}: only a change of elements has a draw for each")
        labels = data.get("labels")
        if labels is not None and not (
            isinstance(labels, dict) and all(isinstance(text, str) for text in labels.values())
        ):
            raise InputError(f"labels of {name} are {labels!r}: they must be texts by name")
        distribution = from_description(data["distribution"])
        return _checked(cls(name, distribution, how, tuple(dims), nominal, each, labels))


def described(text: str) -> dict[str, dict[str, Any]]:
    """Return what a description says of each input; it may hold what cannot be rebuilt.

    Parameters
    ----------
    text : str
        As from `hipuq.Inputs.to_json`.

    Returns
    -------
    dict
        Name -> what `Input.to_dict` gave.

    Raises
    ------
    InputError
        If the text is not such a description.
    """
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"not a description of inputs: {error}") from error
    if not (isinstance(found, dict) and all(isinstance(entry, dict) for entry in found.values())):
        raise InputError(f"not a description of inputs: {text[:60]!r} is no table of tables")
    return found


def _numbers(name: str, nominal: object) -> Array:
    """Return a nominal value as an array of finite numbers."""
    try:
        values = np.asarray(nominal, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"nominal of {name} is {nominal!r}: it must be numbers") from None
    if not np.isfinite(values).all() or not values.size:
        raise InputError(f"nominal of {name} is {values.tolist()}: it must be finite")
    return values


def _checked(entry: Input) -> Input:
    """Return an input once its values are known to be finite numbers, wherever designs can draw them.

    A distribution that gives numbers in the middle may give none at its ends, and a change of a nominal
    value can be too large for it.
    """
    found = np.asarray(entry.drawn.ppf(_PROBES), dtype=np.float64)
    values = entry._applied(np.broadcast_to(found[:, None], (len(found), entry.columns)))
    if not np.isfinite(values).all():
        bad = _PROBES[~np.isfinite(values).reshape(len(_PROBES), -1).all(axis=1)][0]
        raise InputError(f"{entry.name} is no finite number at the quantile {bad:.12g}: check its arguments")
    lower, upper = entry.drawn.support
    slack = 1e-9 * np.abs(found).max()
    if (np.diff(found) < -slack).any():
        raise InputError(f"{entry.name} has quantiles that fall: its ppf must not decrease")
    if found[0] < lower - slack or found[-1] > upper + slack:
        raise InputError(f"{entry.name} has quantiles outside its support {lower:g} to {upper:g}")
    return entry


def _contact(name: str, patterns: ContactPatterns) -> Input:
    return Input(name, patterns, "absolute", ("oscillator",), np.zeros(patterns.oscillators), False)


@UNWARNED
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
    own = known.variable if known and name not in schema.PARAMETERS else None
    labels = own.attrs if own else None
    if not isinstance(value, Variation):
        shape = known.values if known else np.zeros(())
        dims = known.dims if known else ()
        return _checked(Input(name, as_distribution(value, name), "absolute", dims, shape, False, labels))
    if value.nominal is None and known is None:
        raise InputError(f"{name} is {value.how} to a nominal value that nobody knows: give nominal=")
    nominal = known.values if known and value.nominal is None else _numbers(name, value.nominal)
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
    each = value.each is not None
    return _checked(Input(name, value.distribution, value.how, dims, nominal, each, labels))
