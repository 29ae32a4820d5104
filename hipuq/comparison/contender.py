"""A contender: a method with its options, on a model, within budgets of evaluations."""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from hipuq.driver import method_named
from hipuq.errors import InputError, UnknownNameError, check_name
from hipuq.evaluation import How
from hipuq.inputs import Inputs
from hipuq.methods import Method
from hipuq.rounds import completed, estimated
from hipuq.sampling import check_count

Model = Callable[..., xr.Dataset]

QUANTITIES = ("probability_overall", "probability", "mean_corrected", "mean_overall", "mean")
"""What is compared where nothing is named: the first of these that results have as one number."""


NAME = re.compile(r"\S([^\r\n]{0,58}\S)?")
"""What a name may be: a part of a line."""

KEYS = ("method", "options", "model", "inputs", "of", "quantity", "budgets", "replicates")
"""What may be given for a contender."""


@dataclass(frozen=True)
class Contender:
    """One way to the answer.

    Attributes
    ----------
    name : str
    method : Method
    model : callable
    inputs : Inputs
    of : str
        The outcome that it analyses.
    quantity : str or None
        The result that is compared; None takes the first of `QUANTITIES`.
    stages : mapping
        Options of the method by stage.
    sizes : mapping
        Budget of evaluations -> size of the design, where it takes part.
    replicates : int
        Independent repetitions.
    """

    name: str
    method: Method
    model: Model
    inputs: Inputs
    of: str
    quantity: str | None
    stages: Mapping[str, Mapping[str, Any]]
    sizes: Mapping[int, int]
    replicates: int

    @property
    def definition(self) -> dict[str, Any]:
        """What it computes, JSON-able: the same definition and seed give the same numbers."""
        return {
            "method": self.method.title,
            "model": label_of(self.model) if options_of(self.model) is None else options_of(self.model),
            "inputs": self.inputs.to_json(),
            "of": self.of,
            "quantity": self.quantity,
            **{stage: dict(options) for stage, options in self.stages.items()},
        }

    def key(self, *cell: int) -> tuple[int, ...]:
        """Return the key of its stream of random numbers, of a budget and replicate if they are given.

        It depends on nothing but its name: not on the company, nor on the order of budgets.
        """
        return zlib.crc32(self.name.encode()), *cell

    def evaluations(self, budget: int) -> int:
        """Return the number of model runs within a budget; 0 where it does not take part."""
        if budget not in self.sizes:
            return 0
        return self.method.evaluations(self.inputs, self.sizes[budget], **self.stages["evaluations"])

    def results(self, n: int, seed: int, n_jobs: int | None) -> xr.Dataset:
        """Return the results of a run."""
        how = How(n_jobs=n_jobs, progress=False)
        (outcomes,) = completed(
            self.model, self.inputs, self.method, n, seed, of=[self.of], stages=self.stages, how=how
        )
        return estimated(self.method, outcomes, self.inputs, of=self.of, **self.stages["estimate"])

    def compared(self, results: xr.Dataset) -> str:
        """Return the name of the result that is compared.

        Raises
        ------
        InputError
            If the results lack it.
        """
        if self.quantity is not None:
            if self.quantity in results.data_vars:
                return self.quantity
            raise InputError(f"the results of {self.name!r} have no {self.quantity!r} to compare")
        for name in QUANTITIES:
            if name in results and results[name].ndim == 0:
                return name
        raise InputError(f"the results of {self.name!r} have no {' or '.join(QUANTITIES)} over everything")


def options_of(model: Model) -> Any:
    """Return what rebuilds a model, JSON-able; None of a plain function, which does not say."""
    return getattr(model, "options", None) if hasattr(model, "label") else None


def same_model(one: Model, other: Model) -> bool:
    """Say whether two models are the same, as far as they tell."""
    return one is other or (options_of(one) is not None and bool(options_of(one) == options_of(other)))


def label_of(model: Model) -> str:
    """Return the name of a model."""
    return str(getattr(model, "label", getattr(model, "__qualname__", type(model).__qualname__)))


