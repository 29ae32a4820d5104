"""One configuration of a model from words, as the command line takes it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from hipuq.errors import InputError, check_name
from hipuq.models import MODELS, PRESETS, CEAModel


def configured(
    name: str, preset: str | None, contact: str | None, settings: Sequence[str], growth_threshold: float
) -> tuple[CEAModel, xr.Dataset]:
    """Return a model and one sample.

    Parameters
    ----------
    name, preset : str
        Of the model; its first preset by default.
    contact : str or None
        Oscillators in contact, numbered from 1, such as ``"1,2,5"``.
    settings : sequence of str
        ``parameter=value``; values of several elements have commas between them.
    growth_threshold : float
        [1/s]

    Returns
    -------
    model : CEAModel
    sample : Dataset

    Raises
    ------
    InputError, UnknownNameError
        If there is no such model, preset or parameter, or a value cannot be used.
    """
    make = MODELS[check_name("model", name, MODELS)]
    model = make(preset or PRESETS[name][0], growth_threshold=growth_threshold)
    changes: dict[str, ArrayLike] = {}
    for setting in settings:
        parameter, equals, text = setting.partition("=")
        if not equals:
            raise InputError(f"--set is {setting!r}: it takes parameter=value, such as damping_ratio=0.005")
        check_name("parameter", parameter, model.parameters)
        if parameter == "friction":
            raise InputError("--set friction: the whole range of friction is looked at, see --min and --max")
        values = _numbers(f"--set {parameter}", text)
        changes[parameter] = values[0] if len(values) == 1 else values
    if contact is not None:
        check_name("parameter", "contact", model.parameters)
        size = len(model.parameters["contact"].nominal)
        places = _numbers("--contact", contact)
        if not np.isin(places, np.arange(1, size + 1)).all() or len(set(places)) != len(places):
            raise InputError(f"--contact is {contact!r}: it takes oscillators 1 to {size}, each once")
        changes["contact"] = np.isin(np.arange(1, size + 1), places)
    return model, model.nominal(**changes)


def _numbers(what: str, text: str) -> list[float]:
    """Return numbers with commas between them."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{what} is {text!r}: it takes numbers with commas between them") from None
