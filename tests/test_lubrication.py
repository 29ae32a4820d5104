"""Friction over the regimes of lubrication: weights from the lambda ratio, sources, exact identities."""

import json
import tomllib
from pathlib import Path

import chaospy as cp
import numpy as np
import pytest
from closed_forms import K3, onset_hoffmann
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

import hipuq
from hipuq.distributions import as_distribution, described, from_description, from_table, regimes, sources
from hipuq.distributions.lubricated import DEFAULTS, GIVEN
from hipuq.errors import InputError, StudyError, UnknownNameError
from hipuq.inputs import Inputs

MODEL = hipuq.models.two_dof("hoffmann2002")
SHARES = {"film": 0.5, "mixed": 0.3, "boundary": 0.2}


def weights(made):
    return {one.name: one.weight for one in regimes(made.description)}


def probability(friction):
    """Return P(unstable) of the two masses with friction integrated."""
    exact = hipuq.integrate_friction(MODEL, friction)
    return float(hipuq.evaluate(exact, exact.nominal())["probability"][0])


def test_the_default():
    """Median and spread of the lambda ratio as they are told, regimes apart, all with sources."""
    made = hipuq.lubrication()
    ratio = made.description["lambda_ratio"]
    lognormal = stats.lognorm(0.9, scale=np.exp(0.55))
    assert from_description(ratio["distribution"]).ppf(np.array([0.025, 0.5, 0.975])) == pytest.approx(
        lognormal.ppf([0.025, 0.5, 0.975]), rel=1e-6
    )
    assert lognormal.ppf([0.025, 0.975]) == pytest.approx([0.3, 10.0], rel=0.02)
    expected = {"boundary": lognormal.cdf(1), "film": lognormal.sf(3)}
    expected["mixed"] = 1 - expected["boundary"] - expected["film"]
    assert weights(made) == pytest.approx(expected, abs=1e-9)
    assert made.support == pytest.approx((0.04, 1.0))
    assert made.cdf([0.08, 0.09, 0.23, 0.3]) == pytest.approx(
        [expected["film"]] * 2 + [1 - expected["boundary"]] * 2, abs=1e-9
    )
    cited = sources(json.loads(json.dumps(dict(made.description))))
    assert set(cited) == {"lambda ratio", "film", "mixed", "boundary"}
    assert cited["lambda ratio"].startswith("LogNormal(mu=0.55, sigma=0.9): assumption, not a measurement")
    assert "Walter" in cited["film"] and "polyethylene" in cited["mixed"] and "Fan" in cited["boundary"]
    assert made.description["text"] == described(made.description)
    assert made.description["text"].startswith("film 0.271: Triangle(0.04, 0.06, 0.08); mixed 0.458: ")


@settings(max_examples=10)
@given(st.floats(0.2, 3.0), st.floats(0.1, 1.5), st.floats(0.3, 1.5), st.floats(0.1, 3.0))
def test_probabilities_of_the_regimes(mu, sigma, below, between):
    """They are differences of the cdf of the lambda ratio at the limits."""
    ratio = as_distribution(cp.LogNormal(mu, sigma))
    made = hipuq.lubrication(ratio, boundary_below=below, film_from=below + between)
    low, high = ratio.cdf(np.array([below, below + between]))
    expected = {"film": 1 - high, "mixed": high - low, "boundary": low}
    assert weights(made) == pytest.approx(expected, abs=1e-12)
    again = from_description(json.loads(json.dumps(dict(made.description))))
    assert again == made and sources(again.description) == sources(made.description)


def test_other_forms_of_the_lambda_ratio():
    """Probabilities as they are; a number or an atom at a limit belongs to the regime above it."""
    assert weights(hipuq.lubrication(SHARES)) == SHARES
    for number, regime in [(0.99, "boundary"), (1, "mixed"), (2.9, "mixed"), (3.0, "film"), (0, "boundary")]:
        one = hipuq.lubrication(number)
        assert weights(one) == {name: float(name == regime) for name in SHARES}
        assert (
            one.support
            == from_description(
                next(part["distribution"] for part in one.description["components"] if part["weight"])
            ).support
        )
    steps = stats.rv_discrete(values=([0, 1, 3], [0.2, 0.5, 0.3]))()
    made = hipuq.lubrication(steps)
    assert weights(made) == pytest.approx({"film": 0.3, "mixed": 0.5, "boundary": 0.2})
    # What the weights come from need not be rebuilt.
    assert made.rebuilds and from_description(json.loads(json.dumps(dict(made.description)))) == made


