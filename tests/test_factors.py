"""Refined pairs of roots against exact arithmetic, and where modes overtake others against closed forms."""

import numpy as np
import oracle
import pytest

import hipuq
from hipuq.cea.exact import ExactPencil, coalescence, scaled
from hipuq.cea.factors import factored_eigenvalues
from hipuq.cea.overtaking import Change, located


@pytest.mark.parametrize(
    ("preset", "friction"),
    [("oberst2016-calibrated", (0.0525, 0.06)), ("oberst2016", (0.0094, 0.0098, 0.012, 0.05))],
)
def test_factors_against_exact_roots(preset, friction):
    """Where LAPACK is wrong by 1e-6 all roots come out to 1e-9 of the largest, the real ones real."""
    model = hipuq.models.ring(preset)
    stiffness, _ = model.pencils(model.nominal(friction=np.array(friction))).reduced()
    start = np.linalg.eigvals(stiffness).astype(complex)
    values, radius = factored_eigenvalues(stiffness, start, 2, np.ones(start.shape, bool))
    assert np.isfinite(radius).all()
    for matrix, own in zip(stiffness, values, strict=True):
        exact = np.array([complex(ball) for ball, times in oracle.exact_roots(matrix) for _ in range(times)])
        assert (exact.imag == 0).sum() == (own.imag == 0).sum()
        assert np.sort_complex(own) == pytest.approx(np.sort_complex(exact), abs=1e-9 * np.abs(exact).max())


def test_double_roots_stay_apart_and_conjugate():
    """The same oscillator twice: two equal real roots, and two equal pairs, each in its place."""
    for friction in (0.3, 0.6):
        model = hipuq.models.two_dof("hoffmann2002")
        one = model.pencils(model.nominal(friction=friction)).reduced()[0][0]
        matrix = np.kron(np.eye(3), one)
        start = np.linalg.eigvals(matrix).astype(complex)
        values, radius = factored_eigenvalues(matrix[None], start[None], 2, np.ones((1, 6), bool))
        assert np.isfinite(radius).all()
        assert np.sort(values[0].real) == pytest.approx(np.sort(start.real), rel=1e-11)
        assert np.sort(values[0].imag) == pytest.approx(np.sort(start.imag), rel=1e-6, abs=1e-11)
        assert np.array_equal(np.sort_complex(values[0]), np.sort_complex(values[0].conj()))
        upper = np.sort_complex(values[0][values[0].imag >= 0])
        assert (np.abs(np.diff(upper)) > 0).all()


def test_the_friction_of_a_coalescence():
    """From a start that is 1 % off Newton's method finds the onset in closed form to the last digits."""
    model = hipuq.models.two_dof("hoffmann2002")
    exact = ExactPencil(*(part[0] for part in model.pencils(model.nominal()).reduced_parts()))
    found = coalescence(exact, 0.477, 20.9)
    assert found is not None
    assert found[0] == pytest.approx(0.472377492973330, rel=1e-14)
    assert scaled(found[1], exact.exponent) == pytest.approx(21.0, rel=1e-14)


@pytest.mark.parametrize("finest", [1e-3, 1e-11])
def test_overtaking_is_located(finest):
    """A pair of the frequency 1 + x overtakes modes at 1.5 and 1.7 x + 0.85, in a few looks each."""
    looks = []

    def look(cells, x):
        looks.append(len(x))
        frequency = np.stack([1 + x, 1 + x, 1.5 + 0 * x, 0.85 + 1.7 * x], axis=1)
        order = frequency.argsort(axis=1, kind="stable")
        return (order == 1).astype(float), np.take_along_axis(frequency, order, axis=1)

    ends = np.array([0.0, 0.9])
    shown = look([0, 0], ends)[0]
    found = located([Change(7, ends.tolist(), list(shown))], look, finest)
    assert [one.cell for one in found] == [7, 7]
    assert all(one.known and one.ends[1] - one.ends[0] <= finest for one in found)
    assert [np.mean(one.ends) for one in found] == pytest.approx([0.15 / 0.7, 0.5], abs=finest)
    assert len(looks) < 16


def test_what_is_seen_between_may_be_unknown():
    def look(cells, x):
        return np.full((len(x), 2), np.nan), np.ones((len(x), 2))

    (found,) = located([Change(0, [0.0, 1.0], [np.array([0.0, 1.0]), np.array([1.0, 0.0])])], look, 1e-6)
    assert not found.known
    assert found.ends == [0.0, 1.0]
