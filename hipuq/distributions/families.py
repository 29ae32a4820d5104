"""Distributions by the names that they have in study files."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hipuq import _chaospy
from hipuq.distributions.adapters import as_distribution
from hipuq.distributions.base import Distribution
from hipuq.errors import InputError, check_name

FAMILIES: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "uniform": ("Uniform", ("lower", "upper"), ()),
    "normal": ("Normal", ("mu", "sigma"), ()),
    "truncated_normal": ("TruncNormal", ("lower", "upper", "mu", "sigma"), ()),
    "lognormal": ("LogNormal", ("mu", "sigma"), ("shift", "scale")),
    "log_uniform": ("Reciprocal", ("lower", "upper"), ()),
    "triangle": ("Triangle", ("lower", "midpoint", "upper"), ()),
    "beta": ("Beta", ("alpha", "beta"), ("lower", "upper")),
    "pert": ("Beta", ("lower", "mode", "upper"), ("gamma",)),
    "gamma": ("Gamma", ("shape", "scale"), ("shift",)),
    "exponential": ("Exponential", ("scale",), ("shift",)),
    "weibull": ("Weibull", ("shape", "scale"), ("shift",)),
    "discrete_uniform": ("DiscreteUniform", ("lower", "upper"), ()),
    "binomial": ("Binomial", ("size", "prob"), ()),
}
"""Name in study files -> chaospy's name, the parameters that must and those that may be given."""

LEVELS_MAXIMUM = 100_000
"""Most values of a discrete distribution."""

_RISING = ("upper > lower", lambda p: p["lower"] < p["upper"])
_SIGMA = ("sigma > 0", lambda p: p["sigma"] > 0)
_SHAPE = ("shape > 0", lambda p: p["shape"] > 0)
_SCALE = ("scale > 0", lambda p: p.get("scale", 1) > 0)

CONDITIONS: Mapping[str, tuple[tuple[str, Callable[[Mapping[str, float]], bool]], ...]] = {
    "uniform": (_RISING,),
    "normal": (_SIGMA,),
    "truncated_normal": (
        _RISING,
        _SIGMA,
        # chaospy's quantiles are those of differences of the normal distribution: none are left of less.
        ("more than a millionth of the normal distribution between its ends", lambda p: _between(p) > 1e-6),
    ),
    "lognormal": (_SIGMA, _SCALE),
    "log_uniform": (_RISING, ("lower > 0", lambda p: p["lower"] > 0)),
    "triangle": (
        _RISING,
        ("lower <= midpoint <= upper", lambda p: p["lower"] <= p["midpoint"] <= p["upper"]),
    ),
    "beta": (
        ("alpha > 0", lambda p: p["alpha"] > 0),
        ("beta > 0", lambda p: p["beta"] > 0),
        ("upper > lower", lambda p: p.get("lower", 0) < p.get("upper", 1)),
    ),
    "pert": (
        _RISING,
        ("lower <= mode <= upper", lambda p: p["lower"] <= p["mode"] <= p["upper"]),
        ("gamma > 0", lambda p: p.get("gamma", 1) > 0),
    ),
    "gamma": (_SHAPE, _SCALE),
    "exponential": (_SCALE,),
    "weibull": (_SHAPE, _SCALE),
    "discrete_uniform": (
        ("integers lower <= upper", lambda p: _whole(p["lower"], p["upper"]) and p["lower"] <= p["upper"]),
        (f"at most {LEVELS_MAXIMUM:,} values", lambda p: p["upper"] - p["lower"] < LEVELS_MAXIMUM),
        ("values below 2**53", lambda p: max(abs(p["lower"]), abs(p["upper"])) < 2**53),
    ),
    "binomial": (
        ("an integer size > 0", lambda p: _whole(p["size"]) and p["size"] > 0),
        (f"a size below {LEVELS_MAXIMUM:,}", lambda p: p["size"] < LEVELS_MAXIMUM),
        ("0 < prob < 1", lambda p: 0 < p["prob"] < 1),
    ),
}
"""Name in study files -> what its parameters must be, in words and as a function of them.

chaospy takes others too: some then give an error of their own, some numbers that mean nothing.
"""


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
        If a parameter is missing or not a finite number, or they do not go together.
    """
    name, required, optional = FAMILIES[check_name("distribution", family, FAMILIES)]
    allowed = required + optional
    for key, value in parameters.items():
        check_name(f"parameter of the distribution {family!r}", key, allowed)
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not number or not abs(value) <= sys.float_info.max:
            raise InputError(f"{key} of the distribution {family!r} is {value!r}: it must be a finite number")
    for key in required:
        if key not in parameters:
            raise InputError(f"the distribution {family!r} needs {', '.join(required)}: {key} is missing")
    given = ", ".join(f"{key} = {value}" for key, value in parameters.items())
    for words, holds in CONDITIONS[family]:
        if not holds(parameters):
            raise InputError(f"the distribution {family!r} has {given}: it needs {words}")
    arguments = _beta_of(**parameters) if family == "pert" else dict(parameters)
    # Parameters that are too large for their quantiles are refused for what these then are, not warned of.
    try:
        with np.errstate(all="ignore"):
            made = _chaospy.from_dict({"name": name, "kwargs": arguments})
            return as_distribution(made, f"distribution {family!r}")
    except ArithmeticError:
        raise InputError(f"the distribution {family!r} has {given}: its values are too large") from None


def _whole(*values: float) -> bool:
    return all(float(value).is_integer() for value in values)


def _between(p: Mapping[str, float]) -> float:
    """Return the probability that a normal distribution has between two ends."""
    low, high = (math.erf((p[end] - p["mu"]) / p["sigma"] / math.sqrt(2)) for end in ("lower", "upper"))
    return (high - low) / 2


def _beta_of(lower: float, mode: float, upper: float, gamma: float = 4.0) -> dict[str, float]:
    """Return the arguments of the beta distribution that a PERT is.

    Its mean is (lower + gamma mode + upper) / (gamma + 2); that of chaospy 4.3, which takes the mean of
    gamma = 4 for the mode, is another one wherever the mode is not in the middle.
    """
    place = (mode - lower) / (upper - lower)
    return {"alpha": 1 + gamma * place, "beta": 1 + gamma * (1 - place), "lower": lower, "upper": upper}
