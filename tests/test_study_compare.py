"""Comparisons in study files: what they mean, what they refuse, and what a run leaves on disk."""

import json
import sys
import warnings
import zlib
from pathlib import Path

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from compare_studies import ANALYSES, BOTH, COMPARE

import hipuq
from hipuq.cli import main
from hipuq.errors import StudyError
from hipuq.sampling import seed_of
from hipuq.study import Study


def write(folder: Path, text: str) -> Path:
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder


def load(text: str, folder: Path) -> Study:
    return hipuq.load_study(write(folder, text))


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Return a study with analyses and comparisons, its results, the output folder and what it said."""
    folder = tmp_path_factory.mktemp("study")
    study = hipuq.load_study(write(folder, BOTH))
    said: list[str] = []
    tree = hipuq.run_study(study, folder / "out", progress=False, say=said.append)
    return study, tree, folder / "out", said


def test_problems_are_planned_as_the_file_says(tmp_path):
    """Evaluations by hand: budgets times replicates, fewer where a contender says so."""
    study = load(COMPARE, tmp_path)
    assert not study.analyses
    first, second, third = study.problems
    assert [one.name for one in study.problems] == ["hoffmann", "indices", "onset"]
    assert first.title == "Scattered contact stiffness"
    assert [one.name for one in first.race.contenders] == ["random", "latin hypercube", "integrated"]
    assert first.race.baseline == "latin hypercube"
    assert first.race.reference.value == 0.402
    assert first.race.reference.source == "by hand"
    assert first.evaluations == 2 * 3 * (16 + 32) + 2 * 32
    assert second.evaluations == 2 * 64
    assert second.race.budgets == (64,)
    assert third.exact is not None
    # Those of the design are not those of the comparison.
    assert first.race.contenders[1].stages["design"] == {"sampler": "latin_hypercube", "replicates": 4}
    assert first.race.contenders[1].replicates == 3
    assert study.evaluations == sum(one.evaluations for one in study.problems)


def test_a_contender_that_integrates_friction_has_its_model_inputs_and_outcome(tmp_path):
    first = load(COMPARE, tmp_path).problems[0]
    integrated = first.race.contenders[2]
    assert integrated.of == "probability"
    assert list(integrated.inputs) == ["k3"]
    assert integrated.model.label == "two_dof(hoffmann2002), friction integrated"
    assert dict(integrated.sizes) == {32: 32}
    assert list(first.race.contenders[0].inputs) == ["friction", "k3"]


def test_a_run_leaves_results_and_runs(ran):
    _, tree, out, said = ran
    groups = {path.strip("/") for path in tree.groups}
    assert {"a/margin", "b/margin", "compare/hoffmann", "compare/indices", "compare/onset"} <= groups
    stored = hipuq.load_results(out)
    xr.testing.assert_identical(tree, stored)
    assert list(stored.children) == ["a", "b", "compare"]
    found = tree["compare/hoffmann"].to_dataset()
    assert found.attrs["title"] == "Scattered contact stiffness"
    assert found.attrs["reference_source"] == "by hand"
    assert found["evaluations"].values.tolist() == [[16, 32], [16, 32], [0, 32]]
    assert {path.name for path in (out / "compare").iterdir()} == {
        "hoffmann.jsonl",
        "indices.jsonl",
        "onset.jsonl",
    }
    for group in ("a", "b", "compare/hoffmann", "compare/indices", "compare/onset"):
        assert any(line.startswith(f"{group}: ") for line in said)


def test_the_exact_reference_is_the_closed_form(ran):
    """P(friction above the onset mu_c = (k12^2 + (k11 - k22)^2 / 4) / (k12 k3)), uniform from 0 to 0.8."""
    _, tree, _, _ = ran
    found = tree["compare/onset"].to_dataset()
    c, s = np.cos(np.deg2rad([150.0, 30.0])), np.sin(np.deg2rad([150.0, 30.0]))
    k = np.array([11.0, 20.0])
    k11, k22, k12 = k @ c**2, k @ s**2 + 11.0, k @ (c * s)
    onset = (k12**2 + (k11 - k22) ** 2 / 4) / (abs(k12) * 11.0)
    assert float(found["reference"]) == pytest.approx(1 - onset / 0.8, rel=1e-10)
    assert float(found["reference_low"]) == pytest.approx(float(found["reference"]), abs=1e-9)
    assert found.attrs["reference_source"] == "friction integrated exactly"


def test_the_exact_reference_goes_over_every_level(tmp_path):
    study = load(RING, tmp_path)
    tree = hipuq.run_study(study, tmp_path / "out", progress=False)
    found = tree["compare/any_unstable"].to_dataset()
    exact = hipuq.integrate_friction(hipuq.models.ring("oberst2016"), cp.Uniform(0.0, 0.1))
    inputs = exact.inputs(contact=hipuq.ContactPatterns(in_contact=9))
    alone = hipuq.run(exact, inputs, method="monte_carlo", n=1, stratify=True, of="probability")
    assert float(found["reference"]) == pytest.approx(float(alone["probability_overall"]), abs=1e-12)
    assert (
        found.attrs["reference_source"] == "oberst2016; friction integrated exactly, all 1 levels of contact"
    )


def test_a_problem_is_what_compare_makes_of_the_same(ran, tmp_path):
    """The seed comes from the study's and the name alone, so a problem by itself gives the same numbers."""
    study, tree, _, _ = ran
    model = hipuq.models.two_dof("hoffmann2002")
    scatter = {"k3": hipuq.relative(cp.Uniform(-0.1, 0.1))}
    friction = cp.Uniform(0.0, 0.8)
    exact = hipuq.integrate_friction(model, friction)
    contenders = {
        "random": {"method": "monte_carlo"},
        "integrated": {
            "method": "monte_carlo",
            "model": exact,
            "inputs": exact.inputs(**scatter),
            "of": "probability",
            "budgets": [32],
            "replicates": 2,
        },
    }
    key = zlib.crc32(b"compare"), zlib.crc32(b"hoffmann")
    alone = hipuq.compare(
        model,
        model.inputs(friction=friction, **scatter),
        contenders,
        of="any_unstable",
        reference=0.402,
        budgets=[16, 32],
        replicates=3,
        rng=seed_of(np.random.SeedSequence(study.seed, spawn_key=key)),
    )
    found = tree["compare/hoffmann"].to_dataset()
    for name in contenders:
        for part in ("estimate", "low", "high"):
            a, b = (one[part].loc[{"method": name}].values for one in (found, alone))
            np.testing.assert_array_equal(a, b)


