"""Models and inputs from what the tables of a study say of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hipuq.contact import ContactPatterns
from hipuq.errors import HipuqError, InputError, check_name
from hipuq.friction import FRICTION, FrictionIntegrated, integrate_friction
from hipuq.models import MODELS, CEAModel
from hipuq.study.tables import InputTable
from hipuq.variation import Variation


def model_of(options: Mapping[str, Any]) -> CEAModel:
    """Return the model that a [model] table describes.

    Raises
    ------
    InputError
        If there is no such model, or it does not take the options.
    """
    rest = dict(options)
    if "name" not in rest:
        raise InputError(f"the model has no name: [model] needs one of {', '.join(MODELS)}")
    name = rest.pop("name")
    try:
        return MODELS[check_name("model", name, MODELS)](**rest)
    except HipuqError:
        raise
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"model {name!r} does not take these options: {error}") from error


def distributions_of(tables: Mapping[str, InputTable]) -> dict[str, object]:
    """Return what ``model.inputs`` takes: parameter -> its distribution."""
    return {name: table.distribution_for(name) for name, table in tables.items()}


def without_friction(
    model: CEAModel, distributions: Mapping[str, object]
) -> tuple[FrictionIntegrated, dict[str, object]]:
    """Return the model with friction integrated over its distribution, and the distributions left.

    Raises
    ------
    InputError
        If friction has no distribution of its own, or cannot be integrated.
    """
    rest = dict(distributions)
    if FRICTION not in rest:
        raise InputError("integrate_friction needs the distribution [inputs.friction]")
    friction = rest.pop(FRICTION)
    if isinstance(friction, (ContactPatterns, Variation)):
        raise InputError("integrate_friction needs a distribution of friction itself, apply = 'absolute'")
    return integrate_friction(model, friction), rest
