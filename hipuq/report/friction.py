"""What friction does: the fragility curve, the onsets, and the friction that keeps squeak rare enough."""

from __future__ import annotations

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.fragility_curve import weights_of
from hipuq.friction import FRICTION
from hipuq.friction_limits import rounded_down as rounded_down
from hipuq.report.block import Block
from hipuq.report.parts import origin
from hipuq.report.reading import Reading
from hipuq.report.table import Table, number, plain, sentence, significant

FRAGILITY_TITLE = "Fragility: P(squeak) at each friction, and the onsets"

LIMIT_TITLE = "Friction limit that keeps P(squeak) below a target"

NONE, WHOLE, UNKNOWN = "none", "the whole range", "not known"
"""What stands for a target that is exceeded from the start of the range, one that never is, and no answer."""

WAY_OUT = "an analysis with integrate_friction = true, or one swept over friction,"


def curve(reading: Reading) -> tuple[str, xr.Dataset] | None:
    """Return the analysis with a fragility curve, and the curve: its own group, or a sweep over friction."""
    for name in reading.ranked:
        if "fragility" in reading.found[name]:
            return name, reading.found[name]["fragility"]
        if FRICTION in reading.assumed[name]:
            over = reading.swept_over(FRICTION)
            if name in over:
                one = over[name]
                if "probability_overall" in one:
                    ends = ("", "_low", "_high")
                    kept = {f"probability{end}": one[f"probability_overall{end}"] for end in ends}
                    one = xr.Dataset(kept, attrs=one.attrs)
                return name, one
    return None


def group(reading: Reading, key: str) -> tuple[str, xr.Dataset] | None:
    """Return the first analysis, that of the headline before all, with a group, and the group."""
    name = next((name for name in reading.ranked if key in reading.found[name]), None)
    return None if name is None else (name, reading.found[name][key])


def fragility_block(reading: Reading) -> Block:
    """Return what is said beside the fragility curve and the distribution of onsets.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
        Its figures are elsewhere; without a curve a sentence says what would give it.
    """
    found, onsets = curve(reading), group(reading, "onsets")
    if found is None and onsets is None:
        line = f"The fragility curve and the onsets need {WAY_OUT} of whose outcomes these results hold none"
        return Block("fragility", FRAGILITY_TITLE, [line] if reading.results is not None else [])
    analysis = found[0] if found is not None else onsets[0] if onsets is not None else ""
    lines = []
    if found is not None:
        lines += origin(reading, *found)
        lines += _at_ends(found[1])
    if onsets is not None:
        lines += [] if onsets[0] == analysis else origin(reading, *onsets)
        lines += onset_words(onsets[1])
    return Block("fragility", FRAGILITY_TITLE, lines)


def _at_ends(fragility: xr.Dataset) -> list[str]:
    """Return the probability at the ends of the curve, in a sentence."""
    values, friction = fragility["probability"].values, fragility["friction"].values
    if not np.isfinite(values).any() or len(values) < 2:
        return ["The probability is not known at any friction"] if not np.isfinite(values).any() else []
    told = [f"{plain(float(values[i]))} at a friction of {friction[i]:.4g}" for i in (0, -1)]
    half = np.flatnonzero(values >= 0.5)
    text = f"P(squeak) is {told[0]} and {told[1]}"
    if half.size and half[0] > 0:
        text += f"; it reaches one half between {friction[half[0] - 1]:.4g} and {friction[half[0]]:.4g}"
    return [text]


def onset_words(onsets: xr.Dataset) -> list[str]:
    """Return the quantiles of the onset and how many have none, in sentences."""
    found = onset_quantiles(onsets)
    if found is None:
        return ["No configuration has a known onset"]
    quantiles, never, unknown = found
    lines = []
    if np.isfinite(quantiles).any():
        low, median, high = (placed(float(one), onsets) for one in quantiles)
        lines.append(
            "The onset is the friction from which on a configuration is unstable: its 5 % quantile is "
            f"{low}, its median {median}, its 95 % quantile {high}"
        )
    lower, upper = range_of(onsets)
    start = float(weights_of(onsets)[onsets["onset"].values <= lower].sum())
    if start:
        lines.append(
            f"{100 * start:.3g} % of the configurations are unstable from the start of the range, {lower:g}: "
            "their onset is there or lower"
        )
    if never:
        till = f" up to a friction of {upper:g}, where it ends" if np.isfinite(upper) else ""
        lines.append(f"{100 * never:.3g} % of the configurations are stable over the whole range{till}")
    if unknown:
        lines.append(f"The onset of {100 * unknown:.3g} % of the configurations is not known")
    return lines


def range_of(onsets: xr.Dataset) -> tuple[float, float]:
    """Return the range of friction in which onsets were looked for; infinite where it is not told."""
    found = onsets["onset"].attrs.get("range")
    return (-np.inf, np.inf) if found is None else (float(found[0]), float(found[1]))


def censored(onset: float, onsets: xr.Dataset) -> bool:
    """Say whether an onset is where the range begins, or beyond where it ends: it is then no onset."""
    return not np.isfinite(onset) or onset <= range_of(onsets)[0]


