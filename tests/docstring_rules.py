"""What a docstring of hipuq has to tell, and what one lacks.

Form, arguments and returns are numpydoc's to check. To that come rules that can be read off the text: arrays
give their shape, numbers their unit, Datasets what they hold, and every error is named that a function
raises, itself or through helpers of its own.
"""

import ast
import builtins
import functools
import inspect
import itertools
import re
import textwrap
import warnings

from numpydoc.docscrape import get_doc_object
from numpydoc.validate import validate

NO_RULE = {"GL01", "GL02", "ES01", "SA01", "EX01"}
"""Codes of numpydoc for where quotes stand, and for sections that not every docstring needs."""

ARGUMENTS = {"PR01", "PR02", "PR03"}
"""Codes for arguments that are missing, unknown or misordered."""

_SYMBOL = r"(?:1|s|Hz|deg|rad|radii|kg|N|m|J)(?:\^\d)?"
UNIT = re.compile(rf"\[{_SYMBOL}(?:[ /]{_SYMBOL})*\]|\bunits? of (?:the|its|their|what)\b")
"""A unit in brackets, [1] for pure numbers, or words that say whose unit it is."""

_LENGTH = r"(?:\w+|\.\.\.)"
SHAPE = re.compile(rf"\({_LENGTH}(?:, {_LENGTH})+\)|\({_LENGTH},\)")
"""Lengths in parentheses: (s,), (s, n), (..., 2)."""

HELD = re.compile(r"`[^`]+`")
"""The name of a variable, of a dim, or of the function that tells them."""

_COUNTS = r"(?:bool|int|int8|int32|str|Axes)"
_NUMBERS = re.compile(r"\b(?:array|NDArray|Array|float|complex|Complex|number)s?\b")
_COUNTED = re.compile(rf"\barrays? of {_COUNTS}\b|NDArray\[(?:Any|np\.(?:bool_|intp?|int\d+|str_))\]")
_ARRAYS = re.compile(r"\bn?d?arrays?\b", re.IGNORECASE)
_DATASETS = re.compile(r"\b(?:Dataset|DataArray|DataTree)\b")


def problems(value, owner=None):
    """Return what the docstring of a function, a property or a class lacks, a line each."""
    doc = _parsed(value)
    found = [f"{code} {text}" for code, text in validate(doc)["errors"] if code not in NO_RULE]
    if not value.__doc__:
        return found
    if isinstance(value, property):
        return found + _entry_problems("the value", _annotation(value.fget, "return"), value.__doc__, "")
    hints = value.__init__ if inspect.isclass(value) else value
    for section in ("Parameters", "Attributes", "Returns", "Yields"):
        for name, kind, lines in doc[section]:
            hint = _annotation(hints, "return" if section in ("Returns", "Yields") else name)
            if section in ("Returns", "Yields") and (len(doc[section]) > 1 or "tuple" in hint):
                hint = ""  # the hint is of all together
            label = f"{section}, {name or kind}"
            found += _entry_problems(label, hint, " ".join(lines), kind or name)
    if inspect.isclass(value):
        texts = [_parsed(base) for base in _bases(value)]
        told = {
            name for text in texts for part in ("Parameters", "Attributes") for name in _names(text, part)
        }
        found += [f"attribute {name!r} is not documented" for name in attributes(value) if name not in told]
    named = {one for _, kind, _ in doc["Raises"] for one in kind.split(", ")}
    for _, kind, lines in doc["Raises"]:
        if not " ".join(lines).strip():
            found.append(f"Raises, {kind}: no description")
    found += [f"raises {name}, which Raises does not name" for name in sorted(raised(value, owner) - named)]
    return found


def argument_problems(value):
    """Return what is wrong with the arguments in a docstring; nothing if it has no section for them."""
    doc = _sections(value)
    if not _names(doc, "Parameters"):
        return []
    return [f"{code} {text}" for code, text in validate(doc)["errors"] if code in ARGUMENTS]


def _parsed(value):
    """Return a docstring by sections; attributes of a class count as arguments if it has no other."""
    doc = _sections(value)
    base = inspect.isclass(value) and value.__base__
    if base and _ours(base) and inspect.isfunction(value.__init__) and value.__init__ is base.__init__:
        doc["Parameters"] = _parsed(base)["Parameters"]
    elif base and not _names(doc, "Parameters"):
        try:
            arguments = inspect.signature(value).parameters
        except ValueError:  # of a class that leaves its making to a built-in
            return doc
        own = [any(name in arguments for name in one.name.split(", ")) for one in doc["Attributes"]]
        doc["Parameters"] = list(itertools.compress(doc["Attributes"], own))
        doc["Attributes"] = list(itertools.compress(doc["Attributes"], (not yes for yes in own)))
    return doc


def _sections(value):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a section that is unknown: a problem that validate tells
        return get_doc_object(value, config={"show_class_members": False})


def _names(doc, section):
    return [name for entry in doc[section] for name in entry.name.split(", ")]


def _annotation(function, name):
    found = str(getattr(function, "__annotations__", {}).get(name, ""))
    return "" if "Callable" in found else found


