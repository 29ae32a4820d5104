"""Germs of one variable: what a draw is mapped to, and the polynomials that are orthonormal for it.

A germ is a draw in standard form, on the interval -1 to 1 or with unit scale, so that polynomials of
it are well conditioned whatever the parameter: a stiffness of 1e9 N/m +-1 % becomes U(-1, 1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq import _chaospy
from hipuq.distributions import Distribution
from hipuq.errors import InputError
from hipuq.expansion.families import PROBES, SUPPORT, scale_of
from hipuq.expansion.polynomials import HIGHEST_DEGREE, gauss, lanczos

Array = NDArray[np.float64]

ATOMS_MAXIMUM = 100_000
"""Most levels of a discrete distribution that get polynomials of their own."""

PROBED = 4096
"""Quantiles at which a distribution without a family is looked at for jumps."""

# Points of the unit cube are clipped to these: draws beyond their quantiles do not happen.
_ENDS = np.array([2.0**-64, 1.0 - 2.0**-53])


@dataclass(frozen=True, eq=False)
class Germ:
    """A standard form of draws from a distribution.

    Attributes
    ----------
    to_germ, to_draw : callable
        Array -> array of the same shape, inverse to each other.
    low, high : float
        Ends of the draws.
    spread : float
        A length on the scale of the draws, to judge what is rounding.
    recurrence : callable
        order -> (2, order + 1) array: coefficients a and b, NaN beyond the highest degree.
    largest : int
        Highest degree that there is.
    atoms, probabilities : array or None
        Germs of a discrete distribution and their probabilities.
    """

    to_germ: Callable[[Array], Array]
    to_draw: Callable[[Array], Array]
    low: float
    high: float
    spread: float
    recurrence: Callable[[int], Array]
    largest: int = HIGHEST_DEGREE
    atoms: Array | None = None
    probabilities: Array | None = None

    def values(self, draws: Array, rounding: float = 0.0) -> Array:
        """Return the germs of draws.

        Parameters
        ----------
        draws : (s,) array
        rounding : float
            How far rounding may have moved the draws.

        Returns
        -------
        (s,) array

        Raises
        ------
        InputError
            If a draw is not a number or lies outside the distribution by more than rounding.
        """
        slack = rounding + 1e-9 * self.spread
        inside = draws.clip(self.low, self.high)
        with np.errstate(divide="ignore", invalid="ignore"):
            germs = self.to_germ(inside)
            wrong = ~(np.abs(draws - inside) <= slack) | ~np.isfinite(germs)
            if self.atoms is not None:
                wrong |= np.abs(self.to_draw(germs) - inside) > slack + 1e-6 * self.spread
        if wrong.any():
            bad = int(np.argmax(wrong))
            raise InputError(
                f"the draw of sample {bad} is {draws[bad]:.17g}, outside its distribution "
                f"from {self.low:g} to {self.high:g}"
            )
        return germs

    def nodes(self, n: int) -> tuple[Array, Array]:
        """Return the Gauss quadrature of n nodes.

        A discrete distribution has no values between its levels: its nodes are all of them, the rest
        of the n are repeated with weight 0.

        Returns
        -------
        nodes, weights : (n,) array

        Raises
        ------
        InputError
            If a discrete distribution has more than n levels.
        """
        if self.atoms is not None and self.probabilities is not None:
            count = len(self.atoms)
            if count > n:
                raise InputError(f"it has {count} levels, a quadrature of {n} nodes has no room for them")
            nodes = np.concatenate([self.atoms, np.full(n - count, self.atoms[-1])])
            return nodes, np.concatenate([self.probabilities, np.zeros(n - count)])
        return gauss(self.recurrence(n))


def germ_of(distribution: Distribution) -> Germ:
    """Return the germ of a distribution.

    A distribution of a known family has the polynomials of that family, a discrete one those of its own
    levels; any other is mapped by its cumulative probability to U(-1, 1).

    Parameters
    ----------
    distribution : Distribution

    Returns
    -------
    Germ
    """
    low, high = distribution.support
    inner = distribution.ppf(_ENDS)
    low, high = min(low, float(inner[0])), max(high, float(inner[1]))
    if low == high:
        return _discrete(np.array([low]), np.ones(1))
    atoms = _atoms(distribution, float(inner[0]), float(inner[1]))
    if atoms is not None:
        return _discrete(*atoms)
    scale = scale_of(distribution)
    if scale is None:
        return _by_probability(distribution, low, high)
    quantiles = distribution.ppf(PROBES)
    low, high = (float(end) for end in scale.to_draw(np.array(SUPPORT[scale.name])))
    return Germ(
        scale.to_germ,
        scale.to_draw,
        low,
        high,
        float(quantiles[-1] - quantiles[0]),
        lambda order: _chaospy.recurrence(scale.name, scale.arguments, order),
    )


def _by_probability(distribution: Distribution, low: float, high: float) -> Germ:
    """Return the germ ``2 F(x) - 1`` on U(-1, 1), with F from quantiles where there is no cdf."""
    quantiles = distribution.ppf(PROBES)
    cdf = distribution.cdf
    if cdf is None or not np.abs(cdf(quantiles) - PROBES).max() <= 1e-4:
        cdf = _inverse(distribution.ppf)
    probability = cdf
    _check_continuous(distribution, probability)

    def to_draw(germs: Array) -> Array:
        return distribution.ppf(np.clip((germs + 1) / 2, *_ENDS))

    return Germ(
        lambda draws: (2 * probability(draws) - 1).clip(-1.0, 1.0),
        to_draw,
        low,
        high,
        float(quantiles[-1] - quantiles[0]),
        lambda order: _chaospy.recurrence("Uniform", (-1.0, 1.0), order),
    )


def _check_continuous(distribution: Distribution, cdf: Callable[[Array], Array]) -> None:
    """Raise an InputError for values of positive probability, where F(x) is not uniform."""
    u = (np.arange(PROBED) + 0.5) / PROBED
    if np.abs(cdf(distribution.ppf(u)) - u).max() > 2 / PROBED:
        raise InputError(
            f"the distribution {distribution.source!r} has values of positive probability, for which there "
            "are no polynomials here: give a discrete distribution of chaospy or scipy"
        )


def _inverse(ppf: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Return the cumulative probability of a quantile function, by bisection to the last bit."""

    def cdf(x: Array) -> Array:
        low, high = np.zeros_like(x), np.ones_like(x)
        for _ in range(60):
            middle = (low + high) / 2
            below = ppf(middle) < x
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return (low + high) / 2

    return cdf


