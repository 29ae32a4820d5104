"""Docstrings: each public name tells its arguments, shapes, units and errors, and the reference lists it."""

import collections
import importlib
import inspect
import pkgutil
import re
from pathlib import Path

import docstring_rules as rules
import numpy as np
import pytest
import xarray as xr

import hipuq
from hipuq import cea, errors, methods, models, plots

REFERENCE = Path(__file__).parents[1] / "docs" / "reference" / "api.md"

OF_SUBMODULES = ("hipuq.sweeping.at", "hipuq.progress.log_to_stderr")
"""Public names of modules that give out nothing else."""

ENTRIES = """
Inputs relative shift ContactPatterns mixture lubrication design evaluate estimate run lazy_design models.ring
models.two_dof integrate_friction unstable_friction onset_sensitivity fragility friction_limit sweep compare
frequency_ranges literature save_outcomes load_outcomes save_results load_results cea.solve
""".split()
"""Names that show how they are used."""


def named(name):
    """Return an object by its dotted name."""
    module, _, attribute = name.rpartition(".")
    return getattr(importlib.import_module(module), attribute)


def public_names():
    """Return the public functions and classes, each by its shortest name."""
    names = [
        f"{module.__name__}.{name}"
        for module in (hipuq, methods, models, plots, cea)
        for name in module.__all__
        if callable(getattr(module, name)) and not hasattr(errors, name)
    ]
    for record in methods.METHODS.values():
        names += [f"{stage.__module__}.{stage.__name__}" for stage in (record.design, record.estimate)]
    shortest = {}
    for name in (*names, *OF_SUBMODULES):
        shortest.setdefault(id(named(name)), name)
    return list(shortest.values())


def error_names():
    """Return what `hipuq.errors` has."""
    return [f"hipuq.errors.{name}" for name, value in vars(errors).items() if _is_own(value, errors, name)]


def _is_own(value, module, name):
    own = inspect.isfunction(value) or inspect.isclass(value)
    return own and value.__module__ == module.__name__ and not name.startswith("_")


def returned(value):
    """Yield the classes of hipuq that a function returns: their users meet them, listed or not."""
    hint = getattr(value, "__annotations__", {}).get("return", "")
    for name in re.findall(r"\w+", str(hint)):
        found = getattr(value, "__globals__", {}).get(name)
        if inspect.isclass(found) and found.__module__.startswith("hipuq"):
            yield found


def documented():
    """Return name -> (object, class) of all that users meet, members of classes too."""
    found = {name: named(name) for name in (*public_names(), *error_names())}
    for value in list(found.values()):
        for cls in returned(value):
            if cls not in found.values():
                found[f"{cls.__module__}.{cls.__qualname__}"] = cls
    parts, seen = {}, set()
    for name, value in found.items():
        parts[name] = (value, None)
        if inspect.isclass(value):
            parts |= {f"{name}.{one}": (part, value) for one, part in rules.members(value)}
    return {name: part for name, part in parts.items() if not (id(part[0]) in seen or seen.add(id(part[0])))}


DOCUMENTED = documented()


def test_the_reference_lists_every_public_name_once():
    text = REFERENCE.read_text(encoding="utf-8")
    listed = collections.Counter(re.findall(r"^ +(hipuq[\w.]+)$", text, re.MULTILINE))
    whole = [name for name, (_, owner) in DOCUMENTED.items() if owner is None]
    assert listed == collections.Counter(name for name in whole if not name.startswith("hipuq.errors."))
    assert ".. automodule:: hipuq.errors\n   :members:" in text


@pytest.mark.parametrize("name", DOCUMENTED)
def test_docstring_is_complete(name):
    assert rules.problems(*DOCUMENTED[name]) == []


@pytest.mark.parametrize("name", ENTRIES)
def test_entry_has_an_example(name):
    assert ">>> " in named(f"hipuq.{name}").__doc__


@pytest.mark.parametrize("name", DOCUMENTED)
def test_examples_fit_the_page(name):
    lines = (DOCUMENTED[name][0].__doc__ or "").splitlines()
    assert [line for line in lines if line.lstrip()[:4] in (">>> ", "... ") and len(line.lstrip()) > 80] == []


