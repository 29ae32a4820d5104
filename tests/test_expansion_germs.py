"""Germs: standard variables of every family, their polynomials and quadratures, and the way back."""

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy import special, stats

import hipuq
from hipuq import _chaospy
from hipuq.distributions import as_distribution
from hipuq.errors import InputError, SchemaError
from hipuq.expansion.germs import Germs
from hipuq.expansion.polynomials import gauss, orthonormal
from hipuq.expansion.variable import germ_of

RING = hipuq.models.ring()
U = np.random.default_rng(1).random((200, 40))


def germ(distribution):
    return germ_of(as_distribution(distribution))


class Bare:
    """Quantiles only."""

    def __init__(self, frozen):
        self.ppf = frozen.ppf


class Constant:
    def ppf(self, u):
        return np.full(np.shape(u), 2.0)


class Wrong(Bare):
    """A cdf that is not the inverse of its ppf."""

    def cdf(self, x):
        return np.full(np.shape(x), 0.5)


UNIFORM = stats.uniform(-1, 2)
NORMAL = stats.norm()


def beta(a, b):
    return stats.beta(a, b, -1, 2)


# Distribution -> the standard one that its germ has.
FAMILIES = {
    "uniform": (cp.Uniform(2, 5), UNIFORM),
    "uniform of 0 and 1": (cp.Uniform(), UNIFORM),
    "uniform far from 0": (cp.Uniform(0.99e9, 1.01e9), UNIFORM),
    "uniform of scipy": (stats.uniform(loc=3, scale=0.5), UNIFORM),
    "normal": (cp.Normal(2, 3), NORMAL),
    "normal by keyword": (cp.Normal(sigma=0.1), NORMAL),
    "normal of scipy": (stats.norm(1e9, scale=1e7), NORMAL),
    "beta": (cp.Beta(2, 3), beta(2, 3)),
    "beta on an interval": (cp.Beta(2.5, 0.7, lower=-1, upper=4), beta(2.5, 0.7)),
    "beta of scipy": (stats.beta(2, 5, loc=1, scale=3), beta(2, 5)),
    "gamma": (cp.Gamma(2.5, 3, shift=1), stats.gamma(2.5)),
    "gamma of scipy": (stats.gamma(1.5, scale=2), stats.gamma(1.5)),
    "exponential": (cp.Exponential(2), stats.expon()),
    "exponential of scipy": (stats.expon(1, 2), stats.expon()),
    "lognormal": (cp.LogNormal(1, 0.5), NORMAL),
    "lognormal, moved": (cp.LogNormal(1, 0.5, shift=2, scale=3), NORMAL),
    "lognormal of scipy": (stats.lognorm(0.5, 1, 2), NORMAL),
    "log-uniform": (cp.Reciprocal(1, 20), UNIFORM),
    "log-uniform of scipy": (stats.loguniform(0.1, 10), UNIFORM),
    "triangle": (cp.Triangle(0, 1, 3), UNIFORM),
    "truncated normal": (cp.TruncNormal(-1, 2, 0, 1), UNIFORM),
    "weibull": (cp.Weibull(2, 3), UNIFORM),
    "sum": (cp.Gamma(2) + 1, UNIFORM),
    "student": (stats.t(3), UNIFORM),
    "quantiles only": (Bare(stats.gamma(2)), UNIFORM),
    "wrong cdf": (Wrong(stats.gamma(2)), UNIFORM),
}


def quadrature(standard, n):
    """Return nodes and weights for a standard distribution, from scipy."""
    name, args = standard.dist.name, standard.args
    if name == "norm":
        nodes, weights = special.roots_hermitenorm(n)
    elif name in ("gamma", "expon"):
        nodes, weights = special.roots_genlaguerre(n, args[0] - 1 if args else 0.0)
    else:
        a, b = args[:2] if name == "beta" else (1.0, 1.0)
        nodes, weights = special.roots_jacobi(n, b - 1, a - 1)
    return nodes, weights / weights.sum()


@pytest.mark.parametrize("name", FAMILIES)
def test_germs_have_their_standard_distribution(name):
    """Quantile for quantile, and the way back gives the draws."""
    distribution, standard = FAMILIES[name]
    u = (np.arange(400) + 0.5) / 400
    draws = as_distribution(distribution).ppf(u)
    made = germ(distribution)
    germs = made.values(draws)
    assert germs == pytest.approx(standard.ppf(u), rel=1e-6, abs=1e-6)
    assert made.to_draw(germs) == pytest.approx(draws, rel=1e-9, abs=1e-7)
    ends = as_distribution(distribution).ppf(np.array([2.0**-60, 1 - 2.0**-53]))
    assert np.isfinite(made.values(ends)).all()


