"""The head of a gallery page, made from its study: what is run, how long it takes, and the study file.

``{study} oberst2016`` with the option ``:takes: 3 seconds``, which is measured and so written on the page.
"""

from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from tables import code, table

import hipuq
from hipuq.study.plan import Study

ROOT = Path(__file__).parents[2]


def analyses(study: Study) -> str:
    """Return the analyses of a study as a table in Markdown, and its comparisons as one."""
    rows = [
        [
            code(one.name),
            one.model.label,
            one.method.replace("_", " "),
            f"{one.n:,}",
            ", ".join(map(code, one.of)) + "".join(f", over {code(name)}" for name in one.over),
            f"{one.evaluations:,}",
        ]
        for one in study.analyses
    ]
    raced = [
        [
            code(problem.group.removeprefix("compare/")),
            problem.race.label,
            len(problem.race.contenders),
            f"{problem.race.budgets[0]:,} to {problem.race.budgets[-1]:,}",
            f"{problem.race.replicates:,}",
            f"{problem.evaluations:,}",
        ]
        for problem in study.problems
    ]
    tables = (
        (["analysis", "model", "method", "n", "of", "evaluations"], rows),
        (["problem", "model", "methods", "evaluations of a run", "replicates", "evaluations"], raced),
    )
    return "\n\n".join(table(head, body) for head, body in tables if body)


class StudyHead(SphinxDirective):
    """``{study} NAME``, option ``takes``."""

    required_arguments = 1
    option_spec = {"takes": directives.unchanged_required}  # noqa: RUF012

    def run(self) -> list[nodes.Node]:
        """Return title, command, table and study file."""
        name = self.arguments[0]
        file = ROOT / "studies" / name / "study.toml"
        self.env.note_dependency(str(file))
        study = hipuq.load_study(file)
        parts = [
            f"*{study.title}*\n",
            "```console",
            f"$ hipuq run studies/{name}",
            "```",
            f"It takes {self.options['takes']} for {study.evaluations:,} evaluations; seed {study.seed}.\n",
            analyses(study),
            "",
            f"````{{dropdown}} The study file: studies/{name}/study.toml",  # no code: it would end the fence
            f"```{{literalinclude}} /../studies/{name}/study.toml",
            ":language: toml",
            "```",
            "````",
        ]
        return self.parse_text_to_nodes("\n".join(parts))


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("study", StudyHead)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
