"""The order that gives modes their numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.pencils import Array

TIE = 1e-9
"""Frequencies of damped modes this close, relative to the largest, are equal but for rounding."""


def mode_order(frequency: Array, growth_rate: Array, tie: float = 0.0) -> NDArray[np.intp]:
    """Return the order of modes: by ascending frequency, the growing one of a pair last.

    Modes of frequency 0 are ordered by ascending growth rate.

    Parameters
    ----------
    frequency, growth_rate : (s, n) array
        Of any unit.
    tie : float
        Neighbours whose frequencies differ by less than this part of the largest are put with the
        decaying one first; 0 leaves those of equal frequency as they come.

    Returns
    -------
    (s, n) array of int
    """
    still = np.where(frequency == 0, growth_rate, 0.0)
    order = np.lexsort((still, frequency), axis=1)
    if tie > 0:
        sorted_frequency = np.take_along_axis(frequency, order, axis=1)
        sorted_growth = np.take_along_axis(growth_rate, order, axis=1)
        close = np.diff(sorted_frequency, axis=1) < tie * sorted_frequency[:, -1:]
        fall = close & (sorted_frequency[:, :-1] > 0) & (np.diff(sorted_growth, axis=1) < 0)
        rows, first = np.nonzero(fall)
        order[rows, first], order[rows, first + 1] = order[rows, first + 1], order[rows, first]
    return np.asarray(order, np.intp)
