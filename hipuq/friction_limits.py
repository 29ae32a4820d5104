"""The friction up to which instability is rare enough: the fragility curve asked the other way round."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from hipuq import schema
from hipuq.errors import InputError, SchemaError
from hipuq.fragility_curve import enumerated, share_limits, weights_of
from hipuq.intervals import check_confidence

Array = NDArray[np.float64]

ROUNDING = 1e-12
"""Up to which shares are alike."""

LIMITS = ("", "_low", "_high")


def friction_limit(outcomes: xr.Dataset, target: ArrayLike, *, confidence: float = 0.95) -> xr.Dataset:
    """Return the friction up to which instability is as rare as a target.

    Of outcomes it is the quantile of the onset: as long as friction stays at or below it, the probability of
    instability is at most the target, however friction is distributed there. Instability that ends again
    at a higher friction counts, for friction passes through it.

    Parameters
    ----------
    outcomes : Dataset
        Of a model whose friction is integrated, with ``onset``, as from `evaluate`; or a fragility curve,
        ``probability`` with its limits over ``friction``, as from `hipuq.fragility` or a `sweep` over
        friction: then it is the highest friction of the curve up to which no probability exceeds the target.
    target : float or (t,) array
        Probabilities that must not be exceeded [1], from 0 to below 1.
    confidence : float, default 0.95
        Level of the interval [1]: where the Wilson limits of the share cross the target. A curve has its own.

    Returns
    -------
    Dataset
        ``friction_limit``, ``friction_limit_low``, ``friction_limit_high`` [1] over ``target``. Infinity
        means that the target is not exceeded up to the end of the range (attribute ``range``), minus infinity
        that it is from the start, so that there is no such friction, and NaN that nothing is known. Undecided
        configurations count as unstable throughout in the lower limit and as never unstable in the upper one.

    Raises
    ------
    SchemaError
        If the outcomes have no onset, nor a probability over friction.
    InputError
        If a target or the confidence cannot be one.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hoffmann2002")
    >>> exact = hipuq.integrate_friction(model, cp.Uniform(0.0, 1.0))
    >>> inputs = exact.inputs(k3=hipuq.relative(cp.Uniform(-0.1, 0.1)))
    >>> samples = hipuq.design("monte_carlo", inputs, n=200, rng=1)
    >>> outcomes = hipuq.evaluate(exact, samples)
    >>> limit = hipuq.friction_limit(outcomes, 0.05)
    >>> names = ["friction_limit_low", "friction_limit", "friction_limit_high"]
    >>> [round(limit[name].item(), 3) for name in names]
    [0.387, 0.391, 0.393]
    """
    if not isinstance(outcomes, xr.Dataset):
        raise SchemaError(f"outcomes must be an xarray Dataset, not {type(outcomes).__name__}")
    try:
        targets = np.atleast_1d(np.asarray(target, dtype=np.float64))
    except (TypeError, ValueError):
        targets = np.array([np.nan])
    if targets.ndim != 1 or not targets.size or not ((targets >= 0) & (targets < 1)).all():
        raise InputError(f"target is {target!r}: it must be a probability from 0 to below 1, such as 0.03")
    if "onset" in outcomes.variables:
        found, swept, level = _of_onsets(outcomes, targets, check_confidence(confidence))
    else:
        found, swept, level = _of_curve(outcomes, targets)
    attrs = {"units": "1", "range": list(swept)}
    what = "friction up to which the probability of instability stays at or below the target"
    data: dict[str, Any] = {
        f"friction_limit{end}": ("target", values, {"long_name": what + text, **attrs})
        for end, text, values in zip(LIMITS, ("", ", lower limit", ", upper limit"), found, strict=True)
    }
    coord = ("target", targets, {"long_name": "probability that must not be exceeded", "units": "1"})
    limits = xr.Dataset(data, coords={"target": coord})
    limits = schema.stamp(limits, f"friction limit for {targets.size} targets", like=outcomes.attrs)
    return limits.assign_attrs(confidence=level)


def _of_onsets(
    outcomes: xr.Dataset, targets: Array, confidence: float
) -> tuple[list[Array], tuple[float, float], float]:
    """Return the quantiles of the onset with their limits, the range that was swept, the level."""
    values = outcomes["onset"]
    if values.dims != ("sample",):
        raise SchemaError(f"the friction limit needs 'onset' over sample alone, it has {values.dims}")
    if not values.size:
        raise SchemaError("the outcomes are empty: at least one sample is needed")
    if "range" not in values.attrs:
        raise SchemaError("the onset does not say over which range: evaluate a model of integrate_friction")
    lower, upper = map(float, values.attrs["range"])
    onset, weight = values.values.astype(np.float64), weights_of(outcomes)
    unknown, finite = float(weight[np.isnan(onset)].sum()), np.isfinite(onset)
    at, place = np.unique(onset[finite], return_inverse=True)
    below = np.cumsum(np.bincount(place, weight[finite], at.size).astype(np.float64))
    drawn = not enumerated(outcomes)
    low, high = share_limits(below, unknown, weight, confidence if drawn else None)
    # Before the first onset nothing is unstable but what is unknown, and with draws what chance hid.
    start = share_limits(np.zeros(1), unknown, weight, confidence if drawn else None)
    known = 1 - unknown
    shares = (below / known if known > ROUNDING else below, 0.0), (high, float(start[1][0])), (low, 0.0)
    found = [_crossing(at, share, before, targets, lower) for share, before in shares]
    if known <= ROUNDING:
        found[0][:] = np.nan
    return found, (lower, upper), confidence if drawn else 1.0


def _crossing(at: Array, share: Array, before: float, targets: Array, lower: float) -> Array:
    """Return where a share that rises at steps first exceeds each target.

    Below the first step it has the value `before`; a step at the lower end of the range leaves nothing.
    """
    # Weights add up to a share within rounding.
    exceeded = np.append(share, np.inf) > targets[:, None] + ROUNDING
    crossed = np.append(at, np.inf)[exceeded.argmax(axis=1)]
    crossed[before > targets + ROUNDING] = -np.inf
    return np.where(crossed <= lower, -np.inf, crossed)


def _of_curve(curve: xr.Dataset, targets: Array) -> tuple[list[Array], tuple[float, float], float]:
    """Return the last friction of a curve before a target is first exceeded, with limits."""
    for end in LIMITS:
        name = f"probability{end}"
        if name not in curve or curve[name].dims != ("friction",) or not curve.sizes["friction"]:
            raise SchemaError(
                "the friction limit needs 'onset' over sample, from a model of integrate_friction, or "
                f"{name!r} over friction"
            )
    if "friction" not in curve.coords:
        raise SchemaError("the friction limit needs the coord 'friction' of the curve")
    curve = curve.sortby("friction")
    friction = curve["friction"].values.astype(np.float64)
    middle, low, high = (curve[f"probability{end}"].values for end in LIMITS)
    # What is not known lies anywhere between 0 and 1.
    low, high = np.where(np.isnan(low), 0.0, low), np.where(np.isnan(high), 1.0, high)
    first = np.append(friction, np.inf)[_exceeded(low, targets)]
    found = [_before(friction, middle, targets), _before(friction, high, targets), first]
    return found, (float(friction[0]), float(friction[-1])), float(curve.attrs.get("confidence", np.nan))


def _exceeded(share: Array, targets: Array) -> NDArray[np.intp]:
    """Return the place where a share first exceeds each target, or is unknown; its length if never."""
    exceeded = ~(share <= targets[:, None])
    return np.where(exceeded.any(axis=1), exceeded.argmax(axis=1), share.size)


def _before(friction: Array, share: Array, targets: Array) -> Array:
    """Return the last friction before a share first exceeds each target; NaN where that is not known."""
    first = _exceeded(share, targets)
    # Before the first friction there is none, and after the last no end.
    last = np.concatenate([[-np.inf], friction[:-1], [np.inf]])[first]
    return np.where(np.isnan(np.append(share, 0.0)[first]), np.nan, last)


def rounded_down(value: float, digits: int = 4) -> float:
    """Return a number with so many digits and never above it, but for what is rounding already."""
    if not np.isfinite(value) or value <= 0:
        return value
    scale = 10.0 ** (digits - 1 - int(np.floor(np.log10(value))))
    return float(np.floor(value * scale * (1 + 1e-12)) / scale)
