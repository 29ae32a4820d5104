"""Distributions by the names that they have in study files."""

from __future__ import annotations

from collections.abc import Mapping
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
