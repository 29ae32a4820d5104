"""Modes followed over a friction sweep, and the friction at which they lock in.

A mode number is the rank of its frequency. A coalesced pair passes other modes as friction grows,
and then ranks shift though nothing happens to the pair; so a figure over friction needs modes that
are followed. They bear the numbers that they have where most of them are unstable for the first time:
the pairs that can lock in have all done so there, and have not yet passed each other.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from hipuq import schema
from hipuq.errors import InputError, SchemaError

Array = NDArray[np.float64]

TRACKED = ("frequency", "growth_rate", "unstable")


def follow_modes(outcomes: xr.Dataset) -> xr.Dataset:
    """Return the modes of a friction sweep, each followed over friction.

    From one friction to the next modes are matched so that their eigenvalues move least in all, and
    growing modes stay growing and decaying ones decaying as far as verdicts are known. Samples
    without frequencies (failed ones) are left out.

    Parameters
    ----------
    outcomes : Dataset
        ``friction`` over sample; ``frequency`` [Hz], ``growth_rate`` [1/s] and ``unstable`` (1, 0,
        NaN for undecided) over (sample, mode). Nothing but friction may vary.

    Returns
    -------
    Dataset
        The same variables by ascending friction. ``mode`` is the number at ``reference_friction``,
        the smallest friction at which the most modes are known to be unstable.

    Raises
    ------
    SchemaError
        If a variable is missing.
    InputError
        If another parameter varies, or no sample is left.
    """
    sweep = sorted_sweep(outcomes)
    frequency, growth, unstable = (sweep[name].values.astype(np.float64) for name in TRACKED)
    roots = growth + 2j * np.pi * frequency
    kind = np.where(np.isnan(unstable), 0.0, np.sign(growth))
    reference = int((unstable == 1).sum(axis=1).argmax())
    place = np.empty(frequency.shape, np.intp)
    place[reference] = np.arange(frequency.shape[1])
    for i in range(reference, 0, -1):
        place[i - 1] = _next_places(roots[i, place[i]], kind[i, place[i]], roots[i - 1], kind[i - 1])
    for i in range(reference, len(place) - 1):
        place[i + 1] = _next_places(roots[i, place[i]], kind[i, place[i]], roots[i + 1], kind[i + 1])
    columns = {
        name: (("sample", "mode"), np.take_along_axis(sweep[name].values, place, axis=1), sweep[name].attrs)
        for name in TRACKED
    }
    attrs = {"long_name": "friction at which modes have their numbers", "units": "1"}
    return (
        sweep[["friction"]]
        .assign(columns)
        .assign_coords(
            mode=sweep["mode"], reference_friction=((), sweep["friction"].values[reference], attrs)
        )
    )


def lock_in_bracket(outcomes: xr.Dataset, mode: int) -> tuple[float, float]:
    """Return the frictions between which a mode locks in.

    Parameters
    ----------
    outcomes : Dataset
        A friction sweep, as for `follow_modes`.
    mode : int
        Its number as in `follow_modes`: that of the growing mode, the upper of its pair.

    Returns
    -------
    low : float
        Largest friction below `high` at which the mode is known to be stable [1]; NaN if there is none.
    high : float
        Smallest friction at which it is known to be unstable [1]. Both are NaN if there is none.

    Raises
    ------
    SchemaError
        If the outcomes lack a variable.
    InputError
        If another parameter varies, no sample is left, or the mode is not in the sweep.
    """
    return bracket(follow_modes(outcomes), mode)


def bracket(sweep: xr.Dataset, mode: int) -> tuple[float, float]:
    """Return the lock-in bracket of a mode that has been followed already.

    Parameters
    ----------
    sweep : Dataset
        From `follow_modes`.
    mode : int
        Its number.

    Returns
    -------
    low, high : float
        As `lock_in_bracket`.
    """
    check_modes(sweep, [mode])
    friction = sweep["friction"].values
    verdict = sweep["unstable"].sel(mode=mode).values
    first = np.flatnonzero(verdict == 1)
    if first.size == 0:
        return float("nan"), float("nan")
    before = np.flatnonzero(verdict[: first[0]] == 0)
    low = float(friction[before[-1]]) if before.size else float("nan")
    return low, float(friction[first[0]])


def check_modes(sweep: xr.Dataset, modes: list[int]) -> None:
    """Raise an InputError if a mode is not in the sweep.

    Parameters
    ----------
    sweep : Dataset
        With the coordinate ``mode``.
    modes : list of int
        Numbers of modes.
    """
    allowed = sweep["mode"].values.tolist()
    for mode in modes:
        if mode not in allowed:
            raise InputError(f"mode {mode} is not in the sweep: it must be one of {allowed}")


def growth_threshold(outcomes: xr.Dataset) -> float:
    """Return the growth rate above which a mode counts as unstable [1/s].

    Parameters
    ----------
    outcomes : Dataset
        With the model's options in its attributes; 0 is assumed where they are missing.

    Returns
    -------
    float
    """
    model = json.loads(outcomes.attrs.get("options") or "{}").get("model")
    return float(model.get("growth_threshold", 0.0)) if isinstance(model, dict) else 0.0


def check_constant(outcomes: xr.Dataset, varied: Sequence[str], why: str) -> None:
    """Raise an InputError if a parameter differs between samples that is none of those meant to.

    Parameters
    ----------
    outcomes : Dataset
    varied : sequence of str
        Parameters that may differ.
    why : str
        Rest of the message.
    """
    for name in schema.PARAMETERS:
        if name not in varied and name in outcomes.variables and "sample" in outcomes[name].dims:
            values = outcomes[name].transpose("sample", ...).values
            if (values != values[:1]).any():
                raise InputError(f"{name} varies in the outcomes: {why}")


def sorted_sweep(outcomes: xr.Dataset) -> xr.Dataset:
    """Return a checked sweep by ascending friction, without samples that have no frequencies.

    Parameters
    ----------
    outcomes : Dataset
        As for `follow_modes`.

    Returns
    -------
    Dataset
        Friction, frequency, growth rate and verdict, modes as they are numbered.

    Raises
    ------
    SchemaError, InputError
        As `follow_modes`.
    """
    for name in ("friction", *TRACKED):
        if name not in outcomes:
            raise SchemaError(f"the sweep needs {name!r}: outcomes of a friction sweep, all modes")
    if outcomes["friction"].dims != ("sample",):
        raise SchemaError(f"friction needs the dim 'sample' alone, it has {outcomes['friction'].dims}")
    check_constant(outcomes, ["friction"], "in a friction sweep only friction may")
    sweep = outcomes[["friction", *TRACKED]].transpose("sample", ...)
    if "mode" not in sweep.coords:
        sweep = sweep.assign_coords(mode=np.arange(1, sweep.sizes["mode"] + 1))
    complete = np.isfinite(sweep["frequency"].values).all(axis=1)
    complete &= np.isfinite(sweep["growth_rate"].values).all(axis=1)
    if not complete.any():
        raise InputError("no sample of the sweep has frequencies: there is nothing to draw")
    sweep = sweep.isel(sample=np.flatnonzero(complete))
    return sweep.isel(sample=np.argsort(sweep["friction"].values, kind="stable"))


def _next_places(
    roots: NDArray[np.complex128], kind: Array, others: NDArray[np.complex128], other_kind: Array
) -> NDArray[np.intp]:
    """Return for each root its match among the others.

    `kind` is 1 for growing, -1 for decaying, 0 for neither or unknown; a change of it costs as much as
    the longest move. Of two roots that a pair splits into, the growing one gets the upper: both ways
    are the same distance.
    """
    cost = np.abs(roots[:, None] - others)
    changed = kind[:, None] != other_kind
    upper = kind[:, None] * (others.imag - roots.imag[:, None])
    match = linear_sum_assignment(cost + cost.max() * changed - 1e-6 * upper)[1]
    return np.asarray(match, np.intp)
