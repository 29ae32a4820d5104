"""Studies over the damping ratio: what they add by themselves, keep beside results, and refuse."""

import json
import shutil

import numpy as np
import pytest
import xarray as xr
from helpers import SMALL_STUDY

import hipuq
from hipuq.errors import StudyError
from hipuq.study.headline import DAMPING_SWEEP
from hipuq.sweeping import at, swept

SAMPLED = """
[[analysis]]
name = "sampled"
method = "monte_carlo"
n = 4
of = ["unstable", "any_unstable"]
options = { stratify = "contact" }
"""

OVER = SAMPLED + "over = { damping_ratio = [0.0, 0.01] }\n"

INTEGRATED = """
[[analysis]]
name = "integrated"
method = "monte_carlo"
n = 1
integrate_friction = true
of = "probability"
options = { stratify = "contact" }
"""


def load(folder, text):
    folder.mkdir(exist_ok=True)
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return hipuq.load_study(folder)


def run(folder, text, **options):
    return hipuq.run_study(load(folder, text), folder / "out", progress=False, **options)


def test_a_study_adds_the_sweep_over_damping_by_itself(tmp_path):
    study = load(tmp_path, SMALL_STUDY + SAMPLED)
    first, added = study.analyses
    assert added.name == DAMPING_SWEEP
    assert added.implied
    assert not first.implied
    assert added.over["damping_ratio"][0] == 0.0
    assert added.over["damping_ratio"][-1] == 0.02
    assert added.inputs == first.inputs
    # No more samples than the analysis has that it belongs to.
    assert added.evaluations == 9 * first.evaluations
    assert study.evaluations == 10 * first.evaluations


def test_a_map_of_friction_and_damping_is_no_sweep_over_damping(tmp_path):
    over = "over = { damping_ratio = [0.0, 0.01], friction = [0.02, 0.1] }\n"
    text = SMALL_STUDY + SAMPLED + SAMPLED.replace('"sampled"', '"map"') + over
    assert [one.name for one in load(tmp_path, text).analyses] == ["sampled", "map", DAMPING_SWEEP]


@pytest.mark.parametrize(
    "text",
    [
        SMALL_STUDY + OVER,
        SMALL_STUDY + SAMPLED + "[report]\ndamping_samples = 0\n",
        SMALL_STUDY
        + SAMPLED
        + '[analysis.inputs.damping_ratio]\ndistribution = "uniform"\nlower = 0.0\nupper = 0.02\n',
        SMALL_STUDY + SAMPLED + "over = { friction = [0.02, 0.1] }\n",
    ],
    ids=["over", "none asked for", "an input", "no friction"],
)
def test_it_adds_none_where_damping_is_told_or_nothing_asked(text, tmp_path):
    assert [one.implied for one in load(tmp_path, text).analyses] == [False]


@pytest.mark.parametrize("changed", [("monte_carlo", "sobol"), ('["unstable", "any_unstable"]', '"margin"')])
def test_a_study_without_a_probability_gets_one_from_the_sweep(changed, tmp_path):
    text = (
        SAMPLED.replace(*changed)
        .replace('options = { stratify = "contact" }\n', "")
        .replace("n = 4", "n = 16")
    )
    study = load(tmp_path, SMALL_STUDY + text.replace('["unstable", "any_unstable"]', '"any_unstable"'))
    assert [one.name for one in study.analyses] == ["sampled", DAMPING_SWEEP]


def test_its_values_hold_the_damping_of_the_headline(tmp_path):
    text = SMALL_STUDY + SAMPLED + "model = { damping_ratio = 0.2 }\n"
    first, added = load(tmp_path, text).analyses
    assert added.over["damping_ratio"][-1] == 0.2
    assert added.n == first.n
    tree = hipuq.run_study(load(tmp_path, text), tmp_path / "out", progress=False)
    there = tree["sampled/any_unstable"].to_dataset()
    here = at(tree[f"{DAMPING_SWEEP}/any_unstable"].to_dataset(), damping_ratio=0.2)
    # The same draws: no two answers to one question.
    np.testing.assert_array_equal(here["probability_overall"], there["probability_overall"])


def test_the_study_and_its_report_have_one_headline(tmp_path):
    over = SAMPLED + "over = { friction = [0.02, 0.1], damping_ratio = [0.0, 0.01] }\n"
    last = SAMPLED.replace('"sampled"', '"last"')
    study = load(tmp_path, SMALL_STUDY + over + last)
    assert study.headline == "last"
    with pytest.raises(StudyError, match="which the headline's analysis 'last' is not over"):
        load(tmp_path, f"{SMALL_STUDY}{over}{last}[report]\ndamping_ratio = 0.01\n")


