"""The squeak study with few samples, and the recipes of its documentation on what it leaves."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hipuq
from hipuq.sweeping import at

ROOT = Path(__file__).parents[1]
STUDY = ROOT / "studies" / "squeak_report"
RATIOS = [0.0, 0.01, 0.02]

SIZES = {
    "lubrication": 512,
    "uniform": 256,
    "film": 128,
    "mixed": 128,
    "boundary": 128,
    "patterns": 1,
    "drivers": 64,
    "onset": 12,
    "map": 16,
}

PROBABILITY = {"lubrication": 0.3068, "mixed": 0.1050, "boundary": 0.9854}
"""P(any unstable) at 1 % damping from the whole study, 8192 and twice 2048 samples."""


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    whole = hipuq.load_study(STUDY)
    assert {analysis.name for analysis in whole.analyses} == set(SIZES)
    assert not any(analysis.implied for analysis in whole.analyses)
    small = []
    for one in whole.analyses:
        over = {
            name: tuple(RATIOS) if name == "damping_ratio" else own[::6] for name, own in one.over.items()
        }
        small.append(replace(one, n=SIZES[one.name], over=over))
    folder = tmp_path_factory.mktemp("work") / "results" / "squeak_report"
    report = whole.report.model_copy(update={"friction_points": 21})
    hipuq.run_study(replace(whole, analyses=tuple(small), report=report), folder, progress=False)
    return folder


@pytest.fixture(scope="module")
def tree(out):
    return hipuq.load_results(out)


@pytest.mark.parametrize("name", PROBABILITY)
def test_few_samples_agree_with_the_study(name, tree):
    found = at(tree[f"{name}/any_unstable"].to_dataset(), damping_ratio=0.01)
    low, high = (float(found[f"probability_{end}"]) for end in ("low", "high"))
    # Twice the interval: a limit of 95 % may be missed.
    assert abs((low + high) / 2 - PROBABILITY[name]) < high - low


def test_damping_takes_instability_away(tree):
    for name in ("lubrication", "uniform", "film", "mixed", "boundary"):
        probability = tree[f"{name}/any_unstable"]["probability"].values
        assert (np.diff(probability) <= 0).all()
    assert float(tree["film/any_unstable"]["probability"][-1]) == 0.0


def test_the_mixture_lies_between_its_regimes(tree):
    names = ("film", "lubrication", "boundary")
    values = {name: tree[f"{name}/any_unstable"]["probability"].values for name in names}
    assert (values["film"] <= values["lubrication"]).all()
    assert (values["lubrication"] <= values["boundary"]).all()


def test_the_recipes_of_the_docs_are_right(out, monkeypatch):
    monkeypatch.chdir(out.parents[1])
    text = (ROOT / "docs" / "reference" / "report.md").read_text(encoding="utf-8")
    names: dict = {}
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(block, names)
    assert (out.parents[1] / "by_damping.csv").exists()
    assert names["by_mode"].loc[18, "frequency_median"] == pytest.approx(2.35, abs=0.1)
    assert names["by_pattern"].shape == (130, 2)
    assert names["by_count"].index.tolist() == [6, 7, 8, 9]
    assert set(names["side_by_side"]) == {"lubrication", "uniform", "film", "mixed", "boundary"}
    assert names["table"].shape == (3, 4)
    assert len(names["onsets"]) == 12
    assert int(names["by_friction"]["size"].sum()) == 512
    assert names["pairs"].shape == (6, 6)