def test_analyses_are_those_of_a_study_without_comparisons(ran, tmp_path):
    _, tree, _, _ = ran
    study = load('title = "Alone"\nseed = 5\n' + ANALYSES, tmp_path)
    alone = hipuq.run_study(study, tmp_path / "out", progress=False)
    for path in ("a/any_unstable", "b/margin"):
        one, other = (t[path].to_dataset().drop_vars("seconds") for t in (tree, alone))
        xr.testing.assert_equal(one, other)


RING = """
title = "Ring"
[model]
name = "ring"
preset = "oberst2016"
[inputs.friction]
distribution = "uniform"
lower = 0.0
upper = 0.1
[inputs.contact]
distribution = "contact_patterns"
in_contact = [9]
[compare]
of = "any_unstable"
budgets = [8]
replicates = 2
reference = { exact = true }
source = "oberst2016"
[compare.contenders.random]
method = "monte_carlo"
"""
"""Without [[compare.problem]]: the study's own model and inputs."""


def test_the_study_itself_is_the_problem_where_none_is_named(tmp_path):
    (problem,) = load(RING, tmp_path).problems
    assert problem.name == "any_unstable"
    assert problem.title == ""
    assert problem.race.label == "ring(oberst2016)"
    assert problem.evaluations == 16


def test_a_problem_without_a_model_of_its_own_changes_the_study_s(tmp_path):
    text = RING + '[[compare.problem]]\nname = "damped"\nmodel = { damping_ratio = 0.01 }\nreplicates = 3\n'
    (problem,) = load(text, tmp_path).problems
    (random,) = problem.race.contenders
    assert problem.name == "damped"
    assert random.model.preset == "oberst2016"
    assert random.model.parameters["damping_ratio"].nominal == 0.01
    assert list(random.inputs) == ["friction", "contact"]
    assert problem.evaluations == 24