def test_the_added_sweep_samples_friction_that_the_headline_integrates(tmp_path):
    text = SMALL_STUDY + INTEGRATED + "[report]\ndamping_ratios = [0.0, 0.02]\ndamping_samples = 64\n"
    tree = run(tmp_path / "s", text)
    found = tree[f"{DAMPING_SWEEP}/any_unstable"].to_dataset()
    assert found["probability"].dims == ("damping_ratio",)
    exact = float(tree["integrated/probability"]["probability_overall"])
    low, high = (float(at(found, damping_ratio=0.0)[f"probability_{end}"]) for end in ("low", "high"))
    assert low <= exact <= high
    assert float(found["probability"][1]) < float(found["probability"][0])


def test_its_seed_is_that_of_its_headline(tmp_path):
    seeds = []
    for i, text in enumerate((SAMPLED, SAMPLED + SAMPLED.replace('"sampled"', '"second"'))):
        tree = run(tmp_path / str(i), SMALL_STUDY + text + "[report]\ndamping_ratios = [0.0]\n")
        seeds.append(tree[f"{DAMPING_SWEEP}/any_unstable"].attrs["seed"])
    assert seeds[0] == seeds[1]


def test_a_swept_analysis_keeps_everything_by_value(tmp_path):
    tree = run(tmp_path / "s", SMALL_STUDY + OVER)
    assert set(tree["sampled"].children) == {"unstable", "any_unstable", "verdicts", "frequencies"}
    for node in tree["sampled"].children.values():
        assert swept(node.to_dataset()) == ("damping_ratio",)
    alone = run(tmp_path / "t", SMALL_STUDY + SAMPLED + "[report]\ndamping_samples = 0\n")
    here = at(tree["sampled/unstable"].to_dataset(), damping_ratio=0.0)
    there = alone["sampled/unstable"].to_dataset()
    np.testing.assert_array_equal(here["probability"], there["probability"])
    outcomes = hipuq.load_outcomes(tmp_path / "s" / "out" / "outcomes" / "sampled.zarr")
    assert sorted(set(outcomes["damping_ratio"].values.tolist())) == [0.0, 0.01]
    counted = tree["sampled/verdicts"]["samples"].sum("status").values
    assert counted.tolist() == tree["sampled/any_unstable"]["evaluations"].values.tolist()


def test_a_sweep_over_friction_has_a_friction_limit(tmp_path):
    text = (
        SMALL_STUDY + SAMPLED + "over = { damping_ratio = [0.0, 0.02], friction = [0.0, 0.05, 0.2, 0.4] }\n"
    )
    limits = run(tmp_path / "s", text)["sampled/friction_limit"].to_dataset()
    assert limits["friction_limit"].dims == ("damping_ratio", "target")
    low, high = limits["friction_limit"].sel(target=0.1)
    assert float(low) < float(high)


def test_what_an_analysis_is_over_is_no_input_of_it(tmp_path):
    text = SMALL_STUDY + SAMPLED + "over = { friction = [0.02, 0.1] }\n[report]\ndamping_samples = 0\n"
    (one,) = load(tmp_path, text).analyses
    assert "friction" not in one.inputs
    assert "contact" in one.inputs


def test_integrated_friction_leaves_fragility_onsets_and_limits(tmp_path):
    text = SMALL_STUDY + INTEGRATED + "[report]\ndamping_samples = 0\nfragility_points = 11\n"
    tree = run(tmp_path / "s", text)
    assert {"fragility", "onsets", "friction_limit", "verdicts"} <= set(tree["integrated"].children)
    assert tree["integrated/fragility"].sizes["friction"] == 11
    limits = tree["integrated/friction_limit"].to_dataset()
    assert limits["target"].values.tolist() == [0.01, 0.03, 0.1]
    again = hipuq.friction_limit(tree["integrated/onsets"].to_dataset(), [0.01, 0.03, 0.1])
    xr.testing.assert_equal(again, limits)
    # They are made again, from the stored outcomes, where the report asks for others.
    changed = run(tmp_path / "s", text.replace("= 11", "= 21") + "targets = [0.5]\n", resume=True)
    assert changed["integrated/fragility"].sizes["friction"] == 21
    assert changed["integrated/friction_limit"]["target"].values.tolist() == [0.5]
    xr.testing.assert_identical(
        changed["integrated/probability"].to_dataset(), tree["integrated/probability"].to_dataset()
    )


