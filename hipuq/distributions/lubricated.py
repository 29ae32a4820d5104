"""Friction over the regimes of lubrication: a mixture whose weights come from the lambda ratio.

The lambda ratio is the thickness of the lubricant film over the composite roughness of both surfaces,
sqrt(Rq1^2 + Rq2^2): below 1 the surfaces touch (boundary), from 3 a film parts them, between they share the
load (mixed); Oberst et al., INTER-NOISE 2016, p. 5539.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hipuq.distributions.adapters import as_distribution
from hipuq.distributions.base import Distribution
from hipuq.distributions.families import from_family
from hipuq.distributions.mixtures import ROUNDING, Component, mixture_of
from hipuq.distributions.words import described
from hipuq.errors import InputError, check_name

REGIMES = ("film", "mixed", "boundary")
"""Regimes of lubrication, from the highest lambda ratio to the lowest."""

GIVEN = "given by the user"
"""Source of a part that was replaced without saying where it comes from."""


@dataclass(frozen=True)
class Default:
    """What a part is if nobody gives another one.

    Attributes
    ----------
    family : str
        One of `hipuq.distributions.FAMILIES`.
    parameters : mapping
        Its parameters.
    source : str
        Where it comes from, and what of it is an assumption.
    """

    family: str
    parameters: Mapping[str, float]
    source: str


DEFAULTS: Mapping[str, Default] = {
    "lambda_ratio": Default(
        "lognormal",
        {"mu": 0.55, "sigma": 0.9},
        "assumption, not a measurement: median 1.73, the middle of the mixed regime, in which artificial "
        "hips are modelled to operate (Lubricants 10 (2022) 238, abstract), and 0.3 to 10 in 95 % of cases, "
        "since a film that is starved gets considerably thinner (Meng et al., J. Mech. Behav. Biomed. Mater. "
        "50 (2015) 70, abstract)",
    ),
    "film": Default(
        "triangle",
        {"lower": 0.04, "midpoint": 0.06, "upper": 0.08},
        "ceramic on ceramic with a good film: about 0.06 (Walter et al. 2008, PMC2899857); the width 0.04 to "
        "0.08 is that of friction in vivo, ceramic on polyethylene (Damm et al., PLoS ONE 2013)",
    ),
    "mixed": Default(
        "triangle",
        {"lower": 0.09, "midpoint": 0.14, "upper": 0.23},
        "highest friction of the gait cycle in vivo, 0.14 (0.09 to 0.23), but of ceramic on polyethylene "
        "(Damm et al., PLoS ONE 2013): that it holds for mixed lubrication of ceramic on ceramic is an "
        "assumption",
    ),
    "boundary": Default(
        "uniform",
        {"lower": 0.3, "upper": 1.0},
        "up to 0.7 to 1.0 with the film lost (Walter et al. 2008, PMC2899857); the lower end is an "
        "assumption: squeak set in on the bench from 0.29 (Fan et al., J. Orthop. Res. 31 (2013) 1627), and "
        "the friction moment of ceramic bearings rises more than fivefold from serum to dry (Bishop et al., "
        "J. Orthop. Res. 2013, doi 10.1002/jor.22255, abstract), which is 0.3 from 0.06; so is the equal "
        "density",
    ),
}
"""Part -> the distribution that it has by default, and its source."""


def lubrication(
    lambda_ratio: object = None,
    *,
    film: object = None,
    mixed: object = None,
    boundary: object = None,
    boundary_below: float = 1.0,
    film_from: float = 3.0,
    sources: Mapping[str, str] | None = None,
) -> Distribution:
    """Return the friction coefficient of an artificial hip as a mixture over the regimes of lubrication.

    With the lambda ratio L, film thickness over composite roughness: boundary lubrication has the
    probability P(L < boundary_below), a full film P(L >= film_from), and mixed lubrication what is between.
    In each regime friction has a distribution of its own.

    Every default can be replaced. What is measured of them and what is assumed stands in
    `hipuq.distributions.lubricated.DEFAULTS`, in the description of the result, and in reports. The default
    of the lambda ratio is an assumption: take your own where you know better.

    Parameters
    ----------
    lambda_ratio : object, optional
        A distribution with ``cdf``, not below 0; or a number, then there is one regime only; or the
        probabilities of the regimes, ``{"film": 0.5, "mixed": 0.3, "boundary": 0.2}``. The default is
        lognormal with a median of 1.73 and 95 % between 0.3 and 10, an assumption.
    film, mixed, boundary : object, optional
        Distribution of the friction coefficient [1] in the regime, with ``cdf`` and not below 0. Defaults:
        triangle 0.04, 0.06, 0.08; triangle 0.09, 0.14, 0.23; uniform 0.3 to 1.
    boundary_below, film_from : float
        Lambda ratios [1] between which lubrication is mixed.
    sources : mapping, optional
        ``"lambda_ratio"``, ``"film"``, ``"mixed"``, ``"boundary"`` -> where what you give comes from, for
        reports.

    Returns
    -------
    Distribution
        A mixture, see `hipuq.mixture`. `hipuq.distributions.regimes` and `hipuq.distributions.sources` read
        regimes, weights and sources from its description.

    Raises
    ------
    InputError
        If a part cannot be used: not a distribution, without ``cdf``, below 0, probabilities that do not add
        up to 1, or limits that are not 0 < boundary_below < film_from.
    UnknownNameError
        If a probability or a source is given for a part that does not exist.

    Examples
    --------
    >>> import hipuq
    >>> hipuq.lubrication().ppf([0.05, 0.5, 0.95]).round(3)
    array([0.052, 0.151, 0.871])
    >>> friction = hipuq.lubrication({"film": 0.5, "mixed": 0.3, "boundary": 0.2})
    >>> friction.cdf([0.08, 0.25, 0.65, 1.0])
    array([0.5, 0.8, 0.9, 1. ])
    """
    limits = {"boundary_below": boundary_below, "film_from": film_from}
    for name, value in limits.items():
        if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not value > 0:
            raise InputError(f"{name} is {value!r}: it must be a number above 0")
    if not boundary_below < film_from <= sys.float_info.max:
        raise InputError(
            f"boundary_below is {boundary_below:g} and film_from {film_from:g}: "
            "the first must be less, and both finite"
        )
    if sources is not None and not isinstance(sources, Mapping):
        raise InputError(f"sources is {sources!r}: it must name parts with their sources, {{'film': '...'}}")
    cited = dict(sources or {})
    for name, text in cited.items():
        check_name("part that has a source", name, DEFAULTS)
        if not isinstance(text, str):
            raise InputError(f"the source of {name} is {text!r}: it must be text")
    given = {"film": film, "mixed": mixed, "boundary": boundary}
    parts = {name: _friction(name, value) for name, value in given.items()}
    weights, ratio = _weights(lambda_ratio, float(boundary_below), float(film_from))
    texts = {
        name: cited.get(name, DEFAULTS[name].source if value is None else GIVEN)
        for name, value in {"lambda_ratio": lambda_ratio, **given}.items()
    }
    components = [Component(name, parts[name], weights[name], texts[name]) for name in REGIMES]
    return mixture_of(
        components,
        {
            "family": "lubrication",
            "lambda_ratio": {**ratio, "source": texts["lambda_ratio"]},
            **{name: float(value) for name, value in limits.items()},
        },
    )


def _friction(regime: str, value: object) -> Distribution:
    """Return the distribution of friction in a regime."""
    what = f"friction of the {regime} regime"
    found = _default(regime) if value is None else as_distribution(value, what)
    if found.cdf is None:
        raise InputError(f"{what} is {found.source!r}, which has no cdf: a mixture is inverted by it")
    below = _probability_below(found, 0.0)
    if below > 0:
        raise InputError(
            f"{what} is {found.source!r}, which is below 0 with probability {below:.3g}: "
            "a friction coefficient is not"
        )
    return found


def _weights(
    ratio: object, boundary_below: float, film_from: float
) -> tuple[dict[str, float], dict[str, Any]]:
    """Return the probability of each regime, and a description of what it comes from."""
    if isinstance(ratio, Mapping):
        for name in ratio:
            check_name("regime of lubrication", name, REGIMES)
        for name in REGIMES:
            if name not in ratio:
                raise InputError(
                    f"lambda_ratio gives probabilities of regimes without that of {name!r}: give all 3"
                )
            value = ratio[name]
            if (
                isinstance(value, bool)
                or not isinstance(value, (int, float, np.number))
                or not 0 <= value <= 1
            ):
                raise InputError(
                    f"the probability of the regime {name!r} is {value!r}: it must be from 0 to 1"
                )
        total = sum(ratio.values())
        if abs(total - 1) > ROUNDING:
            raise InputError(
                f"the probabilities of the regimes add up to {total:.12g}: they must add up to 1"
            )
        return {name: float(ratio[name]) for name in REGIMES}, {"text": "probabilities of the regimes"}
    if isinstance(ratio, (int, float, np.number)) and not isinstance(ratio, bool):
        if not 0 <= ratio <= sys.float_info.max:
            raise InputError(f"lambda_ratio is {ratio}: it must be finite and not negative")
        number = float(ratio)
        only = "boundary" if number < boundary_below else "mixed" if number < film_from else "film"
        return {name: float(name == only) for name in REGIMES}, {"value": number, "text": f"{number:g}"}
    found = _default("lambda_ratio") if ratio is None else as_distribution(ratio, "lambda_ratio")
    if found.cdf is None:
        raise InputError(
            f"lambda_ratio is {found.source!r}, which has no cdf: the probabilities of the regimes need it"
        )
    below = _probability_below(found, 0.0)
    if below > 0:
        raise InputError(
            f"lambda_ratio is {found.source!r}, which is below 0 with probability {below:.3g}: "
            "it is a ratio of lengths"
        )
    first, last = (_probability_below(found, limit) for limit in (boundary_below, film_from))
    weights = {"film": 1.0 - last, "mixed": last - first, "boundary": first}
    return weights, {"distribution": dict(found.description), "text": described(found.description)}


def _probability_below(distribution: Distribution, x: float) -> float:
    """Return the probability of values less than `x`, without that of `x` itself."""
    assert distribution.cdf is not None
    return float(distribution.cdf(np.array([np.nextafter(x, -np.inf)]))[0])


def _default(part: str) -> Distribution:
    return from_family(DEFAULTS[part].family, DEFAULTS[part].parameters)