def modules():
    """Return the names of all modules that can be imported without running."""
    found = [one.name for one in pkgutil.walk_packages(hipuq.__path__, "hipuq.")]
    return ["hipuq", *(name for name in found if not name.endswith(("__main__", "_kernel")))]


@pytest.mark.parametrize("name", modules())
def test_arguments_of_every_function_are_told_as_they_are(name):
    module = importlib.import_module(name)
    wrong = {}
    for attribute, value in vars(module).items():
        if _is_own(value, module, attribute):
            parts = [(attribute, value)]
            if inspect.isclass(value):
                parts += [(f"{attribute}.{one}", part) for one, part in rules.members(value)]
            wrong |= {one: found for one, part in parts if (found := rules.argument_problems(part))}
    assert wrong == {}


# Each rule can fail: a docstring without fault, and one with each.


def example(frequency, samples, *, count=1):
    """Return the damping ratios of modes.

    Parameters
    ----------
    frequency : (s, n) array
        Im l / (2 pi) [Hz].
    samples : Dataset
        Parameters over ``sample``.
    count : int, default 1
        Number of modes.

    Returns
    -------
    (s,) array
        Damping ratio [1].

    Raises
    ------
    InputError
        If there is no mode.
    UnknownNameError
        If the samples have no such parameter.
    """
    errors.check_name("parameter", count, samples)
    try:
        _refuse(count)
    except errors.StoreError:
        pass
    if count < 1:
        raise errors.InputError("there is no mode")
    return np.zeros(len(frequency))


def _refuse(count):
    raise errors.StoreError(f"{count} is caught")


COUNT = "    count : int, default 1\n        Number of modes.\n"
RETURNS = "    Returns\n    -------\n    (s,) array\n        Damping ratio [1].\n\n"
RAISES = """    Raises
    ------
    InputError
        If there is no mode.
    UnknownNameError
        If the samples have no such parameter.
    """

FAULTS = {
    "no docstring": (None, "", "GL08"),
    "no full stop": ("ratios of modes.", "ratios of modes", "SS03"),
    "third person": ("Return the", "Returns the", "SS05"),
    "argument that is missing": (COUNT, "", "PR01"),
    "argument that is unknown": (COUNT, COUNT + COUNT.replace("count", "counts"), "PR02"),
    "arguments out of order": (
        "    frequency : (s, n) array",
        COUNT + "    frequency : (s, n) array",
        "PR03",
    ),
    "no type": ("samples : Dataset", "samples", "PR04"),
    "no description": ("        Number of modes.\n", "", "PR07"),
    "no returns": (RETURNS, "", "RT01"),
    "returns without description": ("        Damping ratio [1].\n", "", "RT03"),
    "sections out of order": (RETURNS + RAISES, RAISES[:-4] + "\n" + RETURNS, "GL07"),
    "section that is unknown": ("    Raises\n    ------", "    Errors\n    ------", "GL06"),
    "array without shape": ("(s, n) array", "array", "Parameters, frequency: an array without a shape"),
    "shape in words": ("(s, n) array", "array (as given)", "Parameters, frequency: an array without a shape"),
    "number without unit": ("[Hz]", "", "Parameters, frequency: a number without a unit"),
    "range for a unit": ("[Hz]", "in [0, 1]", "Parameters, frequency: a number without a unit"),
    "returned array without shape": (
        "    (s,) array",
        "    array",
        "Returns, array: an array without a shape",
    ),
    "returned number without unit": ("ratio [1]", "ratio", "Returns, (s,) array: a number without a unit"),
    "Dataset of anything": ("over ``sample``", "as given", "Parameters, samples: a Dataset of which"),
    "error that is not named": ("    InputError\n        If there is no mode.\n", "", "raises InputError"),
    "error of a helper": ("UnknownNameError\n", "SchemaError\n", "raises UnknownNameError"),
    "error without reason": ("        If there is no mode.\n", "", "Raises, InputError: no description"),
}


def with_docstring(function, text):
    """Return a function that differs in its docstring alone."""
    found = type(function)(
        function.__code__,
        function.__globals__,
        function.__name__,
        function.__defaults__,
        function.__closure__,
    )
    found.__kwdefaults__, found.__annotations__ = function.__kwdefaults__, dict(function.__annotations__)
    found.__doc__ = text
    return found


