"""Study files: what they mean, what they refuse, and what a run leaves on disk."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from compare_studies import ANALYSES, BOTH
from helpers import SMALL_STUDY
from hypothesis import given, settings
from hypothesis import strategies as st

import hipuq
from hipuq.errors import HipuqError, StoreError, StudyError

STUDIES = Path(__file__).parents[1] / "studies"

SEEDED = f'title = "Seeded"\nseed = 3\n{ANALYSES}'

SMALL = (
    SMALL_STUDY
    + """
[[analysis]]
name = "a"
method = "monte_carlo"
n = 16
of = ["unstable", "any_unstable"]
options = { stratify = "contact" }
[[analysis]]
name = "b"
preset = "oberst2016-calibrated"
method = "monte_carlo"
n = 64
of = "margin"
options = { sampler = "sobol" }
model = { damping_ratio = 0.01 }
[analysis.inputs.spring_stiffness]
distribution = "normal"
mu = 0.0
sigma = 0.05
apply = "relative"
each = "spring"
"""
)


def write(folder: Path, text: str) -> Path:
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder


def test_overrides_apply_to_their_analysis_alone(tmp_path):
    study = hipuq.load_study(write(tmp_path, SMALL))
    first, second = (one for one in study.analyses if not one.implied)
    assert first.model.preset == "oberst2016"
    assert second.model.preset == "oberst2016-calibrated"
    assert first.model.parameters["damping_ratio"].nominal == 0
    assert second.model.parameters["damping_ratio"].nominal == 0.01
    assert list(first.inputs) == ["friction", "contact"]
    assert list(second.inputs) == ["friction", "contact", "spring_stiffness"]
    assert second.inputs.dimension == 12
    assert (first.evaluations, second.evaluations) == (160, 64)


def test_a_run_leaves_outcomes_and_results(tmp_path):
    study = hipuq.load_study(write(tmp_path, SMALL))
    tree = hipuq.run_study(study, tmp_path / "out", progress=False)
    assert {"a/unstable", "a/any_unstable", "b/margin"} <= {path.strip("/") for path in tree.groups}
    xr.testing.assert_identical(tree, hipuq.load_results(tmp_path / "out"))
    outcomes = hipuq.load_outcomes(tmp_path / "out" / "outcomes" / "a.zarr")
    assert outcomes.sizes["sample"] == 160
    assert tree["a/unstable"].to_dataset()["probability"].dims == ("pattern", "mode")


def test_same_seed_same_numbers_and_seed_zero_is_a_seed(tmp_path):
    def numbers(seed, out):
        study = hipuq.load_study(write(tmp_path, SEEDED), seed=seed)
        tree = hipuq.run_study(study, tmp_path / out, progress=False)
        return tree["b/margin"]["mean"].item(), tree["a/any_unstable"].to_dataset()["probability"].values

    first, again, other = numbers(0, "x"), numbers(0, "y"), numbers(1, "z")
    assert first[0] == again[0]
    np.testing.assert_array_equal(first[1], again[1])
    assert first[0] != other[0]


def test_a_later_analysis_changes_no_earlier_one(tmp_path):
    whole = hipuq.load_study(write(tmp_path, SEEDED))
    tree = hipuq.run_study(whole, tmp_path / "two", progress=False)
    alone = hipuq.load_study(write(tmp_path, SEEDED[: SEEDED.rindex("[[analysis]]")]))
    one = hipuq.run_study(alone, tmp_path / "one", progress=False)
    a, b = (t["a/margin"].to_dataset()["mean"].values for t in (tree, one))
    np.testing.assert_array_equal(a, b)


def test_an_analysis_with_single_brackets_is_told_so(tmp_path):
    alone = SEEDED[: SEEDED.rindex("[[analysis]]")].replace("[[analysis]]", "[analysis]")
    with pytest.raises(StudyError, match=r"analysis: write \[\[analysis\]\], with two brackets"):
        hipuq.load_study(write(tmp_path, alone))


BROKEN = [
    ('name = "ring"', 'name = "rnig"', "did you mean 'ring'"),
    ('preset = "oberst2016"', 'preset = "oberst2017"', "did you mean 'oberst2016'"),
    ('preset = "oberst2016"', 'presett = "oberst2016"', "did you mean 'preset'"),
    ('preset = "oberst2016"', 'certifi = "auto"', "did you mean 'certify'"),
    ("[inputs.friction]", "[inputs.frictoin]", "did you mean 'friction'"),
    ('distribution = "uniform"', 'distribution = "unifrom"', "did you mean 'uniform'"),
    ("lower = 0.0", "lowr = 0.0", "did you mean 'lower'"),
    ("lower = 0.0", "", "lower is missing"),
    ("in_contact = [8, 9]", "in_contact = 6.5", "must be an integer or a list"),
    ("in_contact = [8, 9]", 'in_contact = [8, 9]\nweights = "abc"', "must be numbers"),
    ("in_contact = [8, 9]", 'in_contact = [8, 9]\napply = "shift"', "neither apply nor each"),
    ('name = "ring"', 'name = ["ring"]', "unknown model"),
    ('preset = "oberst2016"\n[inputs', 'preset = "oberst2016"\nmass = "heavy"\n[inputs', "must be numbers"),
    (
        'preset = "oberst2016"\n[inputs',
        'preset = "oberst2016"\ngrowth_threshold = "high"\n[inputs',
        "finite number",
    ),
    ('options = { sampler = "sobol" }', "options = { confidence = 95 }", "between 0 and 1"),
    ("n = 16", "N = 16", "unknown key"),
    ("n = 64", "n = 1000", "take 512 or 1024"),
    ("upper = 0.1", "upper = 0.1\nuper = 3", "did you mean 'upper'"),
    ("upper = 0.1", "upper = nan", "finite"),
    ("upper = 0.1", "upper = inf", "finite"),
    ("upper = 0.1", "upper = -0.1", "upper > lower"),
    ("upper = 0.1", 'upper = "0.1"', "finite number"),
    ("in_contact = [8, 9]", "in_contact = [8, 10]", "in_contact holds 10"),
    ("in_contact = [8, 9]", "in_contact = []", "at least one"),
    ("in_contact = [8, 9]", "in_contcat = [8, 9]", "did you mean 'in_contact'"),
    ('method = "monte_carlo"', 'method = "monte_calro"', "did you mean 'monte_carlo'"),
    ("n = 16", "n = 0", "greater than or equal to 1"),
    ("n = 16", "n = 16.5", "valid integer"),
    ("n = 16", "n = true", "valid integer"),
    ("n = 64", "n = 60", "multiple of the 8 replicates"),
    ("n = 64", "n = 96", "power of 2"),
    ('stratify = "contact"', 'stratify = "contcat"', "did you mean 'contact'"),
    ('stratify = "contact"', 'stratfy = "contact"', "did you mean 'stratify'"),
    ('of = "margin"', 'of = "magrin"', "did you mean 'margin'"),
    ('of = "margin"', "of = []", "at least 1"),
    ('name = "b"', 'name = "a"', "given to two analyses"),
    ('name = "b"', 'name = "../b"', "pattern"),
    ("damping_ratio = 0.01", "damping_ratio = -0.01", "not below 0"),
    ("damping_ratio = 0.01", "dampng_ratio = 0.01", "did you mean 'damping_ratio'"),
    ('each = "spring"', 'each = "sprng"', "each='spring'"),
    ('apply = "relative"', 'apply = "relativ"', "relative"),
    ("seed = 3", "seed = -3", "greater than or equal to 0"),
    ("seed = 3", "sed = 3", "did you mean 'seed'"),
    ('title = "Small"', "", "title"),
    ('title = "Small"', "title = ", "not a TOML file"),
    ("upper = 0.1", f"upper = {10**30}", "does not fit into 64 bits"),
    ('name = "ring"\n', "", "the model has no name: [model] needs one of ring, two_dof"),
]


@pytest.mark.parametrize(("old", "new", "message"), BROKEN)
def test_a_broken_study_gives_one_line_that_helps(tmp_path, old, new, message):
    assert old in SMALL
    with pytest.raises(StudyError) as caught:
        hipuq.load_study(write(tmp_path, SMALL.replace(old, new, 1)))
    text = str(caught.value)
    assert message in text
    assert "\n" not in text.strip()


REPORTS = [
    ("mode_shapes = [99]", "mode 99"),
    ("pairs = [[18, 19]]", "mode 19"),
    ('mode_names = { "²" = "1" }', "not the number of a mode"),
    ("friction_sweep = [0.1, 0.0]", "must ascend"),
    ("friction_points = 1", "greater than or equal to 2"),
]


@pytest.mark.parametrize(("line", "message"), REPORTS)
def test_a_report_that_cannot_be_made_is_refused_before_the_run(tmp_path, line, message):
    with pytest.raises(StudyError, match=message):
        hipuq.load_study(write(tmp_path, f"{SMALL}\n[report]\n{line}\n"))


def test_a_file_of_somebody_else_is_not_replaced(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "results.nc").write_bytes(b"mine")
    study = hipuq.load_study(write(tmp_path, SMALL))
    with pytest.raises(StoreError, match="cannot read"):
        hipuq.run_study(study, tmp_path / "out", progress=False)
    assert (tmp_path / "out" / "results.nc").read_bytes() == b"mine"


def test_a_missing_study_and_an_unwritable_folder(tmp_path):
    with pytest.raises(StudyError, match=r"give a study folder or its study\.toml"):
        hipuq.load_study(tmp_path / "none")
    study = hipuq.load_study(write(tmp_path, SMALL))
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(StoreError, match="choose another folder"):
        hipuq.run_study(study, tmp_path / "file" / "out", progress=False)


LINES = [text.strip().splitlines() for text in (SMALL, BOTH)]
VALUES = st.sampled_from(
    ["0", "-1", "1e400", "nan", "true", '""', "[]", "{}", '"x"', "[[1]]", "1979-05-27", "9" * 30]
)


@settings(max_examples=120, deadline=None)
@given(data=st.data())
def test_malformed_studies_never_end_in_anything_but_our_errors(tmp_path_factory, data):
    lines = list(data.draw(st.sampled_from(LINES)))
    for _ in range(data.draw(st.integers(1, 3))):
        i = data.draw(st.integers(0, len(lines) - 1))
        action = data.draw(st.sampled_from(["drop", "twice", "value", "cut", "swap"]))
        if action == "drop":
            lines[i] = ""
        elif action == "twice":
            lines.insert(i, lines[i])
        elif action == "value" and "=" in lines[i]:
            lines[i] = lines[i].split("=")[0] + "= " + data.draw(VALUES)
        elif action == "cut":
            lines[i] = lines[i][: data.draw(st.integers(0, max(len(lines[i]), 1)))]
        else:
            j = data.draw(st.integers(0, len(lines) - 1))
            lines[i], lines[j] = lines[j], lines[i]
    folder = write(tmp_path_factory.mktemp("study"), "\n".join(lines))
    try:
        study = hipuq.load_study(folder)
    except HipuqError as error:
        assert "\n" not in str(error).strip()
    else:
        assert study.analyses or study.problems
        tomllib.loads(study.text)


@pytest.mark.parametrize(
    "folder", sorted(path.parent for path in STUDIES.glob("*/study.toml")), ids=lambda p: p.name
)
def test_every_study_that_we_ship_loads(folder):
    study = hipuq.load_study(folder)
    assert study.name == folder.name
    assert all(one.evaluations > 0 for one in (*study.analyses, *study.problems))
