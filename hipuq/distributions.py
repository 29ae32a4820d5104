"""Distributions of one variable: chaospy, frozen scipy, or anything with ``ppf``.

All sampling goes through `Distribution.ppf` of points in the unit interval, so that every design
(random, latin hypercube, Sobol) and every kind of distribution go together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq import _chaospy
from hipuq.errors import InputError, check_name, unknown_name

Array = NDArray[np.float64]

# Where a stored description is compared with the distribution that it describes.
_PROBES = np.array([0.01, 0.2, 0.5, 0.77, 0.99])


@dataclass(frozen=True)
class Distribution:
    """A distribution of one variable.

    Attributes
    ----------
    source : object
        The object that it was made from.
    ppf : callable
        Quantile function: array in (0, 1) -> array of the same shape.
    cdf : callable or None
        Cumulative probability: array -> array of the same shape.
    support : tuple of float
        Its lower and upper end.
    description : mapping
        What rebuilds it, JSON-able; ``{"kind": "opaque", ...}`` where nothing can.
    """

    source: object
    ppf: Callable[[Array], Array]
    cdf: Callable[[Array], Array] | None
    support: tuple[float, float]
    description: Mapping[str, Any]

    @property
    def rebuilds(self) -> bool:
        """Whether the description is enough to make it again."""
        return bool(self.description["kind"] != "opaque")

    def __eq__(self, other: object) -> bool:
        """Compare descriptions: equal distributions have the same name and arguments."""
        if not isinstance(other, Distribution):
            return NotImplemented
        if not (self.rebuilds and other.rebuilds):
            return self.source is other.source
        return bool(self.description == other.description)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"Distribution({self.source!r})"


def as_distribution(value: object, name: str = "distribution") -> Distribution:
    """Return `value` as a `Distribution`.

    Parameters
    ----------
    value : object
        A chaospy distribution of one variable, a frozen scipy one, or anything with ``ppf``.
    name : str
        What to call it in an error.

    Returns
    -------
    Distribution

    Raises
    ------
    InputError
        If it has no ``ppf``, more than one variable, or quantiles that are not numbers.
    """
    if isinstance(value, Distribution):
        return value
    try:
        if _chaospy.is_distribution(value):
            found = _from_chaospy(value, name)
        elif callable(getattr(value, "ppf", None)):
            found = _from_ppf(value)
        else:
            raise InputError(
                f"{name} is {value!r}: it must be a chaospy distribution, a frozen scipy one, "
                "or an object with ppf"
            )
        _check_quantiles(found, name)
    except InputError:
        raise
    except (AssertionError, AttributeError, TypeError, ValueError) as error:
        # chaospy checks its arguments by assert, some of them on first use only; scipy's quantiles
        # of several variables do not broadcast.
        raise InputError(f"{name} is {value!r}, which cannot be used: {error}") from error
    return found


def from_description(description: Mapping[str, Any]) -> Distribution:
    """Return the distribution that a stored description stands for.

    Raises
    ------
    InputError
        If the description is opaque or not understood.
    """
    kind = description.get("kind")
    if kind == "chaospy":
        return as_distribution(_chaospy.from_dict(dict(description)))
    if kind == "scipy":
        return as_distribution(_scipy_frozen(description))
    if kind == "opaque":
        raise InputError(
            f"the distribution {description.get('text')} cannot be rebuilt from its description: "
            "give it again"
        )
    raise unknown_name("kind of distribution", kind, ["chaospy", "scipy"])


def _from_chaospy(value: Any, name: str) -> Distribution:
    if _chaospy.length(value) != 1:
        raise InputError(
            f"{name} is a joint distribution of {_chaospy.length(value)} variables: "
            "give each parameter a distribution of its own"
        )
    if not _chaospy.adds_up(value):
        raise InputError(
            f"{name} is {value!r}, whose probabilities do not add up to 1 in chaospy: it truncates rightly "
            "at one end only, so nest two, Trunc(Trunc(..., lower=a), upper=b), or take TruncNormal"
        )
    try:
        description = {"kind": "chaospy", **_chaospy.to_dict(value)}
        again = _chaospy.from_dict(description)
        if not np.array_equal(_chaospy.ppf(again, _PROBES), _chaospy.ppf(value, _PROBES)):
            raise InputError("the description is not exact")
    except (InputError, SyntaxError, ValueError):
        description = {"kind": "opaque", "text": repr(value)}
    return Distribution(
        value,
        lambda u: _chaospy.ppf(value, u),
        lambda x: _chaospy.cdf(value, x),
        _chaospy.support(value),
        description,
    )


def _from_ppf(value: Any) -> Distribution:
    family = getattr(getattr(value, "dist", None), "name", None)
    description: dict[str, Any] = {"kind": "opaque", "text": repr(value)}
    if isinstance(family, str) and hasattr(value, "args") and hasattr(value, "kwds"):
        plain = [_plain(arg) for arg in value.args]
        keywords = {key: _plain(arg) for key, arg in value.kwds.items()}
        if None not in plain and None not in keywords.values():
            description = {"kind": "scipy", "name": family, "args": plain, "kwargs": keywords}
            if not _rebuilds(description, value):
                description = {"kind": "opaque", "text": repr(value)}
    cdf = getattr(value, "cdf", None)
    ends = np.asarray(value.ppf(np.array([0.0, 1.0])), dtype=np.float64)
    return Distribution(
        value,
        lambda u: np.asarray(value.ppf(u), dtype=np.float64),
        (lambda x: np.asarray(cdf(x), dtype=np.float64)) if callable(cdf) else None,
        (float(ends[0]), float(ends[1])),
        description,
    )


def _rebuilds(description: Mapping[str, Any], value: Any) -> bool:
    """Say whether a description of scipy's gives the distribution that it was made from."""
    try:
        again = _scipy_frozen(description)
        return bool(np.array_equal(again.ppf(_PROBES), value.ppf(_PROBES)))
    except (InputError, TypeError, ValueError):
        return False


