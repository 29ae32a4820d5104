"""Polynomial chaos: a polynomial surrogate of any outcome, and what it says of mean, spread and causes.

Samples are fitted in polynomials that are orthonormal under the inputs, so mean, variance and Sobol
indices are sums of squared coefficients (Sudret, Reliab. Eng. Syst. Saf. 93 (2008) 964). A discrete input
is conditioned on: one expansion for each level, put together by total probability. Held-out samples say
how good the surrogate is, and mend what it says of means and probabilities.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import InputError, SchemaError
from hipuq.estimation.results import finished
from hipuq.inputs import Inputs
from hipuq.intervals import check_confidence
from hipuq.sampling import Seed, check_count, check_size, seed_of, unit_points
from hipuq.surrogates.checking import Check
from hipuq.surrogates.limit_state import limit_state_of, strata_of
from hipuq.surrogates.summary import summarised
from hipuq.surrogates.surrogate import Basis, fitted
from hipuq.surrogates.training import FIT, HELD_OUT, QUADRATURE, divided, drawn, plan

Array = NDArray[np.float64]

POPULATION = 2**16
"""Points at which the surrogate itself is evaluated."""


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
        Samples to check, as a share of those to fit; they are drawn from all inputs at random.

    Returns
    -------
    Dataset
        Coords ``round``, 0, ``stratum`` (-1 to fit, 0 held out), ``stratum_weight`` and, with
        ``"quadrature"``, ``quadrature_weight`` over sample.

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
    n : int
    sampler, held_out, correction
        As in `design` and `refine`.

    Returns
    -------
    int
    """
    share, levels, held = plan(inputs, n, sampler, held_out)
    return share * levels + held + check_count("correction", correction, 0)


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
    rng : Generator
        Draws the samples.
    of : str
        The outcome whose limit state counts.
    correction : int, default 0
        Number of samples: random ones in strata of equal predictions, more of them where events and
        none are mixed, that is near the limit state.
    fit, degree, q, interaction, limit, population
        As in `estimate`.

    Returns
    -------
    Dataset or None
        None if no correction is asked for, or it has been made.

    Raises
    ------
    InputError
        If the outcome has no limit state, or `correction` is too small.
    """
    wanted = check_count("correction", correction, 0)
    if not wanted or (outcomes["round"].values > 0).any():
        return None
    values = schema.check_outcomes(outcomes, of)
    state = limit_state_of(values, limit)
    if state is None or values.ndim > 1:
        raise InputError(
            f"a correction needs a limit state over samples alone, {of!r} has none: take 'margin', a verdict "
            "such as 'any_unstable', or give limit="
        )
    y = values.values.astype(np.float64)[:, None]
    stratum = outcomes["stratum"].values
    basis, nodes = _basis(outcomes, fit, degree, q, interaction)
    surrogate = fitted(outcomes, y, stratum == FIT, inputs, basis, nodes)
    held = outcomes.isel(sample=stratum == HELD_OUT)
    u = unit_points("sobol", population, inputs.dimension, seed_of(rng), (0,), slice(0, population))
    samples = inputs.samples(u)
    distance = state.distance(surrogate.at(samples, inputs)[:, 0])
    checked = state.distance(surrogate.at(held, inputs)[:, 0])
    number, count = strata_of(distance, checked, state.event(y[stratum == HELD_OUT, 0]), wanted)
    rows = np.concatenate(
        [rng.choice(np.flatnonzero(number == k), count[k], replace=False) for k in range(len(count))]
    )
    chosen = samples.isel(sample=rows)
    size = np.bincount(number, minlength=len(count)) / len(number)
    books = {
        "sample": outcomes["sample"].values.max() + 1 + np.arange(len(rows)),
        "round": np.ones(len(rows), np.int64),
        "stratum": number[rows] + 1,
        "stratum_weight": size[number[rows]],
    }
    chosen = chosen.assign_coords(
        {key: ("sample", book, schema.COORDINATES[key].attrs) for key, book in books.items()}
    )
    return schema.stamp(chosen, f"refine chaos, {len(rows)} samples", like=outcomes.attrs)


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
        Norm of the truncation: below 1 terms of several inputs are fewer (hyperbolic).
    interaction : int, optional
        Most inputs that a term may have.
    limit : float, optional
        The event is that the outcome lies below it; by default what the outcome says of itself.
    held_out : float
        Share of the samples, relative to those to fit, that is held out at random where the samples do
        not say themselves which.
    population : int
        Points at which the surrogate is evaluated for quantiles and probabilities, a power of 2.
    groups : bool, default True
        Whether indices are those of parameters; False gives those of their elements.
    confidence : float, default 0.95
        Level of the intervals.

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
    """
    confidence = check_confidence(confidence)
    check_size("sobol", check_count("population", population))
    if not isinstance(groups, bool):
        raise InputError(f"groups is {groups!r}: it must be true (by parameter) or false (by element)")
    basis, nodes = _basis(outcomes, fit, degree, q, interaction)
    values = schema.check_outcomes(outcomes, of)
    state = limit_state_of(values, limit)
    y = values.values.astype(np.float64).reshape(values.sizes["sample"], -1)
    _check_finite(of, y)
    seed = _seed(outcomes, rng)
    books = outcomes if "stratum" in outcomes.coords else divided(outcomes, inputs, held_out, seed)
    surrogate = fitted(outcomes, y, books["stratum"].values == FIT, inputs, basis, nodes)
    check = Check(surrogate, inputs, books, values, y, state, population, seed, confidence)
    results = summarised(surrogate, check, inputs, groups)
    return finished(results, outcomes, inputs, of=of, method="chaos", confidence=confidence)


def _seed(outcomes: xr.Dataset, rng: Seed) -> int:
    """Return the seed of what the estimate draws: the one given, else the design's, else a new one."""
    own = outcomes.attrs.get("seed")
    if rng is None and isinstance(own, (int, np.integer)):
        return int(own)
    return seed_of(rng)


def _basis(
    outcomes: xr.Dataset, fit: str | None, degree: int | None, q: float, interaction: int | None
) -> tuple[Basis, Array | None]:
    """Return what the fit may use, and the quadrature weights where it takes them."""
    nodes = outcomes.coords.get("quadrature_weight")
    if fit is None:
        fit = "least_squares" if nodes is None else QUADRATURE
    basis = Basis(fit, degree, q, interaction)
    if fit != QUADRATURE:
        return basis, None
    if nodes is None:
        raise SchemaError("fit 'quadrature' needs quadrature nodes: design with sampler='quadrature'")
    return basis, nodes.values.astype(np.float64)


def _check_finite(of: str, y: Array) -> None:
    infinite = int(np.isinf(y).any(axis=1).sum())
    if infinite:
        raise InputError(
            f"{of} is infinite in {infinite} samples ({infinite / len(y):.2%}): no polynomial fits that; "
            "analyse another outcome"
        )
