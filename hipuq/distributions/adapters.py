"""Distributions of others: chaospy, frozen scipy, or anything with ``ppf``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from hipuq import _chaospy
from hipuq.distributions.base import PROBES, Array, Distribution, check_quantiles
from hipuq.errors import InputError

_RAISED = (
    AssertionError,
    AttributeError,
    ArithmeticError,
    LookupError,
    RecursionError,
    TypeError,
    ValueError,
)
"""What distributions of others were seen to raise about their arguments."""


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
        check_quantiles(found, name)
    except InputError:
        raise
    except _RAISED as error:
        # chaospy checks its arguments by assert, some of them on first use only; scipy's quantiles
        # of several variables do not broadcast.
        raise InputError(f"{name} is {value!r}, which cannot be used: {error}") from error
    return found


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
    if not np.array_equal(_chaospy.ppf(value, PROBES), _chaospy.ppf(value, PROBES)):
        raise InputError(
            f"{name} is {value!r}, whose quantiles chaospy draws anew at each call: take hipuq.mixture of "
            "normal distributions"
        )
    try:
        description = {"kind": "chaospy", **_chaospy.to_dict(value)}
        again = _chaospy.from_dict(description)
        if not np.array_equal(_chaospy.ppf(again, PROBES), _chaospy.ppf(value, PROBES)):
            raise InputError("the description is not exact")
    except (InputError, SyntaxError, ValueError):
        description = {"kind": "opaque", "text": repr(value)}
    if _is_skewed_pert(description):
        raise InputError(
            f"{name} is {value!r}: chaospy's PERT takes the mean for the mode; take the family 'pert' of a "
            "study, or chaospy's Beta with the shapes 1 + 4 (mode - lower) / (upper - lower) and "
            "1 + 4 (upper - mode) / (upper - lower)"
        )
    return Distribution(
        value,
        partial(_chaospy.ppf, value),
        partial(_chaospy.cdf, value),
        _chaospy.support(value),
        description,
    )


def _is_skewed_pert(description: Any) -> bool:
    """Say whether a description holds a PERT of chaospy whose mode is not in the middle."""
    if isinstance(description, list):
        return any(map(_is_skewed_pert, description))
    if not isinstance(description, Mapping):
        return False
    if description.get("name") == "PERT":
        given = dict(zip(("lower", "mode", "upper"), description["args"], strict=False))
        given |= description["kwargs"]
        if all(isinstance(given.get(key), int | float) for key in ("lower", "mode", "upper")):
            return not np.isclose(2 * given["mode"], given["lower"] + given["upper"], rtol=1e-12, atol=0)
        return True
    return any(map(_is_skewed_pert, description.values()))


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
        partial(_doubles, value.ppf),
        partial(_doubles, cdf) if callable(cdf) else None,
        (float(ends[0]), float(ends[1])),
        description,
    )


def _doubles(function: Callable[[Array], Any], points: Array) -> Array:
    """Return what a function of another library gives, as an array of doubles."""
    return np.asarray(function(points), dtype=np.float64)


def _rebuilds(description: Mapping[str, Any], value: Any) -> bool:
    """Say whether a description of scipy's gives the distribution that it was made from."""
    try:
        again = scipy_frozen(description)
        return bool(np.array_equal(again.ppf(PROBES), value.ppf(PROBES)))
    except _RAISED:
        return False


def _plain(value: Any) -> float | None:
    """Return a number as float, None for anything else."""
    return float(value) if np.ndim(value) == 0 and isinstance(value, (int, float, np.number)) else None


def scipy_frozen(description: Mapping[str, Any]) -> Any:
    """Return the frozen distribution of scipy that a description stands for.

    Raises
    ------
    InputError
        If scipy has none of this name, or it does not take the arguments.
    """
    from scipy import stats

    name = description["name"]
    family = getattr(stats, str(name), None)
    if not isinstance(family, (stats.rv_continuous, stats.rv_discrete)):
        raise InputError(f"scipy.stats has no distribution {name!r}")
    try:
        return family(*description.get("args", ()), **description.get("kwargs", {}))
    except _RAISED as error:
        raise InputError(f"scipy.stats.{name} does not take these arguments: {error}") from error
