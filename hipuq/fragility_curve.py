"""Fragility: the probability of instability at each friction, over all else that is uncertain."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from hipuq import schema
from hipuq.contact import CONTACT_PATTERNS
from hipuq.errors import InputError, SchemaError
from hipuq.intervals import check_confidence, wilson
from hipuq.uncertain import described

Array = NDArray[np.float64]


def fragility(outcomes: xr.Dataset, friction: ArrayLike, *, confidence: float = 0.95) -> xr.Dataset:
    """Return the fragility curve: the probability of instability at each friction, over what was sampled.

    Parameters
    ----------
    outcomes : Dataset
        Of a model whose friction is integrated, with ``interval`` and ``status``, as from `evaluate`.
    friction : (k,) array
        Where to give it, inside the range that was swept [1].
    confidence : float, default 0.95
        Level of the intervals [1], of Wilson; samples of a stratified design count by their weights.

    Returns
    -------
    Dataset
        ``probability``, ``probability_low``, ``probability_high`` [1] over ``friction`` [1], and ``known``,
        the number of samples that are decided. A sample that is undecided counts as stable in the lower limit
        and as unstable in the upper one. Where every level of a discrete input comes once and nothing else is
        uncertain, limits are bounds by what is unknown alone.

    Raises
    ------
    SchemaError
        If the outcomes have no intervals.
    InputError
        If a friction is outside the range that was swept, or the confidence is not one.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> exact = hipuq.integrate_friction(model, cp.Uniform(0.0, 1.0))
    >>> inputs = exact.inputs(k3=hipuq.relative(cp.Uniform(-0.1, 0.1)))
    >>> samples = hipuq.design("monte_carlo", inputs, n=200, rng=1)
    >>> outcomes = hipuq.evaluate(exact, samples)
    >>> curve = hipuq.fragility(outcomes, [0.4, 0.45, 0.5])
    >>> curve["probability"].values.round(3)
    array([0.14 , 0.425, 0.695])
    """
    confidence = check_confidence(confidence)
    if "interval" not in outcomes.variables or "range" not in outcomes["interval"].attrs:
        raise SchemaError("the outcomes have no 'interval': evaluate a model made by integrate_friction")
    lower, upper = outcomes["interval"].attrs["range"]
    grid = np.atleast_1d(np.asarray(friction, dtype=np.float64))
    if grid.ndim != 1 or not ((grid >= lower) & (grid <= upper)).all() or (np.diff(grid) <= 0).any():
        raise InputError(
            f"friction is {grid}: it must ascend within the range that was swept, {lower} to {upper}"
        )
    known = outcomes["status"].values == schema.STATUS["ok"]
    weight = weights_of(outcomes)
    unstable = _covered(outcomes["interval"].values[known], weight[known], grid, (lower, upper))
    unknown = float(weight[~known].sum())
    drawn = not enumerated(outcomes)
    limits = share_limits(unstable, unknown, weight, confidence if drawn else None)
    values = {
        "probability": unstable / (1 - unknown) if known.any() else np.full(grid.size, np.nan),
        "probability_low": limits[0],
        "probability_high": limits[1],
    }
    what = "probability of instability"
    data: dict[str, Any] = {
        name: ("friction", value, {"long_name": what + text, "units": "1"})
        for (name, value), text in zip(values.items(), ("", ", lower limit", ", upper limit"), strict=True)
    }
    data["known"] = ((), int(known.sum()), {"long_name": "samples with a known verdict", "units": "1"})
    curve = xr.Dataset(data, coords={"friction": ("friction", grid, schema.PARAMETERS["friction"].attrs)})
    curve = schema.stamp(curve, f"fragility at {grid.size} frictions", like=outcomes.attrs)
    return curve.assign_attrs(confidence=confidence if drawn else 1.0)


def weights_of(outcomes: xr.Dataset) -> Array:
    """Return the weight of each sample, (samples,); all together 1.

    Strata have as many samples each: the weight of its level is that of a sample up to a common factor.
    """
    size = outcomes.sizes["sample"]
    weight = outcomes["weight"].values.astype(np.float64) if "weight" in outcomes.coords else np.ones(size)
    return np.asarray(weight / weight.sum())


def share_limits(
    share: Array, unknown: float, weight: Array, confidence: float | None
) -> tuple[Array, Array]:
    """Return limits of a weighted share: the unknown is outside in the lower one, inside in the upper one.

    Parameters
    ----------
    share : (k,) array
        Weight of the samples inside, of all samples.
    unknown : float
        Weight of those of which it is not known.
    weight : (samples,) array
        As from `weights_of`.
    confidence : float or None
        Level of Wilson's interval; None where nothing was drawn.

    Returns
    -------
    low, high : (k,) array
    """
    if confidence is None:
        return share, np.minimum(share + unknown, 1.0)
    # Samples of unequal weight tell as much as this many of equal weight (Kish).
    size = np.full(share.shape, 1.0 / np.square(weight).sum())
    low, _ = wilson(share * size, size, confidence)
    _, high = wilson((share + unknown) * size, size, confidence)
    return low, high


def enumerated(outcomes: xr.Dataset) -> bool:
    """Say whether nothing was drawn: outcomes of every level of a discrete input alike, or without inputs."""
    if not outcomes.attrs.get("inputs"):
        return False
    inputs = described(str(outcomes.attrs["inputs"]))
    if any(entry.get("how") != CONTACT_PATTERNS for entry in inputs.values()):
        return False
    if "weight" not in outcomes.coords:
        return not inputs
    times = float(outcomes["weight"].sum())
    return abs(times - round(times)) < 1e-9


def _covered(intervals: Array, weight: Array, grid: Array, swept: tuple[float, float]) -> Array:
    """Return the weight of the samples that have an interval about each place of a grid, (k,).

    A boundary is stable, but an end of the range that was swept is none.
    """
    lower, upper = swept
    start, end = intervals[..., 0], intervals[..., 1]
    first = np.searchsorted(grid, np.where(start == lower, -np.inf, start), side="right")
    last = np.searchsorted(grid, np.where(end == upper, np.inf, end), side="left")
    weights = np.broadcast_to(weight[:, None], start.shape).ravel()
    change = (np.bincount(at.ravel(), weights, grid.size + 2) for at in (first, last))
    opened, closed = change
    covered: Array = np.cumsum(opened - closed)[: grid.size]
    return np.clip(covered, 0.0, 1.0)
