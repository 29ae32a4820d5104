"""Design and evaluate, and what a sequential method then still wants, round after round."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.designs import Design, definition_of, with_fixed
from hipuq.evaluation import How, evaluated, together
from hipuq.inputs import Inputs
from hipuq.methods import Method
from hipuq.sampling import spawn
from hipuq.store.failures import part_of
from hipuq.threads import one_thread

DEFAULT: How = How()
"""Evaluation in memory, with threads."""

Places = slice | NDArray[np.int64]


def by_rows(record: Method, inputs: Inputs, n: int, seed: int, options: Mapping[str, Any]) -> Design:
    """Return a design of a method by rows."""
    known = record.options("evaluations")
    size = record.evaluations(inputs, n, **{key: own for key, own in options.items() if key in known})

    def make(rows: slice) -> xr.Dataset:
        return record.design(inputs, n, seed, rows=rows, **options)

    return Design(size, make, definition_of(make(slice(0, 1)).attrs, size))


def completed(
    model: Callable[..., xr.Dataset],
    inputs: Inputs,
    record: Method,
    n: int,
    seed: int,
    *,
    of: Sequence[str],
    stages: Mapping[str, Mapping[str, Any]],
    at: Sequence[Mapping[str, float]] = ({},),
    keep: Sequence[str] = (),
    how: How = DEFAULT,
) -> list[xr.Dataset]:
    """Design and evaluate, and what a sequential method then still wants, round after round.

    Parameters
    ----------
    model : callable
    inputs : Inputs
    record : Method
    n : int
        Size of the design.
    seed : int
        Seed of the design; round k draws from ``spawn(seed, k)``.
    of : list of str
        Outcomes to analyse; the first one is what a sequential method looks at.
    stages : mapping
        Options by stage, as from `Method.split`.
    at : sequence of mapping
        Points at which the same samples are evaluated: parameter that is not uncertain -> its value.
    keep : sequence of str
        Outcomes wanted besides.
    how : How
        How to evaluate.

    Returns
    -------
    list of Dataset
        Outcomes of all rounds, at each point.
    """
    wanted = [*with_bounds(of, model), *(name for name in keep if name not in of)]
    base = by_rows(record, inputs, n, seed, stages["design"])
    design = base.at(at)
    whole = evaluated(model, design, wanted, how)
    places: list[Places] = [slice(k * base.size, (k + 1) * base.size) for k in range(len(at))]
    number = 1
    while record.refine is not None:
        with one_thread():
            more = [
                record.refine(part, inputs, spawn(seed, number), of=of[0], **stages["refine"])
                for part in _parts(whole, places)
            ]
        for k, (own, point) in enumerate(zip(more, at, strict=True)):
            if own is None:
                continue
            own = with_fixed(own, point)
            size = whole.sizes["sample"]
            design = design.followed_by(own)
            # What is there already is in the store, or in memory.
            if how.store is None:
                whole = together(whole, evaluated(model, own, wanted, how))
            else:
                whole = evaluated(
                    model, design, wanted, replace(how, resume=True, retry_failed=False, replace=False)
                )
            places[k] = np.concatenate([_numbers(places[k]), np.arange(size, design.size)])
        if all(own is None for own in more):
            break
        number += 1
    return _parts(whole, places)


def _numbers(places: Places) -> NDArray[np.int64]:
    return np.arange(places.start, places.stop) if isinstance(places, slice) else places


def _parts(whole: xr.Dataset, places: Sequence[Places]) -> list[xr.Dataset]:
    """Return parts of outcomes, each with its share of the time."""
    if len(places) == 1:
        return [whole]
    size, seconds = whole.sizes["sample"], float(whole.attrs.get("seconds", np.nan))
    parts = [part_of(whole, rows) for rows in places]
    return [part.assign_attrs(seconds=seconds * part.sizes["sample"] / size) for part in parts]


def estimated(record: Method, outcomes: xr.Dataset, inputs: Inputs, **options: Any) -> xr.Dataset:
    """Return what a method estimates, the same to the last bit whatever number of threads BLAS would take.

    Parameters
    ----------
    record : Method
    outcomes : Dataset
    inputs : Inputs
    **options
        Of the method's estimate, `of` among them.

    Returns
    -------
    Dataset
    """
    with one_thread():
        return record.estimate(outcomes, inputs, **options)


def with_bounds(of: Iterable[str], model: Callable[..., xr.Dataset]) -> list[str]:
    """Return outcomes to analyse, and the bounds ``<of>_low``, ``<of>_high`` that a model gives of them."""
    names = list(of)
    known = getattr(model, "outcomes", ())
    bounds = [f"{name}_{end}" for name in names for end in ("low", "high")]
    return [*names, *(name for name in bounds if name in known)]
