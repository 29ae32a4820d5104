"""Comparisons of methods in the results tree, on the screen, in pictures and on the page."""

import io

import chaospy as cp
import pytest
from compared_results import compared, index_race, named_race, spread, with_comparisons
from index_results import sobol
from index_results import tree as study_tree
from rich.console import Console

import hipuq
from hipuq.report.comparison import facts, summary, tables
from hipuq.report.comparison_cost import cost_summary
from hipuq.report.comparison_error import error_table
from hipuq.report.comparison_winner import time_table, winner_table
from hipuq.report.figures import pictures
from hipuq.report.page import content, write_report
from hipuq.report.summary import analyses, comparisons
from hipuq.report.text import show_results


def shown(tree, width=100):
    stream = io.StringIO()
    show_results(tree, Console(file=stream, width=width))
    return stream.getvalue()


@pytest.fixture(scope="module")
def race():
    return named_race()


@pytest.fixture(scope="module")
def indices():
    return index_race()


def test_comparisons_are_no_analyses(race):
    both = with_comparisons(study_tree(one=sobol()), hoffmann=race)
    assert analyses(both) == ["one"]
    ((name, found),) = comparisons(both)
    assert name == "hoffmann"
    assert found.identical(race)
    assert list(comparisons(study_tree(one=sobol()))) == []


def test_the_screen_tells_who_wins_and_what_it_costs(race):
    text = shown(with_comparisons(study_tree(one=sobol()), hoffmann=race))
    assert "one: sobol, indices of margin" in text
    part = text[text.index("compare hoffmann: Two masses, two_dof(hoffmann2002)") :]
    flat = " ".join(part.split())
    for line in [*facts(race), *summary(race), error_table(race).note]:
        assert line in flat
    assert "Lowest error: lhs at every budget" in flat
    assert all(len(line) <= 100 for line in part.splitlines())
    assert "no results" not in text


def test_the_screen_of_comparisons_alone_and_of_nothing(race):
    text = shown(with_comparisons(study_tree(), hoffmann=race))
    assert text.strip().startswith("compare hoffmann")
    assert "no results" in shown(study_tree())


def test_the_page_holds_tables_words_and_pictures(race, indices, tmp_path):
    root = with_comparisons(study_tree(one=sobol()), hoffmann=race, indices=indices)
    first, second = content(root, {})["comparisons"]
    assert first["label"] == "Two masses, two_dof(hoffmann2002)"
    assert [table.title.split(":")[0] for table in first["tables"]] == [
        "Error",
        "Bias",
        "Intervals",
        "Which wins within so many evaluations",
        "Which wins within a time",
        "What it costs",
    ]
    assert second["tables"][1].title.startswith("Error by parameter")
    page = write_report(root, tmp_path).read_text(encoding="utf-8")
    text = " ".join(page.split())
    for line in [first["lead"], *first["facts"], *first["remarks"]]:
        assert line in text
    assert "sampler = latin_hypercube" in text
    assert "A comparison repeats each contender" in text
    files = {file.name for file in (tmp_path / "figures").iterdir()}
    kinds = ("error", "coverage", "cost")
    assert {f"compare-{name}-{kind}.png" for name in ("hoffmann", "indices") for kind in kinds} <= files
    assert page.count("data:image/png") == len(files)
    assert page.count('class="wide"') == 3


def test_the_page_of_comparisons_alone_and_of_nothing(race, tmp_path):
    page = write_report(with_comparisons(study_tree(), one=race), tmp_path).read_text(encoding="utf-8")
    assert ">Methods compared, one: " in page
    assert "There are no results" not in page
    page = write_report(study_tree(), tmp_path).read_text(encoding="utf-8")
    assert "There are no results" in page
    assert "A comparison repeats" not in page


def test_a_comparison_without_any_interval_has_no_picture_of_them(tmp_path):
    ways = {"a": spread(width=None), "b": spread(width=None)}
    root = with_comparisons(study_tree(), one=compared(ways))
    assert [picture.name for picture in pictures(root)] == ["error", "cost"]


def test_a_race_as_it_is_run(tmp_path):
    model = hipuq.models.two_dof()
    inputs = model.inputs(friction=cp.Uniform(0.0, 0.5), k1=hipuq.relative(cp.Uniform(-0.1, 0.1)))
    made = hipuq.compare(
        model,
        inputs,
        {
            "random": {"method": "monte_carlo"},
            "lhs": {"method": "monte_carlo", "options": {"sampler": "latin_hypercube"}, "replicates": 4},
            "chaos": {"method": "chaos", "budgets": [128]},
        },
        of="any_unstable",
        reference=0.1,
        budgets=[64, 128],
        replicates=5,
        rng=1,
        progress=False,
    )
    file = tmp_path / "results.nc"
    hipuq.save_results(with_comparisons(study_tree(), small=made), file)
    tree = hipuq.load_results(file)
    text = " ".join(shown(tree).split())
    assert "5 replicates (lhs 4), seed 1, 2,368 evaluations in all" in text
    page = write_report(tree, tmp_path).read_text(encoding="utf-8")
    for table in tables(made):
        for row in table.rows:
            assert row[0] in page
    assert len(list((tmp_path / "figures").iterdir())) == 3


@pytest.mark.parametrize("number", [1, 8])
def test_one_contender_and_many(number):
    made = compared({f"c{i}": spread(0.5 + 0.1 * i) for i in range(number)}, budgets=[100], truth=0.0)
    assert error_table(made).columns == ["contender", "100"]
    assert len(error_table(made).rows) == number
    assert bool(winner_table(made).rows) is bool(time_table(made).rows) is (number > 1)
    assert (cost_summary(made) == "") is (number == 1)
    text = shown(with_comparisons(study_tree(), one=made))
    assert ("*" in text) is (number > 1)
    names = [picture.name for picture in pictures(with_comparisons(study_tree(), one=made))]
    assert names == ["error", "coverage", *(["cost"] if number > 1 else [])]
