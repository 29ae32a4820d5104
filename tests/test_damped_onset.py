"""Boundaries of damped pencils and of growth above a threshold: closed forms, the model, dense counts."""

import numpy as np
import published
import pytest
from helpers import pencils
from validate_filter import exact_growing

import hipuq
from hipuq.cea.bounds import EPS
from hipuq.cea.crossing import ROUNDING, expansion, passing
from hipuq.cea.damped_onset import damped_boundaries
from hipuq.cea.growing import exact_sides
from hipuq.cea.newton import solve_crossing
from hipuq.errors import InputError

DAMPED = [{"damping_ratio": ratio} for ratio in (1e-4, 0.001, 0.005, 0.01)]
DAMPED.append({"mass_damping": 3.0, "stiffness_damping": 2e-7})


def hulten_onset(damping: tuple[float, float]) -> float:
    """Return the closed form of the damped onset at 100 and 75 Hz to the last digits."""
    p, q = (2 * np.pi * 100) ** 2, (2 * np.pi * 75) ** 2
    a, b = damping[0] * np.sqrt(p), damping[1] * np.sqrt(q)
    mixed = a * q + b * p
    return float(np.sqrt(((a + b) * (p + q + a * b) * mixed - mixed**2) / ((a + b) ** 2 * p * q) - 1))


def counts(case, friction: np.ndarray, threshold: float = 0.0) -> np.ndarray:
    """Return how many eigenvalues LAPACK puts right of the threshold, mechanisms left out."""
    constant, slope = (part[0] for part in case.reduced_parts())
    damping = case.reduced()[1]
    n = len(constant)
    states = np.zeros((len(friction), 2 * n, 2 * n))
    states[:, :n, n:] = np.eye(n)
    states[:, n:, :n] = -(constant + friction[:, None, None] * slope)
    states[:, n:, n:] = 0 if damping is None else -damping[0]
    values = np.linalg.eigvals(states)
    rigid = np.abs(values) < 1e-6 * np.abs(values).max() * bool(case.mechanisms[0])
    return ((values.real > threshold) & ~rigid).sum(axis=1)


def assert_counts_agree(case, found, upper: float, threshold: float = 0.0, number: int = 500) -> None:
    """Assert that the boundaries give the counts at many frictions, those close to a boundary left out.

    One friction at random in each of as many equal parts of the range.
    """
    friction = upper * (np.arange(number) + np.random.default_rng(7).random(number)) / number
    at = np.array([one.friction for one in found])
    change = np.array([one.direction * (1 if one.frequency == 0 else 2) for one in found])
    expected = counts(case, np.array([0.0]), threshold) + ((friction[:, None] > at) * change).sum(axis=1)
    clear = (np.abs(friction[:, None] - at) > 1e-7).all(axis=1)
    assert clear.sum() > 0.95 * number
    assert np.array_equal(counts(case, friction, threshold)[clear], expected[clear])


@pytest.mark.parametrize("damping", [key for key in published.HULTEN_ONSETS if any(key)])
def test_damped_closed_forms(damping):
    model = hipuq.models.two_dof("hulten", damping_1=damping[0], damping_2=damping[1])
    (found,) = damped_boundaries(model.pencils(model.nominal()), 0.0, 1.0)
    assert [(one.direction, one.certified) for one in found] == [(1, True)]
    assert found[0].friction == pytest.approx(published.HULTEN_ONSETS[damping], rel=1e-10)
    assert found[0].friction == pytest.approx(hulten_onset(damping), rel=1e-13)


def test_vanishing_damping():
    model = hipuq.models.two_dof("hulten", damping_1=1e-6, damping_2=1e-6)
    ((one,),) = damped_boundaries(model.pencils(model.nominal()), 0.0, 1.0)
    assert one.certified
    assert one.friction == pytest.approx(published.HULTEN_ONSET_VANISHING_DAMPING, rel=1e-10)


@pytest.mark.parametrize("preset", published.ONSETS)
@pytest.mark.parametrize("damping", DAMPED, ids=str)
@pytest.mark.parametrize("threshold", [0.0, 5.0])
def test_the_ring_at_full_contact(preset, damping, threshold):
    """All boundaries are proved, agree with a dense count, and with the model on both their sides."""
    model = hipuq.models.ring(preset, growth_threshold=threshold, **damping)
    case = model.pencils(model.nominal())
    (found,) = damped_boundaries(case, 0.0, 0.1, threshold)
    assert all(one.certified for one in found)
    assert_counts_agree(case, found, 0.1, threshold)
    for one in found:
        assert_the_model_agrees(model, one)


def assert_the_model_agrees(model, one, **values) -> None:
    beside = one.friction * np.array([1 - 1e-6, 1 + 1e-6])
    outcomes = model(model.nominal(friction=beside, **values))
    below, above = outcomes["unstable_count"].values
    assert above - below == one.direction
    side = int(one.direction > 0)
    assert outcomes["unstable"].values[side, one.mode - 1] == 1
    assert outcomes["frequency"].values[side, one.mode - 1] == pytest.approx(one.frequency, rel=1e-6)