def _atoms(distribution: Distribution, low: float, high: float) -> tuple[Array, Array] | None:
    """Return the levels of a discrete distribution and their probabilities, None for another."""
    source: Any = distribution.source
    if not (_chaospy.is_discrete(source) or _is_scipy_discrete(source)) or distribution.cdf is None:
        return None
    own = getattr(getattr(source, "dist", source), "xk", None)
    if own is not None:
        # scipy lets levels given one by one lie anywhere; their location is added to them.
        levels = np.sort(np.asarray(own, dtype=np.float64))
        levels = levels + (distribution.support[1] - levels[-1])
    elif high - low > ATOMS_MAXIMUM:
        return None
    else:
        levels = np.arange(low, high + 1)
    return levels, np.diff(distribution.cdf(levels), prepend=0.0)


def _is_scipy_discrete(source: object) -> bool:
    from scipy import stats

    return isinstance(getattr(source, "dist", source), stats.rv_discrete)


def _discrete(levels: Array, probabilities: Array) -> Germ:
    """Return the germ of levels with their probabilities: the levels, scaled to -1 to 1."""
    kept = probabilities > 0
    levels, weight = levels[kept], probabilities[kept] / probabilities[kept].sum()
    middle, half = (levels[0] + levels[-1]) / 2, (levels[-1] - levels[0]) / 2 or 1.0
    atoms = (levels - middle) / half
    known, largest = lanczos(atoms, weight)

    def recurrence(order: int) -> Array:
        found = np.full((2, order + 1), np.nan)
        found[:, : largest + 1] = known[:, : order + 1]
        return found

    between = (levels[1:] + levels[:-1]) / 2
    return Germ(
        lambda draws: atoms[np.searchsorted(between, draws)],
        lambda germs: levels[np.searchsorted((between - middle) / half, germs)],
        float(levels[0]),
        float(levels[-1]),
        float(np.diff(levels).min()) if len(levels) > 1 else 1.0,
        recurrence,
        largest,
        atoms,
        weight,
    )
