"""The form of a study file: which tables and keys it has, and of what type."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from hipuq.contact import ContactPatterns
from hipuq.distributions import FAMILIES, from_family
from hipuq.errors import HipuqError, StudyError, unknown_name
from hipuq.variation import relative, shift

CONTACT_PATTERNS = "contact_patterns"
MAXIMUM_BYTES = 1_000_000


class Table(BaseModel):
    """A table in which unknown keys are errors, and types are taken as they are."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class InputTable(BaseModel):
    """``[inputs.<parameter>]``: a distribution by name, its parameters, and how it applies.

    Attributes
    ----------
    distribution : str
        One of `hipuq.distributions.FAMILIES`, or ``"contact_patterns"``.
    apply : str
        ``"absolute"``, ``"relative"`` (times 1 + draw) or ``"shift"`` (plus draw).
    each : str or None
        Dim of the elements that get a draw each.
    """

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False, frozen=True)

    distribution: str
    apply: Literal["absolute", "relative", "shift"] = "absolute"
    each: str | None = None

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
        if self.distribution not in FAMILIES:
            raise unknown_name(
                f"distribution of input {parameter!r}", self.distribution, [*FAMILIES, CONTACT_PATTERNS]
            )
        try:
            drawn = from_family(self.distribution, rest)
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
        Name of a method.
    n : int
        Size of the design.
    integrate_friction : bool
        Whether friction is integrated over its distribution instead of sampled.
    of : list of str
        Outcomes to analyse; a single one may stand alone.
    options : dict
        Options of the method.
    preset, model, inputs
        What this analysis has in place of the study's.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=60)
    method: str
    n: int = Field(ge=1)
    integrate_friction: bool = False
    of: list[str] = Field(min_length=1)
    options: dict[str, Any] = {}
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
        Range of the friction sweep [1]; no sweep without it.
    friction_points : int
        Points of the sweep.
    mode_shapes : list of int
        Modes whose shapes are drawn.
    shape_friction : float
        Friction at which they are drawn [1].
    pairs : list of (int, int)
        Pairs of modes of the lock-in figure.
    mode_names : dict
        Mode -> the name it has in a publication.
    """

    friction_sweep: tuple[float, float] | None = None
    friction_points: int = Field(default=1001, ge=2, le=1_000_000)
    mode_shapes: list[int] = []
    shape_friction: float = 0.0
    pairs: list[tuple[int, int]] = []
    mode_names: dict[str, str] = {}

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


class StudyFile(Table):
    """A whole study file.

    Attributes
    ----------
    title, description : str
        For people.
    seed : int
        Seed of all randomness.
    model : dict
        ``name``, ``preset`` and options of the model.
    inputs : dict
        Parameter -> its distribution.
    analysis : list
        The analyses, in order.
    report : ReportTable
    """

    title: str = Field(min_length=1)
    description: str = ""
    seed: int = Field(default=0, ge=0, lt=2**63)
    model: dict[str, Any]
    inputs: dict[str, InputTable] = Field(min_length=1)
    analysis: list[AnalysisTable] = Field(min_length=1)
    report: ReportTable = ReportTable()

    @model_validator(mode="after")
    def _distinct(self) -> StudyFile:
        names = [entry.name for entry in self.analysis]
        twice = {name for name in names if names.count(name) > 1}
        if twice:
            raise ValueError(f"the name {min(twice)!r} is given to two analyses")
        return self


def read_study_file(file: Path) -> tuple[str, StudyFile]:
    """Read a study file and check its form.

    Parameters
    ----------
    file : Path

    Returns
    -------
    text : str
        As it is in the file.
    table : StudyFile

    Raises
    ------
    StudyError
        One line that names the file and the key.
    """
    try:
        if file.stat().st_size > MAXIMUM_BYTES:
            raise StudyError(f"{file} is larger than {MAXIMUM_BYTES} bytes: it is not a study file")
        text = file.read_text(encoding="utf-8")
        data = tomllib.loads(text)
    except OSError as error:
        raise StudyError(
            f"cannot read the study {file}: {error.strerror}; give a study folder or its study.toml"
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise StudyError(f"{file} is not a TOML file: {error}") from error
    try:
        return text, StudyFile.model_validate(data)
    except ValidationError as error:
        raise StudyError(f"{file}, {_first_line(error, data)}") from error


_TABLES: dict[str, type[BaseModel]] = {"analysis": AnalysisTable, "report": ReportTable}


def _first_line(error: ValidationError, data: dict[str, Any]) -> str:
    """Return the first problem as one line, with the near match of an unknown key."""
    # A key that is not known explains one that is missing.
    first = min(error.errors(), key=lambda one: one["type"] != "extra_forbidden")
    place = [str(part) for part in first["loc"]]
    if first["type"] == "extra_forbidden":
        table = _TABLES.get(place[0], StudyFile) if len(place) > 1 else StudyFile
        where = f"table {place[0]!r}" if len(place) > 1 else "study file"
        return str(unknown_name(f"key in the {where}", place[-1], table.model_fields))
    message = first["msg"].removeprefix("Value error, ")
    shown = "" if first["type"] in ("missing", "value_error") else f", not {str(first['input'])[:60]!r}"
    where = ".".join(place)
    more = len(error.errors()) - 1
    rest = f" (and {more} more)" if more else ""
    return f"{where}: {message}{shown}{rest}" if where else f"{message}{rest}"
