"""The compiled kernel on every instruction set that runs here, and LAPACK in its place.

Eigenvalues and condition numbers against closed forms and exact arithmetic, bits that do not depend on
the company of a sample, verdicts that do not depend on the kernel, and what happens to bad input.
"""

import ctypes
import os
from dataclasses import replace
from types import SimpleNamespace
from unittest import mock

import mpmath
import numpy as np
import oracle
import pytest
import scipy.linalg
from helpers import assert_same_bits, pencils, random_pencils
from scipy.optimize import linear_sum_assignment

import hipuq
from hipuq.cea import bounds, solve
from hipuq.cea import eigenvalues as eigenvalues_module
from hipuq.cea.bounds import EPS, SAFETY, conditioned_eigenvalues, norms
from hipuq.cea.compact import CompactPencils
from hipuq.cea.eigenvalues import LARGEST_SIZE, eigenvalues
from hipuq.cea.entries import Entries, dense
from hipuq.compiled import angles, binding
from hipuq.compiled.binding import LAPACK, SWITCH, kernel
from hipuq.errors import InputError


def chosen(name):
    """Return the kernel of that name, beside the one in use."""
    with mock.patch.dict(os.environ, {SWITCH: name}):
        return kernel.__wrapped__()


def runs_here(name):
    try:
        return chosen(name) is not None
    except InputError:
        return False


COMPILED = [name for name in binding.TARGETS if runs_here(name)]


@pytest.fixture(params=[*COMPILED, LAPACK])
def every_kernel(request, monkeypatch):
    """Use each kernel in turn."""
    monkeypatch.setenv(SWITCH, request.param)
    kernel.cache_clear()
    yield request.param
    kernel.cache_clear()


def turned(matrices, seed=0):
    """Return matrices turned by random orthogonal ones."""
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=matrices.shape))[0]
    return turn @ matrices @ turn.transpose(0, 2, 1)


def ring_matrices(friction, oscillators=9):
    model = hipuq.models.ring(oscillators=oscillators)
    return model.pencils(model.nominal(friction=friction)).reduced()[0]


def pool():
    """Return matrices of many kinds, 6 x 6: they converge, balance and couple at different paces."""
    rng = np.random.default_rng(5)
    random = rng.normal(size=(12, 6, 6))
    scale = 2.0 ** rng.integers(-20, 20, (4, 6))
    kinds = [
        random,
        random[:4] * scale[:, :, None] / scale[:, None, :],
        random[4:8] + random[4:8].transpose(0, 2, 1),
        1e-200 * random[:2],
        1e100 * random[:2],
        np.triu(random[:3]),
        [np.eye(6), np.zeros((6, 6)), np.roll(np.eye(6), 1, axis=0), np.triu(np.ones((6, 6)))],
    ]
    return np.concatenate(kinds)


def assert_within_bounds(values, radius, exact):
    """Assert that eigenvalues have exact ones, one to one, within their bounds."""
    distance = np.abs(values[:, None] - np.asarray(exact)[None, :])
    pairs = linear_sum_assignment(distance)
    assert (distance[pairs] <= radius[pairs[0]]).all()


def lone(a, b, c, n):
    """Return a tridiagonal matrix with (b, a, c) in each row, and its eigenvalues."""
    matrix = np.diag(np.full(n, a)) + np.diag(np.full(n - 1, b), -1) + np.diag(np.full(n - 1, c), 1)
    return matrix, a + 2 * np.sqrt(complex(b * c)) * np.cos(np.pi * np.arange(1, n + 1) / (n + 1))


@pytest.mark.parametrize("n", [1, 2, 3, 10, 33, 64, 65])
def test_closed_forms(every_kernel, n):
    circle = np.exp(2j * np.pi * np.arange(n) / n)
    cases = [
        lone(1.5, 1.0, 0.98, n),
        lone(0.0, -1.0, 1.02, n),
        # Every shift that the iteration takes first is useless here.
        (np.roll(np.eye(n), 1, axis=0), circle),
        (np.roll(np.eye(n), -1, axis=0), circle),
    ]
    for scale in (1.0, 1e-300, 1e140):
        values = eigenvalues(scale * np.stack([matrix for matrix, _ in cases])) / scale
        for found, (matrix, exact) in zip(values, cases, strict=True):
            assert_within_bounds(found, np.full(n, 100 * EPS * max(1.0, np.linalg.norm(matrix))), exact)
    assert np.array_equal(values.imag[0], np.zeros(n))


