"""Exact: every level of a discrete input once, and nothing left to chance.

For models that give a probability themselves, such as those whose friction is integrated
(`hipuq.integrate_friction`): the probability of each contact pattern, and over all of them.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import InputError, SchemaError
from hipuq.inputs import Inputs
from hipuq.methods import monte_carlo
from hipuq.methods.results import finished, kind_of, labelled, levels_of, with_summaries
from hipuq.sampling import Seed, check_count

Array = NDArray[np.float64]


def design(inputs: Inputs, n: int = 1, rng: Seed = None, *, rows: slice | None = None) -> xr.Dataset:
    """Return every level of the discrete input once, as samples.

    Parameters
    ----------
    inputs : Inputs
        One discrete parameter and no other.
    n : int, default 1
        Samples for each level: 1.
    rng : int or Generator, optional
        Not used: nothing here is random.
    rows : slice, optional
        Only these rows of the design.

    Returns
    -------
    Dataset
        With the level's number and ``weight(sample)``, its probability.

    Raises
    ------
    InputError
        If an input is not discrete, or n is not 1.
    """
    evaluations(inputs, n)
    samples = monte_carlo.design(inputs, 1, 0, rows=rows, stratify=True)
    attrs = {"method": "", "seed": "", "history": ""}
    return schema.stamp(
        samples.assign_attrs(attrs),
        f"design exact, {samples.sizes['sample']} samples",
        method="exact",
        options={"design": {"n": 1}},
        inputs=inputs.to_json(),
    )


def evaluations(inputs: Inputs, n: int = 1) -> int:
    """Return the number of levels.

    Parameters
    ----------
    inputs : Inputs
    n : int, default 1

    Returns
    -------
    int

    Raises
    ------
    InputError
        As `design`.
    """
    if check_count("n", n) != 1:
        raise InputError(f"n is {n}: the exact method takes every level once, n = 1")
    drawn = [name for name in inputs if name not in inputs.discrete]
    if drawn or not inputs.discrete:
        raise InputError(
            f"the exact method takes discrete inputs only, not {', '.join(drawn) or 'none'}: integrate "
            "friction out of the model, and sample what else is continuous by another method"
        )
    return monte_carlo.evaluations(inputs, 1, stratify=True)


def estimate(outcomes: xr.Dataset, inputs: Inputs, *, of: str, rng: Seed = None) -> xr.Dataset:
    """Return the outcome of each level and its weighted sum.

    Parameters
    ----------
    outcomes : Dataset
        Of the design: one sample for each level.
    inputs : Inputs
        Their levels label the results.
    of : str
        Name of the outcome. If the outcomes hold ``<of>_low`` and ``<of>_high``, they bound it.
    rng : int or Generator, optional
        Not used: nothing here is random.

    Returns
    -------
    Dataset
        As from the stratified Monte Carlo analysis. ``_low`` and ``_high`` have no sampling error in them:
        they differ from the value only where part of it is unknown.

    Raises
    ------
    SchemaError
        If the outcomes are not one for each level.
    InputError
        If the outcome has infinite values.
    """
    values = schema.check_outcomes(outcomes, of)
    kind = kind_of(values)
    levels, level = levels_of(outcomes, inputs)
    size = 0 if levels is None else levels.sizes[levels.attrs["dim"]]
    if levels is None or len(level) != size or len(np.unique(level)) != size:
        raise SchemaError(
            f"the exact method needs one outcome for each of {size or 'its'} levels, not {len(level)}: take "
            "them from its own design"
        )
    order = np.argsort(level)
    x = values.values[order].astype(np.float64)
    if np.isinf(x).any():
        bad = np.isinf(x).reshape(size, -1).any(axis=1)
        raise InputError(
            f"{of} is infinite in {bad.sum()} levels ({bad.mean():.2%}): it has no mean; "
            "analyse another outcome"
        )
    unknown = np.isnan(x)
    low, high = (np.where(unknown, end, x) if kind.bounded else x for end in (0.0, 1.0))
    if f"{of}_low" in outcomes and f"{of}_high" in outcomes:
        low, high = (outcomes[f"{of}_{end}"].values[order].astype(np.float64) for end in ("low", "high"))
    columns = {
        "estimate": x,
        "low": low,
        "high": high,
        "floor": low,
        "ceiling": high,
        "known": (~unknown).astype(np.float64),
        "variance": np.zeros_like(x),
    }
    dims = [levels.attrs["dim"], *(str(d) for d in values.dims[1:])]
    arrays = {name: xr.DataArray(column, dims=dims) for name, column in columns.items()}
    results = with_summaries(labelled(values, kind, arrays), levels, kind.quantity, arrays)
    return finished(results, outcomes, inputs, of=of, method="exact", confidence=1.0)