@pytest.mark.parametrize("name", FAMILIES)
def test_polynomials_are_orthonormal(name):
    """To 1e-10 at degree 15, by a quadrature of scipy's for the standard distribution."""
    distribution, standard = FAMILIES[name]
    nodes, weights = quadrature(standard, 24)
    values = orthonormal(nodes[None], germ(distribution).recurrence(15)[None])[0]
    assert np.abs((values * weights) @ values.T - np.eye(16)).max() < 1e-10


@pytest.mark.parametrize("name", FAMILIES)
def test_quadrature_is_exact(name):
    """With n nodes, polynomials up to degree 2 n - 1, compared with more nodes of scipy's."""
    distribution, standard = FAMILIES[name]
    made = germ(distribution)
    for n in (1, 2, 7):
        nodes, weights = made.nodes(n)
        fine, fine_weights = quadrature(standard, 2 * n + 3)
        assert weights.sum() == pytest.approx(1, abs=1e-13)
        for power in range(2 * n):
            scale = fine_weights @ np.abs(fine) ** power
            assert weights @ nodes**power == pytest.approx(
                fine_weights @ fine**power, rel=1e-11, abs=1e-11 * scale
            )


@pytest.mark.parametrize("shape", [0.3, 1.0, 2.5, 40.0])
def test_recurrences_of_laguerre_follow_their_closed_form(shape):
    k = np.arange(51)
    a, b = _chaospy.recurrence("Gamma", (shape,), 50)
    assert a == pytest.approx(2 * k + shape, rel=1e-13)
    assert b[1:] == pytest.approx((k * (k + shape - 1))[1:], rel=1e-13)


def test_recurrences_of_legendre_and_hermite_follow_their_closed_form():
    k = np.arange(51)
    a, b = _chaospy.recurrence("Uniform", (-1.0, 1.0), 50)
    assert np.abs(a).max() < 1e-15 and b[0] == 1
    assert b[1:] == pytest.approx((k**2 / (4 * k**2 - 1))[1:], rel=1e-13)
    a, b = _chaospy.recurrence("Normal", (0.0, 1.0), 50)
    assert np.abs(a).max() < 1e-15 and b[1:] == pytest.approx(k[1:], rel=1e-13)


@pytest.mark.parametrize("p, q", [(2.0, 3.0), (0.5, 0.5), (5.0, 1.5), (0.2, 7.0)])
def test_recurrences_of_jacobi_give_the_nodes_of_scipy(p, q):
    nodes, weights = gauss(_chaospy.recurrence("Beta", (p, q, -1.0, 1.0), 40))
    own, own_weights = special.roots_jacobi(40, q - 1, p - 1)
    assert nodes == pytest.approx(own, abs=1e-13)
    assert weights == pytest.approx(own_weights / own_weights.sum(), rel=1e-8, abs=1e-15)


LEVELS = {
    "binomial": (cp.Binomial(5, 0.3), np.arange(6), stats.binom(5, 0.3).pmf(np.arange(6))),
    "coin": (cp.Binomial(1, 0.2), np.arange(2), np.array([0.8, 0.2])),
    "discrete uniform": (cp.DiscreteUniform(3, 10), np.arange(3, 11), np.full(8, 1 / 8)),
    "binomial of scipy": (stats.binom(4, 0.5), np.arange(5), stats.binom(4, 0.5).pmf(np.arange(5))),
    "own levels": (
        stats.rv_discrete(values=([1, 2, 7], [0.5, 0.2, 0.3]))(),
        np.array([1, 2, 7]),
        np.array([0.5, 0.2, 0.3]),
    ),
    "own levels, moved": (
        stats.rv_discrete(values=([7, 2], [0.6, 0.4]))(loc=1),
        np.array([3, 8]),
        np.array([0.4, 0.6]),
    ),
    "one level": (cp.DiscreteUniform(4, 4), np.array([4]), np.ones(1)),
}


@pytest.mark.parametrize("name", LEVELS)
def test_discrete_germs_have_polynomials_of_their_own(name):
    """Orthonormal over the levels; there are as many as levels, and no more."""
    distribution, levels, probabilities = LEVELS[name]
    made = germ(distribution)
    assert made.largest == len(levels) - 1
    germs = made.values(levels.astype(float))
    assert np.abs(germs).max() <= 1
    assert np.array_equal(made.to_draw(germs), levels)
    values = orthonormal(germs[None], made.recurrence(made.largest + 2)[None])[0]
    assert np.isnan(values[len(levels) :]).all()
    values = values[: len(levels)]
    assert np.abs((values * probabilities) @ values.T - np.eye(len(levels))).max() < 1e-10
    nodes, weights = made.nodes(len(levels) + 2)
    assert np.array_equal(made.to_draw(nodes[: len(levels)]), levels)
    assert weights == pytest.approx([*probabilities, 0, 0])
    with pytest.raises(InputError, match=r"outside its distribution"):
        made.values(np.array([levels[0] + 0.4]))
    if len(levels) > 1:
        with pytest.raises(InputError, match=f"it has {len(levels)} levels"):
            made.nodes(len(levels) - 1)