def test_true_eigenvalues_are_within_the_bounds(every_kernel):
    rng = np.random.default_rng(1)
    near = np.diag([1.0, 1.0 + 1e-9, 2.0, 3.0])
    near[0, 1] = 1.0
    cases = [
        rng.normal(size=(7, 7)),
        turned(near[None])[0],
        rng.normal(size=(6, 6)) * 10.0 ** np.arange(-6, 6, 2)[:, None],
        *ring_matrices(np.array([0.0094, 0.0097]), 5),
    ]
    for matrix in cases:
        values, radius = conditioned_eigenvalues(matrix[None])
        exact = [complex(ball) for ball, times in oracle.exact_roots(matrix) for _ in range(times)]
        assert_within_bounds(values[0], radius[0], exact)


def condition_numbers(matrices):
    """Return eigenvalues and condition numbers as the kernel in use finds them."""
    values, radius = conditioned_eigenvalues(matrices)
    return values, radius / (SAFETY * EPS * norms(matrices)[:, None])


def test_condition_numbers_are_those_of_the_eigenvectors(every_kernel):
    rng = np.random.default_rng(2)
    scale = 2.0 ** rng.integers(-8, 8, (6, 9))
    random = rng.normal(size=(6, 9, 9))
    stacks = [
        (random, True),
        (random * scale[:, :, None] / scale[:, None, :], True),
        (rng.normal(size=(9, 2, 2)), False),
        (ring_matrices(np.linspace(0.0, 0.05, 6)), False),
    ]
    for matrices, balanced in stacks:
        values, condition = condition_numbers(matrices)
        assert np.array_equal(values, eigenvalues(matrices)) or every_kernel == LAPACK
        for matrix, own, number in zip(matrices, values, condition, strict=True):
            others, left, right = scipy.linalg.eig(matrix, left=True)
            order = linear_sum_assignment(np.abs(own[:, None] - others))[1]
            expected = 1 / np.abs((left.conj() * right).sum(axis=0))[order]
            # Rounding moves a condition number by about its square.
            excess, rounding = number / expected - 1, 1e-9 + 100 * EPS * expected**2
            assert (excess >= -rounding).all()
            # Where a matrix was balanced, the rounding is that of the balanced one: its number counts too.
            assert (excess <= rounding).all() or (balanced and every_kernel != LAPACK)


@pytest.mark.parametrize("gap", [1e-2, 1e-8, 1e-14, -1e-2, -1e-8])
def test_condition_numbers_of_a_close_pair(every_kernel, gap):
    """[1, 1; gap, 1] has the eigenvalues 1 -+ sqrt(gap), of condition (1 + |gap|) / (2 sqrt|gap|)."""
    expected = (1 + abs(gap)) / (2 * np.sqrt(abs(gap)))
    plain = np.array([[[1.0, 1.0], [gap, 1.0]]])
    assert condition_numbers(plain)[1][0] == pytest.approx(np.full(2, expected), rel=1e-5)
    among = np.diag([0.0, 0.0, 7.0, -3.0])[None].copy()
    among[:, :2, :2] = plain
    # Turning moves the gap by rounding.
    if abs(gap) > 1e-14:
        assert np.sort(condition_numbers(turned(among))[1][0])[2:] == pytest.approx(expected, rel=1e-5)


def test_dependent_eigenvectors_give_bounds_that_say_nothing(every_kernel):
    for n in (2, 3, 8, 30, 60):
        matrices = np.triu(np.ones((1, n, n)))
        assert (conditioned_eigenvalues(matrices)[1] > norms(matrices)[:, None]).all()
    for n in (2, 3, 8):
        # After a rotation the eigenvalues lie on a circle of the radius eps**(1/n), and know it.
        matrices = np.triu(np.ones((1, n, n)))
        values, radius = conditioned_eigenvalues(turned(0.1 * matrices + 0.9 * np.eye(n)))
        assert (np.abs(values - 1.0) <= radius).all()


