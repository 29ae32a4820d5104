"""How exact results read beside sampled ones: decimals, bounds, no seed, and whether intervals hold them."""

import io

import numpy as np
import published
import pytest
from helpers import SMALL_STUDY
from rich.console import Console

import hipuq
from hipuq.report.page import content, write_report
from hipuq.report.partners import comparison, groups_of
from hipuq.report.summary import analyses, bounded, headline, inputs_table, tables
from hipuq.report.text import show_results

STUDY = (
    SMALL_STUDY
    + """
[[analysis]]
name = "drawn"
method = "monte_carlo"
n = 64
of = ["unstable", "any_unstable"]
options = { stratify = "contact" }
[[analysis]]
name = "certain"
method = "monte_carlo"
n = 1
integrate_friction = true
of = ["probability", "probability_by_mode"]
options = { stratify = "contact" }
[report]
damping_samples = 0
"""
)


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    return hipuq.run_study(hipuq.load_study(folder), folder / "out", progress=False)


@pytest.fixture
def exact(tree):
    return tree["certain/probability"].to_dataset(inherit=False).copy(deep=True)


def shown(tree):
    """Return what is printed of each analysis in full."""
    found = {}
    for name in analyses(tree):
        stream = io.StringIO()
        show_results(tree, Console(file=stream, width=100), analysis=name)
        found[name] = stream.getvalue().strip()
    return found


def test_exact_results_have_neither_seed_nor_interval(tree):
    text = shown(tree)
    assert "seed" in text["drawn"]
    assert "interval" in text["drawn"]
    assert text["certain"].splitlines()[0].endswith(", no damping, exact")
    for word in ("seed", "interval", "bounds", "100%"):
        assert word not in text["certain"]


def test_exact_probabilities_have_eight_decimals(tree, exact):
    assert headline(exact).endswith(f": {float(exact['probability_overall']):.8f}")
    (table,) = tables(exact)
    assert table.columns == ["oscillators in contact", "patterns", "mean", "minimum", "maximum"]
    known = f"{published.PROBABILITY_ANY_UNSTABLE['oberst2016'][9]:.8f}"
    assert table.rows[1] == ["9", "1", known, known, known]
    assert known in shown(tree)["certain"]
    by_mode = tables(tree["certain/probability_by_mode"].to_dataset(inherit=False))
    assert [table.title.split("; ")[1].split(" over")[0] for table in by_mode] == [
        "mean",
        "minimum to maximum",
    ]
    assert all(len(cell.split(".")[1]) == 6 for row in by_mode[0].rows for cell in row[1:])


@pytest.mark.parametrize(("width", "seen"), [(1e-13, False), (1e-6, True)])
def test_bounds_are_shown_where_they_say_more(exact, width, seen):
    for key in ("probability_overall", "probability_mean"):
        exact[f"{key}_high"] = exact[f"{key}_high"] + width
        assert bounded(exact, key) is seen
    assert ("bounds" in headline(exact)) is seen
    (table,) = tables(exact)
    assert ("bounds" in table.columns) is seen


def test_an_unknown_exact_value_has_bounds(exact):
    exact["probability_mean"][0] = np.nan
    exact["probability_mean_low"][0], exact["probability_mean_high"][0] = 0.25, 0.5
    (table,) = tables(exact)
    assert table.rows[0][2:4] == ["n/a", "0.25000000 to 0.50000000"]


def test_the_weighted_mean_is_shown_where_it_differs(exact):
    (plain,) = tables(exact)
    exact["probability_weighted"][0] += 0.01
    (table,) = tables(exact)
    assert table.columns == [*plain.columns, "weighted mean"]


def test_inputs_name_what_is_integrated(tree, exact):
    rows = {row[0]: row for row in inputs_table(exact).rows}
    drawn = {row[0]: row for row in inputs_table(tree["drawn/any_unstable"].to_dataset(inherit=False)).rows}
    assert rows["friction"][3] == "integrated, not sampled"
    assert rows["friction"][-1] == drawn["friction"][-1] == "Uniform(lower=0.0, upper=0.1)"
    assert drawn["friction"][3] == "value"
    assert rows["contact"][-1] == drawn["contact"][-1]


def test_intervals_that_hold_the_exact_value_are_counted(tree):
    found = groups_of(tree.copy(deep=True))
    drawn, certain = found["drawn"], found["certain"]
    inside = drawn["any_unstable"]["probability_mean"].values
    certain["probability"]["probability_mean"].values[:] = inside
    certain["probability_by_mode"]["probability_mean"].values[:] = drawn["unstable"][
        "probability_mean"
    ].transpose(*certain["probability_by_mode"]["probability_mean"].dims)
    modes = int((drawn["unstable"]["probability_mean"] > 0).sum())
    line = "95% intervals that hold the exact value (certain): "
    assert comparison("drawn", found) == f"{line}2 of 2 by group, {modes} of {modes} by group and mode"
    certain["probability"]["probability_mean"].values[:] = [0.1, inside[1]]
    assert comparison("drawn", found).startswith(f"{line}1 of 2 by group, {modes}")
    certain["probability"]["probability_mean"].values[:] = [np.nan, inside[1]]
    assert comparison("drawn", found).startswith(f"{line}1 of 1 by group, {modes}")
    assert comparison("certain", found) == "The same by sampling: drawn"


def test_without_a_partner_nothing_is_compared(tree):
    found = groups_of(tree)
    for name in found:
        assert comparison(name, {name: found[name]}) == ""


def test_the_page_says_the_same(tree):
    drawn, certain = content(tree, {})["sections"]
    assert (drawn["exact"], drawn["integrated"]) == (False, False)
    assert (certain["exact"], certain["integrated"], certain["bounded"]) == (True, True, False)
    assert "by group and mode" in drawn["comparison"]


def test_the_page_of_exact_results(tree, tmp_path):
    page = write_report(tree, tmp_path).read_text(encoding="utf-8")
    part = page[page.index('id="analysis-certain"') : page.index('id="reading"')]
    assert "no sampling error. Friction is integrated: " in part
    for word in ("Intervals", "100%", "seed", "Bounds"):
        assert word not in part