@pytest.mark.parametrize("distribution", [stats.poisson(3), stats.geom(0.2), cp.DiscreteUniform(0, 200)])
def test_many_levels_keep_only_degrees_that_hold(distribution):
    """Orthonormal by sums over all levels up to the highest degree allowed."""
    made = germ(distribution)
    assert 15 <= made.largest <= 50
    values = orthonormal(made.atoms[None], made.recurrence(made.largest)[None])[0]
    assert np.abs((values * made.probabilities) @ values.T - np.eye(len(values))).max() < 1e-9


def test_a_distribution_without_spread_has_only_a_constant():
    made = germ(Constant())
    assert made.largest == 0
    assert made.values(np.full(3, 2.0)).tolist() == [0, 0, 0]


def ring_inputs(**more):
    return RING.inputs(
        friction=cp.Uniform(0.0, 0.1),
        mass=hipuq.relative(cp.Normal(0, 0.01), each="oscillator"),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.01, 0.01), each="spring"),
        contact_angle=hipuq.shift(cp.Normal(0.0, 0.5), each="oscillator"),
        contact_stiffness=hipuq.relative(cp.Beta(2, 3, -0.1, 0.1)),
        spring_angle=hipuq.shift(stats.uniform(-1, 2)),
        **more,
    )


def test_germs_of_the_ring_and_back():
    inputs = ring_inputs()
    germs = Germs.of(inputs)
    assert germs.parameters == tuple(inputs.groups)
    assert germs.elements[:3] == ("friction", "mass[1]", "mass[2]")
    assert germs.elements[-3:] == ("contact_angle[9]", "contact_stiffness", "spring_angle")
    assert germs.elements[10] == "spring_stiffness[1]" and len(germs.elements) == inputs.dimension == 31
    assert germs.largest.shape == (31,)
    samples = inputs.samples(U[:, :31])
    values = germs.values(samples)
    expected = np.column_stack(
        [
            2 * U[:, 0] - 1,
            special.ndtri(U[:, 1:10]),
            2 * U[:, 10:20] - 1,
            special.ndtri(U[:, 20:29]),
            beta(2, 3).ppf(U[:, 29]),
            2 * U[:, 30] - 1,
        ]
    )
    assert values == pytest.approx(expected, abs=1e-8)
    again = germs.samples(values)
    assert set(again.variables) == set(samples.variables)
    for name in samples.variables:
        assert again[name].dims == samples[name].dims and again[name].attrs == samples[name].attrs
        assert again[name].values == pytest.approx(samples[name].values, rel=1e-12, abs=1e-12)
    # Order of dims and other variables do not matter.
    turned = samples.transpose(..., "sample").assign(other=1.0)
    assert np.array_equal(germs.values(turned), values)


names = st.sampled_from(["mass", "spring_stiffness", "contact_angle", "friction"])


@given(
    st.lists(names, min_size=1, unique=True), st.sampled_from(["plain", "relative", "shift"]), st.booleans()
)
def test_draws_are_told_from_values(chosen, how, each):
    """`to_draws` is the inverse of `from_draws` for every way a distribution applies."""
    dims = {"friction": None, "spring_stiffness": "spring"}
    made = {}
    for name in chosen:
        dim = dims.get(name, "oscillator") if each else None
        distribution = cp.Uniform(-0.01, 0.01)
        nominal = 0.3 if name == "friction" else None
        made[name] = (
            distribution if how == "plain" else getattr(hipuq, how)(distribution, each=dim, nominal=nominal)
        )
    inputs = RING.inputs(**made)
    draws = 0.02 * U[:, : inputs.dimension] - 0.01
    assert inputs.to_draws(inputs.from_draws(draws)) == pytest.approx(
        draws,
        abs=1e-14
        if how != "shift"
        else 1e-15 * (1 + max(np.abs(RING.parameters[n].nominal).max() for n in made)),
    )


