"""Moments and Sobol indices of expansions: against enumeration, chaospy and known values."""

import tracemalloc

import chaospy as cp
import numpy as np
import pytest

import hipuq
from hipuq.errors import InputError
from hipuq.expansion import expansion as module
from hipuq.expansion.basis import leading, multi_indices, tensor
from hipuq.expansion.expansion import Expansion
from hipuq.expansion.fitting import least_squares, sparse
from hipuq.expansion.germs import Germs
from hipuq.sampling import unit_points

MIXED = hipuq.Inputs(x=cp.Uniform(0, 2), y=cp.Normal(1, 0.5), z=cp.Exponential(1))
GERMS = Germs.of(MIXED)
INDICES = multi_indices(3, 3)
WEIGHT = np.array([0.5, 0.2, 0.3])


def random_expansion(outputs=2, weight=WEIGHT):
    rng = np.random.default_rng(7)
    coefficients = rng.normal(size=(len(weight), len(INDICES), outputs))
    return Expansion(GERMS, INDICES, coefficients, weight)


def enumerated(expansion, output):
    """Return the values on a product of quadrature nodes and levels, and the weights of each axis.

    Axes: level, x, y, z; means over an axis are exact for the squares of the expansion.
    """
    nodes, weights = GERMS.nodes(5)
    grid = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    levels = len(expansion.weight)
    values = [expansion.predict(grid, np.full(125, level))[:, output] for level in range(levels)]
    return np.reshape(values, (levels, 5, 5, 5)), [expansion.weight, *weights]


def conditional_variance(values, weights, axes):
    """Return the variance of the mean given what lies along `axes`."""
    kept = values
    for axis in reversed(range(values.ndim)):
        if axis not in axes:
            kept = np.moveaxis(kept, axis, -1) @ weights[axis]
    shares = np.ones(1)
    for axis in sorted(axes):
        shares = np.multiply.outer(shares, weights[axis])
    shares = shares[0]
    return (shares * np.square(kept)).sum() - (shares * kept).sum() ** 2


def test_indices_with_levels_are_those_of_enumeration():
    """Groups {x, y} and {z} and the level: variances of conditional means by sums over all values."""
    expansion = random_expansion()
    first, total, second = expansion.sobol([[0, 1], [2]], levels=True)
    axes = [{1, 2}, {3}, {0}]
    for output in range(2):
        values, weights = enumerated(expansion, output)
        everything = {0, 1, 2, 3}
        whole = conditional_variance(values, weights, everything)
        alone = [conditional_variance(values, weights, own) for own in axes]
        assert expansion.variance_overall()[output] == pytest.approx(whole)
        for g in range(3):
            assert first[g, output] == pytest.approx(alone[g] / whole)
            rest = conditional_variance(values, weights, everything - axes[g])
            assert total[g, output] == pytest.approx(1 - rest / whole)
            assert np.isnan(second[g, g, output])
            for h in set(range(3)) - {g}:
                both = conditional_variance(values, weights, axes[g] | axes[h])
                assert second[g, h, output] == pytest.approx((both - alone[g] - alone[h]) / whole)
        mean = sum(
            weights[0][level] * (values[level] @ weights[3] @ weights[2] @ weights[1]) for level in range(3)
        )
        assert expansion.mean_overall()[output] == pytest.approx(mean)


def test_moments_of_levels_are_those_of_enumeration():
    expansion = random_expansion()
    values, weights = enumerated(expansion, 1)
    for level in range(3):
        own = [np.ones(1), *weights[1:]]
        mean = values[level] @ weights[3] @ weights[2] @ weights[1]
        assert expansion.mean()[level, 1] == pytest.approx(mean)
        assert expansion.variance()[level, 1] == pytest.approx(
            conditional_variance(values[level : level + 1], own, {0, 1, 2, 3})
        )


