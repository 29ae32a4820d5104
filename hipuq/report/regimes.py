"""What a probability over the regimes of lubrication rests on: how probable each regime is taken to be."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import xarray as xr

from hipuq.distributions import regimes
from hipuq.friction import FRICTION
from hipuq.report.partners import case_of
from hipuq.report.reading import Reading, probability_name
from hipuq.report.summary import integrated
from hipuq.report.table import listed, number, share

ASSUMPTION = "assumption"
"""First word of the source of something that is assumed."""


def rests_on(reading: Reading) -> tuple[str, str]:
    """Return on which probabilities of regimes the headline rests, and what each regime alone gives.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    long, short : str
        Sentences; empty where friction is no mixture over regimes of lubrication.
    """
    results = reading.results
    if results is None:
        return "", ""
    description = friction_description(results)
    ratio = description.get("lambda_ratio")
    drawn = {one.name: one for one in regimes(description) if one.weight > 0}
    if not ratio or len(drawn) < 2:
        return "", ""
    weights = ", ".join(f"{name} {one.weight:.2f}" for name, one in drawn.items())
    source = str(ratio.get("source", ""))
    assumed = source.startswith(ASSUMPTION)
    given = "assumed, not measured" if assumed else source or "of an unknown source"
    long = f"It rests on the probabilities of the regimes of lubrication, {weights}, which are {given}"
    short = f"It rests on {'assumed ' if assumed else ''}probabilities of lubrication: {weights}"
    alone = _alone(reading, {name: one.distribution for name, one in drawn.items()})
    if alone:
        told = ", ".join(f"{name} {text}" for name, text in alone.items())
        long += f"; in {'each regime' if len(alone) == len(drawn) else listed(alone)} alone P is {told}"
        short += f"; alone they give {told}"
    return long, short


def friction_description(results: xr.Dataset) -> Mapping[str, Any]:
    """Return the description of the distribution of friction, sampled or integrated; empty without one."""
    if (source := integrated(results).get(FRICTION)) is not None:
        return source
    entry = json.loads(results.attrs.get("inputs") or "{}").get(FRICTION, {})
    found = entry.get("distribution") if entry.get("how") == "absolute" else None
    return found if isinstance(found, dict) else {}


def _alone(reading: Reading, drawn: Mapping[str, str]) -> dict[str, str]:
    """Return P of the analyses of one regime alone, with all else as in the headline, by the regime."""
    head = reading.results
    assert head is not None
    found: dict[str, str] = {}
    for name in reading.found:
        one = reading.squeak(name)
        if one is None or reading.at_one(name) or case_of(one)[:2] != case_of(head)[:2]:
            continue
        only = [part for part in regimes(friction_description(one)) if part.weight > 0]
        if len(only) == 1 and drawn.get(only[0].name) == only[0].distribution:
            value = float(one[probability_name(one)])
            found.setdefault(only[0].name, number(value, 2) if 0 < value < 0.001 else share(value, 3))
    return {name: found[name] for name in drawn if name in found}
