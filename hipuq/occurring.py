"""What occurs in outcomes: at which frequencies modes are unstable, and what decided the verdicts."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import SchemaError
from hipuq.estimation.reduction import flag_counts, read, slices
from hipuq.fragility_curve import weights_of

Array = NDArray[np.float64]

LEVELS = (0.05, 0.5, 0.95)
"""Shares of the unstable samples below the three frequencies of a mode."""

FREQUENCIES = ("frequency_low", "frequency_median", "frequency_high")


def frequency_ranges(outcomes: xr.Dataset) -> xr.Dataset:
    """Return at which frequencies each mode is unstable.

    Parameters
    ----------
    outcomes : Dataset
        With ``frequency`` [Hz] and ``unstable`` over (sample, mode), as from `evaluate`; samples of a
        stratified design count by their weights.

    Returns
    -------
    Dataset
        ``frequency_low``, ``frequency_median``, ``frequency_high`` over ``mode`` [Hz]: the frequencies
        below which 5, 50 and 95 % of the samples in which the mode is unstable lie (attribute ``levels``);
        NaN for a mode that never is known to be. ``unstable_samples`` is the number of them,
        ``known_samples`` that of the samples with a verdict.

    Raises
    ------
    SchemaError
        If one of the two outcomes is missing.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> drawn = {"friction": cp.Uniform(0.0, 1.0), "k3": cp.Uniform(9.0, 13.0)}
    >>> samples = hipuq.design("monte_carlo", model.inputs(**drawn), n=1000, rng=1)
    >>> outcomes = hipuq.evaluate(model, samples)
    >>> ranges = hipuq.frequency_ranges(outcomes)
    >>> ranges["unstable_samples"].values  # of modes 1 and 2
    array([  0, 521])
    >>> names = ["frequency_low", "frequency_high"]
    >>> [round(ranges[name].sel(mode=2).item(), 3) for name in names]  # Hz
    [0.715, 0.749]
    """
    for name in ("frequency", "unstable"):
        if (
            not isinstance(outcomes, xr.Dataset)
            or name not in outcomes
            or set(outcomes[name].dims) != {"sample", "mode"}
        ):
            raise SchemaError(f"frequency ranges need {name!r} over sample and mode: keep it in evaluate")
    both = [outcomes[name].transpose("sample", "mode") for name in ("frequency", "unstable")]
    verdict = both[1]
    weight = weights_of(outcomes)
    modes = range(verdict.sizes["mode"])
    # Only what is unstable is kept: few modes ever are.
    parts: list[list[tuple[Array, Array]]] = [[] for _ in modes]
    known = np.zeros(len(modes), np.int64)
    for rows in slices(len(weight)):
        frequency, flag = (np.asarray(read(part, rows), np.float64) for part in both)
        known += (~np.isnan(flag)).sum(axis=0)
        where = (flag == 1) & np.isfinite(frequency)
        for mode in modes:
            own = where[:, mode]
            parts[mode].append((frequency[own, mode], weight[rows][own]))
    unstable = [[np.concatenate(arrays) for arrays in zip(*of_mode, strict=True)] for of_mode in parts]
    found = np.array([_quantiles(*pair) for pair in unstable])
    data: dict[str, Any] = {}
    for name, level, values in zip(FREQUENCIES, LEVELS, found.T, strict=True):
        attrs = {
            "long_name": f"frequency below which {100 * level:g} % of the unstable samples lie",
            "units": "Hz",
        }
        data[name] = ("mode", values, attrs)
    counts = {
        "unstable_samples": (
            "samples in which the mode is unstable",
            np.array([len(pair[0]) for pair in unstable], np.int64),
        ),
        "known_samples": ("samples in which it is known whether the mode is unstable", known),
    }
    for name, (text, count) in counts.items():
        data[name] = ("mode", count, {"long_name": text, "units": "1"})
    coords = {name: coord for name, coord in verdict.coords.items() if coord.dims == ("mode",)}
    ranges = schema.stamp(xr.Dataset(data, coords=coords), "frequency ranges", like=outcomes.attrs)
    return ranges.assign_attrs(levels=list(LEVELS))


def _quantiles(values: Array, weight: Array) -> Array:
    """Return the smallest values below or at which lie `LEVELS` of the weight; NaN without values."""
    if not values.size:
        return np.full(len(LEVELS), np.nan)
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weight[order])
    # Rounding must not leave the last quantile beyond the last value.
    place = np.searchsorted(share / share[-1], np.array(LEVELS) - 1e-12)
    return np.asarray(values[order][np.minimum(place, len(values) - 1)], np.float64)


def verdict_counts(outcomes: xr.Dataset) -> xr.Dataset:
    """Return how many samples have which status, and what decided those that have a verdict.

    Parameters
    ----------
    outcomes : Dataset
        With ``status``, and ``decided_by`` where the model tells it.

    Returns
    -------
    Dataset
        ``samples`` over ``status`` and ``decided`` over ``decided_by``.
    """
    data: dict[str, Any] = {}
    coords: dict[str, Any] = {}
    tables = (
        ("status", "samples", "samples of each status", schema.STATUS),
        ("decided_by", "decided", "samples decided by each", schema.DECIDED_BY),
    )
    for dim, name, text, flags in tables:
        if dim in outcomes:
            found = flag_counts(outcomes[dim], flags)
            data[name] = (dim, np.array(list(found.values()), np.int64), {"long_name": text, "units": "1"})
            attrs = {"long_name": "status" if dim == "status" else "decided by", "units": ""}
            coords[dim] = (dim, np.array(list(flags)), attrs)
    return schema.stamp(xr.Dataset(data, coords=coords), "verdict counts", like=outcomes.attrs)