@pytest.mark.parametrize("preset", published.ONSETS)
@pytest.mark.parametrize("threshold", [0.5, 5.0])
def test_growth_above_a_threshold_without_damping(preset, threshold):
    """Each pair passes the threshold a little after it has merged."""
    model = hipuq.models.ring(preset, growth_threshold=threshold)
    case = model.pencils(model.nominal())
    (found,) = damped_boundaries(case, 0.0, 0.1, threshold)
    assert [(one.direction, one.certified) for one in found] == [(1, True)] * 4
    assert (np.array([one.friction for one in found]) > published.ONSETS[preset]).all()
    assert_counts_agree(case, found, 0.1, threshold)
    for one in found:
        assert_the_model_agrees(model, one)


@pytest.mark.parametrize("threshold", [0.0, 5.0])
def test_scattered_rings_with_and_without_mechanisms(threshold):
    """A batch of patterns of 6 to 9 contacts: counts, and the same boundaries as one by one."""
    rng = np.random.default_rng(3)
    patterns = hipuq.ContactPatterns((6, 7, 8, 9))
    values = {
        "contact": patterns.patterns(patterns.ppf(rng.random(8))),
        "contact_stiffness": 3.98e9 * (1 + 0.1 * rng.uniform(-1, 1, (8, 9))),
        "damping_ratio": 10.0 ** rng.uniform(-4, -2.3, 8),
    }
    model = hipuq.models.ring(growth_threshold=threshold)
    case = model.pencils(model.nominal(**values))
    assert len(set(case.mechanisms)) > 1
    found = damped_boundaries(case, 0.0, 0.1, threshold)
    assert sum(map(len, found)) > 4
    for i, own in enumerate(found):
        assert_counts_agree(case.rows([i]), own, 0.1, threshold)
        assert all(one.certified for one in own)
        for one in own:
            assert_the_model_agrees(model, one, **{name: value[[i, i]] for name, value in values.items()})
        if i < 2:
            assert damped_boundaries(case.rows([i]), 0.0, 0.1, threshold) == [own]


@pytest.mark.parametrize("damped", [True, False])
def test_random_pencils_against_dense_counts(damped):
    """Flutter and divergence, onsets and ends, damping that is not definite, with and without threshold."""
    rng = np.random.default_rng(20)
    kinds = set()
    for _ in range(40):
        n = int(rng.integers(1 if damped else 2, 7))
        factor, other = rng.normal(size=(2, n, n))
        drag = 10.0 ** rng.uniform(-3, -0.5) * (other @ other.T / n + 0.1 * np.eye(n))
        drag += rng.choice([0.0, 0.3]) * rng.normal(size=(n, n)) * np.abs(drag).max()
        case = pencils(
            factor @ factor.T + 0.5 * np.eye(n),
            friction_stiffness=rng.normal(size=(n, n)) * rng.uniform(0.3, 3),
            damping=drag if damped else None,
        )
        threshold = float(rng.choice([0.0, 0.1, 0.5] if damped else [0.02, 0.1, 0.5]))
        (found,) = damped_boundaries(case, 0.0, 2.0, threshold)
        assert all(one.certified for one in found)
        kinds |= {(one.direction, one.frequency == 0) for one in found}
        assert_counts_agree(case, found, 2.0, threshold, number=2000)
    assert kinds >= {(1, False), (-1, False), (1, True)}


def test_a_divergence_right_after_two_eigenvalues_have_become_real():
    """w = 0.01 - mu + 1e-6: the pair meets on the axis at d**2 / 4 above it, one of the two passes 0."""
    drag = 1e-6
    case = pencils([[0.01]], friction_stiffness=[[-1.0]], damping=[[drag]])
    ((one,),) = damped_boundaries(case, 0.0, 1.0)
    assert (one.direction, one.mode, one.frequency, one.certified) == (1, 1, 0.0, True)
    assert one.friction == pytest.approx(0.01, rel=1e-14)


def test_a_narrow_window_is_found():
    """A pair that is unstable over 1e-4 of friction: both its ends."""
    square = np.diag([1.0, 1.01])
    coupling = np.array([[1.0, 4e-6], [-4e-6, 0.0]])
    case = pencils(square, friction_stiffness=coupling, damping=np.eye(2) * 1e-8)
    (found,) = damped_boundaries(case, 0.0, 1.0)
    assert [one.direction for one in found] == [1, -1]
    assert 1e-8 < found[1].friction - found[0].friction < 1e-4
    assert all(one.certified for one in found)


def test_a_boundary_at_an_end_of_the_range_is_not_inside_it():
    model = hipuq.models.two_dof("hulten", damping_1=0.02, damping_2=0.06)
    case = model.pencils(model.nominal())
    ((one,),) = damped_boundaries(case, 0.0, 1.0)
    assert damped_boundaries(case, 0.0, one.friction) == [[]]
    assert damped_boundaries(case, one.friction, 1.0) == [[]]
    assert damped_boundaries(case, 0.0, one.friction * (1 + 1e-12)) == [[one]]
    assert damped_boundaries(case, 0.0, 0.2) == [[]]


