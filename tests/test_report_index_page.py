"""Sobol indices and polynomial chaos in pictures and on the page."""

import io

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from index_results import NAMES, REASON, SENTENCE, by_mode, chaos, sobol, tree
from rich.console import Console

import hipuq
from hipuq.report.figures import pictures
from hipuq.report.page import content, write_report
from hipuq.report.sensitivity import remarks
from hipuq.report.summary import headline, tables
from hipuq.report.text import show_results

NAN = [np.nan] * 6


# Pictures and page


def names(results):
    found = list(pictures(tree(one=results)))
    for picture in found:
        picture.figure.draw_without_rendering()
        assert picture.caption.endswith(".")
    return [picture.name for picture in found]


def test_a_picture_for_each_thing_there_is():
    assert names(sobol()) == ["indices_margin", "second_order_margin", "convergence_margin"]
    assert names(chaos()) == ["indices_margin", "second_order_margin", "surrogate_margin"]
    assert names(sobol(second=False)) == ["indices_margin", "convergence_margin"]
    assert names(sobol(["k1"], [0.9], [1.0])) == ["indices_margin", "convergence_margin"]
    assert names(sobol(first=NAN, total=NAN)) == names(sobol())


def test_modes_have_no_pictures():
    assert names(by_mode(sobol())) == names(by_mode(chaos())) == []


def test_both_orders_of_indices_converge_side_by_side():
    picture = list(pictures(tree(one=sobol())))[-1]
    said = [ax.get_ylabel().split("-order")[0] for ax in picture.figure.axes]
    assert said == ["first", "total"]


def test_convergence_of_a_probability():
    said = {"long_name": "probability: any mode unstable", "units": "1"}
    results = xr.Dataset(coords={"budget": [100, 200]}, attrs={"confidence": 0.95, "of": "margin"})
    for end in ("", "_low", "_high"):
        results[f"probability_by_budget{end}"] = ("budget", [0.4, 0.5], said)
    assert names(results) == ["convergence_margin"]
    assert names(results.expand_dims(mode=[1, 2])) == []


def test_the_page_says_what_intervals_mean(tmp_path):
    root = tree(drawn=sobol(), fitted=chaos(trusted=0))
    drawn, fitted = content(root, {})["sections"]
    assert "95% percentile limits of a bootstrap" in drawn["note"]
    assert "limits from true evaluations" in fitted["note"]
    page = write_report(root, tmp_path).read_text(encoding="utf-8")
    text = " ".join(page.split())
    assert SENTENCE in text
    assert "counted as stable in the lower limit" not in text
    assert "The surrogate is not to be trusted: Q2 is 0.41" in text
    assert "A first-order index (S1) is the share of the variance that goes" in text
    assert "0.470 (0.440 to 0.500)" in text
    files = sorted(file.name for file in (tmp_path / "figures").iterdir())
    assert len(files) == 6
    assert "fitted-surrogate_margin.png" in files


def test_the_page_says_which_outcome_is_undefined():
    groups = {"one/margin": sobol(), "one/onset": sobol(first=NAN, total=NAN)}
    (section,) = content(xr.DataTree.from_dict({"/": tree().to_dataset()} | groups), {})["sections"]
    assert f"onset: Undefined indices: {REASON}" in section["remarks"]


def test_parameters_keep_the_names_they_are_selected_by():
    """Tables of one outcome name parameters as the coordinate does, so that they can be selected."""
    assert {row[0] for row in tables(sobol())[0].rows} == set(NAMES)


# Results as the methods make them


@pytest.fixture(scope="module")
def made():
    model = hipuq.models.two_dof()
    inputs = model.inputs(friction=cp.Uniform(0.0, 0.5), k1=hipuq.relative(cp.Uniform(-0.1, 0.1)))
    plans = {
        "drawn/margin": {"method": "sobol", "of": "margin", "n": 64, "second_order": True},
        "verdict/any_unstable": {"method": "sobol", "of": "any_unstable", "n": 64},
        "modes/growth_rate": {"method": "sobol", "of": "growth_rate", "n": 64},
        "fitted/margin": {"method": "chaos", "of": "margin", "n": 100},
        "fitted modes/growth_rate": {"method": "chaos", "of": "growth_rate", "n": 100},
        "plain/any_unstable": {"method": "monte_carlo", "of": "any_unstable", "n": 200},
    }
    groups = {name: hipuq.run(model, inputs, rng=1, **plan) for name, plan in plans.items()}
    return xr.DataTree.from_dict({"/": tree().to_dataset()} | groups)


def test_pictures_of_results_as_they_are_made(made):
    found = {}
    for picture in pictures(made):
        picture.figure.draw_without_rendering()
        found.setdefault(picture.analysis, []).append(picture.name)
    assert found == {
        "drawn": ["indices_margin", "second_order_margin", "convergence_margin"],
        "verdict": ["indices_any_unstable", "convergence_any_unstable"],
        "fitted": ["indices_margin", "second_order_margin", "surrogate_margin"],
        "plain": ["convergence_any_unstable"],
    }


def test_words_of_results_as_they_are_made(made, tmp_path):
    stream = io.StringIO()
    show_results(made, Console(file=stream, width=300), everything=True)
    text = stream.getvalue()
    for analysis, method in (("drawn", "sobol"), ("fitted", "chaos"), ("modes", "sobol")):
        results = next(iter(made[analysis].children.values())).to_dataset()
        assert f"{analysis}: two_dof(hoffmann2002), {method}, seed 1" in text
        for line in filter(None, [headline(results), *remarks(results)]):
            assert line in text
        assert tables(results)[0].rows
    # The limits of 64 base points are wide.
    assert "the total-order index of friction lies" in headline(made["drawn/margin"].to_dataset())
    assert "by the surrogate alone" in headline(made["fitted/margin"].to_dataset())
    assert "How to read this" in write_report(made, tmp_path).read_text(encoding="utf-8")