def _plain(value: Any) -> float | None:
    """Return a number as float, None for anything else."""
    return float(value) if np.ndim(value) == 0 and isinstance(value, (int, float, np.number)) else None


def _scipy_frozen(description: Mapping[str, Any]) -> Any:
    from scipy import stats

    name = description["name"]
    family = getattr(stats, str(name), None)
    if not isinstance(family, (stats.rv_continuous, stats.rv_discrete)):
        raise InputError(f"scipy.stats has no distribution {name!r}")
    try:
        return family(*description.get("args", ()), **description.get("kwargs", {}))
    except (TypeError, ValueError) as error:
        raise InputError(f"scipy.stats.{name} does not take these arguments: {error}") from error


def _check_quantiles(distribution: Distribution, name: str) -> None:
    """Raise an InputError unless quantiles are finite numbers that do not fall."""
    lower, upper = distribution.support
    if not lower <= upper:
        raise InputError(f"{name} has the support {lower:g} to {upper:g}: check its arguments")
    quantiles = np.asarray(distribution.ppf(_PROBES), dtype=np.float64)
    if quantiles.shape != _PROBES.shape or not np.isfinite(quantiles).all():
        raise InputError(f"{name} gives quantiles that are not finite numbers: check its arguments")
    if (np.diff(quantiles) < 0).any():
        raise InputError(f"{name} gives quantiles that fall: its ppf must not decrease")


FAMILIES: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "uniform": ("Uniform", ("lower", "upper"), ()),
    "normal": ("Normal", ("mu", "sigma"), ()),
    "truncated_normal": ("TruncNormal", ("lower", "upper", "mu", "sigma"), ()),
    "lognormal": ("LogNormal", ("mu", "sigma"), ("shift", "scale")),
    "log_uniform": ("Reciprocal", ("lower", "upper"), ()),
    "triangle": ("Triangle", ("lower", "midpoint", "upper"), ()),
    "beta": ("Beta", ("alpha", "beta"), ("lower", "upper")),
    "pert": ("PERT", ("lower", "mode", "upper"), ("gamma",)),
    "gamma": ("Gamma", ("shape", "scale"), ("shift",)),
    "exponential": ("Exponential", ("scale",), ("shift",)),
    "weibull": ("Weibull", ("shape", "scale"), ("shift",)),
    "discrete_uniform": ("DiscreteUniform", ("lower", "upper"), ()),
    "binomial": ("Binomial", ("size", "prob"), ()),
}
"""Name in study files -> chaospy's name, the parameters that must and those that may be given."""


def from_family(family: str, parameters: Mapping[str, Any]) -> Distribution:
    """Return a distribution by the name and parameters used in study files.

    Parameters
    ----------
    family : str
        One of `FAMILIES`.
    parameters : mapping
        Its parameters, those of chaospy's distribution.

    Returns
    -------
    Distribution

    Raises
    ------
    UnknownNameError
        If there is no such family or parameter.
    InputError
        If a parameter is missing or not a finite number.
    """
    name, required, optional = FAMILIES[check_name("distribution", family, FAMILIES)]
    allowed = required + optional
    for key, value in parameters.items():
        check_name(f"parameter of the distribution {family!r}", key, allowed)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
            raise InputError(f"{key} of the distribution {family!r} is {value!r}: it must be a finite number")
    for key in required:
        if key not in parameters:
            raise InputError(f"the distribution {family!r} needs {', '.join(required)}: {key} is missing")
    made = _chaospy.from_dict({"name": name, "kwargs": dict(parameters)})
    return as_distribution(made, f"distribution {family!r}")
