"""Boundaries of instability over friction against closed forms and certified onsets."""

import numpy as np
import published
import pytest
from discriminant import meetings, zeros
from helpers import pencils
from hypothesis import given
from hypothesis import strategies as st
from validate_onsets import compare

import hipuq
from hipuq.cea.exact import ExactPencil
from hipuq.cea.onset import boundaries
from hipuq.errors import InputError


@pytest.mark.parametrize("preset", published.ONSETS)
def test_certified_onsets_at_full_contact(preset):
    """Four pairs merge one after the other; each boundary is proved from both sides."""
    model = hipuq.models.ring(preset)
    (found,) = boundaries(model.pencils(model.nominal()), 0.0, 0.1)
    assert [one.direction for one in found] == [1, 1, 1, 1]
    assert all(one.certified for one in found)
    friction = [one.friction for one in found]
    # The reference has 6 to 12 digits.
    assert friction == pytest.approx(published.ONSETS[preset], rel=1e-6)
    for one in found:
        beside = one.friction * np.array([1 - 1e-6, 1 + 1e-6])
        count = model(model.nominal(friction=beside))["unstable_count"].values
        assert count[1] - count[0] == one.direction


def test_the_onset_of_the_exact_geometry():
    """The same onset with cosines of 60 digits: the rounding of the entries moves it by 1e-13."""
    model = hipuq.models.ring("oberst2016")
    (found,) = boundaries(model.pencils(model.nominal()), 0.0, 0.012)
    assert found[0].friction == pytest.approx(published.ONSET_OF_THE_EXACT_GEOMETRY, rel=1e-12)


def test_closed_form_onset():
    model = hipuq.models.two_dof("hoffmann2002")
    (found,) = boundaries(model.pencils(model.nominal()), 0.0, 0.8)
    assert len(found) == 1
    assert found[0].friction == pytest.approx(published.HOFFMANN_ONSET, rel=1e-12)
    assert found[0].frequency == pytest.approx(np.sqrt(21) / (2 * np.pi), rel=1e-9)
    assert (found[0].direction, found[0].mode, found[0].certified) == (1, 2, True)
    model = hipuq.models.two_dof("hulten")
    (found,) = boundaries(model.pencils(model.nominal()), 0.0, 1.0)
    assert [one.friction for one in found] == pytest.approx([7 / 24], rel=1e-12)


def test_nothing_changes_in_a_range_without_an_onset():
    model = hipuq.models.two_dof("hulten")
    pencils = model.pencils(model.nominal())
    assert boundaries(pencils, 0.0, 0.29) == [[]]
    assert boundaries(pencils, 0.3, 1.0) == [[]]


def test_a_range_or_pencil_that_cannot_be_used_is_named():
    model = hipuq.models.two_dof("hulten", damping_1=0.02)
    with pytest.raises(InputError, match="damping must be zero"):
        boundaries(model.pencils(model.nominal()), 0.0, 1.0)
    model = hipuq.models.two_dof("hulten")
    for lower, upper in ((0.5, 0.5), (0.5, 0.1), (0.0, np.inf), (0.0, np.nan)):
        with pytest.raises(InputError, match="must be finite and ascend"):
            boundaries(model.pencils(model.nominal()), lower, upper)


def test_the_exact_pencil_is_exact():
    """Its polynomial vanishes at the eigenvalues of a pencil of small whole numbers."""
    constant = np.array([[2.0, 1.0, 0.0], [0.0, 3.0, 1.0], [1.0, 0.0, 5.0]])
    slope = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    exact = ExactPencil(constant, slope)
    assert exact.degree == 2
    for mu in (0.0, 0.75, 2.0, 1e-3):
        p = exact.at(mu)
        scaled = [int(c) / int(p[3]) * 2.0 ** (exact.exponent * (3 - k)) for k, c in enumerate(p.coeffs())]
        assert scaled[::-1] == pytest.approx(np.poly(constant + mu * slope), rel=1e-13)


def scattered_ring(seed: int, oscillators: int, missing: int):
    """Return the pencils of a ring with scattered stiffness, mass and angles and some contacts open."""
    rng = np.random.default_rng([seed, oscillators, missing])
    model = hipuq.models.ring("oberst2016", oscillators=oscillators)
    nominal = {name: parameter.nominal for name, parameter in model.parameters.items()}
    contact = np.ones(oscillators)
    contact[rng.choice(oscillators, missing, replace=False)] = 0
    values = {
        name: nominal[name] * rng.uniform(0.7, 1.3, len(nominal[name]))
        for name in ("mass", "spring_stiffness", "contact_stiffness")
    }
    for name in ("spring_angle", "contact_angle"):
        values[name] = nominal[name] + rng.normal(0, 5, len(nominal[name]))
    values["friction_angle"] = values["contact_angle"] + 90
    return model.pencils(model.nominal(contact=contact, **values))


