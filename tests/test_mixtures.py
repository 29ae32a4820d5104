"""Mixtures: exact quantiles through gaps and atoms, known moments, JSON round trip, words for reports."""

import json

import chaospy as cp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import stats

import hipuq
from hipuq.distributions import (
    Distribution,
    as_distribution,
    described,
    from_description,
    from_table,
    regimes,
    sources,
)
from hipuq.distributions.inversion import doubles_of, keys_of
from hipuq.errors import InputError, UnknownNameError
from hipuq.inputs import Inputs

U = np.concatenate([np.random.default_rng(3).random(100), [2.0**-64, 1e-12, 0.25, 0.5, 1 - 2.0**-53, 1.0]])

number = st.floats(-3.0, 3.0).map(lambda value: round(value, 2))
positive = st.floats(0.1, 3.0).map(lambda value: round(value, 2))

parts = st.one_of(
    st.builds(lambda a, w: cp.Uniform(a, a + w), number, positive),
    st.builds(lambda a, v, w: cp.Triangle(a, a + v, a + v + w), number, positive, positive),
    st.builds(cp.Normal, number, positive),
    st.builds(lambda m, s: stats.norm(m, s), number, positive),
    st.builds(lambda a, w: cp.DiscreteUniform(a, a + w), st.integers(-3, 3), st.integers(1, 4)),
    st.builds(lambda n: stats.binom(n, 0.3), st.integers(1, 4)),
    st.builds(lambda s: stats.t(3, scale=s), positive),
)


@st.composite
def mixtures(draw, deep=True) -> Distribution:
    """Return a mixture of one to three distributions, some of weight 0, some a mixture again."""
    inner = st.one_of(parts, mixtures(deep=False)) if deep else parts
    components = draw(st.lists(inner, min_size=1, max_size=3))
    shares = draw(st.lists(st.integers(0, 4), min_size=len(components), max_size=len(components)))
    shares[0] += 1
    return hipuq.mixture(components, [share / sum(shares) for share in shares])


GAP = hipuq.mixture([cp.Uniform(0.0, 1.0), cp.Uniform(3.0, 5.0)], [0.25, 0.75])


@settings(max_examples=15)
@given(mixtures())
@example(GAP)
def test_quantiles_are_exact_to_neighbouring_doubles(made):
    """The quantile is the smallest double whose probability is at least u."""
    x = made.ppf(U)
    assert (made.cdf(x) >= U).all()
    assert (made.cdf(np.nextafter(x, -np.inf)) < U).all()
    assert (np.diff(made.ppf(np.sort(U))) >= 0).all()
    assert made.ppf(0.0) == made.support[0]
    grid = np.linspace(-10, 10, 401)
    assert (np.diff(made.cdf(grid)) >= 0).all()
    reached = made.cdf(grid)
    assert made.cdf(made.ppf(reached[reached > 0])) == pytest.approx(reached[reached > 0], abs=1e-12)


@settings(max_examples=10)
@given(mixtures())
def test_the_description_rebuilds_it(made):
    again = from_description(json.loads(json.dumps(dict(made.description))))
    assert again == made and again.rebuilds
    assert again.support == made.support
    assert np.array_equal(again.ppf(U), made.ppf(U))
    assert np.array_equal(again.cdf(U * 4 - 2), made.cdf(U * 4 - 2))
    assert described(again.description) == made.description["text"]


def test_moments_are_those_of_the_components():
    """F is the weighted sum; mean and variance follow the law of total expectation and variance."""
    made = hipuq.mixture([cp.Normal(-1.0, 0.5), cp.Normal(2.0, 1.5)], [0.3, 0.7])
    x = np.linspace(-5, 8, 101)
    exact = 0.3 * stats.norm(-1, 0.5).cdf(x) + 0.7 * stats.norm(2, 1.5).cdf(x)
    assert made.cdf(x) == pytest.approx(exact, abs=1e-12)
    mean = 0.3 * -1 + 0.7 * 2
    midpoints = made.ppf((np.arange(20_000) + 0.5) / 20_000)
    variance = 0.3 * (0.25 + 1) + 0.7 * (2.25 + 4) - mean**2
    assert midpoints.mean() == pytest.approx(mean, abs=1e-4)
    assert midpoints.var() == pytest.approx(variance, rel=1e-3)


