"""What stored descriptions say, for reports: a distribution in words, the regimes of a mixture, its sources.

All of it is read from the description alone, so that it needs nothing but a results file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

LAMBDA_RATIO = "lambda ratio"
"""Name under which the source of the probabilities of the regimes is given."""


@dataclass(frozen=True)
class Regime:
    """One named component of a mixture.

    Attributes
    ----------
    name : str
        Such as ``"film"``.
    weight : float
        Its probability.
    distribution : str
        Its distribution in words.
    source : str
        Where the distribution comes from; empty if nobody said.
    """

    name: str
    weight: float
    distribution: str
    source: str


def described(description: Mapping[str, Any]) -> str:
    """Return a distribution in words.

    Parameters
    ----------
    description : mapping
        As `hipuq.distributions.Distribution.description`, or as it comes back from JSON.

    Returns
    -------
    str
        One line, such as ``"Uniform(lower=0.0, upper=0.1)"`` or
        ``"film 0.5: Triangle(0.04, 0.06, 0.08); dry 0.5: Uniform(lower=0.3, upper=1.0)"``.

    Examples
    --------
    >>> arguments = {"mu": 0.0, "sigma": 2.0}
    >>> described({"kind": "chaospy", "name": "Normal", "kwargs": arguments})
    'Normal(mu=0.0, sigma=2.0)'
    """
    if "components" in description:
        # What is never drawn is not told; all weights are 0 in no mixture.
        return "; ".join(_component(part) for part in description["components"] if part["weight"] > 0)
    if "name" not in description:
        # Objects without a description of their own are known by their repr, which may have lines.
        return " ".join(str(description.get("text", "unknown")).split())
    arguments = [_argument(value) for value in description.get("args", ())]
    arguments += [f"{key}={_argument(value)}" for key, value in description.get("kwargs", {}).items()]
    return f"{description['name']}({', '.join(arguments)})"


def regimes(description: Mapping[str, Any]) -> list[Regime]:
    """Return the named components of a mixture; none for other distributions.

    Parameters
    ----------
    description : mapping
        As `hipuq.distributions.Distribution.description`, or as it comes back from JSON.

    Returns
    -------
    list of Regime
        In the order of the mixture, those of weight 0 too.

    Examples
    --------
    >>> import hipuq
    >>> friction = hipuq.lubrication({"film": 0.5, "mixed": 0.3, "boundary": 0.2})
    >>> [(one.name, one.weight) for one in regimes(friction.description)]
    [('film', 0.5), ('mixed', 0.3), ('boundary', 0.2)]
    """
    return [
        Regime(part["name"], part["weight"], described(part["distribution"]), part.get("source", ""))
        for part in description.get("components", ())
        if part.get("name")
    ]


def sources(description: Mapping[str, Any]) -> dict[str, str]:
    """Return where the parts of a distribution come from.

    Parameters
    ----------
    description : mapping
        As `hipuq.distributions.Distribution.description`, or as it comes back from JSON.

    Returns
    -------
    dict
        Part -> its source, for the parts that have one and are drawn: the regimes by name, and
        ``"lambda ratio"`` for what their probabilities come from, together with that distribution in words.
    """
    found = {}
    ratio = description.get("lambda_ratio")
    if ratio:
        found[LAMBDA_RATIO] = f"{ratio['text']}: {ratio['source']}"
    found |= {one.name: one.source for one in regimes(description) if one.source and one.weight > 0}
    return found


def _component(part: Mapping[str, Any]) -> str:
    """Return weight and distribution of a component; one of several components stands in parentheses."""
    own = part["distribution"]
    words = f"({described(own)})" if "components" in own else described(own)
    return f"{part.get('name', '')} {part['weight']:.3g}: {words}".lstrip()


def _argument(value: Any) -> str:
    return described(value) if isinstance(value, Mapping) else str(value)
