"""The prediction beside what is known of patients and from the bench: where they disagree, in numbers."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import xarray as xr

from hipuq.distributions import Distribution, from_description
from hipuq.errors import HipuqError
from hipuq.evidence import LITERATURE
from hipuq.friction import FRICTION
from hipuq.report.block import Block
from hipuq.report.damping import at_damping
from hipuq.report.frequency import between
from hipuq.report.friction import censored, group, onset_quantiles, range_of
from hipuq.report.parts import frequencies
from hipuq.report.reading import Reading, probability_name
from hipuq.report.summary import integrated
from hipuq.report.table import MISSING, Table, factor, number, percent, sentence

TITLE = "Beside the clinic and the bench"

HONEST = (
    "The two are not the same quantity: the model gives the probability of instability under the inputs, "
    "the clinic "
    "the share of patients who heard their hip over years, so that neither confirms the other"
)


def published(reading: Reading, quantity: str) -> xr.Dataset | None:
    """Return what is published of a quantity: ``value``, ``low``, ``high`` over ``source``; or None."""
    if LITERATURE not in reading.tree.children or quantity not in reading.tree[LITERATURE].children:
        return None
    found = reading.tree.children[LITERATURE].children[quantity].to_dataset(inherit=False)
    return found if found.sizes.get("source") else None


def bench(reading: Reading) -> Block:
    """Return the published figures with the prediction beside each.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
        Empty where the results hold no published figures.
    """
    quantities: dict[str, Callable[[Reading, xr.Dataset], list[str]]] = {
        "incidence": _incidence,
        "critical_friction": _critical,
        "squeak_frequency": _frequency,
        "friction": lambda reading, there: [],
    }
    tables, lines = [], []
    for quantity, said in quantities.items():
        there = published(reading, quantity)
        if there is not None:
            lines += said(reading, there)
            tables.append(_table(there, quantity))
    if not tables:
        return Block("bench", TITLE)
    lines = [HONEST, *lines] if reading.results is not None else lines
    incidence = published(reading, "incidence")
    brief = [] if incidence is None else _incidence(reading, incidence, brief=True)
    return Block("bench", TITLE, lines, text=tables, brief=brief)


def _table(there: xr.Dataset, quantity: str) -> Table:
    """Return a row for each source."""
    shown, unit = _units(quantity)
    rows = []
    for i, source in enumerate(there["source"].values):
        value, low, high = (shown(float(there[key][i])) for key in ("value", "low", "high"))
        between = "" if MISSING in (low, high) else f"{low} to {high}"
        reference = str(there["reference"][i].item()) if "reference" in there.coords else ""
        rows.append([str(source), "" if value == MISSING else value, between, reference])
    title = sentence(str(there["value"].attrs.get("long_name", quantity)))
    columns = ["of", f"value{unit}", f"range{unit}", "reference"]
    if not any(row[1] for row in rows):
        columns, rows = [*columns[:1], *columns[2:]], [[row[0], *row[2:]] for row in rows]
    elif not any(row[2] for row in rows):
        columns, rows = [*columns[:2], *columns[3:]], [[*row[:2], *row[3:]] for row in rows]
    return Table(title, columns, rows)


def _units(quantity: str) -> tuple[Callable[[float], str], str]:
    """Return what writes a value of a quantity, and its unit for a heading."""
    if quantity == "incidence":
        return percent, ""
    if quantity == "squeak_frequency":
        return (lambda value: number(value / 1000)), " [kHz]"
    return number, ""


def _ends(there: xr.Dataset) -> tuple[float, float]:
    """Return the lowest and the highest value published of a quantity; of a range without value its ends."""
    value = there["value"].values
    values = np.concatenate([np.where(np.isnan(value), there[key].values, value) for key in ("low", "high")])
    return float(np.nanmin(values)), float(np.nanmax(values))


def _incidence(reading: Reading, there: xr.Dataset, *, brief: bool = False) -> list[str]:
    if reading.results is None:
        return []
    results = reading.results
    value = float(results[probability_name(results)])
    low, high = _ends(there)
    if np.isnan(value):
        return []
    where = f" {words}" if (words := at_damping(results)) and not brief else ""
    told = percent(value) if value >= 0.0005 or value == 0 else f"{number(100 * value, 2)} %"
    text = f"P(squeak) is {told}{where}, the incidence reported {percent(low)} to {percent(high)}: "
    if value > high:
        return [text + f"the model says {factor(value / high)} to {factor(value / low)} times as much"]
    if value == 0:
        return [f"{text}{_at_most(results, low)}"]
    if value < low:
        return [text + f"the model says {factor(low / value)} to {factor(high / value)} times less"]
    return [text + "the model lies within that range, which does not make it right"]


def _at_most(results: xr.Dataset, low: float) -> str:
    """Return what a probability of 0 leaves possible, beside the lowest incidence reported."""
    most = float(results[f"{probability_name(results)}_high"])
    if most <= 0:
        return "the model says that none is unstable"
    told = percent(most) if most >= 0.0005 else f"{number(100 * most, 2)} %"
    text = f"the model says at most {told}"
    if most >= low:
        return f"{text}, which does not tell it from what is reported"
    return f"{text}, that is at least {factor(low / most)} times less"


def _critical(reading: Reading, there: xr.Dataset) -> list[str]:
    low, high = _ends(there)
    measured = f"squeak set in at a friction of {number(low)} to {number(high)} on the bench"
    lines = []
    found = group(reading, "onsets")
    quantiles = None if found is None else onset_quantiles(found[1])
    if found is not None and quantiles is not None:
        lines.append(f"{sentence(measured)}; {_median(float(quantiles[0][1]), found[1], low, high)}")
    friction = friction_of(reading.results)
    if friction is not None and friction.cdf is not None:
        beyond = 1.0 - float(friction.cdf(np.array([low]))[0])
        inputs = f"the friction of the inputs lies at {_support(friction)}"
        if beyond <= 0:
            lines.append(
                f"{sentence(inputs)}, all of it below {number(low)}, the lowest critical friction measured"
            )
        else:
            lines.append(
                f"{sentence(inputs)}; it is above {number(low)}, the lowest critical friction measured, "
                "with a "
                f"probability of {percent(beyond)}"
            )
    return lines


def _median(median: float, onsets: xr.Dataset, low: float, high: float) -> str:
    """Return where the median onset lies beside the lowest and highest friction at which squeak set in."""
    lower, upper = range_of(onsets)
    if censored(median, onsets):
        # Beyond the range nothing was looked at: there is nothing to hold against the bench.
        if np.isfinite(median):
            return f"the median onset of the model is at or below {lower:g}, where the range begins"
        end = f" up to {upper:g}, where the range ends" if np.isfinite(upper) else " within the range"
        return f"half of the configurations of the model have no onset{end}"
    text = f"the median onset of the model, {number(median)}, lies"
    if low <= median <= high:
        return f"{text} within that"
    ratios = sorted((median / low, median / high) if median > high else (low / median, high / median))
    ends = [factor(one) for one in ratios]
    times = ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}"
    return f"{text} {'above' if median > high else 'below'} that by a factor of {times}"


def _support(friction: Distribution) -> str:
    """Return where a distribution lies: its support, or where 98 % of it are."""
    low, high = friction.support
    if np.isfinite([low, high]).all():
        return f"{number(low)} to {number(high)}"
    low, high = map(float, friction.ppf(np.array([0.01, 0.99])))
    return f"{number(low)} to {number(high)} with a probability of 98 %"


def _frequency(reading: Reading, there: xr.Dataset) -> list[str]:
    found = frequencies(reading)
    if found is None:
        return []
    low, high = (found[1][key].values for key in ("frequency_low", "frequency_high"))
    if not np.isfinite(low).any():
        return []
    lowest, highest = float(np.nanmin(low)), float(np.nanmax(high))
    told = []
    for i, source in enumerate(there["source"].values):
        first, last = (float(there[key][i]) for key in ("low", "high"))
        if np.isfinite([first, last]).all() and last > first:
            told.append(f"{_place(lowest, highest, first, last)} ({source})")
    if not told:
        return []
    return [
        f"Unstable modes vibrate at {between(lowest, highest)}: beside squeak on the bench that lies "
        f"{', '.join(told)}"
    ]


def _place(lowest: float, highest: float, first: float, last: float) -> str:
    """Return where a range of frequencies [Hz] lies in a measured one."""
    measured = f"{number(first / 1000)} to {number(last / 1000)} kHz"
    if highest < first or lowest > last:
        return f"{'below' if highest < first else 'above'} {measured}"
    if lowest < first or highest > last:
        return f"partly within {measured}"
    parts = {"lowest": (highest - first) / (last - first), "highest": (last - lowest) / (last - first)}
    end = min(parts, key=lambda key: parts[key])
    if parts[end] > 0.5:
        return f"within {measured}"
    return f"in the {end} {max(1, round(100 * parts[end]))} % of the measured {measured}"


def friction_of(results: xr.Dataset | None) -> Distribution | None:
    """Return the distribution of friction that results were computed with; None without, or if opaque."""
    if results is None:
        return None
    source = integrated(results).get(FRICTION)
    if source is None:
        entry = json.loads(results.attrs.get("inputs") or "{}").get(FRICTION, {})
        source = entry.get("distribution") if entry.get("how") == "absolute" else None
    if source is None:
        return None
    try:
        return from_description(source)
    except (HipuqError, KeyError, TypeError):
        return None
