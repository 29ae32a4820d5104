"""Study files that are broken or made to harm end in a study or in one line: no traceback, no hang."""

import copy
import os
import time
import tomllib

import numpy as np
import pytest
from helpers import SMALL_STUDY
from hostile import evil, garbled, mutate, toml
from hypothesis import given, settings
from hypothesis import strategies as st

import hipuq
from hipuq import cli
from hipuq.distributions import FAMILIES
from hipuq.errors import HipuqError, StudyError
from hipuq.methods import METHODS
from hipuq.methods.base import STAGES
from hipuq.study.file import MAXIMUM_BYTES

WHOLE = [
    SMALL_STUDY
    + """
[[analysis]]
name = "a"
method = "monte_carlo"
n = 8
of = "any_unstable"
options = { stratify = "contact", sampler = "sobol", replicates = 2, confidence = 0.9 }
[[analysis]]
name = "b"
method = "sobol"
n = 8
of = ["margin"]
over = { damping_ratio = [0.0, 0.01] }
[report]
mode_shapes = [1]
pairs = [[1, 2]]
friction_sweep = [0.0, 0.1]
mode_names = { 1 = "x" }
""",
    """
title = "t"
model = { name = "two_dof", preset = "hoffmann2002" }
[inputs.friction]
distribution = "lubrication"
lambda_ratio = { film = 0.5, mixed = 0.3, boundary = 0.2 }
film = { distribution = "mixture", weights = [0.5, 0.5], components = [
  { distribution = "uniform", lower = 0.0, upper = 1.0 },
  { distribution = "triangle", lower = 1.0, midpoint = 2.0, upper = 3.0 } ] }
[inputs.k3]
distribution = "pert"
lower = -0.1
mode = 0.0
upper = 0.1
apply = "relative"
[[analysis]]
name = "a"
method = "chaos"
n = 64
of = "margin"
options = { held_out = 0.0 }
""",
    SMALL_STUDY
    + """
[compare]
of = "any_unstable"
budgets = [64, 256]
replicates = 2
[compare.contenders.random]
method = "monte_carlo"
[[compare.problem]]
name = "exact"
reference = { exact = true }
[[compare.problem]]
name = "stored"
reference = { results = "reference.nc", analysis = "a" }
""",
]
TABLES = [tomllib.loads(text) for text in WHOLE]


def study_file(r) -> bytes:
    """Return a study file that was valid once."""
    place = r.randint(0, len(WHOLE) - 1)
    if r.random() < 0.15:
        return garbled(WHOLE[place].encode(), r)
    table = copy.deepcopy(TABLES[place])
    analyses = table.get("analysis", [])
    for _ in range(r.randint(1, 2)):
        kind = r.random()
        if kind < 0.25 and isinstance(table.get("inputs"), dict):
            family = r.choice(sorted(FAMILIES))
            names = [name for part in FAMILIES[family][1:] for name in part]
            own = {name: evil(r) if r.random() < 0.3 else r.choice([0.0, 0.1, 1.0, 2.0]) for name in names}
            table["inputs"]["friction"] = {"distribution": family, **own}
        elif kind < 0.5 and isinstance(analyses, list) and analyses and isinstance(analyses[0], dict):
            method = r.choice(sorted(METHODS))
            names = sorted({name for stage in STAGES for name in METHODS[method].options(stage)})
            analyses[0] |= {"method": method, "options": {r.choice(names): evil(r) for _ in range(2)}}
        elif table:
            mutate(table, r)
    return "\n".join(f"{toml(key)} = {toml(value)}" for key, value in table.items()).encode()


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("hostile") / "study.toml"


