"""The names of hipuq: variables with their dims, units and meaning, attributes, checks.

Every Dataset that hipuq makes or takes follows this table. Parameters and outcomes of a user's own
model need not be in it; they are then checked for their ``sample`` dim only.
"""

from __future__ import annotations

import json
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
import xarray as xr

from hipuq.errors import SchemaError, check_name, unknown_name

VERSION = 1
"""Version of the schema; stores of another one are not gone on with."""

VERDICT = "verdict"
"""Role of a variable of 1 (yes), 0 (no) and NaN (unknown)."""

PROBABILITY = "probability"
"""Role of a variable whose values are probabilities themselves."""


@dataclass(frozen=True)
class Variable:
    """What the schema says of one variable.

    Attributes
    ----------
    long_name : str
        Its meaning, as used on axes and in tables.
    units : str
        Its unit; ``"1"`` for pure numbers.
    dims : tuple of str
        Its dims.
    role : str
        ``"verdict"``, ``"probability"`` or empty.
    limit_state : float or None
        Value below which the variable means instability.
    """

    long_name: str
    units: str = "1"
    dims: tuple[str, ...] = ("sample",)
    role: str = ""
    limit_state: float | None = None

    @property
    def attrs(self) -> dict[str, Any]:
        """Attributes of the variable in a Dataset."""
        attrs: dict[str, Any] = {"long_name": self.long_name, "units": self.units}
        if self.limit_state is not None:
            attrs["limit_state"] = self.limit_state
        return attrs | ({"role": self.role} if self.role else {})


PARAMETERS: dict[str, Variable] = {
    "friction": Variable("friction coefficient"),
    "contact": Variable("oscillator in contact", dims=("sample", "oscillator")),
    "mass": Variable("mass", "kg", ("sample", "oscillator")),
    "spring_stiffness": Variable("spring stiffness", "N/m", ("sample", "spring")),
    "contact_stiffness": Variable("contact stiffness", "N/m", ("sample", "oscillator")),
    "spring_angle": Variable("spring angle", "deg", ("sample", "spring")),
    "contact_angle": Variable("contact angle", "deg", ("sample", "oscillator")),
    "friction_angle": Variable("friction angle", "deg", ("sample", "oscillator")),
    "damping_ratio": Variable("modal damping ratio of the frictionless modes"),
    "mass_damping": Variable("mass proportional damping", "1/s"),
    "stiffness_damping": Variable("stiffness proportional damping", "s"),
    "k1": Variable("stiffness of spring 1 (unit mass)", "N/m"),
    "k2": Variable("stiffness of spring 2 (unit mass)", "N/m"),
    "k3": Variable("contact stiffness (unit mass)", "N/m"),
    "angle_1": Variable("angle of spring 1", "deg"),
    "angle_2": Variable("angle of spring 2", "deg"),
    "frequency_1": Variable("natural frequency 1", "Hz"),
    "frequency_2": Variable("natural frequency 2", "Hz"),
    "damping_1": Variable("relative damping 1 (twice the damping ratio)"),
    "damping_2": Variable("relative damping 2 (twice the damping ratio)"),
}
"""Parameters of the models that come with hipuq."""

OUTCOMES: dict[str, Variable] = {
    "frequency": Variable("frequency", "Hz", ("sample", "mode")),
    "growth_rate": Variable("growth rate", "1/s", ("sample", "mode")),
    "unstable": Variable("mode unstable", dims=("sample", "mode"), role=VERDICT),
    "any_unstable": Variable("any mode unstable", role=VERDICT),
    "unstable_count": Variable("number of unstable modes"),
    "margin": Variable("stability margin (negative: unstable)", limit_state=0.0),
    "mechanisms": Variable("number of rigid mechanisms"),
}
"""Outcomes of a complex eigenvalue analysis, see `hipuq.cea`."""

