"""Block tridiagonal eigenvalues against 50-digit arithmetic, and whether their bounds hold.

`oracle.exact_roots` encloses the roots of the exact characteristic polynomial; mpmath's QR iteration
at 50 digits is a second reference that shares nothing with it.
"""

import mpmath
import numpy as np
import oracle
import published
import pytest
from helpers import assert_same_bits, joined, pencils

import hipuq
from hipuq.cea import solve
from hipuq.cea.bounds import CERTIFICATE, EPS, STRUCTURED, conditioned_eigenvalues
from hipuq.cea.structured import SAFETY, block_sizes, conjugate_pairs, structured_eigenvalues


def lapack(matrices: np.ndarray) -> np.ndarray:
    return np.linalg.eigvals(matrices).astype(complex)


def exact(matrix: np.ndarray) -> np.ndarray:
    """Return all roots, multiple ones repeated, from the exact characteristic polynomial."""
    return np.array([complex(ball) for ball, times in oracle.exact_roots(matrix) for _ in range(times)])


def high_precision(matrix: np.ndarray) -> np.ndarray:
    """Return the eigenvalues by mpmath at 50 digits."""
    with mpmath.workdps(50):
        values, _ = mpmath.eig(mpmath.matrix(matrix.tolist()))
        return np.array([complex(value) for value in values])


