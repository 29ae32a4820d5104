"""Polynomial chaos: a polynomial surrogate of any outcome, and what it says of mean, spread and causes.

Samples are fitted in polynomials that are orthonormal under the inputs, so mean, variance and Sobol
indices are sums of squared coefficients (Sudret, Reliab. Eng. Syst. Saf. 93 (2008) 964). A discrete input
is conditioned on: one expansion for each level, put together by total probability. Held-out samples say
how good the surrogate is, and mend what it says of means and probabilities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import InputError, SchemaError
from hipuq.estimation.reduction import check_finite
from hipuq.estimation.results import check_independent, finished
from hipuq.inputs import Inputs
from hipuq.intervals import check_confidence
from hipuq.sampling import Seed, check_count, seed_of
from hipuq.surrogates.checking import Check
from hipuq.surrogates.correction import corrections
from hipuq.surrogates.limit_state import limit_state_of
from hipuq.surrogates.options import (
    POPULATION,
    QUADRATURE,
    Basis,
    check_correction,
    check_groups,
    check_limit,
    check_outcomes,
    check_population,
    check_terms,
    without_limit_state,
)
from hipuq.surrogates.summary import summarised
from hipuq.surrogates.surrogate import basis_of, fitted
from hipuq.surrogates.training import FIT, drawn, plan, with_books

Array = NDArray[np.float64]


def design(
    inputs: Inputs,
    n: int,
    rng: Seed,
    *,
    rows: slice | None = None,
    sampler: str = "sobol",
    held_out: float = 0.2,
) -> xr.Dataset:
    """Return samples to fit and, after them, random samples to check the fit.

    Parameters
    ----------
    inputs : Inputs
        The uncertain parameters.
    n : int
        Samples to fit, for each level of a discrete input; with ``"quadrature"`` nodes for each column of
        the unit cube, of which all combinations are taken.
    rng : int or Generator
        Seed.
    rows : slice, optional
        Only these rows of the design.
    sampler : str
        ``"sobol"`` (any number of them: a fit asks for no balance), ``"latin_hypercube"``, ``"random"`` or
        ``"quadrature"``.
    held_out : float, default 0.2
        Samples to check, as a share of those to fit [1]; they are drawn from all inputs at random.

    Returns
    -------
    Dataset
        The inputs over ``sample``. Coords ``round``, 0, ``stratum`` (-1 to fit, 0 held out),
        ``stratum_weight`` and, with ``"quadrature"``, ``quadrature_weight`` over sample.

    Raises
    ------
    InputError
        If n does not suit the sampler, or `held_out` is not a number from 0.
    """
    seed = seed_of(rng)
    samples = drawn(inputs, n, seed, rows, sampler, held_out)
    options = {"design": {"n": int(n), "sampler": sampler, "held_out": held_out}}
    return schema.stamp(
        samples,
        f"design chaos, {samples.sizes['sample']} samples",
        method="chaos",
        seed=seed,
        options=options,
        inputs=inputs.to_json(),
    )


def evaluations(
    inputs: Inputs,
    n: int,
    *,
    sampler: str = "sobol",
    held_out: float = 0.2,
    correction: int = 0,
) -> int:
    """Return the number of model runs, those of the correction included.

    Parameters
    ----------
    inputs : Inputs
        The uncertain parameters.
    n : int
        As in `design`.
    sampler : str
        As in `design`.
    held_out : float, default 0.2
        As in `design` [1].
    correction : int, default 0
        As in `refine`.

    Returns
    -------
    int
        Samples to fit, held-out ones and those of the correction.
    """
    share, levels, held = plan(inputs, n, sampler, held_out)
    return share * levels + held + check_count("correction", correction, 0)


def validate(
    inputs: Inputs,
    n: int,
    *,
    of: Sequence[str],
    sampler: str = "sobol",
    correction: int = 0,
    fit: str | None = None,
    degree: int | None = None,
    q: float = 1.0,
    interaction: int | None = None,
    limit: float | None = None,
    population: int = POPULATION,
    groups: bool = True,
) -> None:
    """Check the options of refine and estimate before anything is evaluated; `of` names all outcomes.

    Each option is told where it is used: in `design`, `refine` or `estimate`.

    Raises
    ------
    InputError
        If one cannot be used, or not with the others.
    """
    basis = Basis(fit or ("quadrature" if sampler == QUADRATURE else "least_squares"), degree, q, interaction)
    if basis.fit == QUADRATURE and sampler != QUADRATURE:
        raise InputError(f"fit 'quadrature' needs the sampler 'quadrature', not {sampler!r}")
    if sampler != QUADRATURE:
        check_terms(basis, inputs, n)
    check_correction(correction, population)
    check_groups(groups)
    check_limit(limit)
    check_outcomes(of, limit, correction)


def refine(
    outcomes: xr.Dataset,
    inputs: Inputs,
    rng: np.random.Generator,
    *,
    of: str,
    correction: int = 0,
    fit: str | None = None,
    degree: int | None = None,
    q: float = 1.0,
    interaction: int | None = None,
    limit: float | None = None,
    population: int = POPULATION,
) -> xr.Dataset | None:
    """Return samples at which true evaluations mend the probability of the surrogate, once.

    Parameters
    ----------
    outcomes : Dataset
        Outcomes of the rounds so far.
    inputs : Inputs
        The inputs of the design.
    rng : Generator
        Draws the samples.
    of : str
        The outcome whose limit state counts.
    correction : int, default 0
        Number of samples: random ones in strata of equal predictions, more of them where events and
        none are mixed, that is near the limit state.
    fit : str, optional
        As in `estimate`.
    degree : int, optional
        As in `estimate`.
    q : float, default 1
        As in `estimate` [1].
    interaction : int, optional
        As in `estimate`.
    limit : float, optional
        As in `estimate`, in the unit of the outcome.
    population : int, default 2**16
        As in `estimate`.

    Returns
    -------
    Dataset or None
        Samples as from `design`, with ``round`` 1; None if no correction is asked for, or it has been made.

    Raises
    ------
    InputError
        If the outcome has no limit state, or `correction` is too small.
    SchemaError
        If the outcomes are not of a design of this method.
    UnknownNameError
        If there is no such outcome.
    """
    wanted = check_correction(correction, population)
    if not wanted:
        return None
    values = schema.check_outcomes(outcomes, of)
    state = limit_state_of(values, limit)
    if state is None or values.ndim > 1:
        raise without_limit_state(of)
    if "stratum" not in outcomes.coords:
        raise SchemaError(
            "a correction needs outcomes of a design of this method: they have no coord 'stratum'"
        )
    if (outcomes["round"].values > 0).any():
        return None
    basis, nodes = basis_of(outcomes, fit, degree, q, interaction)
    chosen = corrections(outcomes, inputs, values, state, basis, nodes, wanted, population, seed_of(rng))
    options = {"refine": {"of": of, "correction": wanted, "population": population, **asdict(basis)}}
    return schema.stamp(chosen, f"refine chaos, {wanted} samples", options=options, like=outcomes.attrs)


def estimate(
    outcomes: xr.Dataset,
    inputs: Inputs,
    *,
    of: str,
    rng: Seed = None,
    fit: str | None = None,
    degree: int | None = None,
    q: float = 1.0,
    interaction: int | None = None,
    limit: float | None = None,
    held_out: float = 0.2,
    population: int = POPULATION,
    groups: bool = True,
    confidence: float = 0.95,
) -> xr.Dataset:
    """Fit the expansion and tell mean, variance, quantiles, Sobol indices, and how far to trust them.

    Mean, variance and indices are sums of squared coefficients (Sudret, Reliab. Eng. Syst. Saf. 93 (2008)
    964).

    Parameters
    ----------
    outcomes : Dataset
        As from `evaluate`; any random samples of the inputs will do.
    inputs : Inputs
        The inputs of the design.
    of : str
        Name of the outcome; other dims than ``sample`` are fitted each on its own.
    rng : int or Generator, optional
        Seed of the points at which the surrogate is evaluated; by default the design's.
    fit : str, optional
        ``"least_squares"``, ``"sparse"`` (least angle regression) or ``"quadrature"``, the default where
        the samples are quadrature nodes; else least squares.
    degree : int, optional
        Degree of the expansion; by default the one with the smallest corrected leave-one-out error.
    q : float, default 1
        Norm of the truncation [1]: below 1 terms of several inputs are fewer (hyperbolic).
    interaction : int, optional
        Most inputs that a term may have.
    limit : float, optional
        The event is that the outcome lies below it, in the unit of the outcome; by default what the outcome
        says of itself.
    held_out : float, default 0.2
        Share of the samples [1], relative to those to fit, that is held out at random where the samples do
        not say themselves which.
    population : int, default 2**16
        Points at which the surrogate is evaluated for quantiles and probabilities, a power of 2.
    groups : bool, default True
        Whether indices are those of parameters; False gives those of their elements.
    confidence : float, default 0.95
        Level of the intervals [1].

    Returns
    -------
    Dataset
        ``mean``, ``variance``, ``degree``, ``terms``, ``loo`` and ``samples_used``, for each level of a
        discrete input (then also ``mean_overall``, ...); ``S1``, ``ST``, ``S2``; ``q2``, ``quantiles``,
        ``mean_corrected``; for an outcome with a limit state ``probability_surrogate``, ``misclassified``
        and the corrected ``probability`` (``probability_overall`` with levels); ``true`` and ``predicted``
        of the held-out samples; ``coefficient`` and ``multi_index``; ``trusted`` with its ``reasons``.

    Raises
    ------
    InputError
        If the outcome has infinite values, there are too few samples, or an option is not allowed.
    SchemaError
        If the outcome does not hold numbers over ``sample``, or the samples are of a Sobol design.
    UnknownNameError
        If there is no such outcome.
    """
    confidence = check_confidence(confidence)
    check_population(population)
    check_groups(groups)
    basis, nodes = basis_of(outcomes, fit, degree, q, interaction)
    values = schema.check_outcomes(outcomes, of)
    check_independent(outcomes, strata=True)
    state = limit_state_of(values, limit)
    y = values.values.astype(np.float64).reshape(values.sizes["sample"], -1)
    check_finite(of, y, 1, len(y), "no polynomial fits that")
    seed = _seed(outcomes, rng)
    books = with_books(outcomes, inputs, held_out, seed)
    surrogate = fitted(outcomes, y, books["stratum"].values == FIT, inputs, basis, nodes)
    check = Check(surrogate, inputs, books, values, y, state, population, seed, confidence)
    return finished(
        summarised(surrogate, check, inputs, groups),
        outcomes,
        inputs,
        of=of,
        method="chaos",
        confidence=confidence,
        **asdict(basis),
        limit=None if state is None else state.limit,
        population=population,
        groups=groups,
        population_seed=seed,
    )


def _seed(outcomes: xr.Dataset, rng: Seed) -> int:
    """Return the seed of what the estimate draws: the one given, else the design's, else a new one."""
    own = outcomes.attrs.get("seed")
    if rng is None and isinstance(own, (int, np.integer)):
        return int(own)
    return seed_of(rng)
