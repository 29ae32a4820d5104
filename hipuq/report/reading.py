"""A results tree as a report reads it: sweeps at one value of each parameter, and one analysis on top."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from hipuq.friction import FRICTION, OF_ANY_MODE
from hipuq.report.partners import case_of, groups_of
from hipuq.sweeping import at, swept

DAMPING = "damping_ratio"

Groups = Mapping[str, xr.Dataset]


@dataclass(frozen=True)
class Assumed:
    """The value of a swept parameter that results are read at.

    Attributes
    ----------
    value : float
    why : str
        Why this one, such as ``"the model's nominal value"``.
    """

    value: float
    why: str


class Reading:
    """What a report reads of a results tree.

    Attributes
    ----------
    tree : DataTree
    report : dict
        The table ``[report]`` of the study; empty in files that have none.
    whole : dict
        Analysis -> name of a group -> its Dataset as it is stored.
    assumed : dict
        Analysis -> parameter that it is swept over -> the value that it is read at.
    found : dict
        As `whole`, at those values.
    """

    def __init__(self, tree: xr.DataTree) -> None:
        self.tree = tree
        self.report: dict[str, Any] = json.loads(tree.attrs.get("report") or "{}")
        self.whole = groups_of(tree)
        wanted = self.report.get(DAMPING)
        self.assumed = {name: _assumed(groups, wanted) for name, groups in self.whole.items()}
        self.found: dict[str, dict[str, xr.Dataset]] = {
            name: {key: _settled(one, self.assumed[name]) for key, one in groups.items()}
            for name, groups in self.whole.items()
        }

    @cached_property
    def mode_names(self) -> dict[str, str]:
        """Mode -> its name in a publication."""
        return dict(self.report.get("mode_names", {}))

    @cached_property
    def analysis(self) -> str | None:
        """The analysis whose probability is the headline; None where no analysis has one.

        ``[report] headline`` if it has one, else the first; unless asked for, none that is over more than
        damping: its probability is that at one friction, say.
        """
        some = [name for name in self.found if self.squeak(name) is not None]
        for named in (self.report.get("headline"), self.tree.attrs.get("headline")):
            if named in some:
                return str(named)
        return next((name for name in some if not self.at_one(name)), None)

    @property
    def results(self) -> xr.Dataset | None:
        """The results that the headline is of."""
        return None if self.analysis is None else self.squeak(self.analysis)

    def squeak(self, analysis: str) -> xr.Dataset | None:
        """Return the results of an analysis that hold one probability of any unstable mode."""
        for of in OF_ANY_MODE:
            results = self.found[analysis].get(of)
            if results is not None and "of" in results.attrs and probability_name(results):
                return results
        return None

    @cached_property
    def ranked(self) -> list[str]:
        """The analyses: that of the headline, those of the same inputs and damping, the others."""
        head = self.results
        case = None if head is None else case_of(head)
        kin = {
            name
            for name, groups in self.found.items()
            if any("of" in one.attrs and case_of(one) == case for one in groups.values())
        }
        return sorted(self.found, key=lambda name: (name != self.analysis, name not in kin))

    def at_one(self, analysis: str) -> str:
        """Return the parameter besides damping at one value of which alone an analysis is read; or nothing.

        Its probability is then none of the inputs as a whole.
        """
        return next((name for name in self.assumed[analysis] if name != DAMPING), "")

    def apart(self, analysis: str) -> bool:
        """Say whether an analysis over damping is read at another damping than that of the headline.

        What it gives there is then no other result for the same question.
        """
        head = self.results
        if head is None or DAMPING not in self.assumed[analysis]:
            return False
        own = head.coords[DAMPING].item() if DAMPING in head.coords else nominal_of(head).get(DAMPING)
        drawn = DAMPING in json.loads(head.attrs.get("inputs") or "{}")
        value = self.assumed[analysis][DAMPING].value
        return drawn or not isinstance(own, float | int) or not bool(np.isclose(own, value, 1e-9, 1e-15))

    def alike(self, analysis: str, key: str) -> str | None:
        """Return the analysis before this one with an identical group, such as the sweep over friction."""
        own = self.found[analysis][key]
        for name, groups in self.found.items():
            if name == analysis:
                return None
            if key in groups and groups[key].equals(own):
                return name
        return None

    def swept_over(self, parameter: str) -> dict[str, xr.Dataset]:
        """Return the probabilities over a parameter, analysis -> results over it alone, as `ranked`.

        An analysis over friction too tells those over another parameter at one friction alone: not here.
        """
        made = {}
        for name in self.ranked:
            one = self.squeak(name)
            elsewhere = FRICTION in self.assumed[name] and parameter != FRICTION
            if one is not None and parameter in self.assumed[name] and not elsewhere:
                rest = {key: kept for key, kept in self.assumed[name].items() if key != parameter}
                made[name] = _settled(self.whole[name][str(one.attrs["of"])], rest)
        return made


def probability_name(results: xr.Dataset) -> str:
    """Return the name of the one probability of results, that over all levels first; or nothing."""
    names = ("probability_overall", "probability")
    return next((name for name in names if name in results and not results[name].ndim), "")


def nominal_of(results: xr.Dataset) -> dict[str, Any]:
    """Return the nominal values that the model had; none where its options do not tell."""
    model = model_options(results)
    nominal = model.get("nominal")
    return dict(nominal) if isinstance(nominal, dict) else {}


def model_options(results: xr.Dataset) -> dict[str, Any]:
    """Return the options of the model; none of a function that has none."""
    model = json.loads(results.attrs.get("options") or "{}").get("model")
    return model if isinstance(model, dict) else {}


def _assumed(groups: Groups, damping: float | None) -> dict[str, Assumed]:
    """Return where an analysis is read: as asked, else at the nominal value, else at the first."""
    first = next((one for one in groups.values() if "of" in one.attrs and swept(one)), None)
    if first is None:
        return {}
    nominal = nominal_of(first)
    made = {}
    for name in swept(first):
        values = first[name].values
        asked = {"the one that the study asks for": damping if name == DAMPING else None}
        choices = asked | {"the nominal value of the model": nominal.get(name)}
        made[name] = Assumed(float(values[0]), "the first value of the sweep")
        for why, value in choices.items():
            if isinstance(value, float | int) and np.isclose(values, value, rtol=1e-9, atol=1e-15).any():
                made[name] = Assumed(float(value), why)
                break
    return made


def _settled(dataset: xr.Dataset, assumed: Mapping[str, Assumed]) -> xr.Dataset:
    """Return a Dataset at the values of the parameters that it is over."""
    for name, one in assumed.items():
        if name in swept(dataset):
            dataset = at(dataset, **{name: one.value})
        elif name in dataset.dims and "of" not in dataset.attrs:
            dataset = dataset.sel({name: one.value}, method="nearest")
    return dataset
