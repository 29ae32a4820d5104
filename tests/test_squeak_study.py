"""The squeak study with few samples."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hipuq
from hipuq.sweeping import at

STUDY = Path(__file__).parents[1] / "studies" / "squeak_report"
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
