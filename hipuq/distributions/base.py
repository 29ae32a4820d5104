"""A distribution of one variable, as everything that draws from it sees it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq import _chaospy
from hipuq.errors import InputError

Array = NDArray[np.float64]

PROBES = np.array([0.01, 0.2, 0.5, 0.77, 0.99])
"""Where a stored description is compared with the distribution that it describes."""


@dataclass(frozen=True)
class Distribution:
    """A distribution of one variable.

    Attributes
    ----------
    source : object
        The object that it was made from.
    ppf : callable
        Quantile function: probabilities [1], an array in (0, 1) -> array of the same shape.
    cdf : callable or None
        Cumulative probability: array -> probabilities [1], an array of the same shape.
    support : tuple of float
        Its lower and upper end, in the unit of the variable.
    description : mapping
        What rebuilds it, JSON-able; ``{"kind": "opaque", ...}`` where nothing can, or somewhere in it.
    """

    source: object
    ppf: Callable[[Array], Array]
    cdf: Callable[[Array], Array] | None
    support: tuple[float, float]
    description: Mapping[str, Any]

    @property
    def rebuilds(self) -> bool:
        """Whether the description is enough to make it again."""
        return not any(part["kind"] == "opaque" for part in _parts(self.description))

    def __eq__(self, other: object) -> bool:
        """Compare descriptions: equal distributions have the same name and arguments."""
        if not isinstance(other, Distribution):
            return NotImplemented
        if not (self.rebuilds and other.rebuilds):
            return self.source is other.source
        return bool(self.description == other.description)

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        """Say how to pickle it, so that it can go to another process."""
        return _blank, (_chaospy.is_distribution(self.source),), self.__dict__

    def __repr__(self) -> str:
        return f"Distribution({self.source!r})"


def _blank(of_chaospy: bool) -> Distribution:
    """Return a distribution to unpickle one into.

    In a new process that would import chaospy, which reconfigures the root logger, so it is loaded first.
    """
    if of_chaospy:
        _chaospy.load()
    return Distribution.__new__(Distribution)


def _parts(description: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Give a description and those of the components in it."""
    yield description
    for component in description.get("components", ()):
        yield from _parts(component["distribution"])


def check_quantiles(distribution: Distribution, name: str) -> None:
    """Raise an InputError unless quantiles are finite numbers that do not fall."""
    lower, upper = distribution.support
    if not lower <= upper:
        raise InputError(f"{name} has the support {lower:g} to {upper:g}: check its arguments")
    quantiles = np.asarray(distribution.ppf(PROBES), dtype=np.float64)
    if quantiles.shape != PROBES.shape or not np.isfinite(quantiles).all():
        raise InputError(f"{name} gives quantiles that are not finite numbers: check its arguments")
    if (np.diff(quantiles) < 0).any():
        raise InputError(f"{name} gives quantiles that fall: its ppf must not decrease")