STORED = COMPARE.replace("reference = 0.402", 'reference = { results = "known.nc", analysis = "a" }')


@pytest.fixture(scope="module")
def known(ran) -> Path:
    """Return the results of analysis a, of the same problem as hoffmann."""
    return ran[2] / "results.nc"


def test_a_reference_comes_from_stored_results(known, ran, tmp_path):
    (tmp_path / "known.nc").write_bytes(known.read_bytes())
    reference = load(STORED, tmp_path).problems[0].race.reference
    stored = ran[1]["a/any_unstable"].to_dataset()
    assert float(reference.value) == float(stored["probability"])
    assert float(reference.low) == float(stored["probability_low"])
    assert float(reference.high) == float(stored["probability_high"])
    assert reference.source == "by hand; known.nc, a/any_unstable"


INTEGRATED = """
[[analysis]]
name = "exact"
method = "chaos"
n = 8
of = "probability"
integrate_friction = true
"""


def test_a_reference_may_have_friction_integrated(tmp_path):
    text = f'title = "Known"\n{ANALYSES}{INTEGRATED}'
    study = load(text, tmp_path)
    tree = hipuq.run_study(study, tmp_path / "out", progress=False)
    (tmp_path / "known.nc").write_bytes((tmp_path / "out" / "results.nc").read_bytes())
    found = STORED.replace('analysis = "a"', 'analysis = "exact", of = "probability"')
    reference = load(found, tmp_path).problems[0].race.reference
    results = tree["exact/probability"].to_dataset()
    assert float(reference.value) in {float(results[name]) for name in results if results[name].ndim == 0}
    # The same problem with another distribution of friction is another one.
    with pytest.raises(StudyError, match=r"integrated\.friction.*0\.8, this one 0\.7"):
        load(found.replace("upper = 0.8", "upper = 0.7", 1), tmp_path)


NOT_THERE = [
    ('"known.nc"', '"none.nc"', "there are no results at"),
    ('"known.nc"', '"../known.nc"', "give a file in the study's folder"),
    ('"known.nc"', '"/known.nc"', "give a file in the study's folder"),
    ('"known.nc"', '"study.toml"', "cannot read"),
    ('"known.nc"', '"link/results.nc"', "leads out of the study's folder"),
    ('analysis = "a"', 'analysis = "aa"', "did you mean 'a'"),
    ('analysis = "a"', 'analysis = "a", of = "margn"', "did you mean 'margin'"),
    ('analysis = "a"', 'analysis = "b", of = "margin"', "it has model.nominal.k1 12.0, this one 11.0"),
    ('analysis = "a" }', 'analysis = "a" }\nquantity = "ST"', "unknown result of the reference 'ST'"),
    ("upper = 0.8", "upper = 0.9", "inputs.friction.distribution.kwargs.upper 0.8, this one 0.9"),
    ('apply = "relative"', 'apply = "shift"', "inputs.k3.how 'relative', this one 'shift'"),
    ('preset = "hoffmann2002"', "k2 = 21.0", "model.nominal.k2 20.0, this one 21.0"),
    ('analysis = "a"', 'analysis = "a", off = "margin"', "did you mean 'of'"),
    ('results = "known.nc", ', "", "problem 'hoffmann', reference.results: Field required"),
]