def test_without_a_discrete_input_indices_add_up():
    """All first, second and the one third order index are 1; the total of one is 1 less what lacks it."""
    expansion = random_expansion(weight=np.ones(1))
    first, total, second = expansion.sobol([[0], [1], [2]])
    assert first.shape == (3, 2) and second.shape == (3, 3, 2)
    pairs = second[np.triu_indices(3, 1)]
    third = 1 - first.sum(axis=0) - pairs.sum(axis=0)
    assert (third > 0).all()
    assert total == pytest.approx(first + np.nansum(second, axis=0) + third)
    assert np.array_equal(second, second.transpose(1, 0, 2), equal_nan=True)
    whole = expansion.sobol([[0, 1, 2]])
    assert whole[0] == pytest.approx(np.ones((1, 2))) and whole[1] == pytest.approx(np.ones((1, 2)))


@pytest.mark.parametrize(
    "marginals",
    [(cp.Uniform(0, 2), cp.Normal(1, 0.5)), (cp.Uniform(-1, 1), cp.Beta(2, 3, 0, 1), cp.Exponential(2))],
)
def test_chaospy_finds_the_same_indices(marginals):
    """Its Sens_m and Sens_t, from its own orthonormal expansion of the same polynomial."""
    inputs = hipuq.Inputs(**{f"x{i}": own for i, own in enumerate(marginals)})
    d = len(marginals)

    def model(x):
        return x[0] ** 2 + 2 * x[0] * x[1] + x[-1] ** 2 * x[1] + 0.5 * x[-1]

    samples = inputs.samples(unit_points("latin_hypercube", 200, d, 1, (0,), slice(0, 200)))
    x = np.stack([samples[name].values for name in inputs])
    germs = Germs.of(inputs)
    indices = multi_indices(d, 3)
    psi = tensor(germs.univariate(germs.values(samples), 3), indices)
    fit = least_squares(psi, model(x)[:, None], [(len(indices), 3)])
    own = Expansion(germs, indices, fit.coefficients[None], np.ones(1))
    first, total, _ = own.sobol([[i] for i in range(d)])
    joint = cp.J(*marginals)
    polynomial = cp.fit_regression(cp.generate_expansion(3, joint, normed=True), x, model(x))
    assert first[:, 0] == pytest.approx(cp.Sens_m(polynomial, joint), abs=1e-8)
    assert total[:, 0] == pytest.approx(cp.Sens_t(polynomial, joint), abs=1e-8)
    assert own.mean_overall()[0] == pytest.approx(float(cp.E(polynomial, joint)))
    assert own.variance()[0, 0] == pytest.approx(float(cp.Var(polynomial, joint)))


@pytest.mark.parametrize("fit", [least_squares, sparse])
def test_ishigami(fit):
    """Degree 10 from a latin hypercube of 1,500: S1, ST and S2 to 2e-3 (Ishigami and Homma, 1990)."""
    a, b = 7.0, 0.1
    inputs = hipuq.Inputs(**{name: cp.Uniform(-np.pi, np.pi) for name in ("x1", "x2", "x3")})
    samples = inputs.samples(unit_points("latin_hypercube", 1500, 3, 0, (0,), slice(0, 1500)))
    x1, x2, x3 = (samples[name].values for name in inputs)
    y = np.sin(x1) + a * np.sin(x2) ** 2 + b * x3**4 * np.sin(x1)
    germs = Germs.of(inputs)
    indices = multi_indices(3, 10)
    psi = tensor(germs.univariate(germs.values(samples), 10), indices)
    found = fit(psi, y[:, None], leading(indices, 1.0))
    assert found.degree[0] == 10 and found.loo[0] < 2e-5
    expansion = Expansion(germs, indices, found.coefficients[None], np.ones(1))
    first, total, second = expansion.sobol([[0], [1], [2]])
    parts = [(1 + b * np.pi**4 / 5) ** 2 / 2, a**2 / 8, 8 * b**2 * np.pi**8 / 225]
    variance = sum(parts)
    assert expansion.variance_overall()[0] == pytest.approx(variance, rel=2e-3)
    assert first[:, 0] == pytest.approx([parts[0] / variance, parts[1] / variance, 0], abs=2e-3)
    assert total[:, 0] == pytest.approx(
        [1 - parts[1] / variance, parts[1] / variance, parts[2] / variance], abs=2e-3
    )
    assert second[0, 2, 0] == pytest.approx(parts[2] / variance, abs=2e-3)


