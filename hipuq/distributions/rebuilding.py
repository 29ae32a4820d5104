"""Distributions from the descriptions that are stored with inputs and results."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hipuq import _chaospy
from hipuq.distributions.adapters import as_distribution, scipy_frozen
from hipuq.distributions.base import Distribution
from hipuq.distributions.mixtures import Component, mixture_of
from hipuq.errors import InputError, unknown_name

KINDS = ("chaospy", "scipy", "mixture")
"""Kinds of descriptions that can be rebuilt."""


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
        return as_distribution(scipy_frozen(description))
    if kind == "mixture":
        return _mixture(description)
    if kind == "opaque":
        raise InputError(
            f"the distribution {description.get('text')} cannot be rebuilt from its description: "
            "give it again"
        )
    raise unknown_name("kind of distribution", kind, KINDS)


def _mixture(description: Mapping[str, Any]) -> Distribution:
    try:
        components = [
            Component(
                part.get("name", ""),
                from_description(part["distribution"]),
                part["weight"],
                part.get("source", ""),
            )
            for part in description["components"]
        ]
    except (AttributeError, KeyError, TypeError) as error:
        raise InputError(f"not a description of a mixture: {error!r}") from error
    return mixture_of(components, description)