@pytest.mark.parametrize(("old", "new", "message"), NOT_THERE)
def test_a_reference_that_is_not_one_of_this_problem_is_refused(known, tmp_path, old, new, message):
    (tmp_path / "known.nc").write_bytes(known.read_bytes())
    (tmp_path / "link").symlink_to(known.parent)
    assert old in STORED
    with pytest.raises(StudyError) as caught:
        load(STORED.replace(old, new, 1), tmp_path)
    assert message in str(caught.value)
    assert "problem 'hoffmann'" in str(caught.value)
    assert "\n" not in str(caught.value)


HOSTILE = [
    ({"options": '{"model":' + "[" * 100_000 + "]" * 100_000 + "}"}, "does not say of which model"),
    ({"options": '{"model":' + "[" * 500 + "]" * 500 + "}"}, "of another problem|does not say"),
    ({"inputs": "{" * 100_000}, "does not say of which model"),
    ({"probability": "many"}, "has a probability of type .*, not of real numbers"),
    ({"probability": 0.5 + 0j}, "has a probability of type complex128, not of real numbers"),
    ({"probability_low": "few"}, "has a probability_low of type .*, not of real numbers"),
    ({"probability_high": True}, "has a probability_high of type .*, not of real numbers"),
    ({"probability_high": [0.9, 0.9]}, "has a probability_high of another shape than probability"),
]


@pytest.mark.parametrize(("changes", "message"), HOSTILE)
def test_results_that_are_no_reference_are_refused_in_a_line(ran, tmp_path, changes, message):
    results = ran[1]["a/any_unstable"].to_dataset()
    for name, value in changes.items():
        if name in results:
            results[name] = ("level", value) if isinstance(value, list) else value
        else:
            results.attrs[name] = value
    tree = xr.DataTree.from_dict({"/": ran[1].to_dataset(), "a/any_unstable": results})
    with warnings.catch_warnings():
        # h5netcdf keeps complex numbers and booleans, but not gladly.
        warnings.simplefilter("ignore")
        tree.to_netcdf(tmp_path / "known.nc", engine="h5netcdf", invalid_netcdf=True)
    with pytest.raises(StudyError, match=message) as caught:
        load(STORED, tmp_path)
    assert "problem 'hoffmann'" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_source_is_inherited_with_its_reference_alone(tmp_path):
    shared = RING.replace("reference = { exact = true }", "reference = 0.25").replace(
        'oberst2016"\n[comp', 'all"\n[comp'
    )
    problems = """
[[compare.problem]]
name = "shared"
[[compare.problem]]
name = "own"
reference = 0.5
[[compare.problem]]
name = "told"
source = "another look"
[[compare.problem]]
name = "both"
reference = 0.5
source = "by hand"
"""
    found = [one.race.reference for one in load(shared + problems, tmp_path).problems]
    assert [(one.value, one.source) for one in found] == [
        (0.25, "all"),
        (0.5, ""),
        (0.25, "another look"),
        (0.5, "by hand"),
    ]


