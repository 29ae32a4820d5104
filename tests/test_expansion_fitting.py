"""Fits: leave-one-out errors against refits, choice of degree, sparse regression, quadrature."""

import chaospy as cp
import numpy as np
import pytest

import hipuq
from hipuq.errors import InputError
from hipuq.expansion.angles import Angles
from hipuq.expansion.basis import leading, multi_indices, tensor
from hipuq.expansion.fitting import least_squares, project, sparse
from hipuq.expansion.germs import Germs
from hipuq.expansion.nested import Nested, Outputs


def germs_of(dimension):
    return Germs.of(hipuq.Inputs(**{f"x{i}": cp.Uniform(-1, 1) for i in range(dimension)}))


def design(dimension, degree, samples, seed=0, **options):
    """Return points of U(-1, 1), the multi-indices and the design matrix."""
    points = np.random.default_rng(seed).uniform(-1, 1, (samples, dimension))
    indices = multi_indices(dimension, degree, **options)
    return points, indices, tensor(germs_of(dimension).univariate(points, degree), indices)


def refitted(psi, y, weights=None):
    """Return the leave-one-out residuals by fitting again without each sample."""
    root = np.ones(len(psi)) if weights is None else np.sqrt(weights)
    found = np.empty_like(y)
    for i in range(len(psi)):
        rest = np.arange(len(psi)) != i
        fit = np.linalg.lstsq(psi[rest] * root[rest, None], y[rest] * root[rest, None], rcond=None)[0]
        found[i] = y[i] - psi[i] @ fit
    return found


def corrected(psi, y, terms):
    """Return the relative corrected leave-one-out error, written out."""
    own, s = psi[:, :terms], len(psi)
    factor = s / (s - terms) * (1 + np.trace(np.linalg.inv(own.T @ own)))
    return factor * np.square(refitted(own, y)).mean(axis=0) / y.var(axis=0, ddof=1)


def test_one_factorisation_gives_the_error_of_every_size():
    """Of all leading columns, and of several outputs at once, equal to refits without each sample."""
    _, indices, psi = design(2, 4, 40)
    y = np.random.default_rng(3).normal(size=(40, 3)) + np.array([0.0, 5.0, 1e3])
    sizes = range(1, len(indices) + 1)
    errors = Nested(psi, np.ones(40)).errors(Outputs.of(y, np.ones(40)), sizes)
    for size, error in zip(sizes, errors, strict=True):
        assert error == pytest.approx(corrected(psi, y, size), rel=1e-8)


def test_the_fit_is_that_of_least_squares():
    _, indices, psi = design(3, 2, 60)
    y = np.random.default_rng(3).normal(size=(60, 2)) + 7.0
    fit = least_squares(psi, y, [(len(indices), 2)])
    assert fit.coefficients == pytest.approx(np.linalg.lstsq(psi, y, rcond=None)[0], abs=1e-12)
    assert fit.loo == pytest.approx(corrected(psi, y, len(indices)), rel=1e-9)
    assert fit.condition == pytest.approx(np.linalg.cond(psi))
    assert fit.degree.tolist() == [2, 2] and fit.terms.tolist() == [10, 10]


def test_weights_count_as_repeated_samples():
    """Coefficients; and the error left out is that of a refit with the weights of the rest."""
    _, indices, psi = design(2, 2, 30)
    y = np.random.default_rng(3).normal(size=(30, 1))
    weights = np.random.default_rng(4).integers(1, 4, 30).astype(float)
    fit = least_squares(psi, y, [(len(indices), 2)], weights)
    again = np.repeat(np.arange(30), weights.astype(int))
    assert fit.coefficients == pytest.approx(least_squares(psi[again], y[again], [(6, 2)]).coefficients)
    mean = weights / weights.mean()
    found = Nested(psi, mean).errors(Outputs.of(y, mean), [6])[0]
    factor = 30 / 24 * (1 + np.trace(np.linalg.inv((psi.T * mean) @ psi)))
    spread = (mean * np.square(y - mean @ y / 30).T).sum() / 29
    assert found == pytest.approx(
        factor * (mean[:, None] * np.square(refitted(psi, y, mean))).mean() / spread, rel=1e-9
    )
    assert least_squares(psi, y, [(6, 2)], 5 * weights).coefficients == pytest.approx(fit.coefficients)


