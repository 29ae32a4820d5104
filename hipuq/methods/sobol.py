"""Sobol indices: which parameters the variance of an outcome comes from.

The first-order index of a parameter is the share of the variance that goes when it alone is known, the
total-order index the share that stays when all others are. They are estimated as SALib does, their
limits by a bootstrap over base points.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import InputError
from hipuq.estimation.reduction import check_finite
from hipuq.estimation.results import Kind, finished, kind_of
from hipuq.inputs import Inputs
from hipuq.intervals import check_confidence
from hipuq.saltelli.decomposition import indices, reason
from hipuq.saltelli.layout import Layout, check_flag, layout_of
from hipuq.saltelli.summary import labelled_indices, moments_and_counts
from hipuq.sampling import Seed, check_count, rows_of, samples_by_block, seed_of, spawn, unit_points

Array = NDArray[np.float64]

MAXIMUM_COLUMNS = 21201 // 2
"""Columns of the unit cube: scipy has Sobol points of 21201 dimensions, and a base point is two points."""

MAXIMUM_POINTS = 2**30
"""Length of scipy's Sobol sequence."""

RESAMPLES_MAXIMUM = 100_000
"""Most resamples of the bootstrap."""

STREAM = 2**31
"""Key of the stream of the design's seed that the seed of resamples is drawn from."""

FIRST_BUDGET = 16
"""Base points of the first estimate of the convergence; each further one has twice as many."""


def design(
    inputs: Inputs,
    n: int,
    rng: Seed,
    *,
    rows: slice | None = None,
    groups: bool = True,
    second_order: bool = False,
) -> xr.Dataset:
    """Return the samples that Sobol indices are estimated from.

    They are the rows of Saltelli, Comput. Phys. Commun. 145 (2002) 280: of each base point one of a matrix A,
    one of a matrix B, and for each parameter that of A with the columns of the parameter taken from B; for
    pairs also that of B with the columns from A.

    Parameters
    ----------
    inputs : Inputs
        The uncertain parameters.
    n : int
        Number of base points, a power of 2: scrambled Sobol points. Of g parameters each gives g + 2
        samples, 2 g + 2 with second order.
    rng : int or Generator
        Seed.
    rows : slice, optional
        Only these rows of the design.
    groups : bool, default True
        Whether the elements of a parameter, such as nine stiffnesses, are taken together. If not, each
        counts as a parameter: ``spring_stiffness[3]``.
    second_order : bool, default False
        Whether to sample for the indices of pairs of parameters too.

    Returns
    -------
    Dataset
        The inputs over ``sample``. Coords ``block(sample)``, the base point from 0, and ``matrix(sample)``, a
        flag.

    Raises
    ------
    InputError
        If n is not a power of 2 from 2 on, or the inputs have too many elements.
    """
    layout = _plan(inputs, n, groups, second_order)
    seed = seed_of(rng)
    owner = np.array(
        [layout.names.index(name) for name in inputs.groups] if groups else range(inputs.dimension)
    )
    total = int(n) * layout.width

    def points(part: slice) -> Array:
        block, matrix = np.divmod(np.arange(part.start, part.stop), layout.width)
        wanted = slice(int(block[0]), int(block[-1]) + 1)
        base = unit_points("sobol", n, 2 * inputs.dimension, seed, (0,), wanted)
        return layout.points(base[block - wanted.start], matrix, owner)

    samples = samples_by_block(inputs, points, rows_of(total, rows), total)
    block, matrix = np.divmod(samples["sample"].values, layout.width)
    samples = samples.assign_coords(
        block=("sample", block, schema.COORDINATES["block"].attrs),
        matrix=("sample", matrix.astype(np.int16), layout.attrs),
    )
    return schema.stamp(
        samples,
        f"design sobol, {total} samples",
        method="sobol",
        seed=seed,
        options={"design": {"n": int(n), "groups": bool(groups), "second_order": layout.second_order}},
        inputs=inputs.to_json(),
    )


def evaluations(inputs: Inputs, n: int, *, groups: bool = True, second_order: bool = False) -> int:
    """Return the number of model runs of a design.

    Parameters
    ----------
    inputs : Inputs
        The uncertain parameters.
    n : int
        As in `design`.
    groups : bool, default True
        As in `design`.
    second_order : bool, default False
        As in `design`.

    Returns
    -------
    int
        The number of base points, times g + 2 of g parameters, or 2 g + 2 with second order.
    """
    return n * _plan(inputs, n, groups, second_order).width


def _plan(inputs: Inputs, n: int, groups: bool, second_order: bool) -> Layout:
    """Return the layout of a design that can be made."""
    n = check_count("n", n, 2)
    if n & (n - 1):
        below = 1 << (n.bit_length() - 1)
        raise InputError(f"n is {n}: the base points must be a power of 2, so take {below} or {2 * below}")
    if n > MAXIMUM_POINTS:
        raise InputError(f"n is {n}: there are at most {MAXIMUM_POINTS} base points")
    if not inputs:
        raise InputError(
            "there are no inputs, so nothing shares the variance: take method 'monte_carlo' with n=1"
        )
    if inputs.dimension > MAXIMUM_COLUMNS:
        raise InputError(
            f"the inputs have {inputs.dimension} elements: a Sobol design has at most {MAXIMUM_COLUMNS}; "
            "let elements share a draw, without each="
        )
    return Layout.of(inputs, groups, second_order)