def test_docstring_without_fault_passes():
    assert rules.problems(example) == []
    assert rules.argument_problems(example) == []


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_found(fault):
    old, new, expected = FAULTS[fault]
    text = new if old is None else example.__doc__.replace(old, new)
    assert text != example.__doc__
    found = rules.problems(with_docstring(example, text))
    assert any(one.startswith(expected) for one in found), found


@pytest.mark.parametrize(
    "fault", ["argument that is missing", "argument that is unknown", "arguments out of order"]
)
def test_fault_in_arguments_is_found_of_every_function(fault):
    old, new, expected = FAULTS[fault]
    found = rules.argument_problems(with_docstring(example, example.__doc__.replace(old, new)))
    assert [one[:4] for one in found] == [expected]


def test_docstring_without_arguments_is_left_alone_elsewhere():
    assert rules.argument_problems(with_docstring(example, "Return a number.")) == []


def test_annotations_ask_for_units_and_shapes_too():
    text = example.__doc__.replace("count : int, default 1", "count : object")
    wanted = with_docstring(example, text)
    assert rules.problems(wanted) == []
    wanted.__annotations__["count"] = "float | None"
    assert rules.problems(wanted) == ["Parameters, count: a number without a unit, such as [Hz] or [1]"]
    wanted.__annotations__["count"] = "NDArray[np.int64]"
    assert rules.problems(wanted) == ["Parameters, count: an array without a shape, such as (s, n)"]


def test_generator_has_to_tell_what_it_yields():
    def numbers():
        """Give numbers."""
        yield 1

    assert [one[:4] for one in rules.problems(numbers)] == ["YD01"]


class Example:
    """What was measured.

    Attributes
    ----------
    frequency : float
        Of a mode [Hz].
    """

    label = ""

    def __init__(self, frequency: float, growth_rate: float) -> None:
        if frequency < 0:
            raise errors.InputError("frequency is below 0")
        self.frequency = frequency
        self.growth_rate = growth_rate

    @property
    def limits(self) -> "NDArray[np.float64]":  # noqa: F821
        """Where it may lie."""
        return np.array([0.0, self.frequency])

    @property
    def table(self) -> xr.Dataset:
        """All of it."""
        return xr.Dataset()

    def halved(self):
        self._refuse()

    def _refuse(self):
        raise errors.ModelError("it is what it is")


def test_faults_of_a_class_are_found():
    assert rules.problems(Example) == [
        "PR01 Parameters {'growth_rate'} not documented",
        "attribute 'label' is not documented",
        "attribute 'growth_rate' is not documented",
        "raises InputError, which Raises does not name",
    ]
    parts = dict(rules.members(Example))
    assert list(parts) == ["limits", "table", "halved"]
    assert rules.problems(parts["limits"]) == [
        "the value: an array without a shape, such as (s, n)",
        "the value: a number without a unit, such as [Hz] or [1]",
    ]
    assert rules.problems(parts["table"]) == ["the value: a Dataset of which no variable or dim is told"]
    assert [one[:4] for one in rules.problems(parts["halved"], Example)] == ["GL08"]
    assert rules.raised(parts["halved"], Example) == {"ModelError"}


@pytest.mark.parametrize("text", ["[1]", "[1/s^2]", "[N s/m]", "in the units of the schema", "[Hz], (s, n)"])
def test_units(text):
    assert rules.UNIT.search(text)


@pytest.mark.parametrize("text", ["", "[0, 1]", "[0, 1)", "[see below]", "units", "a[1.0]", "[1 1/2 s"])
def test_what_is_no_unit(text):
    assert not rules.UNIT.search(text)


@pytest.mark.parametrize("text", ["(s,)", "(s, n)", "(..., 2)", "(2, 2, size, s)"])
def test_shapes(text):
    assert rules.SHAPE.search(text)


@pytest.mark.parametrize("text", ["", "(s)", "()", "(an error, or a wrong shape)", "[s, n]"])
def test_what_is_no_shape(text):
    assert not rules.SHAPE.search(text)
