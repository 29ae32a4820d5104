"""Quantiles of a cumulative probability, exact to neighbouring doubles.

The quantile at u is the smallest x with F(x) >= u, whatever F is like: flat between the parts of a support,
with steps at atoms. It is enclosed between two doubles until none lies between them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Keys = NDArray[np.int64]

_SIGN = np.int64(np.iinfo(np.int64).min)


def keys_of(x: Array) -> Keys:
    """Return integers in the order of doubles: those of neighbours differ by 1."""
    bits = np.ascontiguousarray(x, dtype=np.float64).view(np.int64)
    return np.where(bits < 0, _SIGN - bits, bits)


def doubles_of(keys: Keys) -> Array:
    """Return the doubles of integers, the inverse of `keys_of`."""
    return np.where(keys < 0, _SIGN - keys, keys).view(np.float64)


def inverted(
    cdf: Callable[[Array], Array], u: Array, nodes: Array, guess: Callable[[Array], Array] | None = None
) -> Array:
    """Return the smallest doubles x with ``cdf(x) >= u``.

    Steps of the secant method (Illinois) alternate with halving of the integers that stand for doubles
    wherever a step has not halved the interval: as fast as the first, as sure as the second.

    Parameters
    ----------
    cdf : callable
        Not decreasing, array -> array.
    u : (n,) array
        Probabilities between 0 and 1.
    nodes : (k,) array
        Ascending points to begin with; cdf is below every u at the first and at least u at the last.
    guess : callable, optional
        u -> where the quantiles are expected; NaN where that is not known.

    Returns
    -------
    (n,) array
    """
    at_nodes = np.maximum.accumulate(cdf(nodes))
    above = np.searchsorted(at_nodes, u, side="left").clip(1, len(nodes) - 1)
    node_keys = keys_of(nodes)
    low, high = node_keys[above - 1], node_keys[above]
    f_low, f_high = at_nodes[above - 1] - u, at_nodes[above] - u
    open_ = np.flatnonzero(high - low > 1)
    if guess is not None and open_.size:
        expected = guess(u[open_])
        known = np.isfinite(expected)
        at, near = open_[known], keys_of(expected[known])
        # An expected quantile is right where it and its neighbour below enclose u.
        for step in (0, -1, 1):
            _narrow(cdf, u, at, near + step, low, high, f_low, f_high)
            keep = high[at] - low[at] > 1
            at, near = at[keep], near[keep]
        open_ = open_[high[open_] - low[open_] > 1]
    secant = np.ones(len(u), dtype=bool)
    side = np.zeros(len(u), dtype=np.int8)
    while open_.size:
        width = high[open_] - low[open_]
        trial = low[open_] + width // 2
        use = secant[open_]
        chosen = open_[use]
        a, b = doubles_of(low[chosen]), doubles_of(high[chosen])
        with np.errstate(all="ignore"):
            x = a - f_low[chosen] * ((b - a) / (f_high[chosen] - f_low[chosen]))
        usable = np.isfinite(x)
        trial[np.flatnonzero(use)[usable]] = keys_of(x[usable])
        was = side[open_]
        side[open_] = _narrow(cdf, u, open_, trial, low, high, f_low, f_high)
        # Twice on one side: the value at the other end counts half (Illinois), so that it moves too.
        again = was == side[open_]
        f_low[open_[again & (side[open_] > 0)]] /= 2
        f_high[open_[again & (side[open_] < 0)]] /= 2
        left = high[open_] - low[open_]
        secant[open_] = left <= width // 2
        open_ = open_[left > 1]
    return doubles_of(high)


def _narrow(
    cdf: Callable[[Array], Array],
    u: Array,
    at: NDArray[np.intp],
    trial: Keys,
    low: Keys,
    high: Keys,
    f_low: Array,
    f_high: Array,
) -> NDArray[np.int8]:
    """Move an end of each interval to a trial point within it; 1 where that was the upper end, else -1."""
    inside = np.clip(trial, low[at] + 1, high[at] - 1)
    value = cdf(doubles_of(inside)) - u[at]
    upper = value >= 0
    high[at[upper]], f_high[at[upper]] = inside[upper], value[upper]
    low[at[~upper]], f_low[at[~upper]] = inside[~upper], value[~upper]
    return np.where(upper, 1, -1).astype(np.int8)
