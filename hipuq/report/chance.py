"""Whether contact patterns differ by more than chance gives: chi-square tests of homogeneity, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import stats

from hipuq import schema
from hipuq.report.table import listed, number

Array = NDArray[np.float64]

VERDICTS = ("any_unstable", "unstable")
"""Outcomes that are 0 or 1, so that counts of them can be tested."""

LEVEL = 0.05
"""Level of the tests, of all groups together."""


MOST = 6
"""Groups that are named in a caption at most."""


@dataclass(frozen=True)
class Tested:
    """The test of the patterns with one number in contact.

    Attributes
    ----------
    count : int
        Number in contact.
    patterns : int
    statistic : float
        Chi-square.
    mean, variance : float
        Of the statistic where all patterns have one probability, given how many are unstable in all.
    mode : int
        The mode that it is of; 0 of any.
    """

    count: int
    patterns: int
    statistic: float
    mean: float
    variance: float
    mode: int = 0

    @property
    def p(self) -> float:
        """Probability of such a statistic, or a larger one, by chance alone."""
        return chance_of(self.statistic, self.mean, self.variance)


def chance_of(statistic: float, mean: float, variance: float) -> float:
    """Return the probability of a larger chi-square, by the gamma distribution with its mean and variance.

    Where many are expected in each cell that is the chi-square distribution.
    """
    return float(stats.gamma.sf(statistic, mean**2 / variance, scale=variance / mean))


def homogeneity(hits: Array, known: Array) -> tuple[float, float, float] | None:
    """Return chi-square of hits among known, with its mean and variance if all have one probability.

    Parameters
    ----------
    hits, known : (k,) array
        Counts, those of a pattern in each place.

    Returns
    -------
    tuple of float or None
        None where there are not two patterns, or nothing or everything is a hit: there is no test.

    Notes
    -----
    Mean and variance are those given both margins of the 2 x k table (J. H. Dawson, Biometrika 41 (1954)
    280), so that few expected hits in a pattern, which make chi-square scatter otherwise, are allowed for.
    """
    asked = known > 0
    hits, known = hits[asked], known[asked]
    total, k = float(known.sum()), known.size
    rows = np.array([hits.sum(), total - hits.sum()])
    if k < 2 or (rows < 0.5).any() or total <= 3:
        return None
    share = rows[0] / total
    statistic = float(((hits - known * share) ** 2 / (known * share * (1 - share))).sum())
    spread = []
    for margin in (rows, known):
        size = margin.size
        odd = float((total * (1 / margin).sum() - size**2) / (total - 2))
        spread.append(((total - size) * (size - 1) / (total - 1) - odd, odd))
    (v1, w1), (v2, w2) = spread
    variance = 2 * total / (total - 3) * v1 * v2 + total**2 / (total - 1) * w1 * w2
    return (statistic, total / (total - 1) * (k - 1), variance) if variance > 0 else None


def tested(results: xr.Dataset) -> list[Tested]:
    """Return the tests of results, one for each number in contact, and for each mode where there are modes.

    Parameters
    ----------
    results : Dataset

    Returns
    -------
    list of Tested
        None of exact results, of others than verdicts, or of those that are not stratified by contact.
    """
    needed = {"probability", "known", "in_contact"}
    if (
        schema.is_exact(results)
        or results.attrs.get("of") not in VERDICTS
        or not needed <= {*results.variables}
    ):
        return []
    dims = set(results["probability"].dims)
    if dims - {"mode"} != {"pattern"}:
        return []
    modes = [int(mode) for mode in results["mode"].values] if "mode" in dims else [0]
    made = []
    for mode in modes:
        own = results[["probability", "known"]]
        own = own.sel(mode=mode) if mode else own
        known = own["known"].values.astype(np.float64)
        hits = np.nan_to_num(own["probability"].values) * known
        for count in np.unique(results["in_contact"].values):
            there = results["in_contact"].values == count
            found = homogeneity(hits[there], known[there])
            if found is not None:
                made.append(Tested(int(count), int(there.sum()), *found, mode=mode))
    return made


def apart(tests: Sequence[Tested]) -> list[Tested]:
    """Return the tests that differ by more than chance gives, at `LEVEL` of all together (Bonferroni)."""
    return [one for one in tests if one.p * len(tests) < LEVEL]


def together(tests: Sequence[Tested]) -> float:
    """Return the probability by chance of the sum of the statistics, of groups apart from each other."""
    parts = np.array([(one.statistic, one.mean, one.variance) for one in tests])
    return chance_of(*map(float, parts.sum(axis=0)))


def in_words(tests: Sequence[Tested]) -> str:
    """Return in a sentence whether patterns of the same number differ; empty without a test.

    Parameters
    ----------
    tests : sequence of Tested
        Of any mode, one for each number in contact.
    """
    if not tests:
        return ""
    found, whole = apart(tests), together(tests)
    if not found and whole >= LEVEL:
        return (
            f"Between the {_groups(tests)} the differences are no larger than chance gives "
            f"(chi-square test, p = {number(whole, 2)}): minimum and maximum are mostly sampling"
        )
    larger = found or list(tests)
    p = together(larger)
    said = "p < 0.001" if p < 0.001 else f"p = {number(p, 2)}"
    text = f"Between the {_groups(larger)} the differences are larger than chance gives"
    text += f" (chi-square test, {said})"
    rest = [one for one in tests if one not in larger]
    return f"{text}; between the {_groups(rest)} they are not" if rest else text


def in_short(tests: Sequence[Tested]) -> str:
    """Return what `in_words` says, where there is little room."""
    if not tests:
        return ""
    found, whole = apart(tests), together(tests)
    if found or whole < LEVEL:
        few = f"Patterns of {listed(str(one.count) for one in found)}" if found else "Patterns of a number"
        return f"{few} differ by more than chance gives (chi-square test)"
    return f"Patterns of a number differ no more than by chance (chi-square test, p = {number(whole, 2)})"


def caption(tests: Sequence[Tested]) -> str:
    """Return what a caption adds on whether the patterns differ by more than chance; nothing if all do."""
    found = apart(tests)
    single = len({one.mode for one in tests}) == 1
    if not tests or (single and not found and together(tests) < LEVEL) or len(found) == len(tests):
        return ""
    if found:
        names = [f"{one.count} in contact{f', mode {one.mode}' if one.mode else ''}" for one in found[:MOST]]
        names += [f"{len(found) - MOST} more"] if len(found) > MOST else []
        return (
            " Between patterns of the same number the differences are larger than chance gives only of "
            f"{'; '.join(names)} ({len(found)} of {len(tests)} chi-square tests, together at 5 %)."
        )
    return (
        " Beware: between patterns of the same number the differences are no larger than chance gives "
        "(chi-square tests at 5 %)."
    )


def _groups(tests: Sequence[Tested]) -> str:
    """Return how many patterns each number in contact has, such as ``84 patterns of 6 and the 36 of 7``."""
    return listed(
        f"{'' if i == 0 else 'the '}{one.patterns} {'patterns ' if i == 0 else ''}of {one.count}"
        for i, one in enumerate(tests)
    )
