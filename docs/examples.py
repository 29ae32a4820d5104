"""Run the blocks of code of the pages, in order, each page in a folder of its own.

What becomes of a block follows from its language; CONTRIBUTING.md tells writers the same.

python
    is run, in one namespace for the page.
output
    is what the block of python before it prints; ``...`` stands for anything.
console
    lines after ``$`` are run, the lines below them are what they print.
code-block with a caption
    is written to the file that the caption names.
toml
    is a part of a study file: with `STUDY` and `ANALYSIS` it must be one that could be run.
text
    is no code.

A comment above a block, ``<!-- not run: why -->``, keeps it from being run; it is still parsed.
``<!-- exit: 1 -->`` says that a command fails.
"""

import contextlib
import doctest
import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from markdown_it import MarkdownIt
from sybil import Document, Example, Region, Sybil

import hipuq

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs" / "figures"

STUDY = {
    "title": 'title = "Part of a page"',
    "model": 'model = { name = "ring", preset = "oberst2016" }',
    "friction": 'inputs.friction = { distribution = "uniform", lower = 0.0, upper = 0.1 }',
}
ANALYSIS = """
[[analysis]]
name = "page"
method = "monte_carlo"
n = 8
of = "any_unstable"
"""

GENERATED = frozenset(
    "{toctree} {literalinclude} {schema} {results} {models} {methods} {distributions} {keys} {help} "
    "{study}".split()
)
"""Directives that hold no code of their own. Any other fence is code, or refused."""

COLONS = re.compile(r"^:{3,}\{(code|code-block|sourcecode|doctest)\}", re.MULTILINE)
"""Code in a fence of colons, which is none to Markdown."""

COMMENT = re.compile(r"<!--\s*(not run|exit):\s*(\S.*?)\s*-->\s*$")
CAPTION = re.compile(r"(?::[\w-]+:[^\n]*\n)*?:caption:[ ]*(\S+)\n(?::[\w-]+:[^\n]*\n)*\n?")
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
PRINTED = "printed by the block before"


def blocks(document: Document) -> Iterator[Region]:
    """Return the blocks of code of a page."""
    lines = document.text.splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))
    for token in MarkdownIt("commonmark").parse(document.text):
        if token.type == "code_block":
            raise ValueError(
                f"{document.path}, line {token.map[0] + 1}: indented code; use ``` and a language"
            )
        # What a prompt of Python begins with is a quotation in a quotation in a quotation.
        prompt = token.type == "blockquote_open" and token.level > 1
        if prompt or (token.type == "inline" and COLONS.search(token.content)):
            raise ValueError(f"{document.path}, line {token.map[0] + 1}: code that would not run; use ```")
        if token.type != "fence" or token.info.split(" ")[0] in GENERATED:
            continue
        first, last = token.map
        above = COMMENT.search("".join(lines[:first]).rstrip())
        kind, said = above.groups() if above else ("", "")
        region = Region(starts[first], starts[last])
        region.parsed = (token.info.strip(), token.content, kind, said)
        region.evaluator = evaluate
        yield region


def evaluate(example: Example) -> str | None:
    """Do with a block what its language says; return what is wrong, if anything is."""
    info, content, kind, said = example.parsed
    language = info.removeprefix("{code-block}").strip()
    if info.startswith("{eval-rst}"):
        return "code in it would not run" if re.search(r"code(-block)?::|>>> |doctest::", content) else None
    if info.startswith("{") and not info.startswith("{code-block}"):
        return f"{info} is no directive known here: it may hide code"
    if info.startswith("{"):
        return written(content, language)
    if kind == "not run":
        return parsed(language, content)
    if language == "python":
        return run(example, content)
    if language == "output":
        return compared(content, example.namespace.pop(PRINTED, "nothing: no block of python before it"))
    if language == "console":
        return commands(content, int(said) if kind == "exit" else 0, Path.cwd())
    if language == "toml":
        return part_of_a_study(content)
    if language == "text":
        return None
    return f"what should become of a block in {language or 'no language'}? See docs/examples.py"


def run(example: Example, content: str) -> None:
    """Run a block of Python and keep what it prints; errors point into the page."""
    code = compile("\n" * example.line + content, example.path, "exec", dont_inherit=True)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(code, example.namespace)
    example.namespace[PRINTED] = printed.getvalue()


def compared(want: str, got: str) -> str | None:
    """Return the difference between what a page shows and what was printed."""
    checker, sample = doctest.OutputChecker(), doctest.Example("", want)
    if checker.check_output(want, got, FLAGS):
        return None
    return checker.output_difference(sample, got, FLAGS | doctest.REPORT_NDIFF)


def commands(content: str, code: int, folder: Path) -> str | None:
    """Run the commands of a terminal and compare what they print."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "COLUMNS": "100", "NO_COLOR": "1"}
    found = re.findall(r"^\$ ((?:.*\\\n)*.*)\n((?:(?!\$ ).*\n)*)", content, re.MULTILINE)
    for command, want in found:
        done = subprocess.run(
            ["bash", "-o", "pipefail", "-c", command],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=300,
        )
        if done.returncode != code:
            return f"$ {command}\nended with {done.returncode}, not {code}:\n{done.stdout}"
        if want.strip() and (wrong := compared(want, done.stdout)):
            return f"$ {command}\n{wrong}"
    return None if found and content.startswith("$ ") else "a console begins with $ and a command"


def written(content: str, language: str) -> str | None:
    """Write the file that the caption names."""
    caption = CAPTION.match(content)
    if caption is None:
        return "a {code-block} is a file: give it :caption: NAME, or use a plain block"
    body = content[caption.end() :]
    file = Path.cwd() / caption[1]
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(body, encoding="utf-8")
    if file.name == "study.toml":
        hipuq.load_study(file)
    return parsed(language, body)


def parsed(language: str, content: str) -> str | None:
    """Check that a block that is not run is at least in its language."""
    if language == "python":
        compile(content, "block", "exec", dont_inherit=True)
    elif language == "toml":
        tomllib.loads(content)
    return None


def part_of_a_study(content: str) -> None:
    """Check that a study of which this is a part could be run."""
    given = tomllib.loads(content)
    there = {*given, *given.get("inputs", {})}
    text = "\n".join([*(line for name, line in STUDY.items() if name not in there), content])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "study.toml"
        file.write_text(text + ("" if there & {"analysis", "compare"} else ANALYSIS), encoding="utf-8")
        hipuq.load_study(file)


def begin(namespace: dict[str, Any]) -> None:
    """Go to an empty folder with the studies in it."""
    import matplotlib

    matplotlib.use("agg")
    folder = Path(tempfile.mkdtemp(prefix="hipuq-page-"))
    shutil.copytree(ROOT / "studies", folder / "studies")
    namespace["__name__"] = "__page__"
    namespace["folders of the page"] = (folder, Path.cwd())
    os.chdir(folder)


def end(namespace: dict[str, Any]) -> None:
    """Keep the figures if that is wanted, leave the folder and remove it."""
    folder, before = namespace["folders of the page"]
    if os.environ.get("HIPUQ_FIGURES"):
        for file in sorted(folder.glob("*.png")):
            shutil.copyfile(file, FIGURES / file.name)
    os.chdir(before)
    shutil.rmtree(folder)


pages = Sybil(
    parsers=[blocks],
    patterns=["docs/**/*.md", "docs/*.md", "README.md", "CONTRIBUTING.md"],
    path=str(ROOT),
    setup=begin,
    teardown=end,
)
