"""Sampled results and the exact ones of the same probabilities."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TypeGuard

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.friction import INTEGRATED_OUTCOME, OF_ANY_MODE
from hipuq.report.summary import analyses
from hipuq.schema import is_exact

Found = Mapping[str, Mapping[str, xr.Dataset]]
"""Analysis -> name of a group -> its Dataset."""


def groups_of(tree: xr.DataTree) -> dict[str, dict[str, xr.Dataset]]:
    """Return the Datasets of a results tree, by analysis and name."""
    return {
        analysis: {str(key): node.to_dataset(inherit=False) for key, node in tree[analysis].children.items()}
        for analysis in analyses(tree)
    }


def summed_up(results: xr.Dataset | None, dims: set[str]) -> TypeGuard[xr.Dataset]:
    """Say whether there are results with mean probabilities over these dims."""
    return (
        results is not None
        and "probability_mean" in results
        and set(results["probability_mean"].dims) == dims
    )


def exact_of(sampled: xr.Dataset, found: Found) -> str | None:
    """Return the exact analysis of the probabilities that a sampled result estimates, if there is one.

    Parameters
    ----------
    sampled : Dataset
        Results summed up by group of levels.
    found : mapping
        All results.

    Returns
    -------
    str or None
        Name of the analysis: same model, inputs and friction, integrated there.
    """
    label = f"{sampled.attrs.get('model', '')}, friction integrated"
    dims = {str(dim) for dim in sampled["probability_mean"].dims}
    for analysis, groups in found.items():
        exact = groups.get(INTEGRATED_OUTCOME.get(str(sampled.attrs.get("of")), ""))
        if (
            summed_up(exact, dims)
            and is_exact(exact)
            and str(exact.attrs.get("model", "")).startswith(label)
            and case_of(exact) == case_of(sampled)
            and all(set(exact[dim].values) == set(sampled[dim].values) for dim in dims)
        ):
            return analysis
    return None


def case_of(results: xr.Dataset) -> tuple[object, ...]:
    """Return the options of the model and the inputs, alike whether friction is sampled or integrated.

    Parameters
    ----------
    results : Dataset
        Of any method; of a sweep at one of its values, which then counts as the nominal one.

    Returns
    -------
    tuple
        To compare with that of other results.
    """
    inputs, options = (json.loads(results.attrs.get(key) or "{}") for key in ("inputs", "options"))
    model = options.get("model")
    if not isinstance(model, dict):
        return inputs, model
    sampled = inputs.pop("friction", {})
    drawn = sampled.get("distribution") if sampled.get("how") == "absolute" else sampled
    friction = model.pop("integrated", {}).get("friction", drawn)
    # Neither the nominal friction nor who decides an open verdict changes the probability.
    model.get("nominal", {}).pop("friction", None)
    model.pop("certify", None)
    fixed = {
        str(name): float(one)
        for name, one in results.coords.items()
        if name in schema.PARAMETERS and not one.ndim
    }
    if fixed:
        model["nominal"] = model.get("nominal", {}) | fixed
    return inputs, model, friction


def comparison(analysis: str, found: Found) -> str:
    """Return in one line how sampled and exact probabilities compare; empty without both.

    Of a sampled analysis it says how many intervals of the mean over a group hold the exact value, of
    an exact one where the same is sampled. Where a mode is never unstable, neither exactly nor in the
    samples, there is nothing to compare.
    """
    told: dict[str, list[str]] = {}
    for sampled in _summed(found[analysis]):
        other = exact_of(sampled, found)
        if other is not None:
            held, count = _held(sampled, found[other][INTEGRATED_OUTCOME[str(sampled.attrs["of"])]])
            by = "group and mode" if "mode" in sampled["probability_mean"].dims else "group"
            level = f"{sampled.attrs['confidence']:.0%}"
            line = f"{level} intervals that hold the exact value ({other})"
            told.setdefault(line, []).append(f"{held} of {count} by {by}")
    by_sampling = [
        name
        for name, groups in found.items()
        if any(exact_of(sampled, found) == analysis for sampled in _summed(groups))
    ]
    lines = [f"{line}: {', '.join(parts)}" for line, parts in told.items()]
    if by_sampling:
        lines.append(f"The same by sampling: {', '.join(by_sampling)}")
    return "; ".join(lines)


def _summed(groups: Mapping[str, xr.Dataset]) -> list[xr.Dataset]:
    """Return the results that are summed up by group, those without modes first."""
    found = [one for one in groups.values() if "probability_mean" in one]
    return sorted(found, key=lambda one: one["probability_mean"].ndim)


def _held(sampled: xr.Dataset, exact: xr.Dataset) -> tuple[int, int]:
    """Return how many intervals hold the exact value, and how many there are to compare."""
    own = sampled[[f"probability_mean{end}" for end in ("", "_low", "_high")]]
    value, own = xr.align(exact["probability_mean"], own, join="inner")
    middle, low, high = (own[name].transpose(*value.dims).values for name in own)
    asked = ((value.values > 0) | (middle > 0)) & ~np.isnan(value.values) & ~np.isnan(middle)
    held = (low <= value.values) & (value.values <= high)
    return int((held & asked).sum()), int(asked.sum())


def pairs_of(found: Found) -> list[tuple[str, str, xr.Dataset, xr.Dataset]]:
    """Return the probabilities that are told twice, with friction sampled and integrated.

    Parameters
    ----------
    found : mapping
        All results; of sweeps at one of their values.

    Returns
    -------
    list of tuple
        Sampled analysis, integrated analysis, and the results of both: same model, inputs, friction and
        damping, each with one probability of any unstable mode.
    """
    sampled, other = (
        [(name, groups[of]) for name, groups in found.items() if of in groups and _one(groups[of])]
        for of in OF_ANY_MODE
    )
    return [
        (name, partner, one, two)
        for name, one in sampled
        for partner, two in other
        if case_of(one) == case_of(two)
    ]


def _one(results: xr.Dataset) -> bool:
    """Say whether results have one probability over everything."""
    return "of" in results.attrs and any(
        name in results and not results[name].ndim for name in ("probability_overall", "probability")
    )
