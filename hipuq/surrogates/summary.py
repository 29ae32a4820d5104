"""What a surrogate says, held against true values, as labelled results."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.estimation import indices
from hipuq.estimation.results import ENDS
from hipuq.inputs import Inputs
from hipuq.surrogates.checking import Check, Events
from hipuq.surrogates.surrogate import Surrogate

Array = NDArray[np.float64]

SHOWN = 5_000
"""Most held-out samples whose true and predicted values are kept."""


def summarised(surrogate: Surrogate, check: Check, inputs: Inputs, groups: bool) -> xr.Dataset:
    """Return the results of a surrogate.

    Parameters
    ----------
    surrogate : Surrogate
    check : Check
        What it is held against.
    inputs : Inputs
        All inputs.
    groups : bool
        Whether indices are those of parameters, or of elements.

    Returns
    -------
    Dataset
    """
    table = _Table(check.values, inputs, surrogate.discrete)
    expansion, name = surrogate.expansion, table.name
    units = str(check.values.attrs.get("units", ""))
    square = units if units in ("", "1") else f"({units})^2"
    by_level: dict[str, tuple[NDArray[Any], Array | None, str, str]] = {
        "mean": (expansion.mean(), expansion.mean_overall(), f"mean of {name}, surrogate alone", units),
        "variance": (
            np.where(np.isnan(expansion.mean()), np.nan, expansion.variance()),
            expansion.variance_overall(),
            f"variance of {name}, surrogate alone",
            square,
        ),
        "loo": (surrogate.loo, surrogate.loo_overall, "relative corrected leave-one-out error", "1"),
        "degree": (surrogate.degree, None, "degree of the expansion", "1"),
        "terms": (surrogate.terms, None, "terms that are not zero", "1"),
        "samples_used": (surrogate.used, None, "samples that were fitted", "1"),
    }
    for key, (values, overall, text, unit) in by_level.items():
        table.put(key, values, text, unit, by_level=True)
        if overall is not None and surrogate.discrete:
            table.put(f"{key}_overall", overall, f"{text}, over all levels", unit)
    checked = (~np.isnan(check.true)).sum(axis=0)
    table.put("checked", checked, "held-out samples with a known outcome", "1")
    table.put("q2", check.q2, "share of the variance explained on held-out samples (Q2)", "1")
    if check.kind.graded or not check.kind.bounded:
        # Of a verdict the corrected probability is the better one.
        text = f"mean of {name}, surrogate mended by held-out samples"
        table.put_limits("mean_corrected", check.mean, text, units)
    attrs = schema.COORDINATES["quantile"].attrs
    table.results = table.results.assign_coords(quantile=("quantile", np.array(check.levels), attrs))
    table.put("quantiles", check.quantiles, f"quantile of {name}, surrogate", units, "quantile")
    if check.events is not None:
        _put_events(table, check.events, bool(surrogate.discrete))
    elif check.kind.graded:
        key = "probability_overall" if surrogate.discrete else "probability"
        table.put_limits(key, check.mean, f"{name}, surrogate mended by held-out samples", "1")
    _put_held_out(table, check, units)
    _put_coefficients(table, surrogate, units)
    results = table.results.merge(_indices(surrogate, check, inputs, groups), join="exact")
    trusted = table.shape(np.array([not reasons for reasons in check.reasons], np.int8))
    text = indices.undefined([" and ".join(reasons) for reasons in check.reasons], check.values)
    attrs = {"long_name": "surrogate to be trusted", "units": "1", "reasons": text}
    return results.assign(trusted=(table.extra, trusted, attrs))


class _Table:
    """Results in the making: dims of levels and of the outcome."""

    def __init__(self, values: xr.DataArray, inputs: Inputs, discrete: str) -> None:
        self.name = str(values.attrs.get("long_name", values.name))
        self.extra = [str(dim) for dim in values.dims[1:]]
        self.lengths = values.shape[1:]
        own = {k: c for k, c in values.coords.items() if c.dims and set(c.dims) <= set(self.extra)}
        self.results = xr.Dataset(coords=own)
        self.level: list[str] = []
        if discrete:
            levels = inputs.levels(discrete)
            self.level = [levels.attrs["dim"]]
            labels = levels.drop_vars("weight").drop_attrs(deep=False)
            self.results = self.results.assign_coords(labels.variables).assign(weight=levels["weight"])

    def shape(self, array: NDArray[Any]) -> NDArray[Any]:
        """Return an array (..., outputs) with the dims of the outcome."""
        return array.reshape((*array.shape[:-1], *self.lengths))

    def put(
        self, key: str, array: NDArray[Any], text: str, units: str, *leading: str, by_level: bool = False
    ) -> None:
        """Add a variable from an array (..., outputs); by level the first axis is that of the levels."""
        dims = list(leading)
        if by_level:
            dims = [*dims, *self.level]
            array = array if self.level else array[0]
        attrs = {"long_name": text, "units": units}
        self.results[key] = ((*dims, *self.extra), self.shape(array), attrs)

    def put_limits(self, key: str, triple: tuple[Array, Array, Array], text: str, units: str) -> None:
        """Add an estimate and its limits."""
        for (end, more), array in zip(ENDS.items(), triple, strict=True):
            self.put(key + end, array, text + more, units)


def _put_events(table: _Table, events: Events, levels: bool) -> None:
    """Add what is known of the event: what the surrogate says, its errors, the mended probability."""
    what = f"probability: {events.name}"
    table.put("probability_surrogate", events.by_level, f"{what}, surrogate alone", "1", by_level=True)
    if levels:
        text = f"{what}, surrogate alone, weighted over all levels"
        table.put("probability_surrogate_overall", events.overall, text, "1")
    table.put_limits("misclassified", events.misclassified, "share of held-out samples misclassified", "1")
    key = "probability_overall" if levels else "probability"
    table.put_limits(key, events.corrected, f"{what}, from true evaluations by strata of the surrogate", "1")


def _put_held_out(table: _Table, check: Check, units: str) -> None:
    """Add true and predicted values of held-out samples."""
    rows = np.flatnonzero(check.held)[:SHOWN]
    attrs = schema.COORDINATES["held_out"].attrs
    numbers = check.outcomes["sample"].values[rows] if "sample" in check.outcomes.coords else rows
    table.results = table.results.assign_coords(held_out=("held_out", numbers, attrs))
    for key, values in (("true", check.y[rows]), ("predicted", check.predicted[: len(rows)])):
        table.put(key, values, f"{table.name}, {key}", units, "held_out")
    if check.state is not None:
        table.results["true"].attrs["limit_state"] = check.state.limit


def _put_coefficients(table: _Table, surrogate: Surrogate, units: str) -> None:
    """Add what the surrogate can be made from again."""
    expansion = surrogate.expansion
    names = np.array(expansion.germs.elements)
    terms = np.arange(1, len(expansion.indices) + 1)
    table.results = table.results.assign_coords(
        element=("element", names, schema.COORDINATES["element"].attrs),
        term=("term", terms, schema.COORDINATES["term"].attrs),
    )
    text = "coefficient of the orthonormal polynomials"
    by_term = expansion.coefficients.swapaxes(0, 1)
    by_term = by_term if table.level else by_term[:, 0]
    table.put("coefficient", by_term, text, units, "term", *table.level)
    attrs = {"long_name": "degree of each element in a term", "units": "1"}
    table.results["multi_index"] = (("term", "element"), expansion.indices.astype(np.int16), attrs)


def _indices(surrogate: Surrogate, check: Check, inputs: Inputs, groups: bool) -> xr.Dataset:
    """Return labelled Sobol indices, parameters in the order of the inputs."""
    germs = surrogate.expansion.germs
    columns = germs.parameters if groups else germs.elements
    found = list(dict.fromkeys(columns))
    members = [[i for i, column in enumerate(columns) if column == name] for name in found]
    found_indices = surrogate.expansion.sobol(members, bool(surrogate.discrete))
    if surrogate.discrete:
        found.append(surrogate.discrete)
    names = list(inputs) if groups else inputs.elements
    order = [found.index(name) for name in names]
    whys = [check.undefined(k) for k in range(check.y.shape[1])]
    placed = {}
    for key, array in zip(("S1", "ST", "S2"), found_indices, strict=True):
        part = array[order][:, order] if key == "S2" else array[order]
        part = np.where([bool(why) for why in whys], np.nan, part)
        placed[key] = part.reshape((*part.shape[:-1], *check.values.shape[1:]))
    reason = indices.undefined(whys, check.values)
    made = indices.labelled(placed, names, check.values, dict.fromkeys(placed, reason))
    for key in placed:
        made[key].attrs["long_name"] = f"surrogate's {made[key].attrs['long_name']}"
    return made