BROKEN = [
    ("replicates = 3", "replicats = 3", "unknown key in the table 'compare' 'replicats'"),
    ("replicates = 3", "replicates = 1", "greater than or equal to 2"),
    ("replicates = 2", "replicats = 2", "unknown key in the contender 'integrated' 'replicats'"),
    ('title = "Scattered', 'titel = "Scattered', "unknown key in the problem 'hoffmann' 'titel'"),
    ("budgets = [16, 32]", "budgets = [32, 16]", "they must rise"),
    ("budgets = [16, 32]", "budgets = []", "table 'compare', budgets"),
    ("budgets = [16, 32]", "budgets = [0]", "table 'compare', budgets.0: "),
    ("budgets = [16, 32]", "", "problem 'hoffmann': budgets is missing"),
    ("budgets = [32]", "budgets = [48]", "budget 48 of 'integrated' is none of the comparison's [16, 32]"),
    ("replicates = 2", "replicates = 4", "replicates of 'integrated' is 4: the comparison has 3"),
    ("budgets = [64]", "budgets = [2]", "'sobol' cannot be done within a budget of 2"),
    ('of = "any_unstable"', "", "problem 'hoffmann': of is missing"),
    ('of = "any_unstable"', 'of = "any_unstabel"', "did you mean 'any_unstable'"),
    ('of = "any_unstable"', 'of = "unstable"', "'unstable' is over mode: name the quantity"),
    ('of = "any_unstable"', 'of = "growth_rate"', "'growth_rate' is over mode"),
    ('of = "any_unstable"', 'of = "margin"', "contender 'integrated' integrates friction, which gives no"),
    ("reference = 0.402", "", "problem 'hoffmann': reference is missing"),
    ("reference = 0.402", "reference = nan", "problem 'hoffmann', reference: Input should be a finite"),
    ("reference = 0.402", 'reference = "0.4"', "problem 'hoffmann', reference: "),
    ("replicates = 2", "reference = 0.4", "unknown key in the contender 'integrated' 'reference'"),
    ("reference = 0.402", "reference = {}", "problem 'hoffmann', reference: "),
    ("reference = 0.402", "reference = { exact = false }", "problem 'hoffmann', reference.exact"),
    ("reference = 0.402", "reference = { exat = true }", "did you mean 'exact'"),
    ("reference = 0.402", 'reference = { result = "x.nc", analysis = "a" }', "did you mean 'results'"),
    ("reference = 0.402", "reference = { exact = true }", "only continuous input, there is also k3"),
    ("reference = 0.402", "reference = { friction = 0.4, k3 = 0.1 }", "name the quantity too"),
    ("friction = 0.9, k3", "frction = 0.9, k3", "did you mean 'friction'"),
    ("friction = 0.9, k3 = 0.2", "friction = 0.9", "reference has no number for k3"),
    ("{ friction = 0.9, k3 = 0.2 }", "0.9", "ST needs one by parameter"),
    ("reference = { exact = true }", 'reference = { exact = true }\nof = "margin"', "not for 'margin'"),
    (
        "reference = { exact = true }",
        'reference = { exact = true }\nquantity = "ST"',
        "allowed are probability",
    ),
    ('contenders = ["sobol"]', 'contenders = ["sobl"]', "did you mean 'sobol'"),
    ('contenders = ["sobol"]', 'contenders = ["sobol", "sobol"]', "contender 'sobol' is named twice"),
    ('contenders = ["sobol"]', "contenders = []", "problem 'indices', contenders: "),
    ('baseline = "latin hypercube"', 'baseline = "latin hypercub"', "did you mean 'latin hypercube'"),
    ('name = "indices"', 'name = "Hoffmann"', "the name 'hoffmann' is given to two problems"),
    ('name = "indices"', 'name = "../x"', "problem '../x', name: "),
    ('name = "indices"', "", "problem 2, name: Field required"),
    ('name = "two_dof"', 'name = "two_dfo"', "problem 'hoffmann': unknown model 'two_dfo'"),
    ('preset = "hoffmann2002"', 'preset = "hoffman2002"', "did you mean 'hoffmann2002'"),
    ("upper = 0.8", "uper = 0.8", "problem 'hoffmann': input 'friction'"),
    (
        'options = { sampler = "latin_hypercube", replicates = 4 }',
        "options = { smpler = 1 }",
        "contender 'latin hypercube': unknown",
    ),
    ('sampler = "latin_hypercube"', 'sampler = "latin"', "problem 'hoffmann': unknown sampler 'latin'"),
    ('method = "sobol"', 'method = "sobl"', "contender 'sobol': unknown method 'sobl'"),
    ("[compare.contenders.random]", '[compare.contenders." random"]', "contender ' random': "),
    ("[compare.problem.inputs.k3]", "[compare.problem.inputs.k33]", "did you mean 'k3'"),
    ("[[compare.problem]]", "[compare.problem]", "not a TOML file"),
]


