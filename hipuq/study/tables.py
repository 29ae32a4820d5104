"""The form of the tables of a study file: which keys they have, and of what type."""

from __future__ import annotations

import itertools
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator

from hipuq.contact import CONTACT_PATTERNS, ContactPatterns
from hipuq.distributions import DISTRIBUTIONS, from_table
from hipuq.errors import HipuqError, StudyError, unknown_name
from hipuq.variation import relative, shift

NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]*$"
"""What an analysis or a problem may be called: its group and its files are."""


_PORTS = (f"{port}{number}" for port in ("com", "lpt") for number in range(10))

DEVICES = frozenset(["con", "prn", "aux", "nul", *_PORTS])
"""Names that no file can have on Windows."""


def _not_a_device(name: str) -> str:
    if name.lower() in DEVICES:
        raise ValueError(f"{name!r} is no name for files on every system: take another one")
    return name


def _in_print(text: str) -> str:
    if not text.isprintable():
        raise ValueError(f"{text[:60]!r} has characters that cannot be printed, or more than one line")
    return text


FileName = Annotated[str, Field(pattern=NAME, max_length=60), AfterValidator(_not_a_device)]

Words = Annotated[str, AfterValidator(_in_print)]
"""Text that is shown on a terminal as it is."""


class Table(BaseModel):
    """A table in which unknown keys are errors, and types are taken as they are."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class InputTable(BaseModel):
    """``[inputs.<parameter>]``: a distribution by name, its parameters, and how it applies.

    Attributes
    ----------
    distribution : str
        Its name, such as ``"uniform"``; or ``"contact_patterns"``.
    apply : str
        ``"absolute"``, ``"relative"`` (times 1 + draw) or ``"shift"`` (plus draw).
    each : str or None
        Dim of the elements that get a draw each.
    source : str
        Where the distribution comes from, for the report.
    """

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False, frozen=True)

    distribution: str
    apply: Literal["absolute", "relative", "shift"] = "absolute"
    each: str | None = None
    source: str = ""

    def distribution_for(self, parameter: str) -> object:
        """Return what ``model.inputs`` takes for a parameter.

        Raises
        ------
        InputError
            If the distribution cannot be used.
        """
        rest = dict(self.model_extra or {})
        if self.distribution == CONTACT_PATTERNS:
            if self.apply != "absolute" or self.each is not None:
                raise StudyError(f"input {parameter!r}: contact patterns take neither apply nor each")
            for key in rest:
                if key not in ("in_contact", "oscillators", "weights"):
                    raise unknown_name(
                        f"key of input {parameter!r}", key, ["in_contact", "oscillators", "weights"]
                    )
            if "in_contact" not in rest:
                raise StudyError(f"input {parameter!r}: in_contact is missing")
            return ContactPatterns(**rest)
        if self.distribution not in DISTRIBUTIONS:
            raise unknown_name(
                f"distribution of input {parameter!r}", self.distribution, [*DISTRIBUTIONS, CONTACT_PATTERNS]
            )
        try:
            drawn = from_table({"distribution": self.distribution, **rest})
        except HipuqError as error:
            raise StudyError(f"input {parameter!r}: {error}") from error
        if self.apply == "absolute":
            if self.each is not None:
                raise StudyError(f"input {parameter!r}: each needs apply = 'relative' or 'shift'")
            return drawn
        return {"relative": relative, "shift": shift}[self.apply](drawn, each=self.each)


class AnalysisTable(Table):
    """``[[analysis]]``: what is computed.

    Attributes
    ----------
    name : str
        Name of the group in the results: letters, digits, ``-`` and ``_``.
    method : str
        ``"monte_carlo"``, ``"chaos"`` or ``"sobol"``.
    n : int
        Size of the design: samples, for each pattern if stratified; base points of ``"sobol"``.
    integrate_friction : bool
        Whether friction is integrated over its distribution instead of sampled.
    of : list of str
        Outcomes to analyse, such as ``"any_unstable"``, ``"unstable"`` or ``"margin"``, with friction
        integrated ``"probability"``; a single one may stand alone.
    options : dict
        Options of the method.
    over : dict
        Parameter -> values at which the whole analysis is made, each with the same draws; it is then no
        input of it, whatever the study says.
    preset, model, inputs
        Keys that this analysis has in place of the study's; the others stay.
    """

    name: FileName
    method: str
    n: int = Field(ge=1)
    integrate_friction: bool = False
    of: list[str] = Field(min_length=1)
    options: dict[str, Any] = {}
    over: dict[str, list[float]] = {}
    preset: str | None = None
    model: dict[str, Any] = {}
    inputs: dict[str, InputTable] = {}

    @field_validator("of", mode="before")
    @classmethod
    def _single(cls, value: Any) -> Any:
        return [value] if isinstance(value, str) else value


class ReportTable(Table):
    """``[report]``: what the figures show of the model at nominal values.

    Attributes
    ----------
    friction_sweep : (float, float) or None
        Range of the friction sweep at nominal values [1]; none is drawn without it.
    friction_points : int
        Points of the sweep.
    mode_shapes : list of int
        Modes whose shapes are drawn, at nominal values; none by default.
    shape_friction : float
        Friction at which they are drawn [1].
    pairs : list of (int, int)
        Pairs of modes of the lock-in figure.
    mode_names : dict
        Mode -> the name it has in a publication.
    headline : str or None
        Analysis whose probability is the first thing told; by default the first with one that is over nothing
        but damping.
    damping_ratio : float or None
        Modal damping ratio that the headline assumes, one of those that its analysis is over; by default 0,
        if it is among them.
    damping_ratios : list of float
        At which the probability is computed for the headline's model and inputs, where no analysis does.
    damping_samples : int
        Samples at each of them, fewer if the headline's analysis is plain Monte Carlo with fewer; 0 leaves it
        out.
    targets : list of float
        Probabilities for which a friction limit is told.
    fragility_points : int
        Frictions at which the fragility curve is computed.
    literature : bool
        Whether a study of hips sets beside its results what was measured in patients and on the bench.
    """

    friction_sweep: tuple[float, float] | None = None
    friction_points: int = Field(default=1001, ge=2, le=1_000_000)
    mode_shapes: list[int] = []
    shape_friction: float = 0.0
    pairs: list[tuple[int, int]] = []
    mode_names: dict[str, str] = {}
    headline: str | None = None
    damping_ratio: float | None = Field(default=None, ge=0)
    damping_ratios: list[Annotated[float, Field(ge=0)]] = Field(
        default=[0.0, 0.0025, 0.005, 0.0075, 0.01, 0.0125, 0.015, 0.0175, 0.02], min_length=1
    )
    damping_samples: int = Field(default=2048, ge=0, le=1_000_000)
    targets: list[Annotated[float, Field(ge=0, lt=1)]] = Field(default=[0.01, 0.03, 0.1], min_length=1)
    fragility_points: int = Field(default=201, ge=2, le=100_000)
    literature: bool = True

    @field_validator("friction_sweep", mode="before")
    @classmethod
    def _pair(cls, value: Any) -> Any:
        return tuple(value) if isinstance(value, list) else value

    @field_validator("friction_sweep")
    @classmethod
    def _ascending(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        if value is not None and not value[0] < value[1]:
            raise ValueError(f"the range {list(value)} must ascend")
        return value

    @field_validator("damping_ratios", "targets")
    @classmethod
    def _rising(cls, value: list[float]) -> list[float]:
        if any(a >= b for a, b in itertools.pairwise(value)):
            raise ValueError(f"the values {value} must ascend")
        return value

    @field_validator("pairs", mode="before")
    @classmethod
    def _pairs(cls, value: Any) -> Any:
        return [tuple(v) if isinstance(v, list) else v for v in value] if isinstance(value, list) else value

    @field_validator("mode_names")
    @classmethod
    def _numbers(cls, value: dict[str, str]) -> dict[str, str]:
        for key in value:
            if not (key.isascii() and key.isdecimal()):
                raise ValueError(f"{key!r} is not the number of a mode")
        return value
