"""The eigenvalue kernel against closed forms: flutter, divergence, thresholds, overdamped modes.

Verdicts are asked for on both sides of onsets that are known in closed form. Where double precision
cannot decide, the kernel has to say so; it may never give the wrong verdict.
"""

import numpy as np
import published
import pytest
from helpers import pencils, random_pencils

import hipuq
from hipuq.cea import Pencils, solve

ZIEGLER = {"mass": [[3, 1], [1, 1]], "friction_stiffness": [[-1, 1], [0, 0]]}


def hoffmann(friction) -> Pencils:
    model = hipuq.models.two_dof("hoffmann2002")
    return model.pencils(model.nominal(friction=friction))


def hulten(friction, damping_1=0.0, damping_2=0.0) -> Pencils:
    model = hipuq.models.two_dof("hulten", damping_1=damping_1, damping_2=damping_2)
    return model.pencils(model.nominal(friction=friction))


def ziegler(load) -> Pencils:
    load = np.atleast_1d(load)
    stack = np.broadcast_to(np.array([[2.0, -1.0], [-1.0, 1.0]]), (len(load), 2, 2))
    return pencils(stack, friction=load, **ZIEGLER)


def around(onset: float, distance: float) -> np.ndarray:
    return onset * np.array([1 - distance, 1 + distance])


@pytest.mark.parametrize("distance", [1e-1, 1e-3, 1e-6])
def test_hoffmann_onset_is_bracketed(distance):
    """Hoffmann et al. 2002: flutter above mu_c, at the frequency sqrt(21)."""
    spectra = solve(hoffmann(around(published.HOFFMANN_ONSET, distance)))
    assert spectra.any_unstable.tolist() == [0, 1]
    assert spectra.unstable[1].tolist() == [0, 1]
    assert spectra.frequency[1] == pytest.approx(published.HOFFMANN_OMEGA / (2 * np.pi), rel=distance)


@pytest.mark.parametrize("distance", [1e-9, 1e-12, 1e-14, 1e-15])
def test_beside_an_onset_a_verdict_is_right_or_unknown(distance):
    """So near an onset rounding of the entries may decide: then nothing is claimed."""
    for case, onset in ((hoffmann, published.HOFFMANN_ONSET), (hulten, 7 / 24)):
        below, above = solve(case(around(onset, distance))).any_unstable
        assert below == 0 or np.isnan(below)
        assert above == 1 or np.isnan(above)


def test_hoffmann_growth_rate_is_that_of_the_closed_form():
    """w = 21 +- i s with s^2 = (mu / mu_c - 1) (k12^2 + (k11 - k22)^2 / 4)."""
    mu = np.array([0.5, 0.6, 0.8])
    spectra = solve(hoffmann(mu))
    k12, difference = 4.5 * np.cos(np.pi / 6), 2.25
    w = 21 + 1j * np.sqrt((mu / published.HOFFMANN_ONSET - 1) * (k12**2 + difference**2))
    expected = np.sqrt(w)
    assert spectra.frequency[:, 1] == pytest.approx(expected.real / (2 * np.pi), rel=1e-12)
    assert spectra.growth_rate[:, 1] == pytest.approx(expected.imag, rel=1e-9)
    assert spectra.growth_rate[:, 0] == pytest.approx(-expected.imag, rel=1e-9)


@pytest.mark.parametrize("damping", published.HULTEN_ONSETS)
@pytest.mark.parametrize("distance", [1e-2, 1e-6])
def test_hulten_onsets_are_bracketed(damping, distance):
    """Damping moves the onset, and with unequal ratios lowers it far below the undamped one."""
    spectra = solve(hulten(around(published.HULTEN_ONSETS[damping], distance), *damping))
    assert spectra.any_unstable.tolist() == [0, 1]
    assert spectra.unstable_count.tolist() == [0, 1]


def test_vanishing_damping_destabilises():
    """The limit of equal damping to zero lies below the undamped onset (Ziegler's paradox)."""
    onset = published.HULTEN_ONSET_VANISHING_DAMPING
    assert solve(hulten(around(onset, 1e-3), 1e-4, 1e-4)).any_unstable.tolist() == [0, 1]
    assert solve(hulten(around(onset, 1e-3))).any_unstable.tolist() == [0, 0]


@pytest.mark.parametrize("distance", [1e-2, 1e-6])
def test_ziegler_flutter_begins_and_ends(distance):
    """A full mass matrix: flutter between 7/2 - sqrt 2 and 7/2 + sqrt 2, divergence above."""
    begin, end = published.ZIEGLER_FLUTTER
    spectra = solve(ziegler([*around(begin, distance), *around(end, distance)]))
    assert spectra.any_unstable.tolist() == [0, 1, 1, 1]
    assert spectra.unstable_count.tolist() == [0, 1, 1, 2]
    assert (spectra.frequency[:3] > 0).all()
    assert (spectra.frequency[3] == 0).all()
    # Both modes of the divergent pendulum grow, w = 7/2 - p -+ sqrt((7/2 - p)^2 - 2) over 2.
    half = (3.5 - end * (1 + distance)) / 2
    squares = half + np.array([1, -1]) * np.sqrt(half**2 - 0.5)
    assert spectra.growth_rate[3] == pytest.approx(np.sqrt(-squares), rel=1e-6)


