"""From arrays to labelled results: what an outcome is, its strata, names, summaries, attributes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import SchemaError
from hipuq.estimation.reduction import Groups, by_block, flag_counts, one_group, read
from hipuq.inputs import Inputs
from hipuq.intervals import combined

ENDS = {"": "", "_low": ", lower limit", "_high": ", upper limit"}
"""Ends of the names of an estimate and its limits -> what they add to its long_name."""


@dataclass(frozen=True)
class Kind:
    """What an outcome is to an estimator.

    Attributes
    ----------
    quantity : str
        ``"probability"`` or ``"mean"``.
    graded : bool
        Whether values between 0 and 1 occur: probabilities themselves.
    """

    quantity: str
    graded: bool = False

    @property
    def bounded(self) -> bool:
        """Whether values lie between 0 and 1, so that an unknown one has bounds."""
        return self.quantity == "probability"


def kind_of(values: xr.DataArray) -> Kind:
    """Say what an outcome is: by its role, its type, or, if it says nothing of itself, its values."""
    role = values.attrs.get("role")
    if role == schema.VERDICT or values.dtype.kind == "b":
        return Kind("probability")
    if role == schema.PROBABILITY:
        return Kind("probability", graded=True)
    if role is None and "units" not in values.attrs:
        # Of other numbers mostly the first block tells.
        if all((np.isnan(part) | np.isin(part, (0, 1))).all() for part in by_block(values)):
            return Kind("probability")
    return Kind("mean")


def check_independent(outcomes: xr.Dataset, *, strata: bool = False) -> None:
    """Check that samples are draws of the inputs, as far as their coords tell.

    Parameters
    ----------
    outcomes : Dataset
    strata : bool
        Whether samples of different strata of a surrogate are welcome too.

    Raises
    ------
    SchemaError
        If they are of a design whose samples share values, or are more frequent in some places.
    """
    if "matrix" in outcomes.coords:
        raise SchemaError(
            "the outcomes are of a design of several matrices, as for Sobol indices, whose samples share "
            "values: take those of one matrix, "
            "outcomes.isel(sample=outcomes.matrix == 0).drop_vars(['block', 'matrix'])"
        )
    if strata or "stratum" not in outcomes.coords:
        return
    if any((part != 0).any() for part in by_block(outcomes["stratum"])):
        raise SchemaError(
            "the outcomes are of a design of polynomial chaos, whose samples are no plain draws of the "
            "inputs: take those held out, outcomes.isel(sample=outcomes.stratum == 0)"
        )


def levels_of(outcomes: xr.Dataset, inputs: Inputs) -> tuple[xr.Dataset | None, Groups]:
    """Return the levels that outcomes of a stratified design are of, and what gives the one of each sample.

    Parameters
    ----------
    outcomes : Dataset
        Stratified if it has the coord ``weight`` and that of the levels' dim.
    inputs : Inputs

    Returns
    -------
    levels : Dataset or None
        None if the design was not stratified.
    level : callable
        Rows -> place of each sample's level, from 0, which reads no others. It raises a SchemaError for
        samples of other levels than those of the inputs.
    """
    if "weight" in outcomes.coords:
        for name in inputs.discrete:
            levels = inputs.levels(name)
            if levels.attrs["dim"] in outcomes.coords:
                return levels, partial(_places, outcomes, levels, name)
    return None, one_group


def _places(outcomes: xr.Dataset, levels: xr.Dataset, name: str, rows: slice) -> NDArray[np.intp]:
    """Return the place of the level of each sample among all levels."""
    dim, group = levels.attrs["dim"], levels.attrs["group"]
    numbers: Any = read(outcomes[dim], rows)
    place = levels.get_index(dim).get_indexer(numbers)
    if (place < 0).any() or (
        group in outcomes.coords
        and not np.array_equal(levels[group].values[place], read(outcomes[group], rows))
    ):
        raise SchemaError(f"the outcomes are of another {name} than the inputs: their {dim} does not fit")
    return np.asarray(place, np.intp)


def labelled(values: xr.DataArray, kind: Kind, arrays: Mapping[str, xr.DataArray]) -> xr.Dataset:
    """Return estimate, limits, known counts and, for a mean, the variance as a Dataset.

    Parameters
    ----------
    values : DataArray
        The outcome, for its name, unit and coords.
    kind : Kind
    arrays : mapping of DataArray
        ``estimate``, ``low``, ``high``, ``known`` and, for a mean, ``variance``.

    Returns
    -------
    Dataset
    """
    name = str(values.attrs.get("long_name", values.name))
    units = "1" if kind.bounded else str(values.attrs.get("units", ""))
    what = f"mean of {name}"
    if kind.bounded:
        what = name if name.startswith("probability") else f"probability: {name}"
    results = xr.Dataset()
    for key, (end, text) in zip(("estimate", "low", "high"), ENDS.items(), strict=True):
        results[kind.quantity + end] = arrays[key].assign_attrs(long_name=what + text, units=units)
    results["known"] = arrays["known"].assign_attrs(long_name="samples with a known outcome", units="1")
    if not kind.bounded:
        square = f"({units})^2" if units else ""
        results["variance"] = arrays["variance"].assign_attrs(long_name=f"variance of {name}", units=square)
    kept = {
        key: coord
        for key, coord in values.coords.items()
        if coord.dims and "sample" not in coord.dims and set(coord.dims) <= set(results.dims)
    }
    return results.assign_coords(kept)


def with_summaries(
    results: xr.Dataset,
    levels: xr.Dataset,
    quantity: str,
    arrays: Mapping[str, xr.DataArray],
    confidence: float | None = None,
) -> xr.Dataset:
    """Add what is summed up over levels: overall by weight, and for each group of levels.

    Parameters
    ----------
    results : Dataset
        Estimates by level.
    levels : Dataset
        With attributes ``dim``, ``group`` (a coord) and ``group_dim``.
    quantity : str
        ``"probability"`` or ``"mean"``.
    arrays : mapping of DataArray
        ``estimate``, ``low``, ``high``, ``floor`` and ``ceiling`` by level, see `combined`.
    confidence : float, optional
        Of the limits, where the estimates are shares of ``draws``, which `arrays` then hold.

    Returns
    -------
    Dataset
        With ``<quantity>_overall``, ``_low``, ``_high``; over the group dim ``<quantity>_mean`` with
        ``_low``, ``_high``, ``_min``, ``_max`` over the levels as they are, and
        ``<quantity>_weighted`` by their weights.
    """
    dim, group, group_dim = (levels.attrs[key] for key in ("dim", "group", "group_dim"))
    labels = levels.drop_vars("weight")
    results = results.assign_coords(labels.variables).assign(weight=levels["weight"])
    what, units = (results[quantity].attrs[key] for key in ("long_name", "units"))
    table = xr.Dataset(dict(arrays)).assign(weight=results["weight"], plain=xr.ones_like(results["weight"]))

    def put(key: str, value: xr.DataArray, text: str) -> None:
        results[key] = value.drop_attrs().assign_attrs(long_name=text, units=units)

    overall = combined(table, "weight", dim, confidence=confidence)
    for (end, text), value in zip(ENDS.items(), overall, strict=True):
        put(f"{quantity}_overall{end}", value, f"{what}, weighted over all levels{text}")
    names = np.unique(levels[group].values)
    parts = [table.isel({dim: results[group].values == name}) for name in names]
    index = xr.DataArray(names, dims=group_dim, attrs=schema.COORDINATES[group_dim].attrs)

    def by_group(values: list[xr.DataArray]) -> xr.DataArray:
        return xr.concat(values, dim=xr.Variable(group_dim, names), coords="minimal", join="exact")

    plain = [combined(part, "plain", dim, confidence=confidence) for part in parts]
    for i, (end, text) in enumerate(ENDS.items()):
        value = by_group([triple[i] for triple in plain])
        put(f"{quantity}_mean{end}", value, f"{what}, mean over the levels of a group{text}")
    weighted = by_group([combined(part, "weight", dim)[0] for part in parts])
    put(f"{quantity}_weighted", weighted, f"{what}, weighted mean over a group")
    for end in ("min", "max"):
        value = by_group([getattr(part["estimate"], end)(dim, skipna=False) for part in parts])
        put(f"{quantity}_{end}", value, f"{what}, {end}imum over the levels of a group")
    # Says which coord over the levels the group dim sums up.
    return results.assign_coords({group_dim: index}).assign_attrs(levels_group=group)


def finished(
    results: xr.Dataset,
    outcomes: xr.Dataset,
    inputs: Inputs,
    *,
    of: str,
    method: str,
    confidence: float,
    **options: object,
) -> xr.Dataset:
    """Return results with counts of evaluations, failures and unknowns, seconds and attributes.

    Parameters
    ----------
    results, outcomes : Dataset
    inputs : Inputs
    of, method : str
    confidence : float
    **options
        What else the estimate was made with, JSON-able.

    Returns
    -------
    Dataset
    """
    found = flag_counts(outcomes["status"], schema.STATUS) if "status" in outcomes else {}
    counts = {
        "evaluations": (outcomes.sizes["sample"], "model evaluations", "1"),
        "failed": (found.get("failed", 0), "failed samples", "1"),
        "undecided": (found.get("undecided", 0), "undecided samples", "1"),
        "seconds": (float(outcomes.attrs.get("seconds", np.nan)), "time of the evaluations", "s"),
    }
    for name, (value, long_name, units) in counts.items():
        results[name] = ((), value, {"long_name": long_name, "units": units})
    kept = {key: results.attrs[key] for key in ("levels_group",) if key in results.attrs}
    results = schema.stamp(
        results.drop_attrs(deep=False),
        f"estimate {method} of {of}",
        method=method,
        inputs=inputs.to_json(),
        options={"estimate": {"of": of, "confidence": confidence, **options}},
        like=outcomes.attrs,
    )
    results.attrs.pop("seconds", None)
    return results.assign_attrs(of=of, confidence=confidence, **kept)
