"""Comparisons asked for from Python: checked, and run in one call."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import xarray as xr

from hipuq.comparison.contender import Model, checked_budgets, contender, label_of
from hipuq.comparison.reference import Reference, Value, as_reference
from hipuq.comparison.running import Race
from hipuq.errors import InputError, check_name
from hipuq.inputs import Inputs
from hipuq.intervals import check_confidence
from hipuq.sampling import Seed, check_count, seed_of


def race(
    model: Model,
    inputs: Inputs,
    contenders: Mapping[str, Mapping[str, Any]],
    *,
    of: str,
    reference: Value | Reference,
    budgets: Sequence[int],
    replicates: int = 30,
    quantity: str | None = None,
    baseline: str | None = None,
    confidence: float = 0.95,
) -> Race:
    """Check a comparison; see `compare` for the arguments.

    Returns
    -------
    Race
        Nothing is evaluated yet.

    Raises
    ------
    InputError
        If a contender, a budget or the reference cannot be used.
    """
    level = check_confidence(confidence)
    check_count("replicates", replicates, 2)
    if not isinstance(inputs, Inputs):
        raise InputError(f"inputs is {type(inputs).__name__}: give hipuq.Inputs(...) or model.inputs(...)")
    sizes = checked_budgets(budgets)
    if not isinstance(contenders, Mapping) or not contenders:
        raise InputError("there are no contenders: give a mapping of names, each with its method")
    ready = tuple(
        contender(
            name,
            entry,
            model=model,
            inputs=inputs,
            of=of,
            quantity=quantity,
            budgets=sizes,
            replicates=replicates,
        )
        for name, entry in contenders.items()
    )
    keys = [one.key() for one in ready]
    if len(set(keys)) < len(keys):
        twice = next(one.name for one in ready if keys.count(one.key()) > 1)
        raise InputError(f"contender {twice!r} would draw the same samples as another one: call it otherwise")
    idle = [budget for budget in sizes if not any(budget in one.sizes for one in ready)]
    if idle:
        raise InputError(f"no contender takes the budget {idle[0]}: leave it out")
    first = next(iter(contenders)) if baseline is None else check_name("baseline", baseline, contenders)
    answer = as_reference(reference)
    return Race(
        ready, tuple(sizes), replicates, answer, first, level, label_of(model), inputs.to_json(), str(of)
    )


def compare(
    model: Model,
    inputs: Inputs,
    contenders: Mapping[str, Mapping[str, Any]],
    *,
    of: str,
    reference: Value | Reference,
    budgets: Sequence[int],
    replicates: int = 30,
    quantity: str | None = None,
    baseline: str | None = None,
    rng: Seed = None,
    confidence: float = 0.95,
    n_jobs: int | None = None,
    store: str | os.PathLike[str] | None = None,
    resume: bool = False,
    progress: bool | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> xr.Dataset:
    """Run methods again and again on one problem, and hold what they say against the answer.

    Parameters
    ----------
    model : callable
        Samples Dataset -> outcomes Dataset, as in `evaluate`.
    inputs : Inputs
        The uncertain parameters.
    contenders : mapping
        Name -> ``{"method": ..., "options": {...}}``, the options being those of the method. ``"model"``,
        ``"inputs"``, ``"of"`` and ``"quantity"`` beside them replace those of the comparison, as for friction
        integrated; ``"budgets"`` (some of all) and ``"replicates"`` (fewer) are for what is too dear.
    of : str
        The outcome analysed.
    reference : float, array, mapping, DataArray or Reference
        The exact answer, or a reference far better than any contender, in the unit of the outcome, of
        probabilities and indices [1]: a number; for indices one for each parameter, by name or as an array
        (parameters,) in the order of the first contender's inputs. A DataArray is matched by its coords, such
        as ``pattern``; `hipuq.comparison.Reference` has limits too.
    budgets : sequence of int
        Numbers of evaluations; each contender takes as many as it can within them.
    replicates : int, default 30
        Independent repetitions.
    quantity : str, optional
        The result compared, such as ``"ST"``; by default the probability or mean over everything.
    baseline : str, optional
        The contender whose cost of the same error is told for all; the first by default.
    rng : int or Generator, optional
        Seed from which all runs get theirs. A contender's depend on its name and the budget alone.
    confidence : float, default 0.95
        Level of the limits of error and coverage told here [1]; that of a contender's own intervals is its
        option.
    n_jobs : int, optional
        Threads; all cores by default.
    store : path, optional
        File that gets a line for each run as it is done.
    resume : bool, default False
        Whether to go on from what is in the file: more budgets, replicates and contenders may be asked for.
        Models need a ``label`` and ``options`` then, as those of hipuq have; of hipuq itself the version
        is compared.
    progress : bool, optional
        Whether to show a progress bar; by default on a terminal.
    say : callable, optional
        Gets a line about each budget.

    Returns
    -------
    Dataset
        Over ``method``, ``budget`` and ``replicate``:

        - ``estimate``, ``low``, ``high``: what the run told;
        - ``seconds`` of the run and ``model_seconds`` of the model in it, imports and compilation apart [s].

        Over ``method`` and ``budget``:

        - ``evaluations``, ``replicates``, and ``intervals``, the runs that gave one;
        - ``bias``, ``rmse`` and ``coverage``, the share of intervals that hold the reference, with limits;
        - ``rmse_ratio`` to the lowest error of the budget, with limits;
        - ``run_time`` and ``model_time``, medians of the seconds [s];
        - ``baseline_evaluations`` with limits, with which the baseline has the same error if its error falls
          as ``n**-0.5``;
        - ``cost_ratio`` with limits, time over that of the baseline for the same error;
        - ``break_even``, the time of one evaluation above which a contender on the baseline's model costs
          less than the baseline [s].

        Over ``method``: ``rate``, the slope of log error over log evaluations, with limits.

        Indices have also the dim ``parameter``, results by level that of the levels; ``rmse_overall`` and
        ``coverage_overall`` are over it too. NaN where a contender does not take part.

    Raises
    ------
    InputError
        If a contender, a budget or the reference cannot be used, or results lack the quantity.
    StoreError
        If the file cannot be used, or holds runs of something else.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> def double(samples):
    ...     return samples[["x"]].rename(x="y") * 2.0
    >>> contenders = {
    ...     "random": {"method": "monte_carlo"},
    ...     "sobol": {"method": "monte_carlo", "options": {"sampler": "sobol"}},
    ... }
    >>> inputs = hipuq.Inputs(x=cp.Uniform(0.0, 1.0))
    >>> how = {"of": "y", "reference": 1.0, "budgets": [64], "replicates": 5}
    >>> found = hipuq.compare(double, inputs, contenders, rng=1, **how)
    >>> found["rmse"].sel(budget=64).to_series().round(4).to_dict()
    {'random': 0.0742, 'sobol': 0.0071}
    """
    plan = race(
        model,
        inputs,
        contenders,
        of=of,
        reference=reference,
        budgets=budgets,
        replicates=replicates,
        quantity=quantity,
        baseline=baseline,
        confidence=confidence,
    )
    return plan.run(seed_of(rng), n_jobs=n_jobs, store=store, resume=resume, progress=progress, say=say)
