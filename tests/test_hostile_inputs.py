"""Inputs that are broken or made to harm are refused in one line; accepted ones give right numbers."""

import copy
import json
import math

import chaospy as cp
import numpy as np
import pytest
from hostile import NUMBERS, evil, mutate
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

import hipuq
from hipuq.distributions import FAMILIES, from_family
from hipuq.errors import HipuqError, InputError

POINTS = np.array([0.0, 1e-12, 1e-3, 0.1, 0.25, 0.5, 0.75, 0.9, 0.999, 1 - 1e-12, 1.0])

DESCRIBED = json.loads(
    hipuq.models.ring("oberst2016")
    .inputs(
        friction=hipuq.lubrication({"film": 0.5, "mixed": 0.3, "boundary": 0.2}),
        contact=hipuq.ContactPatterns(in_contact=(8, 9), weights=(0.25, 0.75)),
        spring_stiffness=hipuq.relative(cp.Trunc(cp.Normal(0, 1), upper=1), each="spring"),
        contact_angle=hipuq.shift(stats.norm(0.0, 0.5)),
    )
    .to_json()
)


def check_values(inputs):
    """Check that values are finite, do not fall with the probability, and lie in the support."""
    samples = inputs.samples(POINTS[:, None].repeat(inputs.dimension, axis=1))
    for name, values in samples.data_vars.items():
        assert np.isfinite(values.values.astype(float)).all(), name
    for name in inputs:
        if name not in inputs.discrete:
            own = inputs[name].distribution
            quantiles = own.ppf(POINTS[1:-1])
            slack = 1e-9 * np.abs(quantiles).max()
            assert (np.diff(quantiles) >= -slack).all(), name
            assert own.support[0] - slack <= quantiles[0], name
            assert quantiles[-1] <= own.support[1] + slack, name


@given(st.sampled_from(sorted(FAMILIES)), st.randoms(use_true_random=False))
@settings(max_examples=200)
def test_a_family_gives_numbers_or_one_line(family, r):
    names = [name for part in FAMILIES[family][1:] for name in part]
    given = {
        name: r.choice(NUMBERS) if r.random() < 0.3 else r.choice([0, 1, r.uniform(-2, 5)]) for name in names
    }
    try:
        inputs = hipuq.Inputs(x=hipuq.relative(from_family(family, given), nominal=r.choice(NUMBERS)))
    except HipuqError as error:
        assert "\n" not in str(error)
    else:
        check_values(inputs)


@given(st.randoms(use_true_random=False))
@settings(max_examples=60)
def test_any_description_gives_inputs_or_one_line(r):
    described = copy.deepcopy(DESCRIBED)
    for _ in range(r.randint(1, 2)):
        mutate(described, r)
    text = json.dumps(described, default=str)
    if r.random() < 0.1:
        text = text[: r.randint(0, len(text))]
    try:
        inputs = hipuq.Inputs.from_json(text)
    except HipuqError:
        pass
    else:
        assert inputs == hipuq.Inputs.from_json(inputs.to_json())
        if len(inputs):
            check_values(inputs)


@given(st.randoms(use_true_random=False))
@settings(max_examples=150)
def test_any_contact_patterns_are_right_or_refused(r):
    given = [
        r.choice([evil(r), (8, 9), 9, [1]]),
        r.choice([evil(r), 9, 3]),
        r.choice([evil(r), None, [1, 3]]),
    ]
    try:
        patterns = hipuq.ContactPatterns(*given)
    except HipuqError:
        return
    assert patterns.size == sum(math.comb(patterns.oscillators, own) for own in patterns.in_contact)
    numbers = patterns.ppf(POINTS[:-1])
    assert (np.diff(numbers) >= 0).all()
    assert np.array_equal(patterns.index(patterns.patterns(numbers)), numbers)


def chaospy_named(name, *args):
    return json.dumps(
        {"x": {**DESCRIBED["friction"], "distribution": {"kind": "chaospy", "name": name, "args": [*args]}}}
    )


UNREAL = [
    *(
        "load",
        "os",
        "numpy",
        "quadrature",
        "__class__",
        "__init__",
        "Distribution",
        "Iid",
        "UserDistribution",
    ),
    *("ScipyStatsDist", "OpenTURNSDist", "distributions.Uniform", "", "J.__init__"),
]


@pytest.mark.parametrize("name", UNREAL)
def test_nothing_but_distributions_is_called_by_its_name(name):
    with pytest.raises(InputError, match="unknown chaospy distribution"):
        hipuq.Inputs.from_json(chaospy_named(name))
    scipy = {**DESCRIBED["friction"], "distribution": {"kind": "scipy", "name": name, "args": []}}
    with pytest.raises(InputError, match=r"scipy\.stats has no distribution"):
        hipuq.Inputs.from_json(json.dumps({"x": scipy}))


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        '{"x": ' * 100_000,
        '{"x": {"how": "absolute"}}',
        "[1]",
        '{"x": {"how": "contact_patterns", "in_contact": [8], "__class__": 1}}',
        '{"x": 1' + "0" * 5000 + "}",
        chaospy_named("Uniform", "__import__('os').getcwd()"),
        chaospy_named("Uniform", {"name": "load"}),
        chaospy_named("Uniform", [[["x"]]]),
        chaospy_named("Uniform", 0, 10**400),
        chaospy_named("DiscreteUniform", 0, 10**12),
        chaospy_named("J", {"name": "Uniform"}, {"name": "Uniform"}),
    ],
    ids=range(12),
)
def test_a_hostile_description_is_refused(text):
    with pytest.raises(InputError) as caught:
        hipuq.Inputs.from_json(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "given",
    [
        cp.Uniform(0, 1e308) * 1e10,
        hipuq.relative(cp.Uniform(0, 1e300), nominal=1e300),
        hipuq.shift(cp.Normal(0, 1), nominal=math.nan),
        hipuq.shift(cp.Normal(0, 1), nominal=[1.0, [2.0]]),
        stats.norm(0, math.inf),
        stats.norm(0, -1),
        math.nan,
        "Uniform(0, 1)",
        cp.DiscreteUniform(0, 10**10),
    ],
    ids=range(9),
)
def test_a_hostile_distribution_is_refused(given):
    with pytest.raises(InputError):
        hipuq.Inputs(x=given)


def test_a_pert_has_the_mean_of_its_definition():
    """Mean (lower + gamma mode + upper) / (gamma + 2), which that of chaospy has for a mode in the middle."""
    for gamma in (4.0, 10.0):
        own = from_family("pert", {"lower": 0.0, "mode": 0.2, "upper": 1.0, "gamma": gamma})
        mean = own.ppf((np.arange(20_000) + 0.5) / 20_000).mean()
        assert mean == pytest.approx((gamma * 0.2 + 1) / (gamma + 2), abs=1e-5)