def test_gaps_and_atoms():
    """At the probability of a gap the quantile is its lower end; an atom takes up its whole step."""
    assert GAP.ppf(0.25) == pytest.approx(1.0, abs=1e-15)
    assert GAP.ppf(0.25 + 1e-9) == pytest.approx(3.0, abs=1e-8)
    assert GAP.cdf([1.0, 2.0, 3.0]) == pytest.approx([0.25] * 3, abs=1e-15)
    assert GAP.cdf(2.0) == GAP.cdf(1.5)
    atom = hipuq.mixture([cp.Uniform(0.0, 2.0), stats.rv_discrete(values=([1], [1.0]))()], [0.5, 0.5])
    assert atom.ppf([0.25, 0.2500001, 0.5, 0.75]).tolist() == [1.0] * 4
    assert atom.ppf(0.8) == pytest.approx(1.2)
    levels = hipuq.mixture([cp.DiscreteUniform(0, 1), stats.binom(3, 0.5)])
    assert set(levels.ppf(U)) <= {0.0, 1.0, 2.0, 3.0}
    assert np.isnan(GAP.ppf([np.nan, -0.1, 1.1])).all() and np.isnan(GAP.cdf(np.nan))


def test_weights():
    """All alike without weights; one of 0 is in the description, but neither drawn nor in the support."""
    alike = hipuq.mixture([cp.Uniform(0, 1), cp.Uniform(1, 2), cp.Uniform(2, 3)])
    assert [part["weight"] for part in alike.description["components"]] == [1 / 3] * 3
    one = hipuq.mixture({"low": cp.Uniform(0, 1), "high": cp.Uniform(5, 6)}, {"high": 0, "low": 1})
    assert one.support == as_distribution(cp.Uniform(0, 1)).support
    assert np.array_equal(one.cdf(U), as_distribution(cp.Uniform(0, 1)).cdf(U))
    assert [(part.name, part.weight) for part in regimes(one.description)] == [("low", 1.0), ("high", 0.0)]
    assert one != hipuq.mixture({"low": cp.Uniform(0, 1), "high": cp.Uniform(5, 6)})


class Own:
    """A distribution of no library."""

    def ppf(self, u):
        return np.sqrt(u)

    def cdf(self, x):
        return np.clip(x, 0, 1) ** 2

    def __repr__(self):
        return "Own(\n)"


def test_what_has_no_description_cannot_be_stored():
    made = hipuq.mixture([Own(), cp.Uniform(2, 3)])
    assert not made.rebuilds and made == made and made != hipuq.mixture([Own(), cp.Uniform(2, 3)])
    assert made.ppf(0.125) == pytest.approx(0.5)
    assert described(made.description) == "0.5: Own( ); 0.5: Uniform(lower=2, upper=3)"
    text = hipuq.Inputs(x=hipuq.mixture([made, cp.Uniform(0, 1)])).to_json()
    with pytest.raises(InputError, match="cannot be rebuilt from its description: give it again"):
        Inputs.from_json(text)


def test_words():
    nested = hipuq.mixture({"wet": cp.Trunc(cp.Normal(0.1, 0.2), lower=0), "dry": GAP}, [0.9, 0.1])
    assert (
        described(nested.description)
        == nested.description["text"]
        == (
            "wet 0.9: Trunc(Normal(mu=0.1, sigma=0.2), lower=0); "
            "dry 0.1: (0.25: Uniform(); 0.75: Uniform(lower=3.0, upper=5.0))"
        )
    )
    assert described(as_distribution(stats.norm(1, scale=2)).description) == "norm(1.0, scale=2.0)"
    assert repr(nested.source) == f"mixture({described(nested.description)})"
    assert sources(nested.description) == {}
    assert regimes(GAP.description) == regimes({"kind": "opaque", "text": "?"}) == []