def test_condition_numbers_of_double_eigenvalues(every_kernel):
    """Independent eigenvectors of a double eigenvalue are no reason for large bounds."""
    block = np.random.default_rng(4).normal(size=(1, 4, 4))
    twice = np.zeros((1, 8, 8))
    twice[:, :4, :4] = twice[:, 4:, 4:] = block
    expected = np.sort(condition_numbers(block)[1][0])
    assert np.sort(condition_numbers(twice)[1][0]) == pytest.approx(np.repeat(expected, 2), rel=1e-9)
    for matrix in (np.eye(5), np.zeros((3, 3)), np.diag([1.0, 1.0, 2.0])):
        values, radius = conditioned_eigenvalues(matrix[None])
        assert np.array_equal(np.sort(values.real[0]), np.diag(matrix))
        assert radius[0] == pytest.approx(np.full(len(matrix), SAFETY * EPS * np.linalg.norm(matrix)))


def test_triangles_have_their_eigenvalues_on_the_diagonal(every_kernel):
    matrices = np.triu(np.random.default_rng(0).normal(size=(5, 12, 12)))
    diagonal = np.sort(np.diagonal(matrices, axis1=1, axis2=2), axis=1)
    assert np.array_equal(np.sort(eigenvalues(matrices).real, axis=1), diagonal)
    lower = eigenvalues(np.tril(matrices.transpose(0, 2, 1)))
    assert np.abs(np.sort(lower.real, axis=1) - diagonal).max() < 1e-10


@pytest.mark.parametrize("solver", [eigenvalues, conditioned_eigenvalues])
def test_bits_do_not_depend_on_the_company(every_kernel, solver):
    matrices = pool()
    whole = solver(matrices)
    whole = whole if isinstance(whole, tuple) else (whole,)
    rng = np.random.default_rng(0)
    picks = [np.array([i]) for i in range(len(matrices))]
    picks += [rng.integers(0, len(matrices), size) for size in (2, 3, 7, 8, 9, 17, 40) for _ in range(3)]
    for rows in picks:
        part = solver(matrices[rows])
        for one, other in zip(part if isinstance(part, tuple) else (part,), whole, strict=True):
            assert np.array_equal(one, other[rows])


def test_bits_of_modes_do_not_depend_on_the_company(every_kernel):
    model = hipuq.models.ring()
    rng = np.random.default_rng(0)
    friction = np.append(rng.uniform(0.0, 0.1, 30), [0.0097, 0.00972])
    angle = model.parameters["contact_angle"].nominal + rng.normal(size=(32, 9))
    values = model.values(model.nominal(friction=friction, contact_angle=angle))
    whole = solve(model.compact(values))
    for size in (1, 3, 8, 13):
        rows = rng.choice(32, size, replace=False)
        part = solve(model.compact({name: value[rows] for name, value in values.items()}))
        for name in ("frequency", "growth_rate", "unstable", "margin", "mechanisms", "decided_by"):
            assert np.array_equal(getattr(part, name), getattr(whole, name)[rows], equal_nan=True)


def cases_of_verdicts():
    rng = np.random.default_rng(0)
    ring, two_dof = hipuq.models.ring(), hipuq.models.two_dof("hoffmann2002")
    for oscillators, near in ((9, 0.0097), (12, 0.003)):
        model = hipuq.models.ring(oscillators=oscillators)
        yield model.pencils(model.nominal(friction=near * rng.uniform(0.98, 1.02, 24)))
    yield ring.pencils(ring.nominal(friction=rng.uniform(0, 0.1, 12), damping_ratio=np.full(12, 0.003)))
    yield two_dof.pencils(two_dof.nominal(friction=rng.uniform(0.2, 0.8, 50)))
    yield random_pencils(3, 50, 4)
    yield random_pencils(3, 20, 4, damped=True)