INTEGRATED: dict[str, Variable] = {
    "probability": Variable("probability of instability over friction", role=PROBABILITY),
    "probability_low": Variable(
        "probability of instability over friction, unknown as stable", role=PROBABILITY
    ),
    "probability_high": Variable(
        "probability of instability over friction, unknown as unstable", role=PROBABILITY
    ),
    "probability_by_mode": Variable(
        "probability of instability over friction by mode", dims=("sample", "mode"), role=PROBABILITY
    ),
    "onset": Variable("friction at the onset of instability (inf: never)"),
    "interval": Variable("ends of an unstable interval of friction", dims=("sample", "interval", "bound")),
    "interval_count": Variable("number of unstable intervals of friction"),
}
"""Outcomes of a model whose friction is integrated, see `hipuq.friction`."""

STATUS = {"ok": 0, "undecided": 1, "failed": 2}
"""Flags of the outcome variable ``status``."""

DECIDED_BY = {"double": 0, "structured": 1, "certificate": 2}
"""Flags of the outcome variable ``decided_by``; -1 where nothing decided."""

COORDINATES: dict[str, Variable] = {
    "sample": Variable("sample number", dims=("sample",)),
    "oscillator": Variable("oscillator", dims=("oscillator",)),
    "spring": Variable("spring", dims=("spring",)),
    "mode": Variable("mode, by ascending frequency", dims=("mode",)),
    "pattern": Variable("contact pattern", dims=("pattern",)),
    "count": Variable("oscillators in contact", dims=("count",)),
    "in_contact": Variable("oscillators in contact"),
    "weight": Variable("probability of the level"),
    "replicate": Variable("replicate of the design"),
    "block": Variable("base point of the design"),
    "matrix": Variable("matrix of the design"),
    "parameter": Variable("parameter", dims=("parameter",)),
    "parameter_2": Variable("second parameter", dims=("parameter_2",)),
    "round": Variable("round of a sequential method"),
    "stratum": Variable("use of the sample: -1 to fit, 0 held out, from 1 a stratum of the correction"),
    "stratum_weight": Variable("probability that the stratum holds"),
    "quadrature_weight": Variable("weight of the quadrature node"),
    "quantile": Variable("probability below", dims=("quantile",)),
    "held_out": Variable("number of the held-out sample", dims=("held_out",)),
    "element": Variable("element of a parameter", dims=("element",)),
    "term": Variable("term of the expansion", dims=("term",)),
    "budget": Variable("evaluations", dims=("budget",)),
}
"""Coordinates and dims."""


RESULT_DIMS = ("parameter", "parameter_2", "budget", "quantile", "held_out", "element", "term", "count")
"""Dims of results that no outcome may have."""


def is_exact(results: xr.Dataset) -> bool:
    """Say whether results have no sampling error: limits that hold with a confidence of 1."""
    return bool(results.attrs.get("confidence") == 1)


def flag_attrs(long_name: str, flags: Mapping[str, int]) -> dict[str, Any]:
    """Return CF attributes of an integer flag variable."""
    return {
        "long_name": long_name,
        "units": "1",
        "flag_values": np.array(list(flags.values()), dtype=np.int8),
        "flag_meanings": " ".join(flags),
    }


def index(name: str, length: int) -> tuple[str, np.ndarray, dict[str, str]]:
    """Return the coordinate of an element dim, numbered from 1."""
    return name, np.arange(1, length + 1), COORDINATES[name].attrs


def stamp(
    dataset: xr.Dataset,
    action: str,
    *,
    model: str | None = None,
    method: str | None = None,
    seed: int | None = None,
    options: Mapping[str, Any] | None = None,
    inputs: str | None = None,
    like: Mapping[Hashable, Any] | None = None,
) -> xr.Dataset:
    """Return `dataset` with the attributes that say where it comes from.

    Parameters
    ----------
    dataset : Dataset
        Anything; it is not changed.
    action : str
        What was done, one line of the history.
    model, method : str, optional
        Their names; empty where there is none.
    seed : int, optional
        The seed of all randomness in it.
    options : mapping, optional
        Options of the stages so far, JSON-able.
    inputs : str, optional
        The inputs as JSON.
    like : mapping, optional
        Attributes of the Dataset that this one was made from: what is not given is taken from it.

    Returns
    -------
    Dataset
        A shallow copy.
    """
    from hipuq import __version__

    before = dict(like or {})
    given = {"model": model, "method": method, "seed": seed, "inputs": inputs}
    attrs: dict[Hashable, Any] = {"hipuq_version": __version__}
    for key, value in given.items():
        attrs[key] = value if value is not None else before.get(key, "")
    attrs["options"] = json.dumps(json.loads(before.get("options", "{}")) | dict(options or {}))
    now = datetime.now(UTC).isoformat(timespec="seconds")
    attrs["history"] = "\n".join(filter(None, [str(before.get("history", "")), f"{now} {action}"]))
    if "seconds" in before:
        attrs["seconds"] = before["seconds"]
    return dataset.assign_attrs(attrs)


