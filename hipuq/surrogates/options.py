"""What a surrogate may be asked for: its basis, its samples, what is made of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hipuq import schema
from hipuq.errors import InputError, check_name
from hipuq.expansion.basis import count
from hipuq.expansion.germs import Germs
from hipuq.inputs import Inputs
from hipuq.sampling import check_count, check_size

FITS = ("least_squares", "sparse", "quadrature")
"""Ways to find the coefficients."""

QUADRATURE = "quadrature"
"""Sampler and fit of a tensor Gauss rule."""

POPULATION = 2**16
"""Points at which the surrogate itself is evaluated."""

POPULATION_LIMITS = 2**8, 2**22
"""Fewest and most of them."""

HELD_OUT_MAXIMUM = 100.0
"""Most samples held out, as a share of those to fit."""

STRATA = 8
"""Strata of the correction, of equal probability, by prediction."""

LEAST = 16
"""Fewest true evaluations for each stratum, on average: with less the interval alone would be wide."""

MOST = 0.1
"""Largest share of the points that true evaluations may take: a stratum must have enough of them."""


@dataclass(frozen=True)
class Basis:
    """What a fit may use.

    Attributes
    ----------
    fit : str
        One of `FITS`.
    degree : int or None
        The degree; None chooses it by the leave-one-out error.
    q : float
        Norm of the truncation: 1 keeps all terms up to the degree in all, less keeps fewer interactions.
    interaction : int or None
        Most inputs that may occur in a term.
    """

    fit: str = "least_squares"
    degree: int | None = None
    q: float = 1.0
    interaction: int | None = None

    def __post_init__(self) -> None:
        check_name("fit", self.fit, FITS)
        if self.degree is not None:
            check_count("degree", self.degree, 0)
        if self.interaction is not None:
            check_count("interaction", self.interaction)
        if isinstance(self.q, bool) or not isinstance(self.q, (int, float)) or not 0 < self.q <= 1:
            raise InputError(f"q is {self.q!r}: the norm of the truncation lies above 0 and is at most 1")


def check_share(held_out: float) -> None:
    """Raise an InputError unless `held_out` is a number from 0 that is not huge."""
    number = isinstance(held_out, (int, float)) and not isinstance(held_out, bool)
    if not number or not 0 <= held_out <= HELD_OUT_MAXIMUM:
        raise InputError(
            f"held_out is {held_out!r}: it is a share of the samples to fit, from 0 to {HELD_OUT_MAXIMUM:g}"
        )


def check_population(population: object) -> int:
    """Return a number of points.

    Raises
    ------
    InputError
        If it is no power of 2 between `POPULATION_LIMITS`.
    """
    size = check_count("population", population)
    least, most = POPULATION_LIMITS
    if not least <= size <= most:
        raise InputError(f"population is {size}: it must be a power of 2 from {least} to {most}")
    check_size("sobol", size)
    return size


def check_correction(correction: object, population: object) -> int:
    """Return a number of true evaluations.

    Raises
    ------
    InputError
        If it is not 0, and not enough for all strata or too many for the population.
    """
    wanted = check_count("correction", correction, 0)
    least, most = STRATA * LEAST, int(check_population(population) * MOST)
    if wanted and not least <= wanted <= most:
        raise InputError(
            f"correction is {wanted}: it takes 0 or {least} to {most} true evaluations; "
            "the most is a share of population="
        )
    return wanted


def check_groups(groups: object) -> None:
    """Raise an InputError unless `groups` is True or False."""
    if not isinstance(groups, bool):
        raise InputError(f"groups is {groups!r}: it must be True (by parameter) or False (by element)")


def check_limit(limit: object) -> None:
    """Raise an InputError unless `limit` is None or a finite number."""
    number = isinstance(limit, (int, float)) and not isinstance(limit, bool) and np.isfinite(limit)
    if limit is not None and not number:
        raise InputError(f"limit is {limit!r}: it must be a finite number in the unit of the outcome")


def check_terms(basis: Basis, inputs: Inputs, n: int) -> None:
    """Raise an InputError if so few samples can never be fitted by least squares to the degree asked for."""
    if basis.degree is None or basis.fit != "least_squares":
        return
    _, rest = discrete_of(inputs)
    largest = Germs.of(rest).largest
    terms = count(rest.dimension, basis.degree, q=basis.q, interaction=basis.interaction, largest=largest)
    if terms >= n:
        raise InputError(
            f"degree {basis.degree} in {rest.dimension} inputs has {terms} terms, more than {n} samples can "
            "fit: take more samples, a lower degree, q below 1, interaction=2, or fit='sparse'"
        )


def check_outcomes(of: Sequence[str], limit: float | None, correction: int) -> None:
    """Raise an InputError for options that do not go with outcomes that are known by name.

    Parameters
    ----------
    of : sequence of str
        The first one is that of the correction.
    limit : float or None
    correction : int
    """
    known = schema.OUTCOMES | schema.INTEGRATED
    for name in of:
        if name in known and known[name].role == schema.VERDICT and limit is not None:
            raise InputError(
                f"limit is {limit!r}, but {name} is a verdict, whose event is 1: "
                "leave limit out, or analyse it in an analysis of its own"
            )
    first = known.get(of[0])
    if correction and first is not None:
        no_state = limit is None and first.limit_state is None and first.role != schema.VERDICT
        if no_state or len(first.dims) > 1:
            raise without_limit_state(of[0])


def without_limit_state(name: str) -> InputError:
    """Return the error for a correction of an outcome that has no limit state over samples alone."""
    return InputError(
        f"a correction needs a limit state over samples alone, {name!r} has none: take 'margin', a verdict "
        "such as 'any_unstable', or give limit="
    )


def discrete_of(inputs: Inputs) -> tuple[str, Inputs]:
    """Return the name of the discrete input, empty without one, and the continuous inputs.

    Raises
    ------
    InputError
        If no input is continuous.
    """
    name = inputs.discrete[0] if inputs.discrete else ""
    rest = inputs.without(name) if name else inputs
    if not inputs:
        raise InputError("there are no inputs to expand over: take method 'monte_carlo' with n=1")
    if not rest.dimension:
        raise InputError(
            f"polynomial chaos needs a continuous input, there is only {name!r}: its levels can all be "
            f"evaluated, method 'monte_carlo' with n=1, stratify={name!r}"
        )
    return name, rest
