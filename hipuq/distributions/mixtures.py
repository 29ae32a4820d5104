"""Mixtures: one variable that follows one of several distributions, each with a probability."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from hipuq.distributions.adapters import as_distribution
from hipuq.distributions.base import Array, Distribution, check_quantiles
from hipuq.distributions.inversion import inverted
from hipuq.distributions.words import described
from hipuq.errors import InputError, check_name

ROUNDING = 1e-9
"""How far from 1 weights may add up."""

# Quantiles of the components between which a quantile of the mixture is looked for first.
_LADDER = np.concatenate(
    [2.0 ** np.arange(-40, -8), np.arange(1, 256) / 256, 1 - 2.0 ** np.arange(-9, -41, -1)]
)


@dataclass(frozen=True)
class Component:
    """A part of a mixture.

    Attributes
    ----------
    name : str
        Empty where it has none.
    distribution : Distribution
    weight : float
        Its probability.
    source : str
        Where the distribution comes from; empty where nobody said.
    """

    name: str
    distribution: Distribution
    weight: float
    source: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-able description."""
        named = {"name": self.name} if self.name else {}
        cited = {"source": self.source} if self.source else {}
        own = dict(self.distribution.description)
        return {**named, "weight": self.weight, "distribution": own, **cited}


def mixture(
    components: Sequence[object] | Mapping[str, object],
    weights: Sequence[float] | Mapping[str, float] | None = None,
) -> Distribution:
    """Return the distribution of a variable that follows one of several, each with a probability.

    F(x) is the sum of weight times F of the component, and the quantile at u the smallest double x with
    F(x) >= u: gaps between the components, values of positive probability and discrete components are
    right as they are.

    Parameters
    ----------
    components : sequence or mapping
        The distributions, of chaospy, frozen ones of scipy, mixtures, or objects with ``ppf`` and ``cdf``;
        in a mapping by name.
    weights : sequence or mapping, optional
        Their probabilities [1], in the same order or by the same names; all alike without it. A component of
        weight 0 stays in the description and is never drawn.

    Returns
    -------
    Distribution
        To be used wherever a distribution is. It can be stored if its components can.

    Raises
    ------
    InputError
        If there is no component, one has no ``cdf``, or the weights are not as many as the components,
        finite, not negative, and 1 together.
    UnknownNameError
        If a weight is given by a name that no component has.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> parts = [cp.Uniform(0.0, 1.0), cp.Uniform(3.0, 5.0)]
    >>> two = hipuq.mixture(parts, weights=[0.25, 0.75])
    >>> two.ppf([0.125, 0.25, 0.5, 1.0]).round(3)
    array([0.5  , 1.   , 3.667, 5.   ])
    >>> two.cdf([0.5, 2.0, 4.0])
    array([0.125, 0.25 , 0.625])
    """
    named = isinstance(components, Mapping)
    if not (named or isinstance(components, Sequence)) or isinstance(components, str):
        shown = " ".join(repr(components).split())
        raise InputError(f"components are {shown}: they must be a list, or a dict by name")
    names = [str(key) for key in components] if isinstance(components, Mapping) else [""] * len(components)
    values = list(components.values()) if isinstance(components, Mapping) else list(components)
    if not values:
        raise InputError("the mixture has no components: give at least one distribution")
    parts = [
        as_distribution(value, f"component {name or number}")
        for number, (name, value) in enumerate(zip(names, values, strict=True), 1)
    ]
    given = _weights(names, weights)
    return mixture_of([Component(*part) for part in zip(names, parts, given, strict=True)])


def _weights(names: Sequence[str], weights: Sequence[float] | Mapping[str, float] | None) -> list[float]:
    """Return a weight for each name."""
    if weights is None:
        return [1.0 / len(names)] * len(names)
    if isinstance(weights, Mapping):
        if not any(names):
            raise InputError(f"weights are {weights!r}, by name: give the components by name too")
        for name in weights:
            check_name("component that has a weight", name, names)
        for name in names:
            if name not in weights:
                raise InputError(f"component {name!r} has no weight")
        return [weights[name] for name in names]
    listed = isinstance(weights, (Sequence, np.ndarray)) and not isinstance(weights, str)
    if not listed or len(weights) != len(names):
        raise InputError(f"weights are {weights!r}: the {len(names)} components need one each")
    return list(weights)