def test_the_correction_turns_residuals_into_errors_of_prediction():
    """Chapelle, Vapnik and Bengio (2002): expected over noise, checked on fresh noise and points."""
    _, indices, psi = design(2, 3, 30)
    terms = len(indices)
    noise = np.random.default_rng(1).normal(size=(30, 20_000))
    _, _, fresh = design(2, 3, 20_000, seed=2)
    fitted = np.linalg.lstsq(psi, noise, rcond=None)[0]
    residuals = np.square(noise - psi @ fitted).mean()
    # Terms are orthonormal: the error at a fresh point is the noise and the squares of the coefficients.
    predicted = 1 + np.square(fitted).sum(axis=0).mean()
    assert (fresh.T @ fresh / 20_000) == pytest.approx(np.eye(terms), abs=0.06)
    factor = 30 / (30 - terms) * (1 + np.trace(np.linalg.inv(psi.T @ psi)))
    assert factor * residuals == pytest.approx(predicted, rel=0.02)


@pytest.mark.parametrize("fit", [least_squares, sparse])
@pytest.mark.parametrize("degree", [0, 1, 2, 4])
def test_polynomials_are_recovered_exactly(fit, degree):
    """The degree that is chosen is the true one, output by output, and the coefficients are exact."""
    _, indices, psi = design(3, 6, 250)
    sizes = leading(indices, 1.0)
    true = np.zeros((len(indices), 2))
    for column, top in enumerate((degree, 3)):
        terms = dict((d, n) for n, d in sizes)[top]
        true[:terms, column] = np.random.default_rng(column).uniform(0.5, 1, terms)
    found = fit(psi, psi @ true, sizes)
    assert found.coefficients == pytest.approx(true, abs=1e-10)
    assert found.degree.tolist() == [degree, 3]
    assert found.terms.tolist() == (true != 0).sum(axis=0).tolist()
    assert found.loo[1] < 1e-20
    assert np.isnan(found.loo[0]) if degree == 0 else found.loo[0] < 1e-20


@pytest.mark.parametrize("fit", [least_squares, sparse])
@pytest.mark.parametrize("seed", range(4))
def test_noise_is_hardly_fitted(fit, seed):
    """Of a line with noise of variance 1/4 the prediction is nearly as good as can be at fresh points."""
    points, indices, psi = design(2, 8, 100)
    y = points[:, :1] + 0.5 * np.random.default_rng(seed).normal(size=(100, 1))
    found = fit(psi, y, leading(indices, 1.0))
    assert found.terms[0] <= 8
    if fit is least_squares:
        assert found.degree[0] == 1
    fresh, _, at = design(2, 8, 5000, seed=9)
    error = 0.25 + np.square(fresh[:, :1] - at @ found.coefficients).mean()
    assert error < 0.33
    assert found.loo[0] * y.var(ddof=1) == pytest.approx(error, rel=0.3)


def test_a_sparse_polynomial_is_found_from_fewer_samples_than_terms():
    _, indices, psi = design(12, 4, 150, q=1.0)
    true = np.zeros((len(indices), 1))
    chosen = [0, 3, 20, 101, 700, 1500]
    true[chosen, 0] = [2.0, 1.0, -0.7, 0.5, 0.4, -0.3]
    assert len(indices) == 1820
    found = sparse(psi, psi @ true, leading(indices, 1.0))
    assert np.flatnonzero(np.abs(found.coefficients[:, 0]) > 1e-10).tolist() == chosen
    assert found.coefficients == pytest.approx(true, abs=1e-10)
    assert found.degree[0] == 4 and found.loo[0] < 1e-20


