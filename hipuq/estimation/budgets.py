"""Convergence: estimates after ever more of the samples."""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.estimation.limits import columns
from hipuq.estimation.reduction import Moments
from hipuq.estimation.results import Kind

FIRST = 64
"""Samples after which convergence is first told."""


def shell(rows: slice) -> NDArray[np.intp]:
    """Return the first budget that has each sample: `FIRST` samples, twice as many, and so on."""
    return np.searchsorted(FIRST << np.arange(56), np.arange(rows.start, rows.stop) + 1)


def shells_of(samples: int) -> int:
    """Return the number of budgets up to all samples."""
    return int(shell(slice(samples - 1, samples))[0]) + 1


def by_budget(
    dims: tuple[Hashable, ...], parts: list[Moments], pool: bool, kind: Kind, level: float
) -> dict[str, xr.DataArray]:
    """Return the estimate and its limits after a part of the samples: how it converges.

    Parameters
    ----------
    dims : tuple
        Those of the outcome besides ``sample``.
    parts : list of Moments
        Of the outcome and its bounds by the samples that each budget adds: a replicate or a shell.
    pool : bool
        Whether what was added is one sample; else replicates are told from each other.
    kind : Kind
    level : float

    Returns
    -------
    dict of str to DataArray
        ``estimate``, ``low`` and ``high`` over ``budget`` and `dims`.
    """
    count = len(parts[0].size)
    rows = []
    for k in range(1, count + 1):
        first, *rest = (part.first(k).reshaped(1, k) for part in parts)
        if pool:
            first, *rest = (part.pooled().reshaped(1, 1) for part in (first, *rest))
        rows.append(columns(first, rest, kind, level))
    budgets = ("budget", np.cumsum(parts[0].size).astype(np.int64), schema.COORDINATES["budget"].attrs)
    return {
        name: xr.DataArray(np.concatenate([row[name] for row in rows]), dims=["budget", *dims]).assign_coords(
            budget=budgets
        )
        for name in ("estimate", "low", "high")
    }