def test_replaced_parts():
    """A part of one's own has the source that is given with it, or says that none was."""
    made = hipuq.lubrication(
        SHARES, boundary=cp.Uniform(0.4, 0.6), film=stats.uniform(0.01, 0.02), sources={"film": "own bench"}
    )
    assert sources(made.description) == {
        "lambda ratio": f"probabilities of the regimes: {GIVEN}",
        "film": "own bench",
        "mixed": DEFAULTS["mixed"].source,
        "boundary": GIVEN,
    }
    assert made.cdf([0.02, 0.35, 0.5]) == pytest.approx([0.25, 0.8, 0.9])
    assert from_description(json.loads(json.dumps(dict(made.description)))) == made


@pytest.mark.parametrize("ratio", [None, SHARES], ids=["default", "given"])
def test_friction_integrated_is_the_weighted_sum_of_the_regimes(ratio):
    """An identity: P(unstable) = sum over the regimes of weight * P(unstable | regime)."""
    made = hipuq.lubrication(ratio, mixed=cp.Triangle(0.2, 0.4, 0.9))
    total = sum(
        part["weight"] * probability(from_description(part["distribution"]))
        for part in made.description["components"]
    )
    assert 0.1 < total < 0.9
    assert probability(made) == pytest.approx(total, abs=1e-12)


def test_friction_integrated_has_a_closed_form():
    """The two masses are unstable above mu_c = 0.472: only boundary lubrication gets there."""
    onset = onset_hoffmann(K3)
    assert 0.3 < onset < 1.0
    assert probability(hipuq.lubrication(SHARES)) == pytest.approx(0.2 * (1 - onset) / 0.7, abs=1e-9)
    assert probability(hipuq.lubrication(2.0)) == 0.0


@pytest.mark.parametrize("method", ["monte_carlo", "chaos", "sobol"])
def test_every_method_takes_it(method):
    """Also behind the gaps of its density; inputs and results can be read again."""
    friction = hipuq.lubrication(SHARES)
    inputs = MODEL.inputs(friction=friction, k3=hipuq.relative(cp.Uniform(-0.1, 0.1)))
    assert Inputs.from_json(inputs.to_json()) == inputs
    found = hipuq.run(MODEL, inputs, method=method, n=256, of="any_unstable", rng=1)
    mean = float(found["probability" if "probability" in found else "mean"])
    assert mean == pytest.approx(0.2 * (1 - onset_hoffmann(K3)) / 0.7, abs=0.06)
    again = Inputs.from_json(found.attrs["inputs"])
    assert again["friction"].distribution == friction
    assert sources(json.loads(found.attrs["inputs"])["friction"]["distribution"]) == sources(
        friction.description
    )


def test_what_cannot_be_used_is_named():
    class Quantiles:
        def ppf(self, u):
            return np.asarray(u)

    half = {"film": 0.5, "mixed": 0.3}
    lub = hipuq.lubrication
    cases = [
        (
            InputError,
            "boundary_below is 3 and film_from 1: the first",
            lambda: lub(boundary_below=3, film_from=1),
        ),
        (InputError, "boundary_below is 0: it must be a number above 0", lambda: lub(boundary_below=0)),
        (InputError, "film_from is nan", lambda: lub(film_from=np.nan)),
        (InputError, "film_from inf", lambda: lub(film_from=np.inf)),
        (InputError, "film_from is '3'", lambda: lub(film_from="3")),
        (
            InputError,
            "friction of the mixed regime is Normal.* below 0",
            lambda: lub(mixed=cp.Normal(0.1, 0.1)),
        ),
        (InputError, "friction of the film regime is 0.06: it must be", lambda: lub(film=0.06)),
        (InputError, "friction of the film regime is .* has no cdf", lambda: lub(film=Quantiles())),
        (InputError, "lambda_ratio is .* has no cdf", lambda: lub(Quantiles())),
        (InputError, "lambda_ratio is Normal.* ratio of lengths", lambda: lub(cp.Normal(1, 1))),
        (InputError, "lambda_ratio is -1: it must be finite", lambda: lub(-1)),
        (InputError, "lambda_ratio is True: it must be a chaospy", lambda: lub(True)),
        (InputError, "without that of 'boundary'", lambda: lub(half)),
        (InputError, "add up to 0.9: they must add up to 1", lambda: lub({**half, "boundary": 0.1})),
        (InputError, "of the regime 'boundary' is -0.1", lambda: lub({**half, "boundary": -0.1})),
        (UnknownNameError, "did you mean 'boundary'", lambda: lub({**half, "boundry": 0.2})),
        (UnknownNameError, "did you mean 'film'", lambda: lub(sources={"flim": "x"})),
    ]
    for error, message, call in cases:
        with pytest.raises(error, match=message) as caught:
            call()
        assert "\n" not in str(caught.value)