def validate(
    inputs: Inputs, n: int, *, of: Sequence[str], resamples: int = 1000, minimum_events: int = 50
) -> None:
    """Check the options of the estimate before anything is evaluated.

    Parameters
    ----------
    inputs : Inputs
        Not used: any will do.
    n : int
        Not used: any will do.
    of : sequence of str
        Not used: any will do.
    resamples : int, default 1000
        As in `estimate`.
    minimum_events : int, default 50
        As in `estimate`.

    Raises
    ------
    InputError
        If one cannot be used.
    """
    _check_options(resamples, minimum_events)


def _check_options(resamples: int, minimum_events: int) -> None:
    if check_count("resamples", resamples, 2) > RESAMPLES_MAXIMUM:
        raise InputError(f"resamples is {resamples}: at most {RESAMPLES_MAXIMUM} are made")
    check_count("minimum_events", minimum_events, 0)


def estimate(
    outcomes: xr.Dataset,
    inputs: Inputs,
    *,
    of: str,
    rng: Seed = None,
    confidence: float = 0.95,
    resamples: int = 1000,
    second_order: bool | None = None,
    minimum_events: int = 50,
) -> xr.Dataset:
    """Estimate Sobol indices of an outcome.

    First and total order after Saltelli et al., Comput. Phys. Commun. 181 (2010) 259, second order after
    Saltelli, Comput. Phys. Commun. 145 (2002) 280, as SALib computes them.

    A block with a failed or unknown sample, or without one that it should have, is dropped, for each
    element of the outcome by itself. Indices are undefined (NaN), and say why, where fewer than two
    blocks are left, where the outcome does not vary, and where an outcome of 0 and 1 has too few of
    either to tell. The bootstrap takes base points for independent; those of a Sobol sequence are more
    even, so for a smooth outcome the limits are wider than its error.

    Parameters
    ----------
    outcomes : Dataset
        The variable over ``sample``, with the coords ``block`` and ``matrix`` of the design: all of it
        or any part, in any order.
    inputs : Inputs
        The inputs of the design.
    of : str
        Name of the outcome.
    rng : int or Generator, optional
        Seed of the resampling; by default from the design's, and from the operating system where the
        outcomes do not name it. The results name the one taken, ``resampling_seed``, in their options.
    confidence : float, default 0.95
        Level of the percentile intervals [1].
    resamples : int, default 1000
        Number of resamples.
    second_order : bool, optional
        Whether to estimate indices of pairs; by default where the design has samples for them.
    minimum_events : int, default 50
        Of an outcome of 0 and 1, how many of each there must be among the samples of A and B; of any other,
        how many that differ from its commonest value. Near it small first-order indices are rough still.

    Returns
    -------
    Dataset
        ``S1(parameter)``, ``ST(parameter)`` and, with second order, ``S2(parameter, parameter_2)``, each
        with ``_low`` and ``_high``; ``S1_by_budget``, ``ST_by_budget`` and their limits from the first
        base points alone; ``mean`` and ``variance`` over A and B; the blocks used, ``base_samples``, and
        ``dropped``; ``events`` and ``non_events`` of an outcome of 0 and 1. All also over the dims that
        the outcome has besides ``sample``.

    Raises
    ------
    SchemaError
        If the outcomes are not of a design of this method for these inputs.
    InputError
        If a value is infinite, or an option cannot be used.
    UnknownNameError
        If there is no such outcome.
    """
    confidence = check_confidence(confidence)
    _check_options(resamples, minimum_events)
    values = schema.check_outcomes(outcomes, of)
    layout = layout_of(outcomes, inputs)
    table, rows = layout.table(values, outcomes)
    check_finite(of, table, 0, int(rows.sum()), "it has no variance")
    layout, table = _of_order(second_order, layout, table)
    verdict = kind_of(values) == Kind("probability")
    seed = _resampling_seed(rng, outcomes)

    sizes = [*(FIRST_BUDGET << k for k in range(31) if FIRST_BUDGET << k < len(rows)), len(rows)]
    reasons = [[reason(one, minimum_events, verdict) for one in table[:, :size]] for size in sizes]
    found = [
        indices(
            table[:, :size],
            why,
            len(layout.names),
            layout.pairs if size == len(rows) else [],
            seed=seed,
            resamples=resamples,
            confidence=confidence,
        )
        for size, why in zip(sizes, reasons, strict=True)
    ]
    budget = np.cumsum(rows)[np.array(sizes) - 1]
    results = labelled_indices(found, reasons, layout, values, budget)
    return finished(
        results.assign(moments_and_counts(table, values, verdict)),
        outcomes,
        inputs,
        of=of,
        method="sobol",
        confidence=confidence,
        resamples=resamples,
        second_order=layout.second_order,
        minimum_events=minimum_events,
        resampling_seed=seed,
    )


def _of_order(second_order: bool | None, layout: Layout, table: Array) -> tuple[Layout, Array]:
    """Return layout and outcomes, without the rows for pairs if those are not wanted."""
    if second_order is None:
        return layout, table
    wanted = Layout(layout.names, check_flag("second_order", second_order))
    if wanted.second_order and not layout.second_order:
        raise InputError(
            "second_order is True, but the design has no samples for pairs: design with second_order=True"
        )
    kept = [matrix in wanted.matrices for matrix in layout.matrices]
    return wanted, np.compress(kept, table, axis=2)


def _resampling_seed(rng: Seed, outcomes: xr.Dataset) -> int:
    """Return the seed of resamples: `rng`, else from the design's, else from the operating system."""
    given = outcomes.attrs.get("seed")
    if rng is None and isinstance(given, (int, np.integer)) and given >= 0:
        rng = spawn(int(given), STREAM)
    return seed_of(rng)