def contender(
    name: str,
    entry: Mapping[str, Any],
    *,
    model: Model,
    inputs: Inputs,
    of: str,
    quantity: str | None,
    budgets: Sequence[int],
    replicates: int,
) -> Contender:
    """Return a contender from what was given for it, checked.

    Parameters
    ----------
    name : str
    entry : mapping
        ``"method"``, ``"options"`` of it, and what replaces the rest of the arguments: ``"model"``,
        ``"inputs"``, ``"of"``, ``"quantity"``, ``"budgets"`` (some of all) and ``"replicates"`` (fewer).
    model, inputs, of, quantity, budgets, replicates
        Of the comparison.

    Returns
    -------
    Contender

    Raises
    ------
    InputError
        If it cannot be done.
    """
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise InputError(
            f"the name of a contender is {name!r}: it takes 1 to 60 characters in a line, no space at an end"
        )
    given = dict(entry) if isinstance(entry, Mapping) else {}
    if "method" not in given:
        raise InputError(f"contender {name!r} names no method: give a mapping with 'method' and 'options'")
    for key in given:
        check_name(f"key of contender {name!r}", key, KEYS)
    method = method_named(given["method"])
    options = given.get("options", {})
    if not isinstance(options, Mapping):
        raise InputError(f"options of {name!r} is {options!r}: give a mapping of options of the method")
    own_model, own_inputs = given.get("model", model), given.get("inputs", inputs)
    own_of, own_quantity = given.get("of", of), given.get("quantity", quantity)
    own_budgets = checked_budgets(given.get("budgets", budgets), f"budgets of {name!r}")
    own_replicates = check_count(f"replicates of {name!r}", given.get("replicates", replicates), 2)
    if not callable(own_model):
        raise InputError(f"model of {name!r} is {own_model!r}: give a function, samples -> outcomes")
    if not isinstance(own_inputs, Inputs):
        raise InputError(f"inputs of {name!r} is {type(own_inputs).__name__}: give hipuq.Inputs(...)")
    if hasattr(own_model, "outcomes"):
        check_name(f"outcome of {name!r}", own_of, own_model.outcomes)
    others = [budget for budget in own_budgets if budget not in budgets]
    if others:
        raise InputError(f"budget {others[0]} of {name!r} is none of the comparison's {list(budgets)}")
    if own_replicates > replicates:
        raise InputError(f"replicates of {name!r} is {own_replicates}: the comparison has {replicates}")
    try:
        options = json.loads(json.dumps(options, default=_plain))
    except (TypeError, ValueError) as error:
        raise InputError(f"options of {name!r}: {error}; give plain numbers, text and lists") from error
    stages = method.split(options)
    sizes = {b: _size(name, method, own_inputs, own_of, stages, b) for b in own_budgets}
    return Contender(name, method, own_model, own_inputs, own_of, own_quantity, stages, sizes, own_replicates)


def checked_budgets(budgets: Any, what: str = "budgets") -> list[int]:
    """Return budgets that rise.

    Raises
    ------
    InputError
        If they do not, or are no numbers of evaluations.
    """
    if not isinstance(budgets, Sequence) or isinstance(budgets, str):
        raise InputError(f"{what} are {budgets!r}: give a list of numbers of evaluations")
    sizes = [check_count("budget", budget) for budget in budgets]
    if not sizes or sorted(set(sizes)) != sizes:
        raise InputError(f"{what} are {sizes}: they must rise, one at least")
    return sizes


def _plain(value: Any) -> Any:
    """Return a number of numpy as one of Python."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{value!r} is no plain value")


def _size(
    name: str, method: Method, inputs: Inputs, of: str, stages: Mapping[str, Mapping[str, Any]], budget: int
) -> int:
    """Return the largest size of the design that a budget of evaluations allows."""

    def cost(n: int) -> int | None:
        try:
            return method.evaluations(inputs, n, **stages["evaluations"])
        except UnknownNameError:
            raise
        except InputError:
            return None

    # Sobol points come in powers of 2, replicates in multiples; any other design in every size.
    steps = sorted({m * 2**k for m in range(1, 65) for k in range(31)})
    below = 0
    for n in steps:
        found = cost(n)
        if found is not None and found > budget:
            break
        below = n if found is not None else below
    # Costs rise evenly with n, so between two steps the place is near their line.
    near: set[int] = set()
    first, last = cost(below) if below else None, cost(n)
    if first is not None and last is not None and last > first:
        middle = below + (budget - first) * (n - below) // (last - first)
        near = set(range(max(middle - 128, below), min(middle + 128, n)))
    for size in sorted({below, *near} - {0}, reverse=True):
        found = cost(size)
        if found is not None and found <= budget:
            try:
                method.plan(inputs, size, [of], stages)
            except InputError as error:
                raise InputError(f"{name!r} within {budget} evaluations: {error}") from error
            return size
    raise InputError(f"{name!r} cannot be done within a budget of {budget} evaluations")
