"""Frequencies as text: in Hz or kHz, with the digits that tell them apart."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hipuq.report.table import MISSING

KILO = 1000.0

MOST = 6
"""Decimals at most."""


def unit_of(values: Iterable[float]) -> tuple[str, float]:
    """Return the unit in which frequencies [Hz] are read, and how many Hz it is."""
    known = _known(values)
    return ("Hz", 1.0) if known.size and known.max() < KILO else ("kHz", KILO)


def decimals(values: Iterable[float], size: float, digits: int) -> int:
    """Return how many decimals frequencies need.

    Parameters
    ----------
    values : iterable of float
        In Hz; NaN is left out.
    size : float
        The unit, in Hz.
    digits : int
        Significant digits of the largest at least; more where all lie close together.
    """
    known = _known(values) / size
    if not known.size or not known.max() > 0:
        return 0
    spread = known.max() - known.min()
    needed = [digits - 1 - np.floor(np.log10(known.max()))]
    if spread > 0:
        needed.append(np.ceil(-np.log10(spread)) + digits - 3)
    return int(np.clip(max(needed), 0, MOST))


def between(low: float, high: float) -> str:
    """Return a range of frequencies [Hz], such as ``2.167 to 2.172 kHz``."""
    unit, size = unit_of([low, high])
    places = decimals([low, high], size, 3)
    ends = [f"{value / size:.{places}f}" for value in (low, high)]
    return f"{ends[0]} {unit}" if ends[0] == ends[1] else f"{ends[0]} to {ends[1]} {unit}"


def written(value: float, size: float, places: int) -> str:
    """Return a frequency [Hz] in a unit, for a cell."""
    return f"{value / size:.{places}f}" if np.isfinite(value) else MISSING


def _known(values: Iterable[float]) -> np.ndarray:
    array = np.asarray(list(values), np.float64)
    return array[np.isfinite(array)]