def assert_complete(found, expected: list[float]) -> None:
    """Assert that boundaries are those expected, but for windows narrower than 1e-7."""
    error, windows = compare(np.array([one.friction for one in found]), np.array(expected))
    assert error < 1e-12
    assert (np.diff(windows, axis=1) < 1e-7).all()


@pytest.mark.parametrize(
    ("oscillators", "missing", "samples"),
    [(3, 0, 30), (3, 1, 30), (4, 0, 15), (4, 1, 15), (4, 2, 15), (5, 0, 5), (5, 1, 5), (5, 2, 5)],
)
def test_small_rings_against_the_exact_discriminant(oscillators, missing, samples):
    """Nothing is missed and nothing is made up: where pairs merge and part, and where w passes zero."""
    upper = 1.5
    number = 0
    for seed in range(samples):
        case = scattered_ring(seed, oscillators, missing)
        (found,) = boundaries(case, 0.0, upper)
        parts = [part[0] for part in case.reduced_parts()]
        flutter = [one for one in found if one.frequency > 0]
        divergence = [one for one in found if one.frequency == 0]
        assert_complete(flutter, meetings(*parts, 0.0, upper))
        mechanisms = int(case.mechanisms[0])
        assert_complete(divergence, zeros(*parts, 0.0, upper, mechanisms))
        assert all(one.certified for one in flutter)
        # Mechanisms leave no sign of a determinant to prove divergence by.
        assert all(one.certified == (mechanisms == 0) for one in divergence)
        number += len(found)
    assert number >= samples


def test_a_pair_that_parts_while_another_merges():
    """One of 130 patterns: within 6.5e-7 of friction near 0.0239130 a third root comes near."""
    model = hipuq.models.ring("oberst2016")
    patterns = hipuq.ContactPatterns(in_contact=(6, 7, 8, 9)).samples()
    case = model.pencils(patterns.isel(sample=[19]))
    (found,) = boundaries(case, 0.0, 0.1)
    assert_complete(found, meetings(*(part[0] for part in case.reduced_parts()), 0.0, 0.1))
    assert all(one.certified for one in found)
    close = [one for one in found if abs(one.friction - 0.0239130) < 1e-6]
    assert sorted(one.direction for one in close) == [-1, 1]
    assert abs(close[1].friction - close[0].friction) < 1e-6


def test_divergence():
    """A real root w = 3 - 2 mu passes zero beside one at 7: at 1.5, not a point of the search."""
    case = pencils(np.diag([7.0, 3.0]), friction_stiffness=np.diag([0.0, -2.0]))
    for lower, upper in ((0.0, 1.9), (-0.3, 2.2)):
        ((one,),) = boundaries(case, lower, upper)
        assert one.friction == pytest.approx(1.5, rel=1e-15)
        assert (one.direction, one.mode, one.frequency, one.certified) == (1, 1, 0.0, True)
    back = pencils(np.diag([7.0, -3.0]), friction_stiffness=np.diag([0.0, 2.0]))
    ((one,),) = boundaries(back, 0.0, 1.9)
    assert one.friction == pytest.approx(1.5, rel=1e-15)
    assert (one.direction, one.mode, one.frequency, one.certified) == (-1, 1, 0.0, True)


def test_divergence_of_coupled_modes():
    """det = (1 - 4 mu) 2 - 0.03 mu^2."""
    case = pencils(np.diag([1.0, 2.0]), friction_stiffness=[[-4.0, 0.1], [0.3, 0.0]])
    ((one,),) = boundaries(case, 0.0, 1.0)
    assert one.friction == pytest.approx((np.sqrt(64 + 0.24) - 8) / 0.06, rel=1e-13)
    assert (one.direction, one.mode, one.frequency, one.certified) == (1, 1, 0.0, True)


def test_two_diverging_modes_that_merge_are_one_less():
    """w = -3 +- sqrt(1 - mu^2): two negative roots become one growing pair."""
    case = pencils(np.diag([-2.0, -4.0]), friction_stiffness=[[0.0, 1.0], [-1.0, 0.0]])
    ((one,),) = boundaries(case, 0.0, 1.7)
    assert one.friction == pytest.approx(1.0, rel=1e-15)
    assert (one.direction, one.mode, one.certified) == (-1, 2, True)


@pytest.mark.parametrize("slope", [0.0, 3.0, -0.9])
def test_a_single_mode_without_a_boundary(slope):
    assert boundaries(pencils([[1.0]], friction_stiffness=[[slope]]), 0.0, 1.0) == [[]]