def check_samples(samples: xr.Dataset, allowed: Iterable[str] | None = None) -> int:
    """Check a samples Dataset and return its number of samples.

    Parameters
    ----------
    samples : Dataset
        Needs the dim ``sample``; every data variable needs it too, and finite numbers.
    allowed : iterable of str, optional
        The parameters of the model; without it any name is allowed.

    Returns
    -------
    int
        Length of ``sample``.

    Raises
    ------
    SchemaError
        If a dim is missing, there is no sample, or a value is not a finite number.
    UnknownNameError
        If a data variable is none of the `allowed` names.
    """
    if not isinstance(samples, xr.Dataset):
        raise SchemaError(f"samples must be an xarray Dataset, not {type(samples).__name__}")
    names = None if allowed is None else list(allowed)
    if "sample" not in samples.dims:
        raise SchemaError(f"samples need the dim 'sample', they have {sorted(map(str, samples.dims))}")
    if samples.sizes["sample"] == 0:
        raise SchemaError("samples are empty: at least one sample is needed")
    for key, values in samples.data_vars.items():
        name = str(key)
        if names is not None and name not in names:
            raise unknown_name("parameter in samples", name, names)
        if "sample" not in values.dims:
            raise SchemaError(f"samples variable {name!r} needs the dim 'sample', it has {values.dims}")
        if values.dtype.kind not in "biuf":
            raise SchemaError(f"samples variable {name!r} must hold numbers, it holds {values.dtype}")
        if values.dtype.kind == "f" and not np.isfinite(values.values).all():
            where = int(np.argwhere(~np.isfinite(values.transpose("sample", ...).values))[0][0])
            value = values.transpose("sample", ...).values[where]
            shown = value if np.ndim(value) == 0 else value[~np.isfinite(value)][0]
            raise SchemaError(f"{name} is {shown} in sample {where}: it must be a finite number")
    return samples.sizes["sample"]


def check_outcomes(outcomes: xr.Dataset, of: str) -> xr.DataArray:
    """Return the outcome variable `of`, ``sample`` first.

    Raises
    ------
    SchemaError
        If there is no ``sample`` dim, another one is used by results, or the variable does not hold
        numbers.
    UnknownNameError
        If there is no such variable.
    """
    if not isinstance(outcomes, xr.Dataset):
        raise SchemaError(f"outcomes must be an xarray Dataset, not {type(outcomes).__name__}")
    check_name("outcome", of, [str(name) for name in outcomes.data_vars])
    values = outcomes[of]
    taken = [str(dim) for dim in values.dims if dim in RESULT_DIMS]
    if taken:
        raise SchemaError(f"outcome {of!r} has the dim {taken[0]!r}, which results use: rename it")
    if "sample" not in values.dims:
        raise SchemaError(f"outcome {of!r} needs the dim 'sample', it has {values.dims}")
    if values.sizes["sample"] == 0:
        raise SchemaError(f"outcome {of!r} is empty: at least one sample is needed")
    if values.dtype.kind not in "biuf":
        raise SchemaError(f"outcome {of!r} must hold numbers, it holds {values.dtype}")
    return values.transpose("sample", ...)


def check_results(results: xr.Dataset) -> xr.Dataset:
    """Return `results` if it is a Dataset of results made by hipuq.

    Raises
    ------
    SchemaError
        If attributes of a results Dataset are missing.
    """
    missing = [key for key in ("hipuq_version", "method", "of") if key not in results.attrs]
    if missing:
        raise SchemaError(f"not a results Dataset of hipuq: attribute {missing[0]!r} is missing")
    return results