def distances(values: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return how far each reference root is from its own value, both matched one to one."""
    far = np.abs(reference[:, None] - values[None, :])
    best = np.empty(len(reference))
    for _ in range(len(reference)):
        i, j = np.unravel_index(far.argmin(), far.shape)
        best[i] = far[i, j]
        far[i, :], far[:, j] = np.inf, np.inf
    return best


def block_tridiagonal(rng: np.random.Generator, s: int, blocks: int, b: int) -> np.ndarray:
    """Return random nonsymmetric matrices, (s, blocks * b, blocks * b)."""
    index = np.arange(blocks * b) // b
    inside = np.abs(index[:, None] - index) <= 1
    return rng.normal(size=(s, blocks * b, blocks * b)) * inside


def ring_matrices(friction, preset: str = "oberst2016", **values) -> np.ndarray:
    model = hipuq.models.ring(preset)
    return model.pencils(model.nominal(friction=np.asarray(friction), **values)).reduced()[0]


def false_flutter() -> np.ndarray:
    ratio, friction = published.FALSE_FLUTTER
    return ring_matrices([friction], contact_stiffness=ratio * published.SPRING_STIFFNESS)


def test_accurate_where_lapack_is_not():
    """Errors of 4e-6 by LAPACK; 1e-12 relative by the iteration that keeps the structure."""
    matrices = false_flutter()
    reference = high_precision(matrices[0])
    assert np.abs(reference.imag).max() < 1e-30 * np.abs(reference).max()
    plain = lapack(matrices)
    assert (distances(plain[0], reference) / np.abs(reference)).max() > 1e-6
    values, radius = structured_eigenvalues(matrices, plain, 2)
    assert (distances(values[0], reference) / np.abs(reference)).max() < 1e-12
    assert (values.imag == 0).all()
    assert (radius / np.abs(values)).max() < 1e-10


@pytest.mark.parametrize("friction", [0.00945, 0.0096])
def test_accurate_on_both_sides_of_an_onset(friction):
    """Within one per cent of the onset, complex pairs included."""
    matrices = ring_matrices([friction])
    reference = exact(matrices[0])
    values, radius = structured_eigenvalues(matrices, lapack(matrices), 2)
    assert (distances(values[0], reference) / np.abs(reference)).max() < 1e-12
    assert (values.imag != 0).any() == (friction > published.ONSETS["oberst2016"][0])
    assert np.isfinite(radius).all()


@pytest.mark.parametrize("b", [1, 2, 3, 4])
@pytest.mark.parametrize("blocks", [3, 4, 6])
def test_any_block_size_and_number(b, blocks):
    matrices = block_tridiagonal(np.random.default_rng(10 * b + blocks), 25, blocks, b)
    assert (block_sizes(matrices) == b).all()
    start = lapack(matrices)
    assert (start.imag != 0).any() or b * blocks == 3
    values, radius = structured_eigenvalues(matrices, start, b)
    for matrix, own, bound in zip(matrices, values, radius, strict=True):
        reference = exact(matrix)
        assert distances(own, reference).max() < 1e-11 * np.linalg.norm(matrix)
        nearest = np.abs(own[:, None] - reference).min(axis=1)
        assert (nearest <= bound).all()
    assert np.isfinite(radius).mean() > 0.95


@pytest.mark.parametrize("b", [1, 2, 3])
def test_a_random_matrix_against_mpmath(b):
    matrices = block_tridiagonal(np.random.default_rng(b), 1, 12 // b, b)
    reference = high_precision(matrices[0])
    values, _ = structured_eigenvalues(matrices, lapack(matrices), b)
    assert distances(values[0], reference).max() < 1e-12 * np.linalg.norm(matrices[0])


def test_block_sizes():
    rng = np.random.default_rng(0)
    index = np.arange(18)
    assert block_sizes(ring_matrices([0.01, 0.02])).tolist() == [2, 2]
    tridiagonal = np.where(np.abs(index[:, None] - index) <= 1, 1.0, 0.0)
    assert block_sizes(tridiagonal[None]).tolist() == [1]
    assert block_sizes(np.eye(18)[None]).tolist() == [1]
    assert block_sizes(rng.normal(size=(3, 18, 18))).tolist() == [0, 0, 0]
    assert block_sizes(block_tridiagonal(rng, 1, 6, 3)).tolist() == [3]
    assert block_sizes(block_tridiagonal(rng, 1, 3, 6)).tolist() == [6]
    # Two blocks are a full matrix.
    assert block_sizes(block_tridiagonal(rng, 1, 2, 9)).tolist() == [0]
    for n in (1, 2):
        assert block_sizes(np.ones((1, n, n))).tolist() == [0]
    # Numbers of rows with no divisor have only blocks of one.
    assert block_sizes(block_tridiagonal(rng, 1, 7, 1)).tolist() == [1]
    corner = tridiagonal.copy()
    corner[0, -1] = 1e-300
    assert block_sizes(np.stack([tridiagonal, corner, np.ones((18, 18))])).tolist() == [1, 0, 0]
    assert block_sizes(np.empty((0, 6, 6))).tolist() == []


@pytest.mark.parametrize("preset", published.ONSETS)
def test_bounds_hold_near_an_onset(preset):
    onset = published.ONSETS[preset][0]
    rng = np.random.default_rng(3)
    matrices = ring_matrices(onset * rng.uniform(0.97, 1.03, 60), preset)
    matrices = np.concatenate([matrices, ring_matrices(onset * (1 + np.array([-1e-6, 1e-6])), preset)])
    values, radius = structured_eigenvalues(matrices, lapack(matrices), 2)
    sharpest = 0.0
    for matrix, own, bound in zip(matrices, values, radius, strict=True):
        error = np.abs(own[:, None] - exact(matrix)).min(axis=1)
        assert (error <= bound).all()
        sharpest = max(sharpest, float((error / bound).max()))
    # Neither too small nor without any relation to the error.
    assert 1e-4 < sharpest < 0.2
    assert np.median(radius / np.abs(values)) < 1e-10


def test_an_exact_multiple_root_is_never_split_into_a_known_pair():
    """Integer blocks with multiple real roots: what is called complex beyond its bound is complex."""
    rng = np.random.default_rng(7)
    multiple = 0
    for trial in range(150):
        b, blocks = 1 + trial % 3, 4
        matrix = np.kron(np.eye(blocks), np.ones((b, b))) * rng.integers(-1, 3, (b * blocks, b * blocks))
        for i in range(blocks - 1):
            one, two = slice(i * b, (i + 1) * b), slice((i + 1) * b, (i + 2) * b)
            matrix[one, two] = rng.integers(-1, 2, (b, b)) * rng.integers(0, 2)
            matrix[two, one] = rng.integers(-1, 2, (b, b)) * rng.integers(0, 2)
        matrix = matrix * 10.0 ** rng.integers(-3, 4)
        values, radius = structured_eigenvalues(matrix[None], lapack(matrix[None]), b)
        values, radius = conjugate_pairs(values, radius)
        reference = exact(matrix)
        multiple += max(times for _, times in oracle.exact_roots(matrix)) > 1
        claimed = (np.abs(values[0].imag) > radius[0]).sum()
        assert claimed <= (reference.imag != 0).sum()
    assert multiple > 50


@pytest.mark.parametrize("b", [1, 2, 3, 4])
@pytest.mark.parametrize("kind", ["diagonal blocks", "no upper", "no lower", "coupled", "identity", "zero"])
def test_singular_and_decoupled_blocks(kind, b):
    """Blocks that are exactly singular at a root: found within the bound, or no bound is given."""
    rng = np.random.default_rng(b)
    blocks = 4
    index = np.arange(b * blocks) // b
    step = index[None, :] - index[:, None]
    kept = {
        "diagonal blocks": step == 0,
        "no upper": (step == 0) | (step == -1),
        "no lower": (step == 0) | (step == 1),
        "coupled": np.abs(step) <= 1,
    }
    for _ in range(10):
        if kind in kept:
            matrix = rng.integers(-3, 4, (b * blocks, b * blocks)) * kept[kind] * 1.0
        else:
            matrix = np.eye(b * blocks) * (kind == "identity")
        # Without rounding of their own: the start values of triangular matrices are the exact roots.
        for start in (lapack(matrix[None]), matrix.diagonal()[None].astype(complex)):
            values, radius = structured_eigenvalues(matrix[None], start, b)
            error = np.abs(values[0][:, None] - exact(matrix)).min(axis=1)
            assert (error <= radius[0]).all()


@pytest.mark.parametrize(
    "case", ["zeros", "equal", "conjugates", "far", "random", "shuffled", "one root twice"]
)
def test_bad_start_values_are_repaired_or_refused(case):
    """Right whatever the iteration starts from, or with an infinite radius."""
    rng = np.random.default_rng(0)
    matrices = np.concatenate([ring_matrices(np.linspace(0.009, 0.0102, 12)), false_flutter()])
    good = lapack(matrices)
    norm = np.linalg.norm(matrices, axis=(1, 2))[:, None]
    noise = rng.normal(size=(2, *good.shape))
    start = {
        "zeros": np.zeros_like(good),
        "equal": np.broadcast_to(norm, good.shape).astype(complex),
        "conjugates": good.real + 1e-3j * norm * (-1.0) ** np.arange(18),
        "far": good + 100 * norm,
        "random": norm * (noise[0] + 1j * noise[1]),
        "shuffled": rng.permuted(good, axis=1),
        "one root twice": np.where(np.arange(18) == 1, good[:, :1], good),
    }[case]
    values, radius = structured_eigenvalues(matrices, start, 2)
    for matrix, own, bound in zip(matrices, values, radius, strict=True):
        reference = exact(matrix)
        assert (np.abs(own[:, None] - reference).min(axis=1) <= bound).all()
        if np.isfinite(bound).all():
            # All of them, each once.
            assert distances(own, reference).max() < 1e-10 * np.linalg.norm(matrix)
    if case in ("conjugates", "shuffled"):
        assert np.isfinite(radius).all()


def test_start_values_are_not_changed():
    matrices = false_flutter()
    start = lapack(matrices)
    copy, before = start.copy(), matrices.copy()
    structured_eigenvalues(matrices, start, 2)
    assert np.array_equal(start, copy) and np.array_equal(matrices, before)


@pytest.mark.parametrize("b", [1, 2, 3])
def test_bits_do_not_depend_on_the_batch(b):
    rng = np.random.default_rng(5)
    matrices = block_tridiagonal(rng, 12, 18 // b, b)
    if b == 2:
        matrices[:9] = ring_matrices(np.linspace(0.009, 0.0102, 9))
    if b == 3:
        matrices[4] = np.eye(18)  # singular at its root, where the others are not
    start = lapack(matrices)
    whole = structured_eigenvalues(matrices, start, b)
    for size in (1, 5):
        parts = [
            structured_eigenvalues(matrices[i : i + size], start[i : i + size], b) for i in range(0, 12, size)
        ]
        for k in (0, 1):
            assert np.array_equal(whole[k], np.concatenate([part[k] for part in parts]))


def test_verdicts_do_not_depend_on_the_company_of_other_structures():
    """A dense matrix, or one of wider blocks, must not take the structured path from a neighbour."""
    n = 12
    chain = np.eye(n) + np.eye(n, k=1) + 1e-15 * np.eye(n, k=-1)
    wide = np.eye(n) + np.eye(n, k=1) + 1e-15 * np.eye(n, k=-2)
    dense = np.eye(n) + np.eye(n, k=1) + 1e-15
    ring = 3.0 * np.eye(n) + 1e-9 * np.eye(n, k=1) - 1e-9 * np.eye(n, k=-1) + np.eye(n, k=2)
    case = pencils(np.stack([chain, wide, dense, ring, np.diag(np.arange(1.0, n + 1))]))
    assert len(set(block_sizes(case.stiffness))) >= 3
    alone = joined([solve(case.rows([i])) for i in range(5)])
    assert_same_bits(solve(case), alone)


def test_conjugate_pairs_keep_each_bound_with_its_root():
    values = np.array([[5.0, 2 - 1j, 1.0, 2 + 1j, 3 + 2j, 3 - 2j]])
    radius = np.array([[0.5, 0.21, 0.1, 0.2, 0.3, 0.4]])
    ordered, bounds = conjugate_pairs(values, radius)
    assert ordered[0].tolist() == [1, 5, 2 + 1j, 2 - 1j, 3 + 2j, 3 - 2j]
    assert bounds[0] == pytest.approx([0.1, 0.5, 0.21, 0.21, 0.4, 0.4])
    # The partner of each is the one nearest to its conjugate, whatever rounding did to real parts.
    values = np.array([[2 + 1j, 2 - 1.25j, 1.875 - 1j, 1.875 + 1.25j, 7.0]])
    ordered, bounds = conjugate_pairs(values, np.zeros((1, 5)))
    assert np.array_equal(ordered[0, 2::2], ordered[0, 1::2].conj())
    assert ordered[0, 0] == 7
    # What a root was moved is added to its bound.
    assert bounds[0] == pytest.approx([0, 0.125, 0.125, 0.125, 0.125])
    assert np.array_equal(values[0], [2 + 1j, 2 - 1.25j, 1.875 - 1j, 1.875 + 1.25j, 7.0])


def test_unpaired_roots_have_no_bound():
    values = np.array([[1 + 1j, 2.0, 3.0], [1 + 1j, 1 - 1j, 3.0]])
    ordered, bounds = conjugate_pairs(values, np.full((2, 3), 0.1))
    assert np.array_equal(ordered[0], values[0])
    assert np.isinf(bounds[0]).all() and np.isfinite(bounds[1]).all()
    only_real = np.array([[3.0, 1.0, 2.0]], complex)
    assert conjugate_pairs(only_real, np.array([[0.3, 0.1, 0.2]]))[1].tolist() == [[0.1, 0.2, 0.3]]


def test_radius_of_a_well_separated_symmetric_matrix_is_small():
    matrix = np.diag(np.arange(1.0, 13.0)) + 0.1 * (np.eye(12, k=1) + np.eye(12, k=-1))
    values, radius = structured_eigenvalues(matrix[None], lapack(matrix[None]), 1)
    assert values.imag.max() == 0
    assert (radius >= SAFETY * EPS * np.abs(values)).all()
    assert radius.max() < 10 * SAFETY * EPS * 13


def test_scale_does_not_matter():
    """Multiplying by a power of two changes no digit of the values; bounds scale with them."""
    matrices = ring_matrices(np.linspace(0.009, 0.0102, 5))
    start = lapack(matrices)
    values, radius = structured_eigenvalues(matrices, start, 2)
    for factor in (2.0**-90, 2.0**60):
        other, bound = structured_eigenvalues(factor * matrices, factor * start, 2)
        assert np.abs(other / factor - values).max() < 1e-12 * np.abs(values).max()
        assert bound / factor == pytest.approx(radius, rel=0.5)


def test_paths_of_nominal_rings_near_the_onset():
    """The structured solver decides what condition numbers cannot, and is never overruled."""
    onset = published.ONSETS["oberst2016-calibrated"][0]
    friction = onset * (1 + np.linspace(-0.02, 0.02, 41)[np.arange(41) != 20])
    matrices = ring_matrices(friction, "oberst2016-calibrated")
    _, bounds = conditioned_eigenvalues(matrices)
    assert bounds.max() > 1e-6 * np.linalg.norm(matrices[0])
    spectra = solve(pencils(matrices))
    assert (spectra.decided_by == STRUCTURED).mean() > 0.5
    assert (spectra.decided_by == CERTIFICATE).mean() < 0.2
    assert np.array_equal(spectra.any_unstable == 1, friction > onset)
