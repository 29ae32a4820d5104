"""The eigenvalue kernel where verdicts are delicate: mechanisms, defects, numbering, margins, batches."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import assert_same_bits, joined, pencils, random_pencils

import hipuq
from hipuq.cea import Pencils, damping_ratio, solve
from hipuq.cea.bounds import CERTIFICATE, conditioned_eigenvalues
from hipuq.errors import InputError

FREE = np.array([[1.0, -1.0], [-1.0, 1.0]])
FLUTTER = np.array([[2.0, -1.0], [1.0, 2.5]])


@pytest.mark.parametrize("damping", [None, 0.1 * FREE, 0.1 * np.eye(2)])
def test_a_declared_mechanism_is_taken_out(damping):
    """Two masses on one spring: one rigid motion, neither flutter nor divergence, and one mode."""
    spectra = solve(pencils(FREE, damping=damping, mechanisms=1))
    assert spectra.frequency[0] == pytest.approx([0, np.sqrt(2) / (2 * np.pi)], rel=1e-2)
    assert spectra.frequency[0, 0] == 0 and spectra.growth_rate[0, 0] == 0
    assert spectra.unstable[0].tolist() == [0, 0]
    assert spectra.margin[0] > 0


@pytest.mark.parametrize("damping", [None, 0.1 * np.eye(2)])
def test_a_wrongly_declared_mechanism_leaves_all_unknown(damping):
    spectra = solve(pencils(np.diag([1.0, 2.0]), damping=damping, mechanisms=1))
    assert np.isnan(spectra.unstable).all()
    assert np.isnan(spectra.margin).all()


@pytest.mark.parametrize("damping", [None, 0.1 * FREE])
def test_an_undeclared_zero_is_unknown(damping):
    """A zero eigenvalue could be divergence after rounding: the kernel must be told."""
    spectra = solve(pencils(FREE, damping=damping), certify="never")
    assert np.isnan(spectra.unstable[0, 0])
    assert np.isnan(spectra.any_unstable[0])
    assert np.isnan(spectra.unstable_count[0])


def test_the_certificate_finds_an_undeclared_mechanism():
    """A real root whose bound contains 0 is a mechanism, not divergence."""
    spectra = solve(pencils(FREE))
    assert spectra.any_unstable.tolist() == [0]
    assert spectra.mechanisms.tolist() == [1]
    assert spectra.frequency[0, 0] == 0
    assert spectra.decided_by.tolist() == [CERTIFICATE]


def test_too_few_declared_mechanisms_are_unknown():
    chain = np.zeros((3, 3))
    chain[:2, :2] = FREE
    assert np.isnan(solve(pencils(chain, mechanisms=1), certify="never").any_unstable[0])
    assert solve(pencils(chain, mechanisms=1)).mechanisms.tolist() == [2]
    assert solve(pencils(chain, mechanisms=2)).any_unstable.tolist() == [0]


def test_mechanisms_differ_within_a_batch():
    damping = 0.1 * np.stack([FREE, np.eye(2), FREE])
    stiffness = np.stack([FREE, np.diag([1.0, 2.0]), FREE])
    for drag in (None, damping):
        spectra = solve(pencils(stiffness, damping=drag, mechanisms=[1, 0, 1]))
        assert spectra.any_unstable.tolist() == [0, 0, 0]
        assert (spectra.frequency[:, 0] == 0).tolist() == [True, False, True]


@pytest.mark.parametrize("size", [2, 3])
def test_an_exact_jordan_block_is_unknown(size):
    """On the onset itself the double root is defective: any rounding decides it either way."""
    block = np.eye(size) + np.eye(size, k=1)
    spectra = solve(pencils(block), certify="never")
    assert np.isnan(spectra.unstable).all()
    assert np.isnan(spectra.any_unstable[0]) and np.isnan(spectra.margin[0])
    assert spectra.decided_by.tolist() == [-1]


@pytest.mark.parametrize("size", [2, 3])
def test_the_certificate_knows_an_exact_multiple_root(size):
    """A real root of any multiplicity is no growing exponential."""
    spectra = solve(pencils(np.eye(size) + np.eye(size, k=1)))
    assert spectra.unstable.tolist() == [[0.0] * size]
    assert spectra.frequency[0] == pytest.approx(np.full(size, 1 / (2 * np.pi)))
    assert spectra.margin.tolist() == [0.0]
    assert spectra.decided_by.tolist() == [CERTIFICATE]


def test_a_double_root_without_coupling_is_not_called_unstable():
    assert solve(pencils(np.eye(3))).any_unstable[0] != 1


def test_an_unknown_mode_beside_a_known_unstable_one():
    """One mode is enough to know that the sample is unstable."""
    stiffness = np.zeros((4, 4))
    stiffness[:2, :2] = [[10.0, 1.0], [0.0, 10.0]]
    stiffness[2:, 2:] = FLUTTER
    spectra = solve(pencils(stiffness), certify="never")
    assert spectra.any_unstable.tolist() == [1]
    assert np.isnan(spectra.unstable_count[0])
    assert spectra.margin[0] < 0
    certified = solve(pencils(stiffness))
    assert certified.unstable_count.tolist() == [1]


def test_inside_a_pair_the_decaying_mode_comes_first():
    spectra = solve(random_pencils(5, 200, 6))
    pair = spectra.growth_rate > 0
    rows, modes = np.nonzero(pair & (spectra.frequency > 0))
    assert len(rows) > 50
    assert (modes > 0).all()
    assert np.array_equal(spectra.growth_rate[rows, modes - 1], -spectra.growth_rate[rows, modes])
    assert np.array_equal(spectra.frequency[rows, modes - 1], spectra.frequency[rows, modes])
    assert (np.diff(spectra.frequency, axis=1) >= 0).all()


def test_two_identical_subsystems_keep_their_pairs_together():
    """Four modes of one frequency: pairs must not be torn by the sort."""
    twin = np.kron(np.eye(2), FLUTTER)
    spectra = solve(pencils(np.stack([twin, twin[::-1, ::-1]])))
    assert (np.sign(spectra.growth_rate) == [-1, 1, -1, 1]).all()
    assert spectra.unstable.tolist() == [[0, 1, 0, 1]] * 2


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("threshold", [0.0, 0.05])
def test_the_margin_never_contradicts_the_verdict(damped, threshold):
    """Negative exactly where unstable, positive where stable, NaN where unknown."""
    case = random_pencils(11, 400, 4, damped=damped)
    case.stiffness[:20] -= 3 * np.eye(4)  # some diverge
    ring = hipuq.models.ring(damping_ratio=1e-4 * damped)
    delicate = ring.pencils(ring.nominal(friction=np.linspace(0.008, 0.013, 60)))
    for which in (case, delicate):
        spectra = solve(which, growth_threshold=threshold)
        verdict = spectra.any_unstable
        assert np.array_equal(np.isnan(verdict), np.isnan(spectra.margin))
        assert (spectra.margin[verdict == 1] < 0).all()
        assert (spectra.margin[verdict == 0] > 0).all()
        assert (verdict == 1).any() and (verdict == 0).any()


def test_damping_ratio():
    frequency = np.array([3.0, 0.0, 0.0, 4.0]) / (2 * np.pi)
    ratio = damping_ratio(frequency, np.array([-4.0, -1.0, 0.0, 3.0]))
    assert ratio[[0, 1, 3]] == pytest.approx([0.8, 1.0, -0.6])
    assert np.isnan(ratio[2])


def mixed_ring(damped: str):
    """Return 50 pencils of the ring, several of them near an onset; damped: none, some or all."""
    model = hipuq.models.ring(oscillators=6)
    rng = np.random.default_rng(2)
    ratio = {"none": 0.0, "some": 0.01 * (np.arange(50) % 2), "all": np.full(50, 0.01)}[damped]
    scatter = 1 + 1e-3 * rng.normal(size=(50, 6)) * (np.arange(50) % 3 > 0)[:, None]
    contact = rng.random((50, 6)) < 0.9
    contact[:25] = True
    return model.pencils(
        model.nominal(
            friction=np.linspace(0.0, 0.6, 50),
            contact=contact,
            contact_stiffness=3.98e9 * scatter,
            damping_ratio=ratio,
        )
    )


@pytest.mark.parametrize("damped", ["none", "some", "all"])
def test_bits_do_not_depend_on_the_batch(damped):
    """Each sample is solved by itself: one by one, in threes or at once, the same bits."""
    case = mixed_ring(damped)
    whole = solve(case)
    for size in (1, 3):
        parts = [solve(case.rows(slice(i, i + size))) for i in range(0, 50, size)]
        assert_same_bits(whole, joined(parts))


def test_bits_do_not_depend_on_the_batch_with_full_mass():
    factor = np.random.default_rng(1).normal(size=(20, 4, 4))
    mass = factor @ factor.transpose(0, 2, 1) + np.eye(4)
    case = replace(random_pencils(8, 20, 4, damped=True), mass=mass)
    assert_same_bits(solve(case), joined([solve(case.rows([i])) for i in range(20)]))


@pytest.mark.parametrize("certify", ["never", "auto", "always"])
def test_double_modes_of_a_symmetric_problem_stay_real_with_full_mass(certify):
    """Without friction nothing flutters, and M^(-1/2) K M^(-1/2) must not be made unsymmetric by rounding."""
    rng = np.random.default_rng(1)
    shapes, roots = rng.normal(size=(50, 8, 8)), np.repeat(rng.uniform(1.0, 9.0, (50, 4)), 2, axis=1)
    mass = shapes.transpose(0, 2, 1) @ shapes
    stiffness = shapes.transpose(0, 2, 1) @ (roots[:, :, None] * shapes)
    case = Pencils(
        mass=(mass + mass.transpose(0, 2, 1)) / 2,
        stiffness=(stiffness + stiffness.transpose(0, 2, 1)) / 2,
        friction_stiffness=rng.normal(size=(50, 8, 8)),
        friction=np.zeros(50),
        damping=None,
        mechanisms=np.zeros(50, np.intp),
    )
    assert (solve(case, certify=certify).any_unstable == 0).all()


def test_error_bounds_do_not_depend_on_the_batch():
    """Near an onset some samples have complex pairs and some do not; the bound is each one's own."""
    model = hipuq.models.ring()
    friction = np.linspace(0.0085, 0.0105, 24)
    matrices, _ = model.pencils(model.nominal(friction=friction)).reduced()
    values, radius = conditioned_eigenvalues(matrices)
    alone = [conditioned_eigenvalues(matrices[i : i + 1]) for i in range(len(friction))]
    assert np.array_equal(values, np.concatenate([one[0] for one in alone]))
    assert np.array_equal(radius, np.concatenate([one[1] for one in alone]))
    assert (values.imag != 0).any(axis=1).any() and (values.imag == 0).all(axis=1).any()


