"""The damping that results assume, and what else their model has that its preset has not, in words."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.errors import HipuqError
from hipuq.friction import FRICTION
from hipuq.models import MODELS, CEAModel
from hipuq.report.reading import DAMPING, model_options, nominal_of
from hipuq.report.summary import distribution_text
from hipuq.report.table import listed

RATIOS = (DAMPING, "damping_1", "damping_2")
"""Parameters of damping that are pure numbers, told in per cent."""

RAYLEIGH = ("mass_damping", "stiffness_damping")

NONE = "no damping"


def damping_words(results: xr.Dataset) -> str:
    """Return the damping that results assume.

    Parameters
    ----------
    results : Dataset
        Results of any method, or what is computed at nominal values: samples, or the shapes of modes.

    Returns
    -------
    str
        Such as ``"1 % modal damping"``, ``"uncertain modal damping, Uniform(lower=0.0, upper=0.02)"``, ``"no
        damping"``; empty where the model has no parameter of damping, or does not tell its values.
    """
    nominal, inputs = nominal_of(results), _inputs(results)
    told, known = [], False
    for name in (*RATIOS, *RAYLEIGH):
        if name in results.variables or name in results.attrs:
            found = results[name].values if name in results.variables else results.attrs[name]
            values = np.atleast_1d(np.asarray(found, np.float64))
            told.append(_said(name, [float(values.min()), float(values.max())]))
        elif name in inputs:
            told.append(f"uncertain {_called(name)}, {_drawn(inputs[name])}")
        elif isinstance(nominal.get(name), float | int):
            told.append(_said(name, [float(nominal[name])]))
        else:
            continue
        known = True
    some = [text for text in told if text]
    return listed(some) if some else NONE if known else ""


def at_damping(results: xr.Dataset) -> str:
    """Return the damping as it follows a probability, such as ``"at 1 % modal damping"``; may be empty."""
    words = damping_words(results)
    if not words:
        return ""
    return "without damping" if words == NONE else f"{'with' if 'uncertain' in words else 'at'} {words}"


def percent_of(ratio: float) -> str:
    """Return a damping ratio in per cent, with as many digits as it has."""
    return f"{float(f'{100 * ratio:.6g}'):g} %"


def _said(name: str, ends: list[float]) -> str:
    """Return a value, or a range, of a parameter of damping; empty for 0."""
    if not any(ends):
        return ""
    low, high = ends[0], ends[-1]
    if name in RATIOS:
        text = percent_of(high) if low == high else f"{float(f'{100 * low:.6g}'):g} to {percent_of(high)}"
        return f"{text} modal damping" if name == DAMPING else f"{_called(name)} of {text}"
    text = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return f"{_called(name)} of {text} {schema.PARAMETERS[name].units}"


def _called(name: str) -> str:
    return "modal damping" if name == DAMPING else schema.PARAMETERS[name].long_name


def _drawn(entry: Mapping[str, Any]) -> str:
    if "distribution" not in entry:
        return "by levels"
    text = distribution_text(entry["distribution"])
    how = {"relative": "nominal * (1 + {})", "shift": "nominal + {}"}.get(str(entry.get("how")), "{}")
    return how.format(text)


def _inputs(results: xr.Dataset) -> dict[str, Any]:
    found = json.loads(results.attrs.get("inputs") or "{}")
    return found if isinstance(found, dict) else {}


def preset_of(results: xr.Dataset) -> CEAModel | None:
    """Return the model at the values of its preset; None where there is no such model or preset."""
    said = model_options(results)
    if said.get("model") not in MODELS:
        return None
    more = {key: said[key] for key in ("oscillators",) if key in said}
    try:
        return MODELS[str(said["model"])](said.get("preset"), **more)
    except (HipuqError, TypeError):
        return None


def differences(results: xr.Dataset) -> list[str]:
    """Return the parameters whose nominal value is not that of the preset; none where it is not known."""
    preset = preset_of(results)
    if preset is None:
        return []
    return [
        name
        for name, value in nominal_of(results).items()
        if name in preset.parameters and not _alike(value, preset.parameters[name].nominal)
    ]


def changed_words(results: xr.Dataset) -> str:
    """Return what else than damping and friction the model has that its preset has not; may be empty."""
    nominal, inputs = nominal_of(results), _inputs(results)
    told = []
    for name in differences(results):
        replaced = inputs.get(name, {}).get("how") in ("absolute", "contact_patterns")
        if name not in (*RATIOS, *RAYLEIGH, FRICTION) and not replaced:
            told.append(f"{name.replace('_', ' ')} {value_text(name, nominal[name], unit=True)}")
    threshold = model_options(results).get("growth_threshold")
    if threshold:
        told.append(f"unstable above a growth rate of {threshold:g} 1/s")
    return ", ".join(told)


def label(results: xr.Dataset) -> str:
    """Return model, damping and other values that are not those of the preset, for titles."""
    return ", ".join(
        filter(None, [str(results.attrs["model"]), damping_words(results), changed_words(results)])
    )


def value_text(name: str, value: object, *, unit: bool = False) -> str:
    """Return the value of a parameter, or the range of its elements, as text."""
    array = np.atleast_1d(np.asarray(value, np.float64))
    if name == "contact":
        chosen = np.flatnonzero(array) + 1
        if chosen.size == array.size:
            return f"all {array.size} oscillators"
        return f"oscillators {', '.join(map(str, chosen))} of {array.size}"
    low, high = float(array.min()), float(array.max())
    text = f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"
    units = schema.PARAMETERS[name].units if name in schema.PARAMETERS else "1"
    return f"{text} {units}" if unit and units != "1" else text


def _alike(one: object, other: object) -> bool:
    a, b = (np.asarray(value, np.float64) for value in (one, other))
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=1e-12, atol=0.0))
