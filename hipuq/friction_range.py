"""The range of friction that is swept for a distribution of it."""

from __future__ import annotations

import numpy as np

from hipuq.cea.boundary import SIDE
from hipuq.distributions import Distribution
from hipuq.errors import InputError

TAIL = 1e-9
"""Probability that is cut off at an end of the support that is infinite."""

LARGEST = 1e3
"""Largest modulus of friction that is swept; beyond it the elastic part of the matrix drowns in rounding."""


def covered(distribution: Distribution) -> tuple[float, float]:
    """Return the finite range of friction that a distribution covers, but for its tails.

    Parameters
    ----------
    distribution : Distribution
        Of the friction coefficient, with a ``cdf``.

    Returns
    -------
    lower, upper : float
        Ends of the range [1].

    Raises
    ------
    InputError
        If nothing is left to integrate over.
    """
    lower, upper = distribution.support
    if not np.isfinite(lower):
        lower = float(distribution.ppf(np.array([TAIL]))[0])
    if not np.isfinite(upper):
        upper = float(distribution.ppf(np.array([1.0 - TAIL]))[0])
    first = float(distribution.ppf(np.array([TAIL]))[0])
    assert distribution.cdf is not None
    if first > lower and float(distribution.cdf(np.array([(lower + first) / 2]))[0]) == 0:
        # The support of a discrete distribution may begin a step below its first value.
        lower = first
    lower, upper = max(lower, -LARGEST), min(upper, LARGEST)
    if not (np.isfinite([lower, upper]).all() and lower < upper):
        raise InputError(
            f"the distribution of friction covers {lower:g} to {upper:g} of what can be swept, at most "
            f"{-LARGEST:g} to {LARGEST:g}: nothing to integrate over"
        )
    return lower, upper


def with_atoms(distribution: Distribution, lower: float, upper: float) -> tuple[float, float]:
    """Return a range, a little wider at an end that is an atom: a boundary there is to be found.

    Parameters
    ----------
    distribution : Distribution
        Of the friction coefficient, with a ``cdf``.
    lower, upper : float
        Ends of the range [1], as `covered` returns them.

    Returns
    -------
    lower, upper : float
        Ends of the range that is swept [1].
    """
    cdf = distribution.cdf
    assert cdf is not None
    ends = np.array([lower, upper])
    reach = SIDE * np.abs(ends).max()
    atom = cdf(ends) - cdf(np.nextafter(ends - [0.0, reach], -np.inf)) > TAIL
    low, high = ends + np.where(atom, 4 * reach, 0.0) * [-1.0, 1.0]
    return float(low), float(high)