def _entry_problems(label, hint, text, kind):
    """Return what an entry lacks, by its type as told and as annotated."""
    type_text, whole = f"{kind} {hint}", f"{kind} {text}"
    found = []
    if "callable" in kind:
        return found
    if _ARRAYS.search(type_text) and not SHAPE.search(whole):
        found.append(f"{label}: an array without a shape, such as (s, n)")
    if _NUMBERS.search(_COUNTED.sub("", type_text)) and not UNIT.search(whole):
        found.append(f"{label}: a number without a unit, such as [Hz] or [1]")
    if _DATASETS.search(type_text) and not HELD.search(text):
        found.append(f"{label}: a Dataset of which no variable or dim is told")
    return found


def members(cls):
    """Yield name and object of the methods and properties that a class of hipuq has for its users."""
    seen = set()
    for base in _bases(cls):
        for name, value in vars(base).items():
            if isinstance(value, (classmethod, staticmethod)):
                value = value.__func__
            elif isinstance(value, functools.cached_property):
                value = property(value.func)
            if name[0] != "_" and name not in seen and (inspect.isfunction(value) or type(value) is property):
                seen.add(name)
                yield name, value


def attributes(cls):
    """Return the public attributes of a class that are neither methods nor properties."""
    names = {}
    for base in _bases(cls):
        tree = _tree(base)
        own = [node for node in tree.body if isinstance(node, (ast.Assign, ast.AnnAssign))]
        inner = [node for node in ast.walk(tree) if isinstance(node, (ast.Assign, ast.AnnAssign))]
        for node in own + inner:
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                for one in getattr(target, "elts", [target]):
                    if isinstance(one, ast.Name) and node in own:
                        names[one.id] = None
                    elif isinstance(one, ast.Attribute) and getattr(one.value, "id", "") == "self":
                        names[one.attr] = None
    methods = dict(members(cls))
    return [name for name in names if name[0] != "_" and name not in methods]


def _bases(cls):
    return [base for base in cls.__mro__ if base.__module__ == cls.__module__ or _ours(base)]


def _ours(value):
    return str(getattr(value, "__module__", "")).split(".")[0] == "hipuq"


def raised(value, owner=None):
    """Return the names of the errors that a function or the making of an object raises.

    Those of its own body, and errors of hipuq in the functions that it calls whose name begins with
    ``check_``, or with ``_`` in the same module or class. What it catches itself does not count.
    """
    if inspect.isclass(value):
        makers = [vars(value).get(name) for name in ("__init__", "__post_init__")]
        found = [_raised(maker, value, frozenset()) for maker in makers if inspect.isfunction(maker)]
        return {error.__name__ for errors in found for error in errors}
    return {error.__name__ for error in _raised(value, owner, frozenset())}


def _raised(function, cls, callers):
    function = inspect.unwrap(function)
    if function in callers or not _source(function):
        return set()
    return _raised_in(_tree(function).body, function, cls, callers | {function})


def _raised_in(nodes, function, cls, callers):
    found = set()
    for node in nodes:
        if isinstance(node, ast.Try):
            caught = tuple(error for handler in node.handlers for error in _caught(handler, function, cls))
            inside = _raised_in(node.body, function, cls, callers)
            found |= {error for error in inside if not issubclass(error, caught)}
            found |= _raised_in([*node.handlers, *node.orelse, *node.finalbody], function, cls, callers)
            continue
        if isinstance(node, (ast.FunctionDef, ast.Lambda, ast.ClassDef)):
            continue
        if isinstance(node, ast.Raise) and node.exc is not None:
            made = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            error = _error(_resolved(made, function, cls))
            found |= {error} if error and (_ours(error) or len(callers) == 1) else set()
        elif isinstance(node, ast.Call):
            callee = _resolved(node.func, function, cls)
            if inspect.isfunction(callee) and _is_helper(callee, function):
                found |= _raised(callee, cls, callers)
        found |= _raised_in(ast.iter_child_nodes(node), function, cls, callers)
    return found


def _caught(handler, function, cls):
    """Return the errors that a handler catches for good."""
    if any(isinstance(node, ast.Raise) and node.exc is None for node in handler.body):
        return []
    names = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
    found = [_resolved(name, function, cls) for name in names]
    return [error for error in found if inspect.isclass(error)]


def _is_helper(callee, function):
    if callee.__name__.startswith("check_") and _ours(callee):
        return True
    return callee.__name__.startswith("_") and callee.__module__ == function.__module__


def _error(value):
    """Return an error, or the one that a function makes, None of anything else."""
    if inspect.isfunction(value):
        hint = value.__annotations__.get("return")
        value = value.__globals__.get(hint) if isinstance(hint, str) else hint
    return value if inspect.isclass(value) and issubclass(value, Exception) else None


def _resolved(node, function, cls):
    """Return what a name in the source of a function stands for, None where that is not told."""
    if isinstance(node, ast.Name):
        return function.__globals__.get(node.id, getattr(builtins, node.id, None))
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        if node.value.id in ("self", "cls"):
            value = inspect.getattr_static(cls, node.attr, None) if cls else None
            return getattr(value, "__func__", value)
        return getattr(function.__globals__.get(node.value.id), node.attr, None)
    return None


@functools.cache
def _source(value):
    try:
        return textwrap.dedent(inspect.getsource(value))
    except (OSError, TypeError):
        return ""


@functools.cache
def _tree(value):
    return ast.parse(_source(value)).body[0]