@pytest.mark.parametrize("threshold", [0.0, 5.0])
def test_verdicts_do_not_depend_on_the_kernel(monkeypatch, threshold):
    spectra = {}
    for name in (*COMPILED, LAPACK):
        monkeypatch.setenv(SWITCH, name)
        kernel.cache_clear()
        spectra[name] = [solve(case, growth_threshold=threshold) for case in cases_of_verdicts()]
    kernel.cache_clear()
    expected = spectra.pop(LAPACK)
    assert 0 < np.concatenate([one.any_unstable for one in expected]).mean() < 1
    for found in spectra.values():
        for one, other in zip(found, expected, strict=True):
            assert np.array_equal(one.unstable, other.unstable)
            assert np.array_equal(one.mechanisms, other.mechanisms)


@pytest.mark.parametrize("name", ["AVX512", "numpy", "no", "best"])
def test_an_unknown_kernel_is_one_clear_error(monkeypatch, name):
    monkeypatch.setenv(SWITCH, name)
    kernel.cache_clear()
    with pytest.raises(InputError, match=f"^{SWITCH} is '{name}': it must be empty, 'lapack' or one of"):
        hipuq.models.ring()
    kernel.cache_clear()


def test_a_library_that_is_missing_or_of_other_sources(monkeypatch):
    if COMPILED:
        monkeypatch.setattr(binding, "digest", lambda folder: 0)
        with pytest.raises(InputError, match="compiled from other sources"):
            chosen("")
    monkeypatch.setattr(binding, "FILE", "nothing.so")
    assert chosen("") is None
    assert chosen(LAPACK) is None
    with pytest.raises(InputError, match="'baseline', but the compiled library is missing"):
        chosen("baseline")


@pytest.mark.parametrize("solver", [eigenvalues, conditioned_eigenvalues])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite(every_kernel, solver, bad):
    matrices = np.ones((9, 3, 3))
    matrices[8, 1, 2] = bad
    with pytest.raises(np.linalg.LinAlgError, match="infs or NaNs"):
        solver(matrices)


@pytest.mark.parametrize("shape", [(0, 3, 3), (0, 1, 1), (0, LARGEST_SIZE + 1, LARGEST_SIZE + 1)])
def test_empty_stacks(every_kernel, shape):
    assert eigenvalues(np.zeros(shape)).shape == shape[:2]
    values, radius = conditioned_eigenvalues(np.zeros(shape))
    assert values.shape == radius.shape == shape[:2]


def test_stacks_need_not_be_contiguous(every_kernel):
    matrices = np.random.default_rng(0).normal(size=(6, 5, 5))
    assert np.array_equal(
        eigenvalues(matrices[::2].transpose(0, 2, 1)), eigenvalues(matrices[::2].transpose(0, 2, 1).copy())
    )


def test_lapack_takes_what_does_not_converge(monkeypatch):
    def none_converges(samples, n, matrices, *into):
        ctypes.memset(into[-1], 1, samples)
        return 0

    stuck = SimpleNamespace(eigenvalues=none_converges, conditioned=none_converges)
    for module in (bounds, eigenvalues_module):
        monkeypatch.setattr(module, "kernel_for", lambda size: stuck)
    matrices = np.random.default_rng(0).normal(size=(3, 4, 4))
    expected = np.linalg.eigvals(matrices)
    assert np.array_equal(eigenvalues(matrices), expected)
    assert np.sort(conditioned_eigenvalues(matrices)[0]) == pytest.approx(np.sort(expected))


def test_angles(every_kernel):
    rng = np.random.default_rng(0)
    angle = np.concatenate([rng.uniform(-400, 400, 150), rng.normal(size=50) * 1e8, [1e-300, 44.999, 45.0]])
    found = np.stack(angles.cosine_and_sine(angle))
    assert found.tobytes() == np.stack(angles._polynomials(angle)).tobytes()
    with mpmath.workdps(40):
        turns = [mpmath.mpf(one) / 180 for one in angle]
        exact = [[function(x) for x in turns] for function in (mpmath.cospi, mpmath.sinpi)]
        for row, true in zip(found, exact, strict=True):
            for value, other in zip(row, true, strict=True):
                assert abs(value - other) <= 0.8 * np.spacing(abs(float(other)))


