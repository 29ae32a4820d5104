"""The form of ``[compare]`` in a study file: what is shared, the contenders, the problems."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from hipuq.study.tables import FileName, InputTable, Table, Words

Budgets = Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1)]
ContenderName = Annotated[Words, Field(pattern=r"^\S(.*\S)?$", max_length=60)]


class ExactTable(Table):
    """``reference = { exact = true }``: friction integrated, every level of the discrete inputs once."""

    exact: Literal[True]


class ResultsTable(Table):
    """``reference = { results = FILE, analysis = NAME }``: from results that are stored beside the study.

    Attributes
    ----------
    results : str
        The file, from the folder of the study file on.
    analysis : str
        Name of the analysis in it.
    of : str or None
        Outcome analysed there; that of the problem by default.
    """

    results: str
    analysis: str
    of: str | None = None


def _form(value: Any) -> str:
    """Return which form a reference has; a key that is written wrong belongs to the nearest one."""
    if not isinstance(value, dict):
        return "number"
    forms = {"exact": "exact", "results": "results", "analysis": "results"}
    for key, form in forms.items():
        if key in value:
            return form
    if any(isinstance(one, (bool, str)) for one in value.values()):
        near = [name for key in value for name in get_close_matches(key, forms, n=1)]
        return forms[near[0]] if near else "results"
    return "parameters"


ReferenceForms = Annotated[
    Annotated[float, Tag("number")]
    | Annotated[ExactTable, Tag("exact")]
    | Annotated[ResultsTable, Tag("results")]
    | Annotated[Annotated[dict[str, float], Field(min_length=1)], Tag("parameters")],
    Discriminator(_form),
]
"""What ``reference`` may be: a number, a number by parameter, or where it comes from."""


class Settings(Table):
    """What the problems share, and each of them may have in its own way.

    Attributes
    ----------
    budgets : list of int
        Numbers of evaluations, rising; needed here or in each problem.
    replicates : int
        Independent repetitions.
    of : str
        Outcome analysed; needed here or in each problem.
    quantity : str or None
        The result that is compared; by default the probability or mean over everything.
    baseline : str or None
        The contender that the others are measured by; the first by default.
    confidence : float
        Level of the limits told of errors and coverage.
    reference : float, dict, ExactTable, ResultsTable or None
        The answer, needed here or in each problem: a number, a number by parameter, ``{ exact = true }`` with
        friction integrated and every level once, or ``{ results = FILE, analysis = NAME }``.
    source : str
        Where the reference comes from.
    """

    budgets: Budgets = Field(default_factory=list)
    replicates: int = Field(default=30, ge=2)
    of: str = Field(default="", min_length=1)
    quantity: str | None = None
    baseline: str | None = None
    confidence: float = Field(default=0.95, gt=0, lt=1)
    reference: ReferenceForms | None = None
    source: str = ""


class ContenderTable(Table):
    """``[compare.contenders.<name>]``: a method with its options.

    Attributes
    ----------
    method : str
        Name of a method.
    options : dict
        Options of the method.
    integrate_friction : bool
        Whether friction is integrated over its distribution instead of sampled.
    of, quantity : str or None
        In place of those of the problem.
    budgets : list of int or None
        Those of the problem's that it takes part in; all by default.
    replicates : int or None
        Fewer than those of the problem.
    """

    method: str
    options: dict[str, Any] = Field(default_factory=dict)
    integrate_friction: bool = False
    of: str | None = None
    quantity: str | None = None
    budgets: Budgets | None = None
    replicates: int | None = Field(default=None, ge=2)


class ProblemTable(Settings):
    """``[[compare.problem]]``: a model with inputs, and the answer.

    Attributes
    ----------
    name : str
        Name of its group in the results and of the file of its runs.
    title : str
        For people.
    contenders : list of str or None
        Those that take part; all by default.
    model : dict
        With a ``name`` a model of its own, else options that replace those of the study; the others stay.
    inputs : dict
        All of them with a model of its own, else inputs that replace those of the study; the others stay.
    """

    name: FileName
    title: Words = ""
    contenders: list[str] | None = Field(default=None, min_length=1)
    model: dict[str, Any] = Field(default_factory=dict)
    inputs: dict[str, InputTable] = Field(default_factory=dict)


class CompareTable(Settings):
    """``[compare]``: methods compared on problems with a known answer.

    Attributes
    ----------
    contenders : dict
        Name -> method with its options.
    problem : list of ProblemTable
        Without one the study's own model and inputs are the problem, named by its outcome.
    """

    contenders: dict[ContenderName, ContenderTable] = Field(min_length=1)
    problem: list[ProblemTable] = Field(default_factory=list)

    @model_validator(mode="after")
    def _distinct(self) -> CompareTable:
        if not self.problem and not self.of:
            raise ValueError("of is missing: name the outcome, or give [[compare.problem]]")
        # Two names that differ in case alone would be one file on some systems.
        names = [one.name.lower() for one in self.problem]
        twice = [one.name for one in self.problem if names.count(one.name.lower()) > 1]
        if twice:
            raise ValueError(f"the name {twice[0]!r} is given to two problems")
        return self

    def problems(self) -> list[ProblemTable]:
        """Return the problems, each with all its settings.

        A source is that of a reference: a problem with its own reference does not inherit it.
        """
        shared = {key: getattr(self, key) for key in Settings.model_fields if key in self.model_fields_set}
        entries = self.problem or [ProblemTable.model_construct(name=self.of)]
        return [
            one.model_copy(update={k: v for k, v in shared.items() if k not in _own(one)}) for one in entries
        ]


def _own(problem: ProblemTable) -> set[str]:
    """Return the settings that a problem does not inherit."""
    given = problem.model_fields_set
    return given | {"source"} if "reference" in given else given