@pytest.mark.parametrize(("old", "new", "message"), BROKEN)
def test_a_broken_comparison_gives_one_line_that_helps(tmp_path, old, new, message):
    assert old in COMPARE
    with pytest.raises(StudyError) as caught:
        load(COMPARE.replace(old, new, 1), tmp_path)
    text = str(caught.value)
    assert message in text
    assert "\n" not in text.strip()


def test_what_a_file_needs(tmp_path):
    head = 'title = "Nothing"\n'
    with pytest.raises(
        StudyError, match=r"nothing to run: give at least one \[\[analysis\]\], or \[compare\]"
    ):
        load(head + ANALYSES[: ANALYSES.index("[[analysis]]")], tmp_path)
    with pytest.raises(StudyError, match="no analysis can be called 'compare'"):
        load(BOTH.replace('name = "a"', 'name = "compare"'), tmp_path)
    with pytest.raises(StudyError, match=r"problem 'x': the model has no name: \[model\] needs one of ring"):
        load(COMPARE[: COMPARE.index("[[compare.problem]]")] + OWN, tmp_path)
    with pytest.raises(StudyError, match="of is missing"):
        load(RING.replace('of = "any_unstable"', ""), tmp_path)
    with pytest.raises(StudyError, match="the only input: nothing is left to sample"):
        alone = RING.replace('[inputs.contact]\ndistribution = "contact_patterns"\nin_contact = [9]\n', "")
        load(alone + "integrate_friction = true\n", tmp_path)


OWN = '[[compare.problem]]\nname = "x"\nreference = 0.5\n'


def call(monkeypatch, capsys, *arguments: object) -> tuple[int, str, str]:
    """Return exit code, standard output and standard error of a call."""
    monkeypatch.setattr(sys, "argv", ["hipuq", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        main()
    said = capsys.readouterr()
    code = caught.value.code
    return (code if isinstance(code, int) else int(code is not None)), said.out, said.err


def test_the_command_tells_what_is_compared(monkeypatch, capsys, tmp_path):
    code, said, _ = call(monkeypatch, capsys, "run", write(tmp_path, BOTH), "--dry-run")
    assert code == 0
    lines = [" ".join(line.split()) for line in said.splitlines()]
    assert (
        "compare/hoffmann: random, latin hypercube, integrated with two_dof(hoffmann2002), 16 to 32 "
        "evaluations, 3 replicates, 352 evaluations"
    ) in lines
    assert (
        "compare/indices: sobol with two_dof(hoffmann2002), 64 evaluations, 2 replicates, 128 evaluations"
        in (lines)
    )
    assert lines[-1] == f"in all {24 + 32 + 352 + 128 + 3 * 48:,} evaluations"


def test_an_error_of_a_comparison_is_one_line(monkeypatch, capsys, tmp_path):
    write(tmp_path, COMPARE.replace("replicates = 2", "replicats = 2", 1))
    code, _, err = call(monkeypatch, capsys, "run", tmp_path)
    assert code == 1
    assert "did you mean 'replicates'" in err
    assert len(err.strip().splitlines()) == 1
    assert "Traceback" not in err


def test_definitions_are_in_the_results(ran):
    study, tree, _, _ = ran
    found = json.loads(tree.attrs["analyses"])
    assert set(found) == {"a", "b"}
    assert found["a"]["n"] == 24
    assert found["a"]["of"] == ["any_unstable", "margin"]
    assert found["a"]["model"] == "two_dof(hoffmann2002)"
    assert found["b"]["model_options"]["nominal"]["k1"] == 12.0
    assert found["b"]["options"]["design"] == {"sampler": "latin_hypercube"}
    assert found["a"]["inputs"] == json.loads(study.analyses[0].inputs.to_json())
    assert found["a"]["seed"] == int(tree["a/margin"].attrs["seed"])
    assert found["a"]["hipuq_version"] == hipuq.__version__
