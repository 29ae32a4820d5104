"""What holds the documentation to its word: the runner of its code can fail, every study has its page."""

import importlib.util
import re
from pathlib import Path

import pytest
from sybil import Document

from hipuq.errors import StudyError

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]


def load(name: str, file: Path):
    """Return a module of the documentation, which is no package."""
    spec = importlib.util.spec_from_file_location(name, file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


examples = load("examples_of_pages", DOCS / "examples.py")


@pytest.fixture
def wrong(tmp_path, monkeypatch):
    """Return what the runner finds wrong in a text, for each of its blocks."""
    monkeypatch.chdir(tmp_path)

    def found(text: str) -> list[str | None]:
        document = Document(text, str(tmp_path / "page.md"))
        for region in examples.blocks(document):
            document.add(region)
        return [examples.evaluate(example) for example in document.examples()]

    return found


def fence(language: str, *lines: str, above: str = "") -> str:
    """Return a block of code."""
    return "\n".join([above, f"```{language}", *lines, "```", ""])


def test_what_python_prints_must_be_on_the_page(wrong):
    assert (
        wrong(fence("python", "x = 2") + fence("python", "print(x + 1)") + fence("output", "3")) == [None] * 3
    )
    _, said = wrong(fence("python", "print(3)") + fence("output", "4"))
    assert "+ 3" in said and "- 4" in said
    (said,) = wrong(fence("output", "4"))
    assert "no block of python before it" in said
    with pytest.raises(ZeroDivisionError):
        wrong(fence("python", "1 / 0"))


def test_an_error_of_a_block_points_to_its_line_of_the_page(wrong):
    with pytest.raises(ZeroDivisionError) as caught:
        wrong("\n\n\n" + fence("python", "x = 0", "1 / x"))
    assert caught.traceback[-1].lineno + 1 == 7


def test_commands_must_end_and_print_as_they_should(wrong):
    assert wrong(fence("console", "$ echo one", "one", "$ echo two")) == [None]
    assert wrong(fence("console", "$ echo one \\", "    two", "one two")) == [None]
    (said,) = wrong(fence("console", "$ echo one", "two"))
    assert "+ one" in said
    (said,) = wrong(fence("console", "$ exit 3"))
    assert "ended with 3, not 0" in said
    assert wrong(fence("console", "$ exit 3", above="<!-- exit: 3 -->")) == [None]
    (said,) = wrong(fence("console", "$ false | cat"))
    assert "ended with 1" in said
    (said,) = wrong(fence("console", "echo one"))
    assert "begins with $" in said


def test_a_block_with_a_caption_is_a_file(wrong, tmp_path):
    text = fence("{code-block} toml", ":caption: own/settings.toml", "", 'title = "x"')
    assert wrong(text + fence("console", "$ cat own/settings.toml", 'title = "x"')) == [None, None]
    assert (tmp_path / "own" / "settings.toml").read_text() == 'title = "x"\n'
    (said,) = wrong(fence("{code-block} toml", 'title = "x"'))
    assert ":caption: NAME" in said


def test_parts_of_a_study_file_must_be_such_that_they_could_be_run(wrong):
    good = ["[[analysis]]", 'name = "a"', 'method = "sobol"', "n = 8", 'of = "margin"']
    contact = ["[inputs.contact]", 'distribution = "contact_patterns"', "in_contact = [8, 9]"]
    assert wrong(fence("toml", *good) + fence("toml", *contact)) == [None, None]
    for bad in ("damping = 1", 'of = "margins"', "options = { nosuch = 3 }"):
        text = [line for line in good if not line.startswith(bad[:3])]
        with pytest.raises(StudyError):
            wrong(fence("toml", *text, bad))
    with pytest.raises(StudyError):
        wrong(fence("toml", *[line.replace("contact]", "contcat]") for line in contact]))
    with pytest.raises(StudyError):
        wrong(fence("{code-block} toml", ":caption: study.toml", *good))


@pytest.mark.parametrize("kind", ["dropdown", "note", "code", "sourcecode", "doctest"])
def test_code_cannot_hide_in_a_directive(wrong, kind):
    (said,) = wrong(fence(f"{{{kind}}} python", "1 / 0"))
    assert "no directive known" in said


def test_code_cannot_hide_beside_the_fences(wrong):
    (said,) = wrong(fence("{eval-rst}", ".. code-block:: python", "", "   1 / 0"))
    assert "would not run" in said
    for text in (":::{code-block} python\n1 / 0\n:::\n", ">>> 1 / 0\n"):
        with pytest.raises(ValueError, match="code that would not run"):
            wrong(text)


def test_what_is_not_run_says_why_and_is_still_parsed(wrong):
    above = "<!-- not run: needs a cluster -->"
    assert wrong(fence("python", "1 / 0", above=above)) == [None]
    with pytest.raises(SyntaxError):
        wrong(fence("python", "1 +", above=above))
    with pytest.raises(ZeroDivisionError):
        wrong(fence("python", "1 / 0", above="<!-- not run: -->"))


def test_code_without_a_language_is_refused(wrong):
    (said,) = wrong(fence("", "x = 1"))
    assert "no language" in said
    with pytest.raises(ValueError, match="line 3: indented code"):
        wrong("Text\n\n    x = 1\n")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_block_of_a_page_is_one_that_the_runner_knows(page):
    document = Document.parse(str(page), examples.blocks)
    known = {"python", "output", "console", "toml", "text", "{eval-rst}"}
    for example in document.examples():
        info = example.parsed[0]
        assert info in known or info.startswith("{code-block}"), f"{page}, line {example.line}: {info}"
    # MyST takes such a line for a comment: its text would be lost without a warning.
    lines = page.read_text(encoding="utf-8").splitlines()
    assert [number for number, line in enumerate(lines, 1) if re.match(r"\s*%", line)] == []


def test_every_study_has_its_page_in_the_gallery():
    studies = {file.parent.name for file in (ROOT / "studies").glob("*/study.toml")}
    pages = {page.stem for page in (DOCS / "gallery").glob("*.md")} - {"index"}
    assert pages == studies
    index = (DOCS / "gallery" / "index.md").read_text(encoding="utf-8")
    for name in studies:
        text = (DOCS / "gallery" / f"{name}.md").read_text(encoding="utf-8")
        assert f"```{{study}} {name}\n:takes: " in text
        assert "![" in text, f"{name} shows no figure"
        assert re.search(rf"^{name}$", index, re.MULTILINE), f"{name} is not in the index"


def test_every_figure_is_shown_somewhere():
    shown = {
        Path(name).name for page in PAGES for name in re.findall(r"([\w./-]+\.(?:png|svg))", page.read_text())
    }
    kept = {file.name for file in (DOCS / "figures").iterdir()}
    assert kept - shown == set()