def test_what_depends_on_no_key_of_the_report_is_kept_without_outcomes(tmp_path):
    text = SMALL_STUDY + INTEGRATED + "[report]\ndamping_samples = 0\nfragility_points = 11\n"
    first = run(tmp_path / "s", text)
    shutil.rmtree(tmp_path / "s" / "out" / "outcomes")
    said: list[str] = []
    again = run(tmp_path / "s", text.replace("= 11", "= 21"), resume=True, say=said.append)
    assert set(again["integrated"].children) == set(first["integrated"].children) - {"fragility"}
    assert any("fragility cannot be made from the outcomes that are stored" in line for line in said)


def test_the_root_says_what_is_needed_to_repeat_it(tmp_path):
    text = SMALL_STUDY.replace("[inputs.friction]", '[inputs.friction]\nsource = "a paper"', 1)
    tree = run(tmp_path / "s", text + SAMPLED + "[report]\ndamping_samples = 0\n")
    assert json.loads(tree.attrs["sources"]) == {"sampled": {"friction": "a paper"}}
    assert {"python", "hipuq", "numpy", "chaospy"} <= set(json.loads(tree.attrs["versions"]))
    assert tree.attrs["command"].startswith("hipuq run s --seed ")
    assert list(tree["literature"].children) == [
        "incidence",
        "critical_friction",
        "squeak_frequency",
        "friction",
    ]
    stored = hipuq.load_results(tmp_path / "s" / "out")
    xr.testing.assert_identical(stored, tree)
    without = run(tmp_path / "t", text + SAMPLED + "[report]\ndamping_samples = 0\nliterature = false\n")
    assert "literature" not in without.children


def test_it_is_resumed_as_any_other(tmp_path):
    text = SMALL_STUDY + SAMPLED + "[report]\ndamping_ratios = [0.0, 0.01]\n"
    first = run(tmp_path / "s", text)
    said: list[str] = []
    second = run(tmp_path / "s", text, resume=True, say=said.append)
    xr.testing.assert_identical(second, first)
    assert all("kept, complete" in line for line in said)


@pytest.mark.parametrize(
    ("report", "said"),
    [
        ('headline = "samplet"', "did you mean 'sampled'"),
        ('headline = "other"', "tells no probability of instability"),
        ('headline = "map"', "is over damping_ratio and friction, so it has no one probability"),
        ("damping_ratio = 0.005", "which the headline's analysis 'sampled' is not over"),
        ("damping_ratio = -0.1", "damping_ratio"),
        ("damping_ratios = [0.02, 0.01]", "must ascend"),
        ("damping_ratios = []", "damping_ratios"),
        ("targets = [1.0]", "targets"),
        ("targets = [0.1, 0.1]", "must ascend"),
        ("fragility_points = 1", "fragility_points"),
        ("damping_samples = -1", "damping_samples"),
    ],
)
def test_a_report_that_cannot_be_is_one_line(report, said, tmp_path):
    other = SAMPLED.replace('"sampled"', '"other"').replace('["unstable", "any_unstable"]', '"margin"')
    other += (
        SAMPLED.replace('"sampled"', '"map"') + "over = { damping_ratio = [0.0], friction = [0.1, 0.2] }\n"
    )
    with pytest.raises(StudyError, match="report") as error:
        load(tmp_path, f"{SMALL_STUDY}{OVER}{other}[report]\n{report}\n")
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("over", "said"),
    [
        ("{ dampingratio = [0.0] }", "did you mean 'damping_ratio'"),
        ("{ damping_ratio = [0.01, 0.0] }", "finite numbers that ascend"),
        ("{ contact_stiffness = [1.0] }", "a value for each element"),
        ("{ damping_ratio = 0.0 }", "over"),
        ("[0.0]", "over"),
    ],
)
def test_what_cannot_be_swept_is_one_line(over, said, tmp_path):
    with pytest.raises(StudyError, match=r"sampled|analysis") as error:
        load(tmp_path, f"{SMALL_STUDY}{SAMPLED}over = {over}\n")
    assert said in str(error.value)


def test_no_analysis_is_called_literature(tmp_path):
    with pytest.raises(StudyError, match="what is published is kept there"):
        load(tmp_path, SMALL_STUDY + SAMPLED.replace('"sampled"', '"literature"'))
