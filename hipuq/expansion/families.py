"""Families of distributions with polynomials of their own, and their maps to standard variables.

These are the Askey scheme: Legendre for uniform, Hermite for normal, Jacobi for beta, Laguerre for gamma
(Xiu and Karniadakis, SIAM J. Sci. Comput. 24 (2002) 619), and what becomes one of them by a logarithm.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hipuq import _chaospy
from hipuq.distributions import Distribution

Array = NDArray[np.float64]

PROBES = np.array([0.01, 0.2, 0.5, 0.77, 0.99])
"""Where a map is compared with the distribution that it stands for."""

# How far it may be off, in parts of the distance between the outer probes.
_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Scale:
    """Draws that are ``centre + unit * germ``, or ``shift + exp`` of that.

    Attributes
    ----------
    name, arguments
        chaospy's distribution of the germ.
    centre, unit : float
    shift : float or None
        None for an affine map.
    """

    name: str
    arguments: tuple[float, ...]
    centre: float
    unit: float
    shift: float | None = None

    def to_germ(self, draws: Array) -> Array:
        """Return the standard variable of draws."""
        x = draws if self.shift is None else np.log(draws - self.shift)
        return (x - self.centre) / self.unit

    def to_draw(self, germs: Array) -> Array:
        """Return the draws of a standard variable."""
        with np.errstate(over="ignore"):
            x = self.centre + self.unit * germs
            return x if self.shift is None else self.shift + np.exp(x)


SUPPORT = {
    "Uniform": (-1.0, 1.0),
    "Beta": (-1.0, 1.0),
    "Normal": (-math.inf, math.inf),
    "Gamma": (0.0, math.inf),
}
"""Ends of the standard distributions."""


def _between(name: str, arguments: tuple[float, ...], lower: float, upper: float) -> Scale:
    return Scale(name, arguments, (lower + upper) / 2, (upper - lower) / 2)


def _uniform(lower: float = 0.0, upper: float = 1.0) -> Scale:
    return _between("Uniform", (-1.0, 1.0), lower, upper)


def _normal(mu: float = 0.0, sigma: float = 1.0) -> Scale:
    return Scale("Normal", (0.0, 1.0), mu, sigma)


def _beta(alpha: float, beta: float, lower: float = 0.0, upper: float = 1.0) -> Scale:
    return _between("Beta", (alpha, beta, -1.0, 1.0), lower, upper)


def _gamma(shape: float = 1.0, scale: float = 1.0, shift: float = 0.0) -> Scale:
    return Scale("Gamma", (shape,), shift, scale)


def _exponential(scale: float = 1.0, shift: float = 0.0) -> Scale:
    return _gamma(1.0, scale, shift)


def _lognormal(mu: float = 0.0, sigma: float = 1.0, shift: float = 0.0, scale: float = 1.0) -> Scale:
    return Scale("Normal", (0.0, 1.0), mu + math.log(scale), sigma, shift)


def _log_uniform(lower: float, upper: float, shift: float = 0.0, scale: float = 1.0) -> Scale:
    low, high = math.log(lower * scale), math.log(upper * scale)
    return Scale("Uniform", (-1.0, 1.0), (low + high) / 2, (high - low) / 2, shift)


FAMILIES: Mapping[tuple[str, str], Callable[..., Scale]] = {
    ("chaospy", "Uniform"): _uniform,
    ("chaospy", "Normal"): _normal,
    ("chaospy", "Beta"): _beta,
    ("chaospy", "Gamma"): _gamma,
    ("chaospy", "Exponential"): _exponential,
    ("chaospy", "LogNormal"): _lognormal,
    ("chaospy", "Reciprocal"): _log_uniform,
    ("scipy", "uniform"): lambda loc=0.0, scale=1.0: _uniform(loc, loc + scale),
    ("scipy", "norm"): lambda loc=0.0, scale=1.0: _normal(loc, scale),
    ("scipy", "beta"): lambda a, b, loc=0.0, scale=1.0: _beta(a, b, loc, loc + scale),
    ("scipy", "gamma"): lambda a, loc=0.0, scale=1.0: _gamma(a, scale, loc),
    ("scipy", "expon"): lambda loc=0.0, scale=1.0: _exponential(scale, loc),
    ("scipy", "lognorm"): lambda s, loc=0.0, scale=1.0: _lognormal(0.0, s, loc, scale),
    ("scipy", "loguniform"): lambda a, b, loc=0.0, scale=1.0: _log_uniform(a, b, loc, scale),
    ("scipy", "reciprocal"): lambda a, b, loc=0.0, scale=1.0: _log_uniform(a, b, loc, scale),
}
"""Kind and name of a distribution -> its map, a function of the distribution's own arguments."""


def scale_of(distribution: Distribution) -> Scale | None:
    """Return the map of a distribution to its standard variable, None where it is of no family.

    Parameters
    ----------
    distribution : Distribution

    Returns
    -------
    Scale or None
    """
    description = distribution.description
    make = FAMILIES.get((description["kind"], description.get("name", "")))
    args, keywords = description.get("args", ()), description.get("kwargs", {})
    if make is None or not all(isinstance(x, (int, float)) for x in (*args, *keywords.values())):
        return None
    try:
        scale = make(*args, **keywords)
    except (TypeError, ValueError):
        return None
    # What was read from the description must be the distribution itself.
    standard = _chaospy.from_dict({"name": scale.name, "args": scale.arguments})
    quantiles = distribution.ppf(PROBES)
    off = np.abs(scale.to_draw(_chaospy.ppf(standard, PROBES)) - quantiles).max()
    rounding = 8 * np.finfo(np.float64).eps * np.abs(quantiles).max()
    return scale if off <= _TOLERANCE * (quantiles[-1] - quantiles[0]) + rounding else None
