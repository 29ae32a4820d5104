"""The only place that imports chaospy.

Importing chaospy reconfigures the root logger; `load` puts it back as it was. Its discrete
distributions invert to numbers between the levels, so they are mapped to their levels here.
"""

from __future__ import annotations

import ast
import logging
import sys
import warnings
from functools import cache, lru_cache
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq.errors import InputError, unknown_name

Array = NDArray[np.float64]

LEVELS_MAXIMUM = 1_000_000
"""Most levels of a discrete distribution, which are written out to invert it."""

_NOT_DESCRIBED = (
    *("Distribution", "Iid", "UserDistribution"),
    *("ScipyStatsDist", "OpenTURNSDist", "openturns_dist"),
)
"""Distributions of chaospy that are made of functions and objects, or of any number of copies."""


def load() -> ModuleType:
    """Import chaospy and leave the root logger as it was."""
    if "chaospy" not in sys.modules:
        root = logging.getLogger()
        level, handlers = root.level, list(root.handlers)
        import chaospy  # noqa: F401

        root.setLevel(level)
        for handler in [handler for handler in root.handlers if handler not in handlers]:
            root.removeHandler(handler)
            handler.close()
    return sys.modules["chaospy"]


def is_distribution(value: object) -> bool:
    """Say whether `value` is a chaospy distribution, without importing chaospy."""
    chaospy = sys.modules.get("chaospy")
    return chaospy is not None and isinstance(value, chaospy.Distribution)


def length(distribution: Any) -> int:
    """Return the number of variables of a chaospy distribution."""
    return len(distribution)


def support(distribution: Any) -> tuple[float, float]:
    """Return the lower and upper end of a one-dimensional distribution."""
    lower, upper = float(distribution.lower[0]), float(distribution.upper[0])
    if distribution.interpret_as_integer:
        # The ends lie half a level, give or take rounding, outside the levels.
        return float(round(lower + 0.5)), float(round(upper - 0.5))
    return lower, upper


def ppf(distribution: Any, u: Array) -> Array:
    """Return the quantiles at `u`, any shape, levels for a discrete distribution."""
    if distribution.interpret_as_integer:
        lower, upper = support(distribution)
        if not upper - lower < LEVELS_MAXIMUM:
            raise ValueError(f"it has more than {LEVELS_MAXIMUM:,} levels, from {lower:g} to {upper:g}")
        levels = np.arange(lower, upper + 1)
        cumulative = _cumulative(distribution, levels)
        cumulative[-1] = 1.0
        found: Array = levels[np.searchsorted(cumulative, u, side="left").clip(0, len(levels) - 1)]
        return found
    with np.errstate(all="ignore"):
        # Its searches step outside the numbers on the way.
        flat = np.asarray(distribution.inv(np.ravel(u)), dtype=np.float64)
    return flat.reshape(np.shape(u))


def _cumulative(distribution: Any, x: Array) -> Array:
    with warnings.catch_warnings():
        # Of the whole number of trials of a binomial distribution, which chaospy gives scipy as a float.
        warnings.filterwarnings("ignore", "non-integer arg n", DeprecationWarning)
        return np.asarray(distribution.cdf(x), dtype=np.float64)


def adds_up(distribution: Any) -> bool:
    """Say whether the cumulative probability reaches 1 at the upper end.

    That of ``Trunc`` with both ends does not in chaospy 4.3, and its quantiles are as wrong.
    """
    return bool(abs(float(_cumulative(distribution, distribution.upper)[0]) - 1) < 1e-9)


def cdf(distribution: Any, x: Array) -> Array:
    """Return the cumulative probability at `x`, any shape."""
    at = np.floor(x) if distribution.interpret_as_integer else np.asarray(x, dtype=np.float64)
    # Outside its support chaospy's formulas can give NaN.
    lower, upper = support(distribution)
    flat = _cumulative(distribution, np.ravel(at.clip(lower, upper)))
    inside = flat.reshape(np.shape(x))
    return np.where(at < lower, 0.0, np.where(at >= upper, 1.0, inside))


def is_discrete(value: object) -> bool:
    """Say whether `value` is a chaospy distribution of integers."""
    return is_distribution(value) and bool(value.interpret_as_integer)  # type: ignore[attr-defined]


@lru_cache(maxsize=256)
def recurrence(name: str, arguments: tuple[float, ...], order: int) -> Array:
    """Return recurrence coefficients of the monic polynomials orthogonal for a distribution.

    ``p[k+1](x) = (x - a[k]) p[k](x) - b[k] p[k-1](x)``, from chaospy's closed forms.

    Parameters
    ----------
    name : str
        Name of chaospy's distribution, one that has closed forms.
    arguments : tuple of float
        Its arguments.
    order : int
        Highest k.

    Returns
    -------
    (2, order + 1) array
        a and b; b[0] is 1, the whole probability.
    """
    chaospy = load()
    found = np.array(chaospy.stieltjes(order, getattr(chaospy, name)(*arguments))[0][:, 0], np.float64)
    found.flags.writeable = False
    return found


def to_dict(distribution: Any) -> dict[str, Any]:
    """Return class names and arguments of a distribution, read from its representation."""
    expression = ast.parse(repr(distribution), mode="eval").body
    description: dict[str, Any] = _call_to_dict(expression)
    return description


def _call_to_dict(node: ast.expr) -> Any:
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        return {
            "name": node.func.id,
            "args": [_call_to_dict(arg) for arg in node.args],
            "kwargs": {str(pair.arg): _call_to_dict(pair.value) for pair in node.keywords},
        }
    return ast.literal_eval(node)


def from_dict(data: dict[str, Any]) -> Any:
    """Return the distribution that `to_dict` describes.

    Raises
    ------
    UnknownNameError
        If chaospy has no such distribution.
    InputError
        If it is no description, or the distribution does not take the arguments.
    """
    if not isinstance(data, dict) or not isinstance(data.get("name"), str):
        raise InputError(f"not a description of a chaospy distribution: {str(data)[:60]}")
    chaospy, name = load(), data["name"]
    if name not in names():
        raise unknown_name("chaospy distribution", name, names())
    arguments = [_argument(value) for value in data.get("args", ())]
    keywords = {key: _argument(value) for key, value in data.get("kwargs", {}).items()}
    try:
        return getattr(chaospy, name)(*arguments, **keywords)
    except (TypeError, ValueError, AssertionError, ArithmeticError, LookupError, AttributeError) as error:
        raise InputError(f"chaospy.{name} does not take these arguments: {error}") from error


def _argument(value: Any) -> Any:
    """Return a number, a list of them or a distribution from its description; no other thing is in one."""
    if isinstance(value, dict):
        return from_dict(value)
    if isinstance(value, list):
        return [_argument(one) for one in value]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return value
    raise InputError(f"an argument of a chaospy distribution is {str(value)[:60]!r}: it must be a number")


@cache
def names() -> list[str]:
    """Return the names of chaospy's distributions that can be described."""
    chaospy = load()
    return sorted(
        name
        for name in dir(chaospy)
        if isinstance(getattr(chaospy, name), type)
        and issubclass(getattr(chaospy, name), chaospy.Distribution)
        and name not in _NOT_DESCRIBED
    )
