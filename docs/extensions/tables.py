"""Tables of the reference, generated from the package: schema, models, methods, keys of a study, commands.

A page asks for one by a directive, such as ``{schema} PARAMETERS``. Nothing in these tables is written
by hand, so none of it can disagree with the code.
"""

import importlib
import inspect
import os
import subprocess
import sys
import typing
from collections.abc import Iterable

import numpy as np
from docutils import nodes
from numpydoc.docscrape import ClassDoc, FunctionDoc
from pydantic import BaseModel
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import hipuq
from hipuq import schema
from hipuq.distributions.families import FAMILIES
from hipuq.methods import METHODS
from hipuq.models import MODELS, PRESETS


def table(head: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table in Markdown."""
    head = list(head)
    lines = [head, ["---"] * len(head), *([str(cell).replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def code(value: object) -> str:
    """Return `value` as code in Markdown, nothing for nothing."""
    return f"`{value}`" if str(value) else ""


def rows_of(variables: dict[str, schema.Variable]) -> list[list[str]]:
    """Return name, meaning, unit, dims and role of variables."""
    return [
        [code(name), one.long_name, code(one.units), code(", ".join(one.dims)), role_of(one)]
        for name, one in variables.items()
    ]


def role_of(variable: schema.Variable) -> str:
    """Return what the values of a variable are, beyond their unit."""
    if variable.limit_state is not None:
        return f"instability below {variable.limit_state:g}"
    return {schema.VERDICT: "verdict: 1, 0 or NaN (unknown)"}.get(variable.role, variable.role)


def plain(value: object) -> str:
    """Return a default as a study file and Python write it."""
    if isinstance(value, BaseModel) or (isinstance(value, (list, dict, str)) and not value):
        return "none"
    return {"None": "none", "True": "true", "False": "false"}.get(str(value), code(repr(value)))


class Generated(SphinxDirective):
    """A directive whose content is Markdown made from its argument."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        return self.parse_text_to_nodes(self.markdown(self.arguments[0]))

    def markdown(self, argument: str) -> str:
        """Return the text."""
        raise NotImplementedError


class Schema(Generated):
    """``{schema} OUTCOMES``: one of the dicts of `hipuq.schema`."""

    def markdown(self, argument: str) -> str:
        """Return a table of variables, or of flags."""
        found = getattr(schema, argument)
        if all(isinstance(value, int) for value in found.values()):
            return table(["meaning", "value"], ([code(name), value] for name, value in found.items()))
        rows = rows_of(found)
        head = ["name", "meaning", "unit", "dims", "values"]
        if not any(row[-1] for row in rows):
            head, rows = head[:-1], [row[:-1] for row in rows]
        return table(head, rows)


class Results(Generated):
    """``{results} sobol any_unstable``: what the results of a small analysis hold."""

    def markdown(self, argument: str) -> str:
        """Return a table of the variables of results that are made here."""
        import chaospy as cp

        method, of = argument.split()
        model = hipuq.models.two_dof("hoffmann2002")
        inputs = model.inputs(friction=cp.Uniform(0.0, 0.8), k3=hipuq.relative(cp.Uniform(-0.1, 0.1)))
        found = hipuq.run(model, inputs, method=method, n=64, of=of, rng=0, progress=False)
        return table(
            ["name", "meaning", "unit", "dims"],
            (
                [code(name), one.attrs["long_name"], code(one.attrs["units"]), code(", ".join(one.dims))]
                for name, one in found.data_vars.items()
            ),
        )


class Models(Generated):
    """``{models} ring``: presets, parameters and their nominal values."""

    def markdown(self, argument: str) -> str:
        """Return a table of parameters, a column of nominal values for each set of parameters."""
        presets: dict[tuple[str, ...], list[str]] = {}
        for preset in PRESETS[argument]:
            presets.setdefault(tuple(MODELS[argument](preset).parameters), []).append(preset)
        return "\n\n".join(self._one(argument, names, own) for names, own in presets.items())

    def _one(self, model: str, names: tuple[str, ...], presets: list[str]) -> str:
        built = [MODELS[model](preset) for preset in presets]
        head = ["parameter", "meaning", "unit", "element", *map(code, presets)]
        rows = []
        for name in names:
            variable = schema.PARAMETERS[name]
            values = [self._nominal(one.parameters[name].nominal) for one in built]
            dims = code(", ".join(variable.dims[1:]))
            rows.append([code(name), variable.long_name, code(variable.units), dims, *values])
        return table(head, rows)

    @staticmethod
    def _nominal(values: np.ndarray) -> str:
        """Return nominal values in short: a number, or first, second, ..., last."""
        flat = np.atleast_1d(values)
        if flat.dtype == bool or np.all(flat == flat[0]):
            return f"{flat[0]:g}" + (" each" if len(flat) > 1 else "")
        return f"{flat[0]:g}, {flat[1]:g}, ..., {flat[-1]:g}"


class Methods(Generated):
    """``{methods} sobol``: the options of a method, with their defaults."""

    def markdown(self, argument: str) -> str:
        """Return a table: meaning from the docstrings, and which stage takes the option."""
        method = METHODS[argument]
        stages = {stage: method.options(stage) for stage in ("design", "estimate")}
        meanings: dict[str, str] = {}
        for stage in reversed(stages):
            for entry in FunctionDoc(getattr(method, stage))["Parameters"]:
                text = " ".join(entry.desc)
                if not text.startswith("As in"):
                    meanings |= dict.fromkeys(entry.name.split(", "), text)
        return table(
            ["option", "meaning", "default", "stage"],
            (
                [
                    code(name),
                    meanings[name],
                    plain(default),
                    ", ".join(s for s in stages if name in stages[s]),
                ]
                for name, default in {**stages["design"], **stages["estimate"]}.items()
            ),
        )


class Distributions(Generated):
    """``{distributions} study``: names of distributions in study files, with their parameters."""

    def markdown(self, argument: str) -> str:
        """Return a table of names, the parameters that must and those that may be given."""
        return table(
            ["distribution", "parameters", "may be left out", "chaospy's name"],
            (
                [code(name), *(", ".join(map(code, some)) for some in (needed, optional)), code(theirs)]
                for name, (theirs, needed, optional) in FAMILIES.items()
            ),
        )


class Keys(Generated):
    """``{keys} hipuq.study.tables.AnalysisTable``: the keys of a table of a study file."""

    def markdown(self, argument: str) -> str:
        """Return a table of keys: meaning from the docstring, type and default from the form."""
        module, _, name = argument.rpartition(".")
        form: type[BaseModel] = getattr(importlib.import_module(module), name)
        meanings: dict[str, str] = {}
        for one in form.__mro__[::-1]:
            if issubclass(one, BaseModel) and one.__module__.startswith("hipuq."):
                for entry in ClassDoc(one)["Attributes"]:
                    meanings |= dict.fromkeys(entry.name.split(", "), " ".join(entry.desc))
        rows = []
        for key, field in form.model_fields.items():
            default = "needed" if field.is_required() else plain(field.get_default(call_default_factory=True))
            if not meanings[key]:
                raise ValueError(f"{argument} does not say what {key!r} means")
            rows.append([code(key), meanings[key], code(_kind(field.annotation)), default])
        return table(["key", "meaning", "type", "default"], rows)


class Help(Generated):
    """``{help} run``: what a command says of itself."""

    def markdown(self, argument: str) -> str:
        """Return the help of a command as a block of text."""
        command = [sys.executable, "-m", "hipuq", *argument.split(), "--help"]
        plain_text = os.environ | {"COLUMNS": "90", "NO_COLOR": "1", "TERM": "dumb"}
        said = subprocess.run(command, env=plain_text, capture_output=True, text=True, check=True).stdout
        return f"```text\n{said.replace('python -m hipuq', 'hipuq').strip()}\n```"


def _kind(annotation: object) -> str:
    """Return a type in the words of a study file."""
    if typing.get_origin(annotation) is typing.Annotated:
        return _kind(typing.get_args(annotation)[0])
    if typing.get_origin(annotation) is typing.Literal:
        return " or ".join(repr(one) for one in typing.get_args(annotation))
    origin, inner = typing.get_origin(annotation), typing.get_args(annotation)
    if origin in (list, tuple):
        parts = dict.fromkeys(_kind(one) for one in inner if one is not Ellipsis)
        return f"list of {' and '.join(parts)}"
    if origin is dict:
        return "table"
    if inner:  # a union; None only says that the key may be left out
        return " or ".join(dict.fromkeys(_kind(one) for one in inner if one is not type(None)))
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        return "table"
    names = {str: "text", float: "number", int: "integer", bool: "true or false"}
    return names.get(annotation, "anything")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directives."""
    for name, directive in {
        "schema": Schema,
        "results": Results,
        "models": Models,
        "methods": Methods,
        "distributions": Distributions,
        "keys": Keys,
        "help": Help,
    }.items():
        app.add_directive(name, directive)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