def test_undamped_samples_in_a_damped_batch_are_solved_as_undamped():
    """Whether a neighbour is damped must not change a sample by one bit."""
    mixed, plain = mixed_ring("some"), mixed_ring("none")
    undamped = np.flatnonzero(np.arange(50) % 2 == 0)
    assert mixed.damping is not None and plain.damping is None
    assert_same_bits(solve(mixed.rows(undamped)), solve(plain.rows(undamped)))
    whole = solve(mixed)
    assert np.array_equal(whole.frequency[undamped], solve(plain).frequency[undamped])


def test_tiny_damping_leaves_the_frequencies():
    """The state space and the squared problem are two routes to the same modes."""
    for name in ("mixed_ring", "random"):
        if name == "random":
            case = random_pencils(4, 30, 5)
            mass = case.mass[:, :, None] * np.eye(5)
        else:
            model = hipuq.models.ring(oscillators=5)
            case = model.pencils(model.nominal(friction=np.array([0.0, 0.3])))
            mass = case.mass[:, :, None] * np.eye(10)
        damped = replace(case, damping=1e-9 * mass)
        one, other = solve(case), solve(damped)
        assert one.frequency == pytest.approx(other.frequency, rel=1e-6)
        assert one.growth_rate == pytest.approx(other.growth_rate, abs=1e-6 * one.frequency.max())


