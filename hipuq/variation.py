"""How a distribution applies to a nominal value: relative to it, or as a shift of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hipuq.distributions import Distribution, as_distribution

Array = NDArray[np.float64]

# What is too large for numbers is refused for what it then is, not warned of.
UNWARNED = np.errstate(all="ignore")


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


@UNWARNED
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


@UNWARNED
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