def test_what_is_no_mixture_is_named():
    uniform = cp.Uniform(0, 1)

    class Quantiles:
        def ppf(self, u):
            return np.asarray(u)

    cases = [
        (
            InputError,
            "add up to 0.9: they must add up to 1",
            lambda: hipuq.mixture([uniform] * 2, [0.4, 0.5]),
        ),
        (InputError, "the weight of component 2 is -0.5", lambda: hipuq.mixture([uniform] * 2, [1.5, -0.5])),
        (InputError, "the weight of component 1 is nan", lambda: hipuq.mixture([uniform], [np.nan])),
        (InputError, "the weight of component 1 is True", lambda: hipuq.mixture([uniform], [True])),
        (
            InputError,
            "the weight of component 1 is \\[0.5\\]",
            lambda: hipuq.mixture([uniform] * 2, [[0.5], 0.5]),
        ),
        (InputError, "weights are 1.0: the 1 components", lambda: hipuq.mixture([uniform], 1.0)),
        (InputError, "the 2 components need one each", lambda: hipuq.mixture([uniform] * 2, [1.0])),
        (InputError, "has no components", lambda: hipuq.mixture([])),
        (InputError, "must be a list, or a dict", lambda: hipuq.mixture(uniform)),
        (InputError, "component 2 is 3: it must be a chaospy", lambda: hipuq.mixture([uniform, 3])),
        (InputError, "component a is .* has no cdf", lambda: hipuq.mixture({"a": Quantiles()})),
        (UnknownNameError, "did you mean 'dry'", lambda: hipuq.mixture({"dry": uniform}, {"dri": 1.0})),
        (InputError, "'b' has no weight", lambda: hipuq.mixture({"a": uniform, "b": uniform}, {"a": 1.0})),
        (InputError, "give the components by name too", lambda: hipuq.mixture([uniform], {"a": 1.0})),
        (InputError, "not a description of a mixture", lambda: from_description({"kind": "mixture"})),
    ]
    for error, message, call in cases:
        with pytest.raises(error, match=message) as caught:
            call()
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("sampler", ["random", "latin_hypercube", "sobol"])
def test_every_design_draws_from_it(sampler):
    """Shares of the components are the weights, to within the error of the design."""
    inputs = hipuq.Inputs(x=GAP, y=cp.Uniform(0, 1))
    drawn = hipuq.design("monte_carlo", inputs, n=1024, rng=1, sampler=sampler)["x"].values
    assert not ((drawn > 1) & (drawn < 3 - 1e-9)).any()
    assert (drawn <= 1).mean() == pytest.approx(0.25, abs=0.04 if sampler == "random" else 0.002)
    assert inputs == Inputs.from_json(inputs.to_json())


def test_polynomials_of_it():
    """Chaos maps a gap away by the cumulative probability; values of positive probability are refused."""
    inputs = hipuq.Inputs(x=GAP)
    found = hipuq.run(lambda s: s[["x"]].rename(x="y"), inputs, method="chaos", n=50, of="y", rng=1)
    assert float(found["mean"]) == pytest.approx(0.25 * 0.5 + 0.75 * 4, abs=0.1)
    atom = hipuq.mixture([cp.Uniform(0, 1), cp.Binomial(1, 0.5)])
    with pytest.raises(InputError, match=r"mixture.* has values of positive probability"):
        hipuq.run(lambda s: s.rename(x="y"), hipuq.Inputs(x=atom), method="chaos", n=50, of="y", rng=1)


@given(st.lists(st.floats(), min_size=2, max_size=20))
def test_keys_are_in_the_order_of_doubles(values):
    x = np.array([value for value in values if not np.isnan(value)])
    assert np.array_equal(doubles_of(keys_of(x)), x)
    finite = x[np.isfinite(x)]
    assert (keys_of(np.nextafter(finite, np.inf)) - keys_of(finite) == 1).all()


def test_in_study_files():
    table = {
        "distribution": "mixture",
        "source": "two benches",
        "components": [
            {"distribution": "uniform", "lower": 0, "upper": 1, "source": "bench one"},
            {
                "distribution": "mixture",
                "components": {"a": {"distribution": "uniform", "lower": 3, "upper": 5}},
            },
        ],
        "weights": [0.25, 0.75],
    }
    made = from_table(table)
    assert np.array_equal(made.ppf(U), GAP.ppf(U))
    assert sources(hipuq.mixture([made, GAP]).description) == {}
    wrong = [
        ({"weight": [0.5, 0.5]}, UnknownNameError, "did you mean 'weights'"),
        ({"components": 3}, InputError, "components are 3"),
        ({"components": [3]}, InputError, "component 1 is 3: it must be a table"),
        ({"components": [{"distribution": "unifrm"}]}, InputError, "component 1: .* did you mean 'uniform'"),
        ({"components": [{"lower": 0}]}, InputError, "component 1: the key distribution is missing"),
        ({"source": 3}, InputError, "source is 3: it must be text"),
    ]
    for change, error, message in wrong:
        with pytest.raises(error, match=message):
            from_table({**table, **change})
    with pytest.raises(InputError, match="needs components"):
        from_table({"distribution": "mixture"})