STUDY = """
title = "two masses"
seed = 1
[model]
name = "two_dof"
preset = "hoffmann2002"
[inputs.friction]
distribution = "lubrication"
source = "our own review"
[inputs.k3]
distribution = "uniform"
lower = 10.0
upper = 12.0
[[analysis]]
name = "a"
method = "monte_carlo"
n = 16
of = "any_unstable"
"""
PLAIN = 'distribution = "lubrication"'


def study(folder, keys=""):
    (folder / "study.toml").write_text(STUDY.replace(PLAIN, f"{PLAIN}\n{keys}"), encoding="utf-8")
    return hipuq.load_study(folder)


def friction_of(loaded):
    return loaded.analyses[0].inputs["friction"].distribution


def test_in_study_files(tmp_path):
    assert friction_of(study(tmp_path)) == hipuq.lubrication()
    given = "lambda_ratio = { film = 0.5, mixed = 0.3, boundary = 0.2 }"
    assert friction_of(study(tmp_path, given)) == hipuq.lubrication(SHARES)
    keys = """
boundary_below = 0.5
film_from = 4
lambda_ratio = { distribution = "lognormal", mu = 0.2, sigma = 0.5, source = "simulator" }
boundary = { distribution = "mixture", components = [{ distribution = "uniform", lower = 0.3, upper = 0.5 }] }
"""
    found = friction_of(study(tmp_path, keys))
    expected = hipuq.lubrication(
        cp.LogNormal(0.2, 0.5),
        boundary=hipuq.mixture([cp.Uniform(0.3, 0.5)]),
        boundary_below=0.5,
        film_from=4,
        sources={"lambda_ratio": "simulator"},
    )
    assert weights(found) == weights(expected) and found.description["boundary_below"] == 0.5
    assert found == expected
    assert found == from_description(json.loads(json.dumps(dict(found.description))))
    assert friction_of(study(tmp_path, "lambda_ratio = 5")) == hipuq.lubrication(5)
    assert from_table({"distribution": "lubrication"}) == hipuq.lubrication()


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("flim = 3", "did you mean 'film'"),
        ("film = 3", "film is 3: it must be a table"),
        ('film = { distribution = "unifrm" }', "film: unknown distribution .* did you mean 'uniform'"),
        ('film = { distribution = "normal", mu = 0.0, sigma = 1.0 }', "which is below 0"),
        ("lambda_ratio = { film = 0.5, mixt = 0.5 }", "did you mean 'mixed'"),
        ('lambda_ratio = { distribtion = "uniform" }', "the key distribution is missing"),
        ("boundary_below = 5", "the first must be less"),
        ("film_from = '3'", "film_from is '3'"),
    ],
)
def test_study_files_with_mistakes(tmp_path, keys, message):
    with pytest.raises(StudyError, match=message) as caught:
        study(tmp_path, keys)
    assert "\n" not in str(caught.value)


def test_every_input_table_may_name_its_source():
    from hipuq.study.tables import InputTable

    for table in (
        {"distribution": "uniform", "lower": 0.0, "upper": 1.0},
        {"distribution": "contact_patterns", "in_contact": 8, "oscillators": 9},
    ):
        plain, cited = InputTable(**table), InputTable(**table, source="a paper")
        assert (plain.source, cited.source) == ("", "a paper")
        assert cited.distribution_for("x") == plain.distribution_for("x")


def test_the_page_is_right_as_written():
    """Its study file is the distribution that it says."""
    page = Path(__file__).parents[1] / "docs" / "theory" / "lubrication.md"
    text = page.read_text(encoding="utf-8")
    table = tomllib.loads(text.split("```toml")[1].split("```")[0])["inputs"]["friction"]
    own = {"lambda_ratio": "own simulation", "boundary": "own bench"}
    assert from_table(table) == hipuq.lubrication(
        cp.LogNormal(1.0, 0.5), boundary=cp.Uniform(0.3, 0.7), sources=own
    )


def test_probabilities_and_values_of_a_study_have_sources():
    shares = {"film": 0.5, "mixed": 0.3, "boundary": 0.2, "source": "own survey"}
    found = from_table({"distribution": "lubrication", "lambda_ratio": shares})
    assert sources(found.description)["lambda ratio"] == "probabilities of the regimes: own survey"
    found = from_table({"distribution": "lubrication", "lambda_ratio": {"value": 5.0, "source": "own bench"}})
    assert sources(found.description)["lambda ratio"] == "5: own bench"


@pytest.mark.parametrize("cited", [["film"], "film", {"film": 1}])
def test_sources_are_texts_by_part(cited):
    with pytest.raises(InputError, match="source"):
        hipuq.lubrication(sources=cited)
