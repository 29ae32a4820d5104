"""Runs of a comparison as one labelled Dataset."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.comparison.contender import label_of, same_model
from hipuq.comparison.costs import costs
from hipuq.comparison.record import Record, Run
from hipuq.comparison.statistics import Cells, errors, ranks, rates
from hipuq.sampling import spawn

if TYPE_CHECKING:
    from hipuq.comparison.running import Race

RUNS = {
    "estimate": "{what}",
    "low": "{what}, lower limit",
    "high": "{what}, upper limit",
    "bias": "mean error",
    "bias_error": "standard error of the mean error",
    "rmse": "root mean square error",
    "rmse_overall": "root mean square error over all {dims}",
    "reference": "{what}, reference",
    "reference_low": "{what}, lower limit of the reference",
    "reference_high": "{what}, upper limit of the reference",
}
"""Variables in the unit of what is compared -> their long names."""

NUMBERS = {
    "coverage": ("share of intervals that hold the reference", "1"),
    "coverage_overall": ("share of intervals that hold the reference, over all {dims}", "1"),
    "rmse_ratio": ("root mean square error over the lowest of the budget", "1"),
    "rate": ("slope of the logarithm of the error over that of evaluations", "1"),
    "intervals": ("runs that give an interval", "1"),
    "evaluations": ("model evaluations of a run", "1"),
    "replicates": ("runs", "1"),
    "seconds": ("time of a run", "s"),
    "model_seconds": ("time of the model's evaluations in a run", "s"),
    "run_time": ("median time of a run", "s"),
    "model_time": ("median time of the model's evaluations in a run", "s"),
    "baseline_evaluations": ("evaluations of {baseline} for the same error", "1"),
    "cost_ratio": ("time over that of {baseline} for the same error", "1"),
    "break_even": ("time of one evaluation above which it costs less than {baseline}", "s"),
}
"""Other variables -> long name, unit."""

CELL = ("method", "budget")
RUN = ("method", "budget", "replicate")


def dataset(race: Race, record: Record, reference: NDArray[np.float64], seed: int) -> xr.Dataset:
    """Return all runs with what they say about the contenders.

    Parameters
    ----------
    race : Race
    record : Record
        With all its runs.
    reference : (3, ...) array
        Value, lower and upper limit.
    seed : int

    Returns
    -------
    Dataset
        See `hipuq.compare`.
    """
    cells = _cells(race, record, reference)
    level, labels = race.confidence, record.labels
    extra = list(labels["dims"])
    numbers, resampled = errors(cells, lambda i, j: _stream(race, seed, i, j), level)
    rmse = numbers["rmse_overall" if extra else "rmse"]
    names = [one.name for one in race.contenders]
    place = names.index(race.baseline)
    same = [same_model(one.model, race.contenders[place].model) for one in race.contenders]
    numbers |= ranks(rmse, resampled, level) | rates(rmse, resampled, cells.evaluations, level)
    numbers |= costs(cells, rmse, resampled, place, same, level)
    by_run = {name: getattr(cells, name) for name in ("estimate", "low", "high", "seconds", "model_seconds")}
    by_cell = {"evaluations": cells.evaluations, "replicates": cells.replicates}
    ends = ("reference", "reference_low", "reference_high")
    data: dict[str, Any] = {}
    for name, array in {
        **by_run,
        **by_cell,
        **dict(zip(ends, reference, strict=True)),
        **numbers,
    }.items():
        dims = _dims(name, array.ndim, extra)
        data[name] = (dims, array, _attrs(name, labels, race.baseline, level))
    count = np.arange(1, race.replicates + 1)
    coords: dict[str, Any] = {
        "method": ("method", np.array(names), {"long_name": "method", "units": ""}),
        "budget": (
            "budget",
            np.array(race.budgets, np.int64),
            {"long_name": "budget of evaluations", "units": "1"},
        ),
        "replicate": ("replicate", count, {"long_name": "replicate", "units": "1"}),
    }
    for dim in extra:
        known = schema.COORDINATES.get(dim)
        coords[dim] = (dim, np.array(labels["coords"][dim]), known.attrs if known else {})
    options = {
        "quantity": labels["name"],
        "confidence": level,
        "baseline": race.baseline,
        "contenders": {one.name: {**one.definition, "model": label_of(one.model)} for one in race.contenders},
    }
    made = schema.stamp(
        xr.Dataset(data, coords),
        f"compare {', '.join(names)}",
        model=race.label,
        seed=seed,
        options={"compare": options},
        inputs=race.inputs,
    )
    return made.assign_attrs(
        of=race.of,
        quantity=labels["name"],
        baseline=race.baseline,
        confidence=level,
        reference_source=race.reference.source,
        jobs=", ".join(map(str, sorted({run.jobs for run in _used(race, record)}))),
        title="",
    )


def _stream(race: Race, seed: int, i: int, j: int) -> np.random.Generator:
    """Return the generator of the resamples of a cell: that of its runs without the replicate."""
    return spawn(seed, *race.contenders[i].key(race.budgets[j]))


def _cells(race: Race, record: Record, reference: NDArray[np.float64]) -> Cells:
    """Return the runs as arrays."""
    shape = (len(race.contenders), len(race.budgets), race.replicates)
    found = np.full((3, *shape, *reference.shape[1:]), np.nan)
    spent = np.full((2, *shape), np.nan)
    evaluations, replicates = np.zeros((2, *shape[:2]), np.int64)
    names = [one.name for one in race.contenders]
    for run in _used(race, record):
        i, j = names.index(run.contender), race.budgets.index(run.budget)
        replicates[i, j] += 1
        found[:, i, j, run.replicate] = run.estimate, run.low, run.high
        spent[:, i, j, run.replicate] = run.seconds, run.model_seconds
        # A sequential method may need fewer than planned.
        evaluations[i, j] = max(evaluations[i, j], run.evaluations)
    estimate, low, high = found
    seconds, model = spent
    exact = race.reference.exact
    return Cells(estimate, low, high, seconds, model, evaluations, replicates, reference[0], exact)


def _used(race: Race, record: Record) -> Iterator[Run]:
    """Give the runs that the comparison asks for; the record may hold more."""
    for one in race.contenders:
        for budget in one.sizes:
            for k in range(one.replicates):
                yield record.runs[one.name, budget, k]


def _dims(name: str, size: int, extra: list[str]) -> tuple[str, ...]:
    """Return the dims of a variable."""
    if name.startswith("reference"):
        return tuple(extra)
    if name.startswith("rate"):
        return ("method",)
    dims = RUN if name in ("estimate", "low", "high", "seconds", "model_seconds") else CELL
    return (*dims, *extra) if size > len(dims) else dims


def _attrs(name: str, labels: dict[str, Any], baseline: str, level: float) -> dict[str, str]:
    """Return long name and unit of a variable."""
    known = RUNS | {key: text for key, (text, _) in NUMBERS.items()}
    base, end = name, ""
    for suffix, side in {"_low": "lower", "_high": "upper"}.items():
        if name not in known and name.endswith(suffix):
            base, end = name.removesuffix(suffix), f", {side} {level:.0%} limit"
    units = labels["units"] if base in RUNS else NUMBERS[base][1]
    words = {
        "what": labels["long_name"],
        "dims": " and ".join(f"{dim}s" for dim in labels["dims"]),
        "baseline": baseline,
    }
    return {"long_name": known[base].format(**words) + end, "units": units}