def mixture_of(components: Sequence[Component], more: Mapping[str, Any] | None = None) -> Distribution:
    """Return the mixture of checked components.

    Parameters
    ----------
    components : sequence of Component
    more : mapping, optional
        What else its description holds, such as where the weights come from.

    Returns
    -------
    Distribution

    Raises
    ------
    InputError
        As of `mixture`.
    """
    for number, part in enumerate(components, 1):
        weight: object = part.weight
        known = isinstance(weight, (int, float, np.number)) and not isinstance(weight, bool)
        if not (known and 0 <= part.weight <= sys.float_info.max):
            raise InputError(
                f"the weight of component {part.name or number} is {weight!r}: "
                "it must be a finite number that is not negative"
            )
        if part.distribution.cdf is None:
            raise InputError(
                f"component {part.name or number} is {part.distribution.source!r}, which has no cdf: "
                "a mixture is inverted by it"
            )
    total = float(np.sum([part.weight for part in components]))
    if abs(total - 1) > ROUNDING:
        raise InputError(f"the weights of the mixture add up to {total:.12g}: they must add up to 1")
    made = Mixture(tuple(replace(part, weight=float(part.weight)) for part in components))
    own = {"components": [part.to_dict() for part in made.components]}
    description = {**(more or {}), "kind": "mixture", **own, "text": described(own)}
    found = Distribution(made, made.ppf, made.cdf, made.support, description)
    check_quantiles(found, "the mixture")
    return found


@dataclass(frozen=True, eq=False)
class Mixture:
    """What a mixture computes.

    Attributes
    ----------
    components : tuple of Component
    """

    components: tuple[Component, ...]

    def __repr__(self) -> str:
        return f"mixture({described({'components': [part.to_dict() for part in self.components]})})"

    @cached_property
    def drawn(self) -> list[tuple[float, Distribution]]:
        """The components that are ever drawn, with weights that add up to 1 as near as they can."""
        total = float(np.sum([part.weight for part in self.components]))
        return [(part.weight / total, part.distribution) for part in self.components if part.weight > 0]

    @cached_property
    def support(self) -> tuple[float, float]:
        """Lower and upper end."""
        ends = np.array([own.support for _, own in self.drawn])
        return float(ends[:, 0].min()), float(ends[:, 1].max())

    def cdf(self, x: object) -> Array:
        """Return the cumulative probability at `x`, any shape."""
        points = np.asarray(x, dtype=np.float64)
        flat = points.ravel()
        total = np.where(np.isnan(flat), np.nan, 0.0)
        for weight, own in self.drawn:
            lower, upper = own.support
            total[flat >= upper] += weight
            inside = np.flatnonzero((flat >= lower) & (flat < upper))
            if inside.size:
                assert own.cdf is not None
                total[inside] += weight * np.clip(own.cdf(flat[inside]), 0.0, 1.0)
        total[(total > 1) | (flat >= self.support[1])] = 1.0
        return total.reshape(points.shape)

    def ppf(self, u: object) -> Array:
        """Return the quantiles at `u`, any shape: NaN outside 0 to 1, the lower end at 0."""
        points = np.asarray(u, dtype=np.float64)
        flat = points.ravel()
        found = np.where(flat == 0, self.support[0], np.nan)
        inner = (flat > 0) & (flat <= 1)
        if inner.any():
            found[inner] = inverted(self.cdf, flat[inner], self._nodes, self._guess)
        return found.reshape(points.shape)

    @cached_property
    def _nodes(self) -> Array:
        """Points that no quantile lies below or above, and quantiles of the components between."""
        lower, upper = self.support
        between = [own.ppf(_LADDER) for _, own in self.drawn]
        ends = [np.array(own.support) for _, own in self.drawn]
        first = np.nextafter(lower, -np.inf)
        nodes = np.concatenate([[first, lower, 0.0, upper], *between, *ends])
        found: Array = np.unique(nodes[(nodes >= first) & (nodes <= upper)])
        return found

    @cached_property
    def _alone(self) -> list[tuple[float, float, Distribution]]:
        """Components whose support no other one shares: probability below, weight, distribution."""
        found = []
        for place, (weight, own) in enumerate(self.drawn):
            lower, upper = own.support
            others = [other.support for i, (_, other) in enumerate(self.drawn) if i != place]
            if all(high <= lower or low >= upper for low, high in others):
                below = float(self.cdf(np.nextafter(lower, -np.inf)))
                found.append((below, weight, own))
        return found

    def _guess(self, u: Array) -> Array:
        """Return where quantiles are expected: those of a component where it is alone, else NaN."""
        found = np.full(u.shape, np.nan)
        for below, weight, own in self._alone:
            mine = (u > below) & (u <= below + weight)
            if mine.any():
                found[mine] = own.ppf(((u[mine] - below) / weight).clip(0.0, 1.0))
        return found
