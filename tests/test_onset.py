"""Boundaries of instability over friction against closed forms and certified onsets."""

import numpy as np
import published
import pytest

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