def test_a_shared_draw_is_told_from_the_element_that_shows_it():
    inputs = hipuq.Inputs(a=hipuq.relative(cp.Uniform(-0.1, 0.1), nominal=[0.0, 2.0], each="part"))
    with pytest.raises(InputError, match="relative to a nominal value of 0"):
        inputs.to_draws(inputs.samples(U[:, :2]))
    model = hipuq.models.ring(contact_angle=[0.0, *range(10, 90, 10)])
    inputs = model.inputs(contact_angle=hipuq.relative(cp.Uniform(-0.1, 0.1)))
    samples = inputs.samples(U[:, :1])
    assert inputs.to_draws(samples) == pytest.approx(0.2 * U[:, :1] - 0.1, abs=1e-14)
    samples["contact_angle"][3, 4] += 1.0
    with pytest.raises(InputError, match="share one draw, but not those of sample 3"):
        inputs.to_draws(samples)


def test_a_stiff_parameter_is_as_well_conditioned_as_any():
    """A stiffness of 1e9 +-1 %: the same germs and polynomials as U(-1, 1), whatever the way it is given."""
    ways = hipuq.Inputs(
        a=cp.Uniform(0.99e9, 1.01e9),
        b=hipuq.relative(cp.Uniform(-0.01, 0.01), nominal=1e9),
        c=hipuq.shift(stats.uniform(-1e7, 2e7), nominal=1e9),
    )
    germs = Germs.of(ways)
    values = germs.values(ways.samples(np.repeat(U[:, :1], 3, axis=1)))
    assert values == pytest.approx(np.repeat(2 * U[:, :1] - 1, 3, axis=1), abs=1e-10)
    nodes, weights = germs.nodes(16)
    values = germs.values(germs.samples(nodes.T))
    powers = germs.univariate(values, 15)
    for own, weight in zip(powers, weights, strict=True):
        assert np.abs((own * weight) @ own.T - np.eye(16)).max() < 1e-8


def test_the_grid_integrates_products():
    inputs = hipuq.Inputs(x=cp.Uniform(0, 2), y=cp.Normal(1, 2), z=cp.Binomial(2, 0.25))
    germs = Germs.of(inputs)
    points, weights = germs.grid(4)
    assert points.shape == (4 * 4 * 3, 3) and weights.sum() == pytest.approx(1)
    samples = germs.samples(points)
    x, y, z = (samples[name].values for name in "xyz")
    assert set(z) == {0.0, 1.0, 2.0}
    assert weights @ (x**3 * y**2 * z) == pytest.approx(2 * 5 * 0.5)
    with pytest.raises(InputError, match=r"z: it has 3 levels.*take more nodes"):
        germs.grid(2)
    many = Germs.of(hipuq.Inputs(**{f"x{i}": cp.Uniform(0, 1) for i in range(8)}))
    with pytest.raises(InputError, match=r"6 quadrature nodes for each of 8 inputs are 1.68e\+06"):
        many.grid(6)


def test_samples_that_do_not_fit_are_named():
    inputs = hipuq.Inputs(x=cp.Uniform(0, 1), y=cp.LogNormal(0, 1))
    germs = Germs.of(inputs)
    samples = inputs.samples(U[:, :2])
    moved = samples.copy(deep=True)
    moved["x"][7] = 1.01
    below = samples.copy(deep=True)
    below["y"][2] = 0.0
    missing = samples.copy(deep=True)
    missing["x"][1] = np.nan
    cases = [
        (InputError, "x: the draw of sample 7 is 1.01.*, outside its distribution from 0 to 1", moved),
        (InputError, "y: the draw of sample 2 is 0, outside", below),
        (InputError, "x: the draw of sample 1 is nan", missing),
        (SchemaError, "do not hold the input 'y'", samples.drop_vars("y")),
        (SchemaError, "it needs", samples.assign(x=samples["x"].expand_dims(part=2))),
    ]
    for error, message, given_samples in cases:
        with pytest.raises(error, match=message):
            germs.values(given_samples)
    # Rounding is no reason to refuse a sample.
    samples["x"][0] = 1 + 1e-12
    assert germs.values(samples)[0, 0] == 1.0
    with pytest.raises(SchemaError, match="has 3 elements: the inputs have 9"):
        ring = RING.inputs(mass=cp.Uniform(20, 30))
        Germs.of(ring).values(xr.Dataset({"mass": (("sample", "oscillator"), np.ones((4, 3)))}))


def test_inputs_with_levels_have_no_germs():
    inputs = ring_inputs(contact=hipuq.ContactPatterns((8, 9)))
    with pytest.raises(InputError, match="contact is a contact pattern: it has levels, no draws"):
        Germs.of(inputs)
    with pytest.raises(InputError, match="levels, no draws"):
        inputs.from_draws(U[:, : inputs.dimension])
    germs = Germs.of(inputs.without("contact"))
    assert germs.values(inputs.samples(U[:, : inputs.dimension])).shape == (200, 31)