def placed(onset: float, onsets: xr.Dataset) -> str:
    """Return an onset as text: at the start and beyond the end of the range it says so."""
    lower, upper = range_of(onsets)
    if not np.isfinite(onset):
        return f"beyond {upper:g}, where the range ends" if np.isfinite(upper) else "beyond the range"
    return f"at or below {lower:g}" if onset <= lower else number(onset)


def onset_quantiles(onsets: xr.Dataset) -> tuple[np.ndarray, float, float] | None:
    """Return the 5, 50 and 95 % quantiles of the known onsets, what has none, what is unknown.

    Returns
    -------
    quantiles : (3,) array
        Infinite where the range of friction ends before; see `censored`.
    never, unknown : float
        Shares of the weight.
    """
    onset = onsets["onset"].values.astype(np.float64)
    weight = weights_of(onsets)
    known = ~np.isnan(onset)
    if not known.any():
        return None
    order = np.argsort(onset[known], kind="stable")
    reached = np.cumsum(weight[known][order]) / weight[known].sum()
    place = np.minimum(np.searchsorted(reached, np.array([0.05, 0.5, 0.95]) - 1e-12), len(order) - 1)
    return onset[known][order][place], float(weight[onset == np.inf].sum()), float(weight[~known].sum())


def limit_block(reading: Reading) -> Block:
    """Return the friction limits for each target.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    Block
        Without them a sentence that says what would give them.
    """
    found = group(reading, "friction_limit")
    if found is None:
        line = f"The friction limits need {WAY_OUT} of whose outcomes these results hold none"
        return Block("limit", LIMIT_TITLE, [line] if reading.results is not None else [])
    analysis, limits = found
    rows, said = [], limit_words(reading, analysis, limits)
    for i, target in enumerate(limits["target"].values):
        value, low, high = (float(limits[f"friction_limit{end}"][i]) for end in ("", "_low", "_high"))
        row = [f"{100 * float(target):g} %", _limit(value)]
        if not schema.is_exact(limits):
            row.append(f"{_limit(low)} to {_limit(high)}" if _limit(low) != _limit(high) else _limit(low))
        rows.append(row)
    level = f"{100 * float(limits.attrs.get('confidence', np.nan)):g} % interval"
    columns = ["target for P(squeak)", "friction limit", *([level] if not schema.is_exact(limits) else [])]
    ends = limits["friction_limit"].attrs.get("range")
    note = "" if ends is None else f"Friction was looked at from {float(ends[0]):g} to {float(ends[1]):g}. "
    note += f"{sentence(NONE)}: the target is exceeded from the start; {WHOLE}: it is kept to the end"
    lines = first = origin(reading, analysis, limits)
    lines = [*first, *said]
    brief_columns = ["target", *(row[0] for row in rows)]
    brief = Table(
        "", brief_columns, [[columns[k], *(row[k] for row in rows)] for k in range(1, len(columns))]
    )
    table = Table("Friction up to which P(squeak) stays at or below a target", columns, rows, note)
    return Block("limit", LIMIT_TITLE, lines, [table], brief=[brief, *first])


def limit_words(reading: Reading, analysis: str, limits: xr.Dataset) -> list[str]:
    """Return in sentences up to which friction each target is kept to, as far as that can be promised.

    Parameters
    ----------
    reading : Reading
    analysis : str
    limits : Dataset
        As from `hipuq.friction_limit`. Of sampled ones the lower limit is told first: the estimate is
        missed by half of all samples.
    """
    ends = limits["friction_limit"].attrs.get("range")
    end = "" if ends is None else f", {float(ends[1]):g},"
    exact = schema.is_exact(limits)
    kept, lines = [], []
    for i, target in enumerate(limits["target"].values):
        share_ = f"{100 * float(target):g} %"
        value, low = (float(limits[f"friction_limit{part}"][i]) for part in ("", "_low"))
        if np.isnan(value):
            lines.append(f"Whether a target of {share_} is kept at any friction is not known")
        elif np.isneginf(value):
            lines.append(f"A target of {share_} is exceeded from the start of the range")
        elif np.isneginf(low):
            onsets = reading.found[analysis].get("onsets")
            count = "" if onsets is None else f" ({onsets.sizes['sample']:,})"
            lines.append(
                f"Too few configurations{count} for a target of {share_}: no friction can be promised "
                f"(estimate {_limit(value)})"
            )
        else:
            up = f"the end of the range{end}" if np.isinf(low) else f"a friction of {_limit(low)}"
            estimate = "" if exact or np.isinf(low) else f" (estimate {_limit(value)})"
            kept.append(f"up to {up} at most {share_}{estimate}")
    if kept:
        level = 100 * float(limits.attrs.get("confidence", np.nan))
        sure = "" if exact else f"With {level:g} % confidence (two-sided interval): "
        lines.insert(0, sentence(f"{sure}{'; '.join(kept)} of the configurations are unstable"))
    return lines


def _limit(value: float) -> str:
    """Return a friction limit as text, rounded down: infinities and NaN in words."""
    if np.isinf(value):
        return WHOLE if value > 0 else NONE
    return UNKNOWN if np.isnan(value) else significant(rounded_down(value), 4)
