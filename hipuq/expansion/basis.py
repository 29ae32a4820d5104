"""Multi-indices of the terms of an expansion, and products of univariate polynomials.

Truncation by a norm below 1 keeps high degrees of single inputs and drops high interactions (Blatman
and Sudret, J. Comput. Phys. 230 (2011) 2345).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hipuq.errors import InputError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MOST_TERMS = 20_000
"""Most terms of an expansion."""

# Room for rounding where the norm of a multi-index is compared with the degree.
_ROUNDING = 1e-9


def multi_indices(
    dimension: int,
    degree: int,
    *,
    q: float = 1.0,
    interaction: int | None = None,
    largest: ArrayLike | None = None,
) -> Indices:
    """Return the multi-indices of all terms up to a degree.

    Parameters
    ----------
    dimension : int
        Number d of variables.
    degree : int
        Highest norm ``(sum alpha**q)**(1/q)`` of a multi-index alpha.
    q : float
        Above 0, at most 1: 1 is the total degree, less drops interactions.
    interaction : int, optional
        Most variables that may occur in a term.
    largest : (d,) array of int, optional
        Highest degree of each variable.

    Returns
    -------
    (terms, d) array of int
        Ordered by norm, the first row 0; of equal norm those of fewer variables first, then earlier
        variables.

    Raises
    ------
    InputError
        If there are more than `MOST_TERMS`, or q, degree or interaction cannot be used.
    """
    caps = _caps(dimension, degree, q, interaction, largest)
    found = list(islice(_terms(caps, degree, q, interaction), MOST_TERMS + 1))
    if len(found) > MOST_TERMS:
        raise InputError(
            f"degree {degree} in {dimension} inputs has more than {MOST_TERMS} terms (q={q:g}, "
            f"interaction={interaction}): take a lower degree, q below 1 or interaction=2"
        )
    indices = np.zeros((len(found), dimension), np.int64)
    for row, term in zip(indices, found, strict=True):
        for variable, power in term:
            row[variable] = power
    size = np.round(norms(indices, q) / _ROUNDING) * _ROUNDING
    active = (indices > 0).sum(axis=1)
    return indices[np.lexsort((*(-indices.T[::-1]), active, size))]


def count(
    dimension: int,
    degree: int,
    *,
    q: float = 1.0,
    interaction: int | None = None,
    largest: ArrayLike | None = None,
) -> int:
    """Return the number of terms up to a degree, or ``MOST_TERMS + 1`` where there are more.

    Parameters
    ----------
    dimension, degree, q, interaction, largest
        As of `multi_indices`.

    Returns
    -------
    int

    Raises
    ------
    InputError
        If q, degree or interaction cannot be used.
    """
    caps = _caps(dimension, degree, q, interaction, largest)
    return sum(1 for _ in islice(_terms(caps, degree, q, interaction), MOST_TERMS + 1))


def norms(indices: Indices, q: float) -> Array:
    """Return the norm ``(sum alpha**q)**(1/q)`` of each multi-index, (terms,)."""
    return np.asarray((indices.astype(np.float64) ** q).sum(axis=1) ** (1 / q))


def leading(indices: Indices, q: float) -> list[tuple[int, int]]:
    """Return for every degree the number of leading terms that belong to it.

    Parameters
    ----------
    indices : (terms, d) array of int
        Ordered as by `multi_indices`.
    q : float
        Of the norm that they were made with.

    Returns
    -------
    list of (terms, degree)
        From degree 0; degrees that add no term are left out.
    """
    size = norms(indices, q)
    highest = int(np.ceil(size.max(initial=0.0) - _ROUNDING))
    counts = {int((size <= degree + _ROUNDING).sum()): degree for degree in range(highest, -1, -1)}
    return sorted(counts.items())


def tensor(univariate: Array, indices: Indices) -> Array:
    """Return the terms of an expansion at points, products over the variables that occur in each.

    Parameters
    ----------
    univariate : (d, degree + 1, s) array
        Polynomials of each variable, the first of them 1.
    indices : (terms, d) array of int

    Returns
    -------
    (s, terms) array
        In memory term by term.
    """
    values = np.ones((len(indices), univariate.shape[2]))
    for value, row in zip(values, indices, strict=True):
        for variable in np.flatnonzero(row):
            value *= univariate[variable, row[variable]]
    return values.T


def _caps(
    dimension: int, degree: int, q: float, interaction: int | None, largest: ArrayLike | None
) -> list[int]:
    """Return the highest degree of each variable; check the rest."""
    if not 0 < q <= 1:
        raise InputError(f"q is {q!r}: the norm of the truncation lies above 0 and is at most 1")
    if degree < 0:
        raise InputError(f"degree is {degree!r}: it must be 0 or more")
    if degree > MOST_TERMS:
        raise InputError(f"degree is {degree!r}: it must be at most {MOST_TERMS:,}")
    if interaction is not None and interaction < 1:
        raise InputError(f"interaction is {interaction!r}: it must be 1 or more, or None for no limit")
    caps = np.full(dimension, degree) if largest is None else np.minimum(np.asarray(largest), degree)
    return [int(cap) for cap in np.broadcast_to(caps, dimension)]


def _terms(
    caps: list[int], degree: int, q: float, interaction: int | None
) -> Iterator[tuple[tuple[int, int], ...]]:
    """Yield the terms as pairs (variable, power), one by one.

    Every beginning of a term is a term, so the work is proportional to the number of terms.
    """
    costs = [power**q for power in range(degree + 1)]
    budget = (degree + _ROUNDING) ** q
    most = len(caps) if interaction is None else interaction
    stack: list[tuple[tuple[tuple[int, int], ...], float]] = [((), 0.0)]
    while stack:
        term, cost = stack.pop()
        yield term
        if len(term) == most or cost + 1 > budget:
            continue
        for variable in range(term[-1][0] + 1 if term else 0, len(caps)):
            for power in range(1, caps[variable] + 1):
                if cost + costs[power] > budget:
                    break
                stack.append(((*term, (variable, power)), cost + costs[power]))
