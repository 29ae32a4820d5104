"""Imports: `import hipuq` is light, and modules import only what comes before them in one fixed order.

Read from the source with ast, function-level imports included, so that nothing can flow back.
"""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import hipuq
from hipuq.methods import METHODS
from hipuq.models import MODELS

PACKAGE = Path(hipuq.__file__).parent

HEAVY = ("xarray", "pandas", "scipy", "chaospy", "SALib", "matplotlib", "dask", "pydantic")

ORDER = [
    ["errors"],
    ["differences"],
    ["threads"],
    ["_chaospy", "_salib"],
    ["schema"],
    ["distributions"],
    ["contact"],
    ["variation"],
    ["uncertain"],
    ["inputs"],
    ["sampling"],
    ["designs"],
    ["expansion"],
    ["compiled"],
    ["cea"],
    ["models"],
    ["store"],
    ["progress"],
    ["evaluation"],
    ["intervals"],
    ["friction_range"],
    ["friction"],
    ["fragility_curve"],
    ["friction_limits"],
    ["evidence"],
    ["combinations"],
    ["estimation"],
    ["occurring"],
    ["saltelli"],
    ["surrogates"],
    ["methods"],
    ["rounds"],
    ["driver"],
    ["sweeping"],
    ["comparison"],
    ["configuration"],
    ["study"],
    ["plots"],
    ["report"],
    ["cli"],
    ["__main__"],
]
RANK = {name: rank for rank, names in enumerate(ORDER) for name in names}

FILES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def top(path: Path) -> str:
    """Return the module or folder directly below the package that a file belongs to."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> list[tuple[str, int, int]]:
    """Return (dotted name, line, level) of every import in a file; `from a import b` gives a.b."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(alias.name, node.lineno, 0) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found += [(f"{node.module}.{alias.name}", node.lineno, node.level) for alias in node.names]
    return found


def test_importing_the_package_is_light():
    """So that a short command answers at once: nothing heavy is loaded before it is used."""
    code = f"import sys, hipuq; print(*[name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
    assert done.stderr == ""


def test_every_public_name_can_be_loaded():
    missing = [name for name in hipuq.__all__ if not hasattr(hipuq, name)]
    assert missing == []
    assert {"evaluate", "design", "estimate", "run", "Inputs", "ContactPatterns"} <= set(hipuq.__all__)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_go_one_way(path):
    here = top(path)
    assert here in RANK, f"{here} has no place in the order of modules"
    wrong = []
    for name, line, level in imports(path):
        if level:
            wrong.append(f"line {line}: relative import")
        if name.split(".")[0] != "hipuq":
            continue
        if name in ("hipuq", "hipuq.__version__"):
            continue  # the version is what everything may know
        there = name.split(".")[1]
        if RANK.get(there, len(ORDER)) > RANK[here]:
            wrong.append(f"line {line}: {here} imports {name}")
    assert wrong == []


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_who_imports_what(path):
    """Methods know no model, one file knows chaospy, one SALib, and the kernel knows no labels."""
    names = {name for name, _, _ in imports(path)}
    heads = {name.split(".")[0] for name in names}
    assert "chaospy" not in heads or path.name == "_chaospy.py"
    assert "SALib" not in heads or path.name == "_salib.py"
    if top(path) in ("expansion", "estimation", "saltelli", "surrogates", "methods"):
        assert not any(name.startswith(("hipuq.models", "hipuq.cea", "hipuq.evaluation")) for name in names)
    if top(path) == "cea":
        assert not heads & {"xarray", "chaospy"}
        assert all(
            name.startswith(("hipuq.cea", "hipuq.compiled", "hipuq.errors"))
            for name in names
            if name.startswith("hipuq")
        )
    if top(path) not in ("plots", "report"):
        assert "matplotlib" not in heads


def test_registries_agree_with_their_folders():
    """A method is a file of its own name; every file of models gives something to the registry."""
    for name, method in METHODS.items():
        assert method.design.__module__ == method.estimate.__module__ == f"hipuq.methods.{name}"
    shared = {"base", "__init__"}
    assert {path.stem for path in (PACKAGE / "methods").glob("*.py")} - shared == set(METHODS)
    modules = {function.__module__.split(".")[-1] for function in MODELS.values()}
    assert {path.stem for path in (PACKAGE / "models").glob("*.py")} - {
        "base",
        "blocks",
        "damping",
        "matrices",
        "matrix_input",
        "onset",
        "outcomes",
        "parameter",
        "sensitivity",
        "shapes",
        "__init__",
    } == modules