def test_bad_values_are_named():
    good = random_pencils(0, 3, 2)
    cases = {
        "stiffness must have the shape": {"stiffness": np.zeros((3, 2))},
        "mass must have the shape": {"mass": np.ones((3, 3))},
        "friction must have the shape": {"friction": np.zeros(2)},
        "damping must have the shape": {"damping": np.zeros((3, 2))},
        "mechanisms must have the shape": {"mechanisms": np.zeros(2, np.intp)},
        "stiffness holds a value that is not finite, first in sample 1": {
            "stiffness": np.where(np.arange(3)[:, None, None] == 1, np.nan, np.eye(2))
        },
        "friction holds a value that is not finite, first in sample 2": {
            "friction": np.array([0, 0, np.inf])
        },
        "mass must be positive, it is 0.0 in sample 0": {"mass": np.zeros((3, 2))},
        "mechanisms must lie between 0 and 1": {"mechanisms": np.full(3, 2, np.intp)},
    }
    for message, change in cases.items():
        with pytest.raises(InputError, match=message):
            replace(good, **change)


def test_a_mass_matrix_that_is_not_positive_definite_is_an_error():
    with pytest.raises(InputError, match="not positive definite"):
        solve(pencils(np.eye(2), mass=[[1, 2], [2, 1]]))


@pytest.mark.parametrize("threshold", [-1.0, np.nan, np.inf])
def test_a_threshold_must_not_be_negative(threshold):
    with pytest.raises(InputError, match="growth_threshold"):
        solve(pencils(np.eye(2)), growth_threshold=threshold)


def test_a_symmetric_stiffness_is_stable_however_close_its_roots():
    """Without friction nothing couples two equal oscillators: their crossing is no onset."""
    rng = np.random.default_rng(0)
    turned = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    double = turned @ np.diag([1.0, 1.0, 2.0, 2.0, 2.0, 3.0]) @ turned.T
    for stiffness in (np.eye(4), (double + double.T) / 2):
        spectra = solve(pencils(stiffness))
        assert spectra.unstable.tolist() == [[0.0] * len(stiffness)]
        assert not spectra.growth_rate.any()
        assert spectra.margin[0] >= 0
    singular = np.diag([0.0, 1.0, 1.0])
    assert np.isnan(solve(pencils(singular), certify="never").any_unstable[0])


def test_strongly_nonnormal_matrices_get_condition_numbers():
    """A radius that holds for rings holds for no other family: here errors are far larger."""
    n = 7
    side = np.ones(n) / np.sqrt(n)
    mirror = np.eye(n) - 2 * np.outer(side, side)
    triangle = np.diag(1 + 0.01 * np.arange(n) / n) + 0.3 * np.triu(np.ones((n, n)), 1)
    stiffness = mirror @ triangle @ mirror
    assert np.iscomplex(np.linalg.eigvals(stiffness)).any()
    assert np.isnan(solve(pencils(stiffness), certify="never").any_unstable[0])
    certified = solve(pencils(stiffness))
    assert certified.any_unstable.tolist() == [0]
    assert certified.decided_by.tolist() == [CERTIFICATE]
