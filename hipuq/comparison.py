"""Methods compared on one problem with a known answer: error, coverage and cost over evaluations."""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from hipuq import schema
from hipuq.driver import completed, estimated, method_named
from hipuq.errors import InputError
from hipuq.inputs import Inputs
from hipuq.intervals import check_confidence, wilson
from hipuq.methods import Method
from hipuq.sampling import Seed, check_count, seed_of, spawn

Array = NDArray[np.float64]

QUANTITIES = ("probability_overall", "probability", "mean_corrected", "mean_overall", "mean")
"""What is compared where nothing is named: the first of these that results have."""

RESAMPLES = 1000
"""Resamples of the replicates for the limits of a root mean square error."""


@dataclass(frozen=True)
class Contender:
    """One way to the answer.

    Attributes
    ----------
    name : str
    record : Method
    model : callable
    inputs : Inputs
    of : str
        The outcome that it analyses.
    stages : mapping
        Options of the method by stage.
    """

    name: str
    record: Method
    model: Callable[..., xr.Dataset]
    inputs: Inputs
    of: str
    stages: Mapping[str, Mapping[str, Any]]

    def size(self, budget: int) -> int:
        """Return the largest size of the design that a budget of evaluations allows.

        Raises
        ------
        InputError
            If none does.
        """
        most = min(budget, self._linear(budget) + 1)
        # Sobol points come in powers of 2, replicates in multiples; any other design in every size.
        powers = {m * 2**k for m in range(1, 65) for k in range(31) if m * 2**k <= most}
        sizes: list[int] = sorted(powers | set(range(max(most - 256, 1), most + 1)), reverse=True)
        for n in sizes:
            count = self._evaluations(n)
            if count is not None and count <= budget:
                self.record.plan(self.inputs, n, [self.of], self.stages)
                return n
        raise InputError(f"{self.name!r} cannot be done within a budget of {budget} evaluations")

    def _linear(self, budget: int) -> int:
        """Return about how large a design a budget allows, from the cost of a small one."""
        for n in (64, 128, 256, 512, 1024):
            count = self._evaluations(n)
            if count:
                return int(budget * n // count) + 64
        return budget

    def _evaluations(self, n: int) -> int | None:
        try:
            return self.record.evaluations(self.inputs, n, **self.stages["evaluations"])
        except InputError:
            return None

    def results(self, n: int, seed: int, n_jobs: int | None) -> xr.Dataset:
        """Return the results of a run."""
        outcomes = completed(
            self.model,
            self.inputs,
            self.record,
            n,
            seed,
            of=[self.of],
            stages=self.stages,
            n_jobs=n_jobs,
            progress=False,
        )
        return estimated(self.record, outcomes, self.inputs, of=self.of, **self.stages["estimate"])


def compare(
    model: Callable[..., xr.Dataset],
    inputs: Inputs,
    contenders: Mapping[str, Mapping[str, Any]],
    *,
    of: str,
    reference: ArrayLike,
    budgets: Sequence[int],
    replicates: int = 30,
    quantity: str | None = None,
    rng: Seed = None,
    confidence: float = 0.95,
    n_jobs: int | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> xr.Dataset:
    """Run methods again and again on one problem, and hold what they say against the answer.

    Parameters
    ----------
    model : callable
    inputs : Inputs
    contenders : mapping
        Name -> ``{"method": ..., **options of the method}``; ``"model"``, ``"inputs"`` and ``"of"`` in it
        replace those of the comparison, as for friction integrated.
    of : str
        The outcome analysed.
    reference : float or array
        The exact answer, or a reference far better than any contender; for indices one for each
        parameter, in the order of the first contender's inputs.
    budgets : sequence of int
        Numbers of evaluations; each contender takes as many as it can within them.
    replicates : int, default 30
        Independent repetitions.
    quantity : str, optional
        The result compared, such as ``"probability"`` or ``"ST"``; by default the probability or mean over
        everything.
    rng : int or Generator, optional
        Seed from which all runs get theirs. A contender's depend on its name, not on its company.
    confidence : float, default 0.95
        Level of the limits of error and coverage told here; that of a contender's own intervals is its
        option.
    n_jobs : int, optional
        Threads; all cores by default.
    say : callable, optional
        Gets a line about each contender and budget.

    Returns
    -------
    Dataset
        Over ``method``, ``budget`` and ``replicate``: ``estimate``, ``low``, ``high``, and ``seconds``,
        which leave out the first run of a contender, for it imports and compiles. Over ``method`` and
        ``budget``: ``evaluations``, ``bias`` and ``rmse`` with limits, and ``coverage``, the share of
        intervals that hold the reference, with limits. Indices have also the dim ``parameter``.

    Raises
    ------
    InputError
        If a contender or a budget cannot be used, or results lack the quantity.
    """
    level = check_confidence(confidence)
    check_count("replicates", replicates, 2)
    seed = seed_of(rng)
    sizes = _budgets(budgets)
    if not isinstance(contenders, Mapping) or not contenders:
        raise InputError("there are no contenders: give a mapping of names, each with its method")
    ready = [_contender(name, entry, model, inputs, of) for name, entry in contenders.items()]
    plans = [[contender.size(budget) for budget in sizes] for contender in ready]
    truth = _reference(reference)
    shape = (len(ready), len(sizes), replicates)
    found = np.full((3, *shape, *truth.shape), np.nan)
    seconds, evaluations = np.full(shape, np.nan), np.zeros(shape[:2], np.int64)
    labels: dict[str, Any] = {}
    for i, (contender, plan) in enumerate(zip(ready, plans, strict=True)):
        key = zlib.crc32(contender.name.encode())
        contender.results(plan[0], seed_of(np.random.SeedSequence(seed, spawn_key=(key,))), n_jobs)
        for j, n in enumerate(plan):
            for k in range(replicates):
                one = seed_of(np.random.SeedSequence(seed, spawn_key=(key, j, k)))
                started = time.perf_counter()
                results = contender.results(n, one, n_jobs)
                seconds[i, j, k] = time.perf_counter() - started
                labels = labels or _labels(results, quantity, contender.name)
                found[:, i, j, k] = _values(results, quantity, truth, labels, contender.name)
                evaluations[i, j] = int(results["evaluations"])
            say(f"{contender.name}, {evaluations[i, j]:,} evaluations: {replicates} replicates")
    made = _summarised(found, truth, spawn(seed, 0), level)
    names = [contender.name for contender in ready]
    results = _dataset(made, found, seconds, evaluations, truth, names, sizes, labels)
    entries = {one.name: {"method": one.record.title, "of": one.of, **one.stages} for one in ready}
    return schema.stamp(
        results,
        f"compare {', '.join(names)}",
        model=str(getattr(model, "label", getattr(model, "__qualname__", type(model).__qualname__))),
        seed=seed,
        options={"compare": {"quantity": quantity, "confidence": level, "contenders": entries}},
        inputs=inputs.to_json(),
    ).assign_attrs(of=of)


def _budgets(budgets: Sequence[int]) -> list[int]:
    """Return budgets that rise."""
    if not isinstance(budgets, Sequence) or isinstance(budgets, str):
        raise InputError(f"budgets are {budgets!r}: give a list of numbers of evaluations")
    sizes = [check_count("budget", budget) for budget in budgets]
    if not sizes or sorted(set(sizes)) != sizes:
        raise InputError(f"budgets are {sizes}: they must rise, one at least")
    return sizes


def _reference(reference: ArrayLike) -> Array:
    """Return the reference as an array of finite numbers."""
    try:
        truth = np.asarray(reference, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"reference is {reference!r}: it must be a number, or one for each index") from None
    if not np.isfinite(truth).all():
        raise InputError(f"reference is {reference!r}: it must be finite")
    return truth


def _contender(
    name: str, entry: Mapping[str, Any], model: Callable[..., xr.Dataset], inputs: Inputs, of: str
) -> Contender:
    options = dict(entry) if isinstance(entry, Mapping) else {}
    if "method" not in options:
        raise InputError(f"contender {name!r} names no method: give a mapping with 'method' and its options")
    record = method_named(options.pop("method"))
    own_model, own_inputs = options.pop("model", model), options.pop("inputs", inputs)
    own_of = options.pop("of", of)
    if not isinstance(own_inputs, Inputs):
        raise InputError(f"inputs of {name!r} is {type(own_inputs).__name__}: give hipuq.Inputs(...)")
    return Contender(name, record, own_model, own_inputs, own_of, record.split(options))


def _name(results: xr.Dataset, quantity: str | None, contender: str) -> str:
    asked = QUANTITIES if quantity is None else (f"{quantity}_overall", quantity)
    for name in asked:
        if name in results and (results[name].ndim == 0 or quantity is not None):
            return name
    raise InputError(f"the results of {contender!r} have no {' or '.join(asked)} over everything")


def _values(
    results: xr.Dataset, quantity: str | None, truth: Array, labels: Mapping[str, Any], contender: str
) -> Array:
    """Return estimate and limits, (3, ...) as the reference; limits are NaN where there are none."""
    name = _name(results, quantity, contender)
    for dim, coord in labels["coords"].items():
        if dim in results.coords:
            if set(results[dim].values) != set(coord.values):
                raise InputError(f"{name} of {contender!r} has another {dim} than the first contender")
            results = results.sel({dim: coord.values})
    parts = [results[name + end].values if name + end in results else np.nan for end in ("", "_low", "_high")]
    if np.shape(parts[0]) != truth.shape:
        raise InputError(
            f"{name} of {contender!r} has the shape {np.shape(parts[0])}, the reference has {truth.shape}"
        )
    return np.array([np.broadcast_to(part, truth.shape) for part in parts])


def _labels(results: xr.Dataset, quantity: str | None, contender: str) -> dict[str, Any]:
    name = _name(results, quantity, contender)
    variable = results[name]
    coords = {dim: variable[dim] for dim in variable.dims}
    return {"attrs": dict(variable.attrs), "dims": list(variable.dims), "coords": coords}


def _summarised(found: Array, truth: Array, rng: np.random.Generator, level: float) -> dict[str, Array]:
    """Return bias, root mean square error and coverage over the replicates, with limits."""
    estimate, low, high = found
    error = estimate - truth
    count = error.shape[2]
    ends = [0.5 - level / 2, 0.5 + level / 2]
    drawn = rng.integers(count, size=(RESAMPLES, count))
    squares = np.square(error)
    resampled = np.sqrt(np.stack([squares[:, :, rows].mean(axis=2) for rows in drawn]))
    rmse_low, rmse_high = np.quantile(resampled, ends, axis=0)
    told = np.isfinite(low) & np.isfinite(high)
    hits = ((low <= truth) & (truth <= high) & told).sum(axis=2).astype(np.float64)
    n = told.sum(axis=2).astype(np.float64)
    held = np.divide(hits, n, out=np.full_like(hits, np.nan), where=n > 0)
    cover_low, cover_high = wilson(hits, n, level)
    bare = n == 0
    return {
        "bias": error.mean(axis=2),
        "bias_error": error.std(axis=2, ddof=1) / np.sqrt(count),
        "rmse": np.sqrt(squares.mean(axis=2)),
        "rmse_low": rmse_low,
        "rmse_high": rmse_high,
        "coverage": held,
        "coverage_low": np.where(bare, np.nan, cover_low),
        "coverage_high": np.where(bare, np.nan, cover_high),
    }


TEXTS = {
    "bias": "mean error",
    "bias_error": "standard error of the mean error",
    "rmse": "root mean square error",
    "rmse_low": "root mean square error, lower limit",
    "rmse_high": "root mean square error, upper limit",
    "coverage": "share of intervals that hold the reference",
    "coverage_low": "share of intervals that hold the reference, lower limit",
    "coverage_high": "share of intervals that hold the reference, upper limit",
}
"""Results over method and budget -> their long names."""


def _dataset(
    made: dict[str, Array],
    found: Array,
    seconds: Array,
    evaluations: NDArray[np.int64],
    truth: Array,
    names: list[str],
    budgets: list[int],
    labels: dict[str, Any],
) -> xr.Dataset:
    units, extra = labels["attrs"].get("units", ""), labels["dims"]
    what = labels["attrs"]["long_name"]
    data: dict[str, Any] = {}
    for name, array in zip(("estimate", "low", "high"), found, strict=True):
        text = {"estimate": what, "low": f"{what}, lower limit", "high": f"{what}, upper limit"}[name]
        attrs = {"long_name": text, "units": units}
        data[name] = (("method", "budget", "replicate", *extra), array, attrs)
    for name, array in made.items():
        unit = "1" if name.startswith("coverage") else units
        data[name] = (("method", "budget", *extra), array, {"long_name": TEXTS[name], "units": unit})
    attrs = {"long_name": "time of a run", "units": "s"}
    data["seconds"] = (("method", "budget", "replicate"), seconds, attrs)
    attrs = {"long_name": "model evaluations", "units": "1"}
    data["evaluations"] = (("method", "budget"), evaluations, attrs)
    data["reference"] = (tuple(extra), truth, {"long_name": f"{what}, reference", "units": units})
    count = np.arange(1, found.shape[3] + 1)
    coords = {
        "method": ("method", np.array(names), {"long_name": "method", "units": ""}),
        "budget": ("budget", np.array(budgets), {"long_name": "budget of evaluations", "units": "1"}),
        "replicate": ("replicate", count, {"long_name": "replicate", "units": "1"}),
        **labels["coords"],
    }
    return xr.Dataset(data, coords)
