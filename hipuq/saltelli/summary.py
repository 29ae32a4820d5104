"""Sobol indices of a design as labelled results: by budget, with moments and counts of the samples."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.estimation.indices import labelled, symmetric, undefined
from hipuq.estimation.results import ENDS
from hipuq.saltelli.decomposition import base
from hipuq.saltelli.layout import Layout

Array = NDArray[np.float64]


def labelled_indices(
    found: list[Array],
    reasons: list[list[str]],
    layout: Layout,
    values: xr.DataArray,
    budget: NDArray[np.int64],
) -> xr.Dataset:
    """Return indices of all budgets, the last one of all outcomes, as a Dataset.

    Parameters
    ----------
    found : list of (3, indices) arrays over the outputs
        Estimates and limits from ever more base points: first order, total order, and in the last one pairs.
    reasons : list of list of str
        Why those of an output are undefined, for each budget; empty where they are not.
    layout : Layout
    values : DataArray
        The outcome, ``sample`` first.
    budget : (b,) array of int
        Evaluations.

    Returns
    -------
    Dataset
    """
    shape, count = values.shape[1:], len(layout.names)
    places = {"S1": slice(0, count), "ST": slice(count, 2 * count)}
    whole, settling = found[-1], np.stack([part[:, : 2 * count] for part in found])
    missing = np.isnan(whole[1:].sum(axis=(0, 1)))
    no_limits = "the outcome does not vary in some resamples, so there are no limits; take more samples"
    why = undefined(reasons[-1], values)
    without = [text or (no_limits if lost else "") for text, lost in zip(reasons[-1], missing, strict=True)]
    why_limits = undefined(without, values)
    early = undefined(reasons[0], values)
    arrays, texts = {}, {}
    for e, end in enumerate(ENDS):
        for name, place in places.items():
            arrays[name + end] = whole[e, place].reshape(count, *shape)
            key = f"{name}_by_budget{end}"
            arrays[key] = settling[:, e, place].reshape(len(budget), count, *shape)
            texts[key] = why or (early and f"at {budget[0]} evaluations: {early}")
        if layout.second_order:
            arrays["S2" + end] = symmetric(whole[e, 2 * count :], count).reshape(count, count, *shape)
    texts |= {name + end: why_limits if end else why for name in ("S1", "ST", "S2") for end in ENDS}
    return labelled(arrays, layout.names, values, texts, budget)


def moments_and_counts(table: Array, values: xr.DataArray, verdict: bool) -> dict[str, xr.DataArray]:
    """Return moments over A and B and counts of an outcome.

    Parameters
    ----------
    table : (outputs, blocks, width) array
        As from `Layout.table`.
    values : DataArray
        The outcome, ``sample`` first.
    verdict : bool
        Whether it is one of 0 and 1, of which events are counted.

    Returns
    -------
    dict of str to DataArray
    """
    known = [base(one) for one in table]
    with np.errstate(over="ignore"):
        variance = [both.var(ddof=1) if both.size else np.nan for both in known]
    name, units = values.attrs.get("long_name", values.name), str(values.attrs.get("units", ""))
    columns: dict[str, tuple[list[float], str, str]] = {
        "mean": ([both.mean() if both.size else np.nan for both in known], f"mean of {name}", units),
        "variance": (variance, f"variance of {name}", f"({units})^2" if units else ""),
        "base_samples": ([len(both) for both in known], "base points used", "1"),
        "dropped": ([table.shape[1] - len(both) for both in known], "base points dropped", "1"),
    }
    if verdict:
        for key, value in (("events", 1), ("non_events", 0)):
            text = f"{key.replace('_', '-')} among the samples of A and B"
            columns[key] = ([int((both == value).sum()) for both in known], text, "1")
    return {
        key: xr.DataArray(
            np.array(column).reshape(values.shape[1:]),
            dims=values.dims[1:],
            attrs={"long_name": text, "units": unit},
        )
        for key, (column, text, unit) in columns.items()
    }
