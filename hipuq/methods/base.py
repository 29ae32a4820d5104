"""What methods share: their record, and designs made by blocks of rows."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import InputError, check_name
from hipuq.inputs import Inputs
from hipuq.intervals import check_confidence
from hipuq.sampling import BLOCK

Array = NDArray[np.float64]

STAGES = ("design", "refine", "estimate", "evaluations")
"""Functions of a method that take options."""


@dataclass(frozen=True)
class Method:
    """A method of analysis.

    Attributes
    ----------
    title : str
        Its name in tables and figures.
    design : callable
        ``(inputs, n, rng, *, rows=None, **options) -> samples``.
    estimate : callable
        ``(outcomes, inputs, *, of, rng=None, **options) -> results``.
    evaluations : callable
        ``(inputs, n, **options) -> int``.
    refine : callable or None
        ``(outcomes, inputs, rng, *, of, **options) -> samples or None``, of a sequential method: what
        else it wants evaluated, None when it has enough.
    """

    title: str
    design: Callable[..., xr.Dataset]
    estimate: Callable[..., xr.Dataset]
    evaluations: Callable[..., int]
    refine: Callable[..., xr.Dataset | None] | None = None

    def options(self, stage: str) -> dict[str, Any]:
        """Return the options of a stage, one of `STAGES`, with their defaults."""
        function = getattr(self, stage)
        if function is None:
            return {}
        signature = inspect.signature(function)
        return {
            name: parameter.default
            for name, parameter in signature.parameters.items()
            if parameter.kind is parameter.KEYWORD_ONLY and name not in ("rows", "of", "rng")
        }

    def check(self, stage: str, options: Mapping[str, Any]) -> None:
        """Check that all options belong to ``"design"`` or ``"estimate"``.

        Raises
        ------
        UnknownNameError
            If one does not.
        """
        for name in options:
            check_name(f"option of the {stage} of {self.title}", name, self.options(stage))

    def split(self, options: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
        """Return the options of each stage; several may take the same one.

        Raises
        ------
        UnknownNameError
            If an option belongs to none.
        InputError
            If a confidence is not one.
        """
        known = {stage: self.options(stage) for stage in STAGES}
        allowed = dict.fromkeys(name for own in known.values() for name in own)
        for name in options:
            check_name(f"option of {self.title}", name, allowed)
        if "confidence" in options:
            check_confidence(options["confidence"])
        return {
            stage: {name: value for name, value in options.items() if name in own}
            for stage, own in known.items()
        }


def rows_of(total: int, rows: slice | None) -> slice:
    """Return `rows` with a start and a stop.

    Raises
    ------
    InputError
        If they are not rows of a design of `total` samples.
    """
    if rows is None:
        return slice(0, total)
    ends = (rows.start, rows.stop) if isinstance(rows, slice) else (rows,)
    if not isinstance(rows, slice) or not all(isinstance(end, (int, type(None))) for end in ends):
        raise InputError(f"rows is {rows!r}: it must be a slice of integers, such as slice(0, 100)")
    start = 0 if rows.start is None else rows.start
    stop = total if rows.stop is None else rows.stop
    if rows.step not in (None, 1) or not 0 <= start < stop <= total:
        raise InputError(f"rows is {rows}: it must be a slice without a step inside 0 to {total}")
    return slice(start, stop)


def samples_by_block(inputs: Inputs, points: Callable[[slice], Array], rows: slice, total: int) -> xr.Dataset:
    """Return rows of a design, mapped to physical values in fixed blocks.

    Quantile functions that iterate to convergence may stop differently in another company, so each
    block is always mapped whole.

    Parameters
    ----------
    inputs : Inputs
    points : callable
        Rows -> points of the unit cube, (rows, dimension).
    rows : slice
        The rows wanted.
    total : int
        Rows of the whole design.

    Returns
    -------
    Dataset
        Over ``sample``, numbered by row.
    """
    parts = []
    for start in range(rows.start // BLOCK * BLOCK, rows.stop, BLOCK):
        stop = min(start + BLOCK, total)
        # The numbers keep the dim where a stratum leaves no other input.
        part = inputs.samples(points(slice(start, stop))).assign_coords(sample=np.arange(start, stop))
        parts.append(part.isel(sample=slice(max(rows.start - start, 0), rows.stop - start)))
    whole = parts[0] if len(parts) == 1 else xr.concat(parts, "sample", data_vars="all", join="exact")
    numbers = np.arange(rows.start, rows.stop)
    return whole.assign_coords(sample=("sample", numbers, schema.COORDINATES["sample"].attrs))
