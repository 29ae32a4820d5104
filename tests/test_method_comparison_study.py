"""The comparison of methods with few replicates: all its problems, their known answers, report."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from closed_forms import hoffmann_scattered, hulten_scattered
from rich.console import Console

import hipuq
from hipuq.report.page import write_report
from hipuq.report.text import show_results
from hipuq.study import Study

STUDY = Path(__file__).parents[1] / "studies" / "method_comparison"

PROBLEMS = ("hoffmann", "hulten", "hoffmann_ST", "oberst2016", "ring", "ring_S1", "ring_ST")


FEWER = {"integrated": 16, "chaos of 39 inputs": 512}
"""Contenders that take most of the time -> a smaller size than their budget allows."""


@pytest.fixture(scope="module")
def whole() -> Study:
    return hipuq.load_study(STUDY)


def small(problem):
    """Return a problem with two replicates of each contender's smallest budget.

    In the first problem they have two budgets, but for those that integrate at random.
    """
    race = problem.race
    contenders = []
    for one in race.contenders:
        two = problem.name == PROBLEMS[0] and not one.name.startswith(
            ("integrated random", "integrated Sobol")
        )
        sizes = {b: min(n, FEWER.get(one.name, n)) for b, n in list(one.sizes.items())[: 1 + two]}
        contenders.append(replace(one, sizes=sizes, replicates=2))
    budgets = tuple(b for b in race.budgets if any(b in one.sizes for one in contenders))
    return replace(problem, race=replace(race, contenders=tuple(contenders), budgets=budgets, replicates=2))


@pytest.fixture(scope="module")
def results(whole, tmp_path_factory):
    assert tuple(problem.name for problem in whole.problems) == PROBLEMS
    problems = tuple(small(problem) for problem in whole.problems)
    out = tmp_path_factory.mktemp("method_comparison")
    tree = hipuq.run_study(replace(whole, problems=problems), out, progress=False)
    write_report(tree, out)
    return hipuq.load_results(out), out


def of(results, problem):
    return results[0][f"compare/{problem}"].to_dataset()


def test_references_are_the_closed_forms(whole):
    found = {problem.name: problem.race.reference for problem in whole.problems}
    assert found["hoffmann"].value == pytest.approx(hoffmann_scattered().probability, abs=1e-14)
    assert found["hulten"].value == pytest.approx(hulten_scattered().probability, abs=1e-14)
    assert found["hoffmann_ST"].value == pytest.approx(hoffmann_scattered().total, abs=1e-14)
    assert all(one.source for name, one in found.items() if name != "oberst2016")


def test_exact_methods_are_exact(results):
    for problem in ("hoffmann", "hulten"):
        chaos = of(results, problem).loc[{"method": "integrated chaos"}]
        assert float(chaos["rmse"].max()) < 1e-10
        assert (chaos["coverage"][:2] == 1).all()


def test_each_problem_is_compared(results):
    for problem in PROBLEMS:
        race = of(results, problem)
        ran = race["evaluations"] > 0
        assert ran.any("budget").all()
        assert (race["evaluations"].where(ran) <= race["budget"]).where(ran, True).all()
        # Indices of few events are undefined; nothing else is.
        rmse = race.get("rmse_overall", race["rmse"])
        if not problem.endswith(("S1", "ST")):
            assert (rmse.notnull() == ran).all()
        assert float(rmse.max()) < 0.6
        assert (race["model_seconds"].where(ran) < race["seconds"].where(ran)).where(ran, True).all()


def test_patterns_have_their_own_errors(results):
    race = of(results, "oberst2016")
    assert race["rmse"].sizes["pattern"] == 130
    np.testing.assert_allclose(race["rmse_overall"], np.sqrt((race["rmse"] ** 2).mean("pattern")), rtol=1e-12)
    # Exact means over the 36 patterns of 7 and the one of 9, as certified.
    assert race["reference"][-1].item() == pytest.approx(0.9050272753, abs=1e-10)
    assert "integrated" in race.attrs["reference_source"]


def test_report_and_screen_tell_of_each_problem(results):
    tree, out = results
    page = (out / "report.html").read_text()
    console = Console(width=100, record=True, file=io.StringIO())
    show_results(tree, console)
    shown = console.export_text()
    for problem in PROBLEMS:
        assert f"Methods compared, {problem}" in page
        assert problem in shown
        assert (out / "figures" / f"compare-{problem}-error.png").stat().st_size > 10_000