@given(st.randoms(use_true_random=False))
@settings(max_examples=120)
def test_any_study_file_ends_in_a_study_or_in_one_line(file, r):
    file.write_bytes(study_file(r))
    began = time.perf_counter()
    try:
        study = hipuq.load_study(file)
    except HipuqError as error:
        text = str(error)
        assert isinstance(error, StudyError)
        assert text.startswith(str(file)) or text.startswith(f"cannot read the study {file}")
        assert text.isprintable()
        assert len(text) < 600 + len(str(file))
    else:
        assert isinstance(study.evaluations, int)
        assert study.title.isprintable()
        for analysis in study.analyses:
            points = np.linspace(0, 1, 5)[:, None].repeat(analysis.inputs.dimension, axis=1)
            for name, values in analysis.inputs.samples(points).data_vars.items():
                assert np.isfinite(values.values.astype(float)).all(), name
    assert time.perf_counter() - began < 20


def dry_run(file, monkeypatch, capsys) -> str:
    """Return what the command line says of a study file that it refuses."""
    monkeypatch.setattr("sys.argv", ["hipuq", "run", str(file), "--dry-run"])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    assert caught.value.code == 1
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    assert "unexpected" not in text
    return text


def test_what_is_no_file_is_not_read(tmp_path, monkeypatch, capsys):
    """A pipe without a writer and a device without an end would never be read to it."""
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "zeros.toml").symlink_to("/dev/zero")
    (tmp_path / "folder" / "study.toml").mkdir(parents=True)
    (tmp_path / "loop.toml").symlink_to(tmp_path / "loop.toml")
    with (tmp_path / "huge.toml").open("wb") as opened:
        opened.truncate(300_000_000)
    for name, why in {
        "pipe.toml": "is not a file but a pipe",
        "zeros.toml": "is not a file but a device",
        "folder": "is not a file but a folder",
        "loop.toml": "cannot read the study",
        "huge.toml": f"at most {MAXIMUM_BYTES:,} are read",
        "no.toml": "No such file",
    }.items():
        assert why in dry_run(tmp_path / name, monkeypatch, capsys)


TELLING = [
    ('title = "Small"', 'title = "a\\u001b[31mb"', "characters that cannot be printed"),
    ('title = "Small"', "title = " + "[" * 5000, "not a TOML file"),
    ('title = "Small"', "x = " + "[" * 30 + "]" * 30, "more than 20 tables and lists within each other"),
    ('title = "Small"', 'x = "' + "y" * 100_000 + '"', "unknown key"),
    ("seed = 3", f"seed = {10**30}", "64 bits"),
    ("upper = 0.1", "upper = nan", "must be a finite number"),
    ("upper = 0.1", "upper = 0.0", "it needs upper > lower"),
    ("n = 8", f"n = {10**30}", "64 bits"),
    ('name = "a"', 'name = "../../x"', "should match"),
    ('name = "a"', 'name = "CON"', "no name for files on every system"),
    ('name = "b"', 'name = "A"', "given to two analyses"),
    ('preset = "oberst2016"', "mass = [1.0, [2.0]]", "mass is [1.0, [2.0]]: it must be numbers"),
]


@pytest.mark.parametrize(("old", "new", "why"), TELLING, ids=range(len(TELLING)))
def test_a_hostile_value_is_told(tmp_path, monkeypatch, capsys, old, new, why):
    assert old in WHOLE[0]
    (tmp_path / "study.toml").write_text(WHOLE[0].replace(old, new, 1), encoding="utf-8")
    assert why in dry_run(tmp_path, monkeypatch, capsys)


def test_references_stay_in_the_folder(tmp_path, monkeypatch, capsys):
    os.mkfifo(tmp_path / "pipe.nc")
    (tmp_path / "zeros.nc").symlink_to("/dev/zero")
    for name, why in {
        "pipe.nc": "is not a file but a pipe",
        "zeros.nc": "a link that leads out of",
        "../reference.nc": "give a file in the study's folder",
        "/etc/passwd": "give a file in the study's folder",
        ".": "there are no results",
    }.items():
        (tmp_path / "study.toml").write_text(WHOLE[2].replace("reference.nc", name))
        assert why in dry_run(tmp_path, monkeypatch, capsys)