def test_a_product_is_found_though_lower_degrees_see_nothing():
    points, indices, psi = design(3, 4, 200)
    y = points.prod(axis=1, keepdims=True)
    for fit in (least_squares, sparse):
        found = fit(psi, y, leading(indices, 1.0))
        assert found.degree[0] == 3 and found.loo[0] < 1e-20
    assert found.terms[0] == 1 + 1


def textbook(columns, y, count):
    """Return the order of entry by least-angle regression, each step solved anew."""
    order = [int(np.argmax(np.abs(columns.T @ y)))]
    residual = y.copy()
    while len(order) < count:
        c = columns.T @ residual
        height = np.abs(c[order]).max()
        own = columns[:, order]
        move = own @ np.linalg.solve(own.T @ own, np.sign(c[order]))
        a = columns.T @ move
        steps = {}
        for j in set(range(columns.shape[1])) - set(order):
            both = ((height - c[j]) / (1 - a[j]), (height + c[j]) / (1 + a[j]))
            steps[j] = min(step for step in both if step > 0)
        j = min(steps, key=steps.get)
        residual -= steps[j] * move
        order.append(j)
    return order


@pytest.mark.parametrize("seed", range(5))
def test_terms_enter_by_angle(seed):
    """Also after a coefficient has passed through 0."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(200, 30)) @ (np.eye(30) + 0.3 * rng.normal(size=(30, 30)))
    columns -= columns.mean(axis=0)
    y = columns @ rng.normal(size=30) + 0.1 * rng.normal(size=200)
    y -= y.mean()
    path = Angles(np.column_stack([np.ones(200), columns])).path(y, 31)
    assert path.first(1).tolist() == [0]
    expected = textbook(columns / np.linalg.norm(columns, axis=0), y, 30)
    assert (path.first(8)[1:] - 1).tolist() == expected[:7]
    assert (path.first(99)[1:] - 1).tolist() == expected


def test_large_bases_give_the_same_order(monkeypatch):
    _, _, psi = design(4, 4, 100)
    y = np.random.default_rng(0).normal(size=100)
    y -= y.mean()
    order = Angles(psi).path(y, 70).first(60)
    monkeypatch.setattr("hipuq.expansion.angles.GRAM_MAXIMUM", 0)
    assert np.array_equal(Angles(psi).path(y, 70).first(60), order)
    assert len(set(order.tolist())) == 60 and order.max() < 70


def test_a_rank_deficient_design_is_no_fit():
    """Never a fit of minimum norm: a degree whose terms cannot be told apart is no candidate."""
    points, indices, _ = design(2, 3, 50)
    points[:, 1] = points[:, 0]
    y = np.sin(points[:, :1])
    same = tensor(germs_of(2).univariate(points, 3), indices)
    with pytest.raises(InputError, match="50 samples cannot tell 3 terms apart, only 2"):
        least_squares(same, y, leading(indices, 1.0)[1:])
    two = np.where(points > 0, 0.5, -0.5)
    two[:, 1] = points[:, 0] ** 2
    mixed = tensor(germs_of(2).univariate(two, 3), indices)
    found = least_squares(mixed, two[:, :1] + two[:, 1:], leading(indices, 1.0))
    # The square of an input with two values is a constant: degree 1 is the only candidate that is left.
    assert found.degree[0] == 1 and found.loo[0] < 1e-20
    assert found.condition < 100
    found = sparse(same, y, leading(indices, 1.0))
    assert found.loo[0] < 1e-3
    assert found.condition < 100
    assert same @ found.coefficients == pytest.approx(y, abs=0.02)


def test_a_sample_that_decides_a_term_alone_is_no_fit():
    psi = np.ones((20, 2))
    psi[:, 1] = 0.0
    psi[4, 1] = 1.0
    with pytest.raises(InputError, match="of 20 samples some decide a term of 2 alone"):
        least_squares(psi, np.arange(20.0)[:, None], [(2, 1)])


def test_too_few_samples_are_named():
    _, indices, psi = design(3, 2, 9)
    y = np.arange(9.0)[:, None]
    with pytest.raises(InputError, match="9 samples are too few for 10 terms: at least 11 are needed and 20"):
        least_squares(psi, y, [(10, 2)])
    assert least_squares(psi, y, leading(indices, 1.0)).degree[0] <= 1
    assert sparse(psi, y, [(10, 2)]).terms[0] < 9
    with pytest.raises(InputError, match="1 samples are too few"):
        sparse(psi[:1], y[:1], [(10, 2)])
    with pytest.raises(InputError, match="there are no samples"):
        least_squares(psi[:0], y[:0], [(1, 0)])


@pytest.mark.parametrize("fit", [least_squares, sparse])
def test_a_constant_outcome_has_one_term_and_no_error(fit):
    """Alone, and beside one that varies; rounding is no variation."""
    points, indices, psi = design(2, 3, 50)
    y = np.column_stack([np.full(50, 0.1), points[:, 0], 1e6 * (1 + 2e-16 * (points[:, 1] > 0))])
    found = fit(psi, y, leading(indices, 1.0))
    assert np.array_equal(np.isnan(found.loo), [True, False, True])
    assert found.degree.tolist() == [0, 1, 0] and found.terms[[0, 2]].tolist() == [1, 1]
    assert found.coefficients[0, 0] == 0.1
    assert not found.coefficients[1:, [0, 2]].any()
    alone = fit(psi, y[:, :1], leading(indices, 1.0))
    assert alone.coefficients[0, 0] == 0.1 and alone.condition == 1


@pytest.mark.parametrize("fit", [least_squares, sparse])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_missing_outcomes_do_not_arrive(fit, value):
    _, indices, psi = design(2, 1, 20)
    y = np.arange(40.0).reshape(20, 2)
    y[3, 1] = value
    with pytest.raises(InputError, match="the outcome of sample 3 to fit is not a finite number"):
        fit(psi, y, leading(indices, 1.0))


def test_what_does_not_fit_together_is_named():
    _, _, psi = design(2, 1, 20)
    y = np.arange(20.0)[:, None]
    with pytest.raises(InputError, match=r"outcomes have the shape \(20,\)"):
        least_squares(psi, y[:, 0], [(3, 1)])
    with pytest.raises(InputError, match="weights must be one number for each sample"):
        least_squares(psi, y, [(3, 1)], -np.ones(20))
    with pytest.raises(InputError, match="they need a number of terms from 1 to 3"):
        least_squares(psi, y, [(4, 1)])


def test_projection_on_a_grid_is_least_squares_with_its_weights():
    germs = germs_of(2)
    points, weights = germs.grid(5)
    indices = multi_indices(2, 4)
    psi = tensor(germs.univariate(points, 4), indices)
    y = np.column_stack([np.exp(points[:, 0] + points[:, 1] / 2), np.full(25, 3.0)])
    found = project(psi, y, weights, degree=4)
    again = least_squares(psi, y, [(len(indices), 4)], weights)
    assert found.coefficients == pytest.approx(again.coefficients, abs=1e-12)
    assert found.coefficients[0] == pytest.approx([2 * np.sinh(1) * np.sinh(0.5), 3.0], rel=1e-7)
    assert np.isnan(found.loo).all()
    assert found.degree.tolist() == [4, 0] and found.terms.tolist() == [15, 1]
    # Without two of the nodes the rest still give a polynomial of that degree exactly.
    kept = np.delete(np.arange(25), [3, 12])
    true = np.arange(15.0)[:, None]
    partial = project(psi[kept], psi[kept] @ true, weights[kept], degree=4)
    assert partial.coefficients == pytest.approx(true, abs=1e-10)
    assert np.isnan(partial.loo).all() and partial.degree.tolist() == [4]
    with pytest.raises(InputError, match="12 samples are too few for 15 terms"):
        project(psi[:12], y[:12], weights[:12])
