"""A surrogate held against true values that it has not seen."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq.estimation.results import Kind, kind_of
from hipuq.inputs import Inputs
from hipuq.surrogates.limit_state import LimitState, Strata, sample_strata
from hipuq.surrogates.surrogate import Surrogate

Array = NDArray[np.float64]
Triple = tuple[Array, Array, Array]

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
"""Quantiles that are told."""

VALUES_MAXIMUM = 2**22
"""Most predictions held at a time."""

Q2_LEAST = 0.9
"""Share of the variance that a surrogate to be trusted explains on held-out samples."""

MISCLASSIFIED_MOST = 0.05
"""Share of held-out samples that a surrogate to be trusted may misclassify."""

HELD_OUT_LEAST = 20
"""Known held-out samples that a check takes."""

DIFFERENT_LEAST = 5
"""Held-out samples that differ from the commonest value: with fewer the outcome is as good as constant."""

UNKNOWN_MOST = 0.01
"""Share of the samples to fit that may be unknown."""


@dataclass(frozen=True)
class Events:
    """What is known of an event.

    Attributes
    ----------
    name : str
        What the event is.
    by_level : (levels, outputs) array
        Its probability by the surrogate alone.
    overall : (outputs,) array
        The same over all levels.
    misclassified : three (outputs,) arrays
        Share of held-out samples with another verdict than the true one, and its limits.
    corrected : three (outputs,) arrays
        The probability from true evaluations, and its limits.
    """

    name: str
    by_level: Array
    overall: Array
    misclassified: Triple
    corrected: Triple


@dataclass(frozen=True)
class Check:
    """A surrogate and the true values that it is held against.

    Attributes
    ----------
    surrogate : Surrogate
    inputs : Inputs
        All inputs.
    outcomes : Dataset
        Samples with the coords ``round``, ``stratum`` and ``stratum_weight``.
    values : DataArray
        The outcome, ``sample`` first.
    y : (s, outputs) array
        The same, flat.
    state : LimitState or None
    population : int
        Points at which the surrogate is evaluated.
    seed : int
    confidence : float
    """

    surrogate: Surrogate
    inputs: Inputs
    outcomes: xr.Dataset
    values: xr.DataArray
    y: Array
    state: LimitState | None
    population: int
    seed: int
    confidence: float

    levels = QUANTILES

    @cached_property
    def kind(self) -> Kind:
        """What the outcome is."""
        return kind_of(self.values)

    @cached_property
    def held(self) -> NDArray[np.bool_]:
        """Which samples are held out, (s,)."""
        first = self.outcomes["round"].values == 0
        return np.asarray(first & (self.outcomes["stratum"].values >= 0))

    @cached_property
    def true(self) -> Array:
        """Values of the held-out samples, (h, outputs)."""
        return self.y[self.held]

    @cached_property
    def predicted(self) -> Array:
        """Predictions at the held-out samples, (h, outputs)."""
        return self.surrogate.at(self.outcomes.isel(sample=self.held), self.inputs)

    @cached_property
    def strata(self) -> Strata:
        """The strata that the held-out samples were drawn in."""
        return sample_strata(self.outcomes, self.held)

    @cached_property
    def everywhere(self) -> Array:
        """Predictions at points of the continuous inputs, (points, levels, outputs)."""
        size = self.population
        while size > 1024 and size * self.surrogate.loo.size > VALUES_MAXIMUM:
            size //= 2
        return self.surrogate.everywhere(size, self.seed)

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which levels have any weight, (levels,): what is unknown of the others does not count."""
        return self.surrogate.expansion.weight > 0

    @cached_property
    def q2(self) -> Array:
        """Share of the variance explained on held-out samples, (outputs,); NaN where they do not vary."""
        mean = self.strata.mean([self.true] * 3, self.confidence)[0]
        error = self.strata.mean([np.square(self.true - self.predicted)] * 3, self.confidence)[0]
        spread = self.strata.mean([np.square(self.true - mean)] * 3, self.confidence)[0]
        varies = spread > np.square(64 * np.finfo(np.float64).eps * np.abs(mean))
        return 1 - np.divide(error, spread, out=np.full_like(error, np.nan), where=varies)

    @cached_property
    def mean(self) -> Triple:
        """The surrogate's mean plus the mean residual of held-out samples, with limits, (outputs,).

        The surrogate is a control variate: its own mean is known from the coefficients.
        """
        low, high = self._bounds()
        residuals = [part[self.held] - self.predicted for part in (self.y, low, high)]
        own = self.surrogate.expansion.mean_overall()
        found = [own + part for part in self.strata.mean(residuals, self.confidence)]
        middle, below, above = (np.clip(part, 0.0, 1.0) if self.kind.bounded else part for part in found)
        return middle, below, above

    def _bounds(self) -> tuple[Array, Array]:
        """Return the bounds of each value: its own, or 0 and 1 where it is an unknown probability."""
        names = [f"{self.values.name}_{end}" for end in ("low", "high")]
        if all(name in self.outcomes for name in names):
            low, high = (self.outcomes[name].transpose(*self.values.dims).values for name in names)
            return low.reshape(self.y.shape).astype(np.float64), high.reshape(self.y.shape).astype(np.float64)
        if not self.kind.bounded:
            return self.y, self.y
        unknown = np.isnan(self.y)
        return np.where(unknown, 0.0, self.y), np.where(unknown, 1.0, self.y)

    @cached_property
    def quantiles(self) -> Array:
        """Quantiles of the surrogate, (quantiles, outputs)."""
        values = self.everywhere[:, self.used]
        points, levels, outputs = values.shape
        weights = np.broadcast_to(self.surrogate.expansion.weight[self.used], (points, levels)).ravel()
        found = np.full((len(QUANTILES), outputs), np.nan)
        for k in range(outputs):
            part = values[:, :, k].ravel()
            if not np.isnan(part).any():
                found[:, k] = np.quantile(part, QUANTILES, weights=weights, method="inverted_cdf")
        return found

    @cached_property
    def events(self) -> Events | None:
        """What is known of the event, None where the outcome has no limit state."""
        if self.state is None:
            return None
        state = self.state
        distance = state.distance(self.everywhere)
        by_level = np.where(np.isnan(distance).any(axis=0), np.nan, (distance < 0).mean(axis=0))
        overall = (self.surrogate.expansion.weight[:, None] * by_level)[self.used].sum(axis=0)
        true, said = state.event(self.true), state.event(self.predicted)
        wrong = np.where(np.isnan(true) | np.isnan(said), np.nan, (true != said).astype(np.float64))
        name = str(self.values.attrs.get("long_name", self.values.name))
        if not self.kind.bounded:
            name += f" below {state.limit:g}"
        return Events(
            name, by_level, overall, self.strata.share(wrong, self.confidence), self._corrected(said, overall)
        )

    def _corrected(self, said: Array, overall: Array) -> Triple:
        """Return the probability of the event from true evaluations.

        From those of the correction, where there are any; else from the held-out samples, stratified by
        what the surrogate says of them.
        """
        assert self.state is not None
        rows = self.outcomes["round"].values > 0
        if rows.any():
            strata = sample_strata(self.outcomes, rows, self._draws())
            return strata.share(self.state.event(self.y[rows]), self.confidence)
        true = self.state.event(self.true)
        plain = self.strata.share(true, self.confidence)
        if len(self.strata.weight) != 1:
            return plain
        columns = []
        for k in range(true.shape[1]):
            place, p = said[:, k] == 1, overall[k]
            known = ~np.isnan(true[:, k])
            counts = [(known & (place == side)).sum() for side in (False, True)]
            if np.isnan(p) or min(counts) == 0:
                columns.append([part[k] for part in plain])
                continue
            both = Strata(place.astype(np.intp), np.array([1 - p, p]), self._independent(k, p))
            columns.append([part[0] for part in both.share(true[:, k : k + 1], self.confidence)])
        middle, low, high = np.array(columns).T
        return middle, low, high

    def _independent(self, k: int, p: float) -> float:
        """Return the number of independent draws that tell the surrogate's own share p as well as its points.

        A point is one draw of the continuous inputs for all levels together.
        """
        assert self.state is not None
        event = self.state.distance(self.everywhere[:, self.used, k]) < 0
        by_point = event @ self.surrogate.expansion.weight[self.used]
        variance = float(by_point.var()) / len(by_point)
        return p * (1 - p) / variance if variance > 0 else np.inf

    def _draws(self) -> float:
        """Return the number of points that the weights of the strata were found from."""
        refine = json.loads(self.outcomes.attrs.get("options") or "{}").get("refine", {})
        return float(refine.get("population", self.population))

    def undefined(self, output: int) -> str:
        """Return why indices of an output are undefined, empty where they are not."""
        expansion = self.surrogate.expansion
        if np.isnan(expansion.mean_overall()[output]):
            where = " of some level" if self.surrogate.discrete else ""
            return f"too few samples{where} have a known outcome"
        fitted = self.y[self.outcomes["stratum"].values < 0, output]
        if np.nanmax(fitted) == np.nanmin(fitted):
            return "the outcome does not vary in the samples"
        no_better = self.q2[output] <= 0 or self.surrogate.loo_overall[output] >= 1
        # Means of levels differ by chance too: without a polynomial that is no cause.
        if no_better or not expansion.variance_overall()[output] > 0:
            return "no polynomial predicts the outcome better than its mean; more samples may help"
        return ""

    @cached_property
    def reasons(self) -> list[list[str]]:
        """Why each output is not to be trusted; empty where it is."""
        return [self._reasons(k) for k in range(self.y.shape[1])]

    def _reasons(self, k: int) -> list[str]:
        reasons = []
        fitted = self.outcomes["stratum"].values < 0
        unknown = float(np.isnan(self.y[fitted, k]).mean())
        if unknown > UNKNOWN_MOST:
            reasons.append(f"{unknown:.1%} of the samples to fit are unknown")
        known = int((~np.isnan(self.true[:, k])).sum())
        if known < HELD_OUT_LEAST:
            reasons.append(
                f"{known} held-out samples are too few to check the fit, {HELD_OUT_LEAST} are needed"
            )
        q2 = self.q2[k]
        if np.isnan(q2):
            reasons.append("the outcome does not vary in the held-out samples")
        elif q2 <= 0:
            reasons.append(f"the surrogate predicts held-out samples no better than their mean (Q2 {q2:.2f})")
        elif q2 < Q2_LEAST:
            reasons.append(
                f"the surrogate explains {q2:.0%} of the variance of held-out samples, below {Q2_LEAST:.0%}"
            )
        true = self.true[~np.isnan(self.true[:, k]), k]
        same = int(np.unique(true, return_counts=True)[1].max(initial=0))
        if known >= HELD_OUT_LEAST and known - same < DIFFERENT_LEAST:
            reasons.append(
                f"only {known - same} of {known} held-out samples differ from the commonest value, "
                "so neither the fit nor the limits of the mean can be judged"
            )
        if self.events is not None:
            wrong = self.events.misclassified[0][k]
            if wrong > MISCLASSIFIED_MOST:
                reasons.append(f"{wrong:.1%} of the held-out samples are misclassified")
            alone, (_, low, high) = self.events.overall[k], (part[k] for part in self.events.corrected)
            if alone < low or alone > high:
                interval = f"{low:.4f} to {high:.4f}"
                reasons.append(f"its own probability {alone:.4f} lies outside the corrected {interval}")
        return reasons
