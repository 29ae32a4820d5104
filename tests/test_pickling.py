"""Pickles: models, distributions and inputs reach other processes as they are, bit for bit.

Nothing of the package loads a pickle from a file; executors of other processes send them.
"""

import copy
import logging
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import chaospy as cp
import numpy as np
import pytest
import scipy.stats

import hipuq
from hipuq.distributions import FAMILIES, as_distribution, from_family
from hipuq.models import MODELS, PRESETS

U = np.concatenate([[0.0, 1.0, 2.0**-60, 1 - 2.0**-53], np.linspace(0, 1, 101)[1:-1]])

PARAMETERS = {
    "uniform": {"lower": 0.1, "upper": 0.3},
    "normal": {"mu": 1 / 3, "sigma": 0.1},
    "truncated_normal": {"lower": 0.0, "upper": 1.0, "mu": 0.3, "sigma": 0.2},
    "lognormal": {"mu": 0.1, "sigma": 0.7, "shift": 0.2},
    "log_uniform": {"lower": 0.1, "upper": 10.0},
    "triangle": {"lower": 0.0, "midpoint": 0.1, "upper": 1.0},
    "beta": {"alpha": 2.0, "beta": 3.0, "upper": 2.0},
    "pert": {"lower": 0.0, "mode": 0.3, "upper": 1.0},
    "gamma": {"shape": 2.5, "scale": 0.4},
    "exponential": {"scale": 0.3},
    "weibull": {"shape": 1.5, "scale": 0.3},
    "discrete_uniform": {"lower": 1, "upper": 6},
    "binomial": {"size": 5, "prob": 0.3},
}


class Opaque:
    """A user's own distribution, with nothing that describes it."""

    def ppf(self, u):
        return np.asarray(u) ** 2


class OwnNormal(cp.Normal):
    """A user's own distribution of chaospy, which has none of this name."""


def mixed():
    """Return a mixture of distributions of three libraries."""
    far = cp.DiscreteUniform(40, 44)
    return hipuq.mixture(
        {"one": cp.Triangle(0.0, 0.1, 1.0), "other": scipy.stats.gamma(2.0), "far": far}, [0.2, 0.5, 0.3]
    )


DISTRIBUTIONS = {
    **{name: lambda name=name: from_family(name, PARAMETERS[name]) for name in FAMILIES},
    "mixture": mixed,
    "lubrication": hipuq.lubrication,
    "scipy": lambda: as_distribution(scipy.stats.truncnorm(-1.0, 2.0, loc=0.1)),
    "scipy discrete": lambda: as_distribution(scipy.stats.poisson(3.0)),
    "opaque of chaospy": lambda: as_distribution(OwnNormal(0.1, 2.0)),
    "opaque": lambda: as_distribution(Opaque()),
}


def again(value):
    """Return what another process gets."""
    return pickle.loads(pickle.dumps(value))


@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_distributions(name):
    given = DISTRIBUTIONS[name]()
    assert given.rebuilds == ("opaque" not in name)
    for made in (again(given), again(again(given)), copy.deepcopy(given)):
        assert made.description == given.description
        assert made.support == given.support
        assert made.ppf(U).tobytes() == given.ppf(U).tobytes()
        assert (made.cdf is None) == (given.cdf is None)
        if given.cdf is not None:
            x = given.ppf(U)
            assert made.cdf(x).tobytes() == given.cdf(x).tobytes()
        assert made == given or not given.rebuilds


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_every_protocol(protocol):
    given = mixed()
    made = pickle.loads(pickle.dumps(given, protocol))
    assert made == given
    assert made.ppf(U).tobytes() == given.ppf(U).tobytes()


def test_own_distribution_that_cannot_be_pickled_fails_only_when_pickled():
    class Own:
        def __init__(self):
            self.ppf = lambda u: np.asarray(u) ** 2

    found = as_distribution(Own())
    assert found.ppf(np.array([0.5])) == 0.25
    with pytest.raises((AttributeError, pickle.PicklingError), match="local"):
        pickle.dumps(found)


def test_inputs():
    model = hipuq.models.ring("oberst2016")
    inputs = model.inputs(
        friction=hipuq.lubrication(),
        contact=hipuq.ContactPatterns(in_contact=(6, 7), weights=(0.25, 0.75)),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
        contact_angle=hipuq.shift(cp.Normal(0.0, 0.5), each="oscillator"),
    )
    made = again(inputs)
    assert made == inputs
    points = np.random.default_rng(1).random((32, inputs.dimension))
    assert made.samples(points).identical(inputs.samples(points))
    assert again(inputs["contact"].distribution) == inputs["contact"].distribution
    change = hipuq.shift(mixed(), nominal=2.0)
    assert again(change) == change


@pytest.mark.parametrize("name", MODELS)
def test_models(name):
    for preset in PRESETS[name]:
        model = MODELS[name](preset, certify="never", growth_threshold=0.5)
        exact = hipuq.integrate_friction(model, cp.Uniform(0.0, 0.005))
        for given in (model, exact):
            made = again(given)
            assert (made.label, made.options, made.outcomes) == (given.label, given.options, given.outcomes)
            assert made(made.nominal()).identical(given(given.nominal()))


def test_another_process_gives_the_same_bits():
    """Spawned, so that it has nothing but the pickle; which leaves its root logger alone, unlike chaospy."""
    exact = hipuq.integrate_friction(hipuq.models.two_dof(), hipuq.lubrication())
    samples = exact.nominal(k3=np.array([1.0, 5.0, 11.0, 20.0]))
    here = hipuq.evaluate(exact, samples, progress=False)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        there = hipuq.evaluate(exact, samples, executor=pool, progress=False)
        root = "(lambda root: (root.level, len(root.handlers)))(__import__('logging').getLogger())"
        loaded, after = pool.submit(eval, f"('chaospy' in __import__('sys').modules, {root})").result()
    assert np.isfinite(here["probability"]).all()
    assert there.equals(here)
    assert loaded and after == (logging.WARNING, 0)