def test_divergence_is_recognised():
    """A negative real w grows without oscillation and comes first."""
    spectra = solve(pencils(np.diag([9.0, -4.0, 1.0])))
    assert spectra.frequency[0] == pytest.approx(np.array([0, 1, 3]) / (2 * np.pi))
    assert spectra.growth_rate[0].tolist() == [2, 0, 0]
    assert spectra.unstable[0].tolist() == [1, 0, 0]
    assert spectra.margin[0] < 0


@pytest.mark.parametrize("stiffness", [[[1.0, 0.0], [0.0, -1.0]], [[1.0, 3.0], [-3.0, -1.0]]])
def test_a_stiffness_without_trace_has_a_margin(stiffness):
    """The scale of the margin must not vanish where eigenvalues add up to nothing."""
    spectra = solve(pencils(stiffness))
    assert spectra.any_unstable.tolist() == [1]
    assert np.isfinite(spectra.margin[0]) and spectra.margin[0] < 0


@pytest.mark.parametrize("side", [-1, 1])
def test_growth_threshold_undamped(side):
    """A flutter mode counts exactly if it grows faster than the threshold."""
    growth = float(solve(hoffmann(0.6)).growth_rate.max())
    threshold = growth * (1 - side * 1e-9)
    spectra = solve(hoffmann(0.6), growth_threshold=threshold)
    assert spectra.any_unstable.tolist() == [float(side > 0)]
    assert np.sign(spectra.margin[0]) == -side


@pytest.mark.parametrize("side", [-1, 1])
def test_growth_threshold_of_divergence(side):
    spectra = solve(pencils(np.diag([-4.0, 1.0])), growth_threshold=2 * (1 - side * 1e-9))
    assert spectra.any_unstable.tolist() == [float(side > 0)]


@pytest.mark.parametrize("side", [-1, 1])
def test_growth_threshold_damped(side):
    """l^2 - 0.4 l + 1 = 0 grows with 0.2, beside a stable mode."""
    case = pencils(np.diag([1.0, 4.0]), damping=np.diag([-0.4, 0.1]))
    spectra = solve(case, growth_threshold=0.2 * (1 - side * 1e-9))
    assert spectra.any_unstable.tolist() == [float(side > 0)]
    assert spectra.growth_rate[0] == pytest.approx([0.2, -0.05])
    assert np.sign(spectra.margin[0]) == -side


@pytest.mark.parametrize("damped", [False, True])
def test_growth_threshold_is_a_shift_of_the_pencil(damped):
    """Growth above g: right half plane of the shifted pencil (M, C + 2 g M, K + g C + g^2 M)."""
    case, g = random_pencils(3, 300, 5, damped=damped), 0.1
    mass = case.mass[:, :, None] * np.eye(5)
    damping = np.zeros_like(mass) if case.damping is None else case.damping
    shifted = pencils(
        case.stiffness + g * damping + g * g * mass,
        mass=case.mass,
        friction_stiffness=case.friction_stiffness,
        friction=case.friction,
        damping=damping + 2 * g * mass,
    )
    direct = solve(case, growth_threshold=g).any_unstable
    assert np.array_equal(direct, solve(shifted).any_unstable)
    assert 0.1 < direct.mean() < 0.9


def test_overdamped_modes():
    """A real pair is one mode with frequency 0 and the larger real part: always n modes."""
    spectra = solve(pencils(np.diag([1.0, 4.0, 2.0]), damping=np.diag([5.0, 0.1, 7.0])))
    assert spectra.frequency.shape == (1, 3)
    assert spectra.frequency[0] == pytest.approx([0, 0, np.sqrt(4 - 0.05**2) / (2 * np.pi)])
    slow = [(-7 + np.sqrt(41)) / 2, (-5 + np.sqrt(21)) / 2]
    assert spectra.growth_rate[0] == pytest.approx([*sorted(slow), -0.05])
    assert spectra.any_unstable.tolist() == [0]


def test_damped_divergence():
    """K = -1 with damping: l^2 + l - 1 = 0, the root that grows stands for the mode."""
    spectra = solve(pencils(np.diag([-1.0, 4.0]), damping=np.diag([1.0, 1.0])))
    assert spectra.growth_rate[0] == pytest.approx([(np.sqrt(5) - 1) / 2, -0.5])
    assert spectra.unstable[0].tolist() == [1, 0]
    assert spectra.margin[0] < 0


def test_critical_damping_is_stable():
    """The double root -1 is defective, but far from the imaginary axis."""
    assert solve(pencils([[1.0]], damping=[[2.0]])).any_unstable.tolist() == [0]


def test_one_degree_of_freedom():
    spectra = solve(pencils([[4.0]], mass=[1.0]))
    assert spectra.frequency[0] == pytest.approx([1 / np.pi])
    assert spectra.any_unstable.tolist() == [0]
    assert spectra.margin[0] > 0
