"""Distributions from the tables of study files, which may hold tables themselves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hipuq.distributions.base import Distribution
from hipuq.distributions.families import FAMILIES, from_family
from hipuq.distributions.lubricated import DEFAULTS, REGIMES, lubrication
from hipuq.distributions.mixtures import mixture
from hipuq.errors import HipuqError, InputError, check_name


def from_table(table: Mapping[str, Any]) -> Distribution:
    """Return the distribution that a table of a study file describes.

    Parameters
    ----------
    table : mapping
        ``distribution``, one of `DISTRIBUTIONS`; its parameters; and, if wanted, ``source``, a text. The
        distributions in a mixture and in lubrication are such tables too.

    Returns
    -------
    Distribution

    Raises
    ------
    InputError
        If it cannot be used: the message names the place within the table.
    """
    rest = {key: value for key, value in table.items() if key not in ("distribution", "source")}
    if not isinstance(table.get("source", ""), str):
        raise InputError(f"source is {table['source']!r}: it must be text")
    if "distribution" not in table:
        raise InputError(f"the key distribution is missing: there are {', '.join(map(str, table)) or 'none'}")
    name = check_name("distribution", table["distribution"], DISTRIBUTIONS)
    return DISTRIBUTIONS[name](name, rest)


def _mixture(name: str, table: Mapping[str, Any]) -> Distribution:
    """Return the mixture of a table: ``components`` and, if wanted, ``weights``."""
    _check_keys(name, table, ("components", "weights"))
    if "components" not in table:
        raise InputError("the mixture needs components")
    given = table["components"]
    components: Any = given
    if isinstance(given, Mapping):
        components = {key: _nested(f"component {key}", value) for key, value in given.items()}
    elif isinstance(given, Sequence) and not isinstance(given, str):
        components = [_nested(f"component {i}", value) for i, value in enumerate(given, 1)]
    return mixture(components, table.get("weights"))


def _lubrication(name: str, table: Mapping[str, Any]) -> Distribution:
    """Return friction over the regimes of lubrication; a part that is a table has its own ``source``."""
    _check_keys(name, table, (*DEFAULTS, "boundary_below", "film_from"))
    options, sources = dict(table), {}
    for part in DEFAULTS.keys() & options.keys():
        value = options[part]
        if part != "lambda_ratio" or _is_table(value):
            options[part] = _nested(part, value)
        elif isinstance(value, Mapping):
            # The probabilities of the regimes, or one value.
            rest = {key: own for key, own in value.items() if key != "source"}
            options[part] = rest["value"] if set(rest) == {"value"} else rest
        if isinstance(value, Mapping) and value.get("source"):
            sources[part] = value["source"]
    return lubrication(**options, sources=sources)


def _is_table(value: object) -> bool:
    """Say whether a value is the table of a distribution, not of probabilities of regimes or of a value."""
    return isinstance(value, Mapping) and ("distribution" in value or not value.keys() & {*REGIMES, "value"})


def _nested(place: str, table: object) -> Distribution:
    if not isinstance(table, Mapping):
        raise InputError(f"{place} is {table!r}: it must be a table with the key distribution")
    try:
        return from_table(table)
    except HipuqError as error:
        raise InputError(f"{place}: {error}") from error


def _check_keys(name: str, table: Mapping[str, Any], allowed: Sequence[str]) -> None:
    for key in table:
        check_name(f"parameter of the distribution {name!r}", key, allowed)


DISTRIBUTIONS: Mapping[str, Callable[[str, Mapping[str, Any]], Distribution]] = {
    **dict.fromkeys(FAMILIES, from_family),
    "mixture": _mixture,
    "lubrication": _lubrication,
}
"""Name in study files -> function that makes the distribution from its name and its parameters."""