def test_predictions_do_not_depend_on_chunks(monkeypatch):
    expansion = random_expansion()
    rng = np.random.default_rng(0)
    points = GERMS.values(MIXED.samples(rng.random((100, 3))))
    level = rng.integers(0, 3, 100)
    psi = tensor(GERMS.univariate(points, 3), INDICES)
    expected = np.einsum("st,sto->so", psi, expansion.coefficients[level])
    assert expansion.predict(points, level) == pytest.approx(expected, rel=1e-12)
    everywhere = expansion.at_all_levels(points)
    assert everywhere[np.arange(100), level] == pytest.approx(expected, rel=1e-12)
    assert expansion.predict(points, 2) == pytest.approx(everywhere[:, 2], rel=1e-12)
    monkeypatch.setattr(module, "CHUNK_BYTES", 1000)
    assert expansion.predict(points, level) == pytest.approx(expected, rel=1e-12)
    assert expansion.at_all_levels(points) == pytest.approx(everywhere, rel=1e-12)


def test_predictions_need_little_memory():
    """39 inputs, 820 terms: 20,000 points would be 131 MB of terms at once."""
    germs = Germs.of(hipuq.Inputs(**{f"x{i}": cp.Uniform(-1, 1) for i in range(39)}))
    indices = multi_indices(39, 2)
    expansion = Expansion(germs, indices, np.ones((1, 820, 1)), np.ones(1))
    points = np.random.default_rng(0).uniform(-1, 1, (20_000, 39))
    tracemalloc.start()
    try:
        predicted = expansion.predict(points)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert np.isfinite(predicted).all()
    assert peak < 64e6


def test_a_level_without_a_fit_leaves_nothing_overall():
    """Unless it never happens: NaN if the level has a weight, else as if it were not there."""
    expansion = random_expansion()
    coefficients = expansion.coefficients.copy()
    coefficients[1, :, 0] = np.nan
    missing = Expansion(GERMS, INDICES, coefficients, WEIGHT)
    assert np.array_equal(np.isnan(missing.mean()), [[False, False], [True, False], [False, False]])
    for part in (missing.mean_overall(), missing.variance_overall()):
        assert np.isnan(part[0]) and np.isfinite(part[1])
    groups = [[0, 1], [2]]
    for own, whole in zip(missing.sobol(groups, True), expansion.sobol(groups, True), strict=True):
        assert np.isnan(own[..., 0]).all()
        assert np.array_equal(own[..., 1], whole[..., 1], equal_nan=True)
    assert np.isnan(missing.predict(np.zeros((1, 3)), 1)[0, 0])
    never = Expansion(GERMS, INDICES, coefficients, np.array([0.5, 0.0, 0.3]))
    rest = Expansion(GERMS, INDICES, coefficients[[0, 2]], np.array([5.0, 3.0]))
    assert never.mean_overall() == pytest.approx(rest.mean_overall())
    for own, other in zip(never.sobol(groups, True), rest.sobol(groups, True), strict=True):
        assert own == pytest.approx(other, nan_ok=True)


def test_what_does_not_vary_has_no_indices():
    """NaN rather than 0; a difference between levels alone is the level's, all of it."""
    coefficients = np.zeros((3, len(INDICES), 2))
    coefficients[:, 0] = [[0.1, 1.0], [0.1, 2.0], [0.1, 3.0]]
    expansion = Expansion(GERMS, INDICES, coefficients, WEIGHT)
    first, total, second = expansion.sobol([[0], [1], [2]], levels=True)
    for part in (first, total, second):
        assert np.isnan(part[..., 0]).all()
    assert first[:, 1] == pytest.approx([0, 0, 0, 1]) and total[:, 1] == pytest.approx([0, 0, 0, 1])
    assert second[0, 3, 1] == 0
    assert expansion.mean_overall()[0] == pytest.approx(0.1)


def test_arrays_that_do_not_fit_are_named():
    with pytest.raises(InputError, match="they need 3 levels of 20 terms"):
        Expansion(GERMS, INDICES, np.zeros((2, 20, 1)), WEIGHT)
    with pytest.raises(InputError, match="0 in the first row"):
        Expansion(GERMS, INDICES[1:], np.zeros((3, 19, 1)), WEIGHT)