@pytest.mark.parametrize(("lower", "upper"), [(0.0, 1.0), (0.0, 0.9), (0.1, 1.3), (-1.0, 0.7), (0.3, 5.0)])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_single_mode_has_its_boundary_anywhere(lower, upper, sign):
    """w = sign (1 - 2 mu): also where the search looks at 0.5 itself."""
    ((one,),) = boundaries(pencils([[sign]], friction_stiffness=[[-2.0 * sign]]), lower, upper)
    assert one.friction == pytest.approx(0.5, rel=1e-15)
    assert (one.direction, one.mode, one.frequency, one.certified) == (sign, 1, 0.0, True)


def turning(start: float) -> object:
    """Return w = 3 +- sqrt(1 - (mu - start)^2): a pair that merges at start + 1 and parted at start - 1."""
    twist = np.array([[0.0, 1.0], [-1.0, 0.0]])
    return pencils(np.diag([2.0, 4.0]) - start * twist, friction_stiffness=twist)


@pytest.mark.parametrize(("lower", "upper"), [(0.0, 2.0), (0.1, 1.9), (0.5, 1.5), (-0.5, 3.0), (0.9, 1.01)])
def test_a_pair_merges_where_the_search_looks(lower, upper):
    ((one,),) = boundaries(turning(0.0), lower, upper)
    assert one.friction == pytest.approx(1.0, rel=1e-15)
    assert (one.direction, one.mode, one.certified) == (1, 2, True)
    assert one.frequency == pytest.approx(np.sqrt(3) / (2 * np.pi), rel=1e-14)


@pytest.mark.parametrize("upper", [1.0, 1.25, 1.5, 2.0, 2.9])
def test_a_pair_parts_where_the_search_looks(upper):
    found = boundaries(turning(1.5), 0.0, upper)[0]
    assert [(one.direction, one.mode, one.certified) for one in found] == [(-1, 2, True)] + [
        (1, 2, True) for one in found[1:]
    ]
    expected = [0.5] if upper <= 2.5 else [0.5, 2.5]
    assert [one.friction for one in found] == pytest.approx(expected, rel=1e-15)


def test_a_boundary_at_an_end_of_the_range_is_not_inside_it():
    case = turning(0.0)
    assert boundaries(case, 0.0, 1.0) == [[]]
    assert boundaries(case, 0.0, 1.0 - 1e-9) == [[]]
    assert boundaries(case, 1.0 + 1e-9, 2.0) == [[]]
    assert len(boundaries(case, 1.0 - 1e-9, 2.0)[0]) == 1
    assert len(boundaries(case, 0.0, 1.0 + 1e-9)[0]) == 1


def test_two_pairs_at_once():
    """The same system twice, and once with its frequencies doubled: both change within what is resolved."""
    model = hipuq.models.two_dof("hoffmann2002")
    case = model.pencils(model.nominal())
    for factor in (1.0, 4.0):
        twice = pencils(
            np.kron(np.diag([1.0, factor]), case.stiffness[0]),
            friction_stiffness=np.kron(np.diag([1.0, factor]), case.friction_stiffness[0]),
        )
        (found,) = boundaries(twice, 0.0, 0.8)
        assert sum(one.direction for one in found) == 2
        assert [one.friction for one in found] == pytest.approx(
            [published.HOFFMANN_ONSET] * len(found), abs=3e-8
        )


@given(st.integers(0, 2**32 - 1), st.integers(2, 4))
def test_random_pencils_against_counts(seed, n):
    """The boundaries add up to what LAPACK counts at 500 frictions away from them."""
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(n, n))
    case = pencils(
        factor @ factor.T + 0.2 * np.eye(n),
        mass=rng.uniform(0.5, 2.0, n),
        friction_stiffness=rng.normal(size=(n, n)) * rng.uniform(0.3, 3.0),
    )
    (found,) = boundaries(case, 0.0, 2.0)
    assert all(one.certified for one in found)
    at = np.array([one.friction for one in found])
    friction = rng.uniform(0.0, 2.0, 500)
    friction = friction[(np.abs(friction[:, None] - at) > 1e-6).all(axis=1)]
    assert len(friction) > 490
    constant, slope = (part[0] for part in case.reduced_parts())
    values = np.linalg.eigvals(constant + friction[:, None, None] * slope)
    count = ((values.imag > 0) | (values.imag == 0) & (values.real < 0)).sum(axis=1)
    change = np.array([one.direction for one in found], int)
    assert np.array_equal(count, ((friction[:, None] > at) * change).sum(axis=1))