def test_right_angles_are_exact(every_kernel):
    turns = np.arange(-9, 10)
    cosine, sine = angles.cosine_and_sine(90.0 * np.append(turns, turns + 4 * 10**8))
    quarter = np.tile(turns % 4, 2)
    assert np.array_equal(cosine, np.array([1.0, 0.0, -1.0, 0.0])[quarter])
    assert np.array_equal(sine, np.array([0.0, 1.0, 0.0, -1.0])[quarter])


def compact(**changes):
    """Return pencils of five samples by their entries; two of them meet."""
    rng = np.random.default_rng(0)
    places = [(0, 0, 0), (1, 1, 1), (2, 2, 2), (0, 1, 1), (3, 0, 2), (3, 2, 0)]
    fields = {
        "mass": rng.uniform(1.0, 2.0, (3, 5)),
        "stiffness": (
            Entries.at(rng.uniform(1.0, 2.0, (4, 5)), places),
            Entries.at(np.ones((1, 1)), [(0, 1, 2)]),
        ),
        "friction_stiffness": (Entries.at(rng.normal(size=(2, 5)), [(0, 0, 1), (1, 1, 0)]),),
        "friction": rng.uniform(0.0, 1.0, 5),
        "mechanisms": np.zeros(5, np.intp),
        "filter_radius": 1e-6,
    }
    return CompactPencils(**fields | changes)


def test_entries_are_the_matrices(every_kernel):
    case = compact()
    numbers = case.stiffness[0].values
    expected = np.zeros((5, 3, 3))
    for i in range(3):
        expected[:, i, i] = numbers[i]
    expected[:, 1, 1] += numbers[0]
    expected[:, 0, 2] = expected[:, 2, 0] = numbers[3]
    assert np.array_equal(dense(case.stiffness[:1], 5, 3), expected)
    assert np.array_equal(dense([Entries.whole(expected)], 5, 3), expected)
    assert np.array_equal(case.rows([3, 1]).stiffness, case.rows().stiffness[[3, 1]])
    one, other = solve(case), solve(replace(case.rows(), filter_radius=0.0))
    assert np.array_equal(one.unstable, other.unstable)
    assert one.frequency == pytest.approx(other.frequency, rel=1e-12)


def test_a_model_gives_the_same_matrices_by_their_entries(every_kernel):
    rng = np.random.default_rng(0)
    model = hipuq.models.ring()
    names = ("spring_stiffness", "mass", "contact_angle", "spring_angle")
    nominal = {name: model.parameters[name].nominal for name in names}
    changed = {name: one * rng.uniform(0.9, 1.1, (20, len(one))) for name, one in nominal.items()}
    contact = rng.random((20, 9)) < 0.8
    values = model.values(model.nominal(friction=rng.uniform(0, 0.1, 20), contact=contact, **changed))
    entries, whole = model.compact(values), model.assemble(values)
    assert np.array_equal(entries.rows().reduced()[0], whole.reduced()[0])
    assert_same_bits(solve(entries), solve(whole))


@pytest.mark.parametrize(
    ("message", "changes"),
    {
        "friction holds a value that is not finite, first in sample 2": {
            "friction": np.array([0, 0, np.nan, 0, 0])
        },
        "stiffness holds a value that is not finite, first in sample 0": {
            "stiffness": (Entries.at(np.full((1, 1), np.inf), [(0, 1, 1)]),)
        },
        "friction_stiffness holds a value above": {
            "friction_stiffness": (Entries.at(np.full((1, 5), -1e200), [(0, 0, 1)]),)
        },
        "mass must be positive, it is -1.0 in sample 0": {"mass": np.array([[1.0], [-1.0], [1.0]])},
        "mass holds a value that is not finite": {"mass": np.array([[1.0], [np.nan], [1.0]])},
        "mechanisms must lie between 0 and 2": {"mechanisms": np.full(5, 3, np.intp)},
    }.items(),
)
def test_bad_entries_are_named(message, changes):
    with pytest.raises(InputError, match=message):
        compact(**changes)
    with pytest.raises(InputError):
        pencils(np.eye(2), mass=[-1.0, 1.0])
