"""What methods share: their record."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import xarray as xr

from hipuq.errors import check_name
from hipuq.inputs import Inputs
from hipuq.intervals import check_confidence

STAGES = ("design", "refine", "estimate", "evaluations", "validate")
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
    validate : callable or None
        ``(inputs, n, *, of, **options)``, where `of` names all outcomes to analyse: raises for options that
        could not be used, before anything is evaluated.
    """

    title: str
    design: Callable[..., xr.Dataset]
    estimate: Callable[..., xr.Dataset]
    evaluations: Callable[..., int]
    refine: Callable[..., xr.Dataset | None] | None = None
    validate: Callable[..., None] | None = None

    def options(self, stage: str) -> dict[str, Any]:
        """Return the options of a stage with their defaults.

        Parameters
        ----------
        stage : str
            One of `STAGES`.

        Returns
        -------
        dict
            Name of an option -> its default; empty if the method has no such stage.
        """
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
        """Check that all options belong to a stage.

        Parameters
        ----------
        stage : str
            One of `STAGES`, such as ``"design"``.
        options : mapping
            Options by name.

        Raises
        ------
        UnknownNameError
            If one does not.
        """
        for name in options:
            check_name(f"option of the {stage} of {self.title}", name, self.options(stage))

    def plan(self, inputs: Inputs, n: int, of: Sequence[str], stages: Mapping[str, Mapping[str, Any]]) -> int:
        """Return the number of model runs of an analysis that can be made.

        Parameters
        ----------
        inputs : Inputs
            The uncertain parameters.
        n : int
            Size of the design.
        of : sequence of str
            Outcomes to analyse.
        stages : mapping
            Options by stage, as from `split`.

        Returns
        -------
        int
            As of `evaluations`.

        Raises
        ------
        InputError
            If an option cannot be used.
        """
        count = self.evaluations(inputs, n, **stages["evaluations"])
        if self.validate is not None:
            self.validate(inputs, n, of=of, **stages["validate"])
        return count

    def split(self, options: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
        """Return the options of each stage; several may take the same one.

        Parameters
        ----------
        options : mapping
            Options of all stages together, by name.

        Returns
        -------
        dict
            Stage of `STAGES` -> its options.

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