def test_a_range_or_pencil_that_cannot_be_used_is_named():
    model = hipuq.models.two_dof("hulten", damping_1=0.02, damping_2=0.02)
    case = model.pencils(model.nominal())
    for lower, upper in ((0.5, 0.5), (0.5, 0.1), (0.0, np.inf), (0.0, np.nan)):
        with pytest.raises(InputError, match="must be finite and ascend"):
            damped_boundaries(case, lower, upper)
    for threshold in (-1.0, np.nan):
        with pytest.raises(InputError, match="threshold is"):
            damped_boundaries(case, 0.0, 1.0, threshold)
    free = hipuq.models.two_dof("hulten")
    with pytest.raises(InputError, match="sample 0 is undamped"):
        damped_boundaries(free.pencils(free.nominal()), 0.0, 1.0)
    rigid = pencils(np.diag([1.0, 2.0]), damping=np.eye(2), mechanisms=1)
    with pytest.raises(InputError, match="does not have the 1 mechanisms"):
        damped_boundaries(rigid, 0.0, 1.0)
    # The second mode is neither damped nor coupled: it stays on the imaginary axis.
    loose = pencils(np.diag([1.0, 2.0]), friction_stiffness=np.diag([1.0, 0.0]), damping=np.diag([0.1, 0.0]))
    with pytest.raises(InputError, match="stays within rounding"):
        damped_boundaries(loose, 0.0, 1.0)


def ring_matrices(preset: str, ratio: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    model = hipuq.models.ring(preset, damping_ratio=ratio)
    case = model.pencils(model.nominal())
    drag = case.reduced()[1]
    assert drag is not None
    constant, slope = case.reduced_parts()
    return constant[0], slope[0], drag[0]


@pytest.mark.parametrize("preset", published.ONSETS)
def test_errors_of_lapack_stay_within_the_bound(preset):
    """Near the first onset, where condition numbers are largest, against enclosed eigenvalues."""
    matrices = ring_matrices(preset, 1e-4)
    friction = published.ONSETS[preset][0] * np.linspace(0.8, 1.5, 12)
    about = expansion(*(np.repeat(part[None], 12, 0) for part in matrices), friction)
    assert ROUNDING * EPS > 0
    for k, mu in enumerate(friction):
        exact = exact_sides(*matrices, 0.0, mu).values
        error = np.abs(about.values[k][:, None] - exact).min(axis=1)
        assert (error <= np.diagonal(about.rounding[k])).all()


def test_exact_counts_are_those_of_the_oracle():
    matrices = ring_matrices("oberst2016", 0.001)
    for mu in (0.0, 0.01, 0.017, 0.02, 0.1):
        for threshold in (0.0, 2.5):
            stiffness = matrices[0] + mu * matrices[1]
            expected = exact_growing(stiffness, matrices[2], threshold)
            assert exact_sides(*matrices, threshold, mu).right == expected


def test_a_root_on_the_line_is_not_counted():
    none = np.zeros((1, 1))
    assert exact_sides(np.eye(1), none, none, 0.0, 0.5).right is None
    assert exact_sides(-np.eye(1), none, none, 1.0, 0.5).right is None
    assert exact_sides(-np.eye(1), none, none, 1.0 - EPS, 0.5).right == 1


def test_no_eigenvalue_passes_where_it_is_said_that_none_can():
    """The criterion on random pencils: sampled eigenvalues stay on their side of the line."""
    rng = np.random.default_rng(5)
    factor = rng.normal(size=(300, 4, 4))
    constant = factor @ factor.transpose(0, 2, 1) + np.eye(4)
    slope = rng.normal(size=(300, 4, 4))
    damping = 0.05 * np.abs(rng.normal(size=300))[:, None, None] * np.eye(4)
    half = 10.0 ** rng.uniform(-3, 0, 300)
    middle = rng.uniform(0, 2, 300)
    verdict = passing(expansion(constant, slope, damping, middle), half, 0.0)
    seen = {int(np.sign(v)) if v != -2 else -2 for v in verdict}
    assert seen >= {-2, -1, 0}
    for i in range(300):
        case = pencils(constant[i], friction_stiffness=slope[i], damping=damping[i])
        number = counts(case, middle[i] + half[i] * np.linspace(-1, 1, 101))
        if verdict[i] == -1:
            assert (number == number[0]).all()
        elif verdict[i] >= 0:
            assert np.count_nonzero(np.diff(number)) <= 1


def test_a_crossing_is_solved_for_from_afar_and_given_up_where_there_is_none():
    model = hipuq.models.two_dof("hulten", damping_1=0.02, damping_2=0.06)
    case = model.pencils(model.nominal())
    drag = case.reduced()[1]
    assert drag is not None
    matrices = (*(part[0] for part in case.reduced_parts()), drag[0])
    shape = np.array([1.0, -0.5 - 0.5j])
    crossing = solve_crossing(*matrices, 0.0, 2 * np.pi * 93.5, shape, 0.25)
    assert crossing is not None
    assert crossing.friction == pytest.approx(hulten_onset((0.02, 0.06)), rel=1e-14)
    assert solve_crossing(np.eye(1), np.zeros((1, 1)), np.eye(1), 0.0, 1.0, np.ones(1), 0.5) is None
