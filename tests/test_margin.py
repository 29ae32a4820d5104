"""The stability margin: its sign is that of the verdict, it is smooth through an onset, and has its kinks.

The first test looks at 100,000 samples in all, divided among its cases.
"""

import functools
from itertools import pairwise

import chaospy as cp
import flint
import numpy as np
import oracle
import published
import pytest
from helpers import pencils

import hipuq
from hipuq.cea import solve
from hipuq.cea.bounds import CERTIFICATE

PRESETS = tuple(published.ONSETS)
FRICTION = cp.Uniform(0.0, 0.1)
SCATTER = {
    "contact": hipuq.ContactPatterns(in_contact=(6, 7, 8, 9)),
    "spring_stiffness": hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
    "contact_stiffness": hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"),
    "spring_angle": hipuq.shift(cp.Uniform(-1.0, 1.0), each="spring"),
    "contact_angle": hipuq.shift(cp.Uniform(-1.0, 1.0), each="oscillator"),
}
# Six, seven and nine in contact: with two mechanisms, one and none.
PATTERNS = ((1, 2, 3, 4, 5, 7), (1, 2, 3, 5, 6, 8, 9), tuple(range(1, 10)))


def ring(preset, size, *, scatter=True, damped=False, **options):
    """Return a ring and samples of it: friction and pattern, scattered stiffness and angles, damping."""
    model = hipuq.models.ring(preset, **options)
    inputs = {"friction": FRICTION, **(SCATTER if scatter else {"contact": SCATTER["contact"]})}
    if damped:
        inputs["damping_ratio"] = cp.Uniform(1e-4, 2e-3)
    return model, hipuq.design("monte_carlo", model.inputs(**inputs), n=size, rng=1)


def contact_of(pattern):
    """Return the contact of each of nine oscillators, 0 or 1."""
    return np.isin(np.arange(1, 10), pattern).astype(float)


@functools.cache
def boundaries(preset):
    """Return (friction, contact) of the boundaries of a nominal ring, the first of each pattern twice.

    Beyond the first the others do not change whether any mode is unstable.
    """
    model = hipuq.models.ring(preset)
    places = []
    for pattern in PATTERNS:
        contact = contact_of(pattern)
        found = hipuq.unstable_friction(model, model.nominal(contact=contact[None]), upper=0.1)
        assert found["certified"].values.all()
        friction = found["friction"].values
        places += [(mu, contact) for mu in (friction[0], *friction)]
    return places


def near_onsets(preset, size, **options):
    """Return a nominal ring and samples at relative distances of 1e-9 to 1e-3 from its boundaries."""
    model, rng = hipuq.models.ring(preset, **options), np.random.default_rng(2)
    places = boundaries(preset)
    chosen = rng.integers(0, len(places), size)
    distance = rng.choice([-1.0, 1.0], size) * 10 ** rng.uniform(-9, -3, size)
    friction = np.array([places[i][0] for i in chosen]) * (1 + distance)
    return model, model.nominal(friction=friction, contact=np.array([places[i][1] for i in chosen]))


def two_dof(preset, size, *, damped=False, **options):
    """Return a model of two degrees of freedom and samples on both sides of its onset."""
    model = hipuq.models.two_dof(preset, **options)
    inputs = {"friction": cp.Uniform(0.0, 0.8)}
    if preset == "hulten":
        inputs["frequency_1"] = cp.Uniform(70.0, 110.0)
    if damped:
        inputs |= {"damping_1": cp.Uniform(0.0, 0.06), "damping_2": cp.Uniform(0.0, 0.06)}
    return model, hipuq.design("monte_carlo", model.inputs(**inputs), n=size, rng=3)


CASES = {
    **{f"scatter, {p}": (ring, 25_850, {"preset": p}) for p in PRESETS},
    **{f"nominal, {p}": (ring, 4_000, {"preset": p, "scatter": False}) for p in PRESETS},
    **{f"near onsets, {p}": (near_onsets, 250, {"preset": p}) for p in PRESETS},
    **{f"near onsets, never, {p}": (near_onsets, 600, {"preset": p, "certify": "never"}) for p in PRESETS},
    **{f"near onsets, always, {p}": (near_onsets, 60, {"preset": p, "certify": "always"}) for p in PRESETS},
    **{f"scatter, always, {p}": (ring, 200, {"preset": p, "certify": "always"}) for p in PRESETS},
    **{f"damped, {p}": (ring, 2_000, {"preset": p, "damped": True}) for p in PRESETS},
    **{f"threshold, {p}": (ring, 6_000, {"preset": p, "growth_threshold": 20.0}) for p in PRESETS},
    **{
        f"damped, threshold, {p}": (ring, 1_500, {"preset": p, "damped": True, "growth_threshold": 5.0})
        for p in PRESETS
    },
    **{
        f"damped, always, {p}": (ring, 40, {"preset": p, "damped": True, "certify": "always"})
        for p in PRESETS
    },
    "Hoffmann": (two_dof, 5_500, {"preset": "hoffmann2002"}),
    "Hoffmann, threshold": (two_dof, 4_000, {"preset": "hoffmann2002", "growth_threshold": 0.3}),
    "Hoffmann, always": (two_dof, 500, {"preset": "hoffmann2002", "certify": "always"}),
    "Hulten": (two_dof, 4_000, {"preset": "hulten"}),
    "Hulten, damped": (two_dof, 4_000, {"preset": "hulten", "damped": True}),
    "Hulten, damped, always": (two_dof, 1_000, {"preset": "hulten", "damped": True, "certify": "always"}),
}

assert sum(size for _, size, _ in CASES.values()) == 100_000


def signs(outcomes):
    """Return the verdicts, after a check that the margin has the sign of each."""
    verdict, margin = outcomes["any_unstable"].values, outcomes["margin"].values
    assert np.array_equal(np.isnan(margin), np.isnan(verdict))
    assert (margin[verdict == 1] < 0).all()
    assert (margin[verdict == 0] > 0).all()
    assert np.isfinite(margin[~np.isnan(margin)]).all()
    return verdict


@pytest.mark.parametrize("case", CASES)
def test_the_sign_of_the_margin_is_the_verdict(case):
    make, size, options = CASES[case]
    model, samples = make(size=size, **options)
    verdict = signs(hipuq.evaluate(model, samples, keep=["any_unstable", "margin"], progress=False))
    assert len(verdict) == size
    assert (verdict == 1).sum() > 0.05 * size and (verdict == 0).sum() > 0.02 * size
    # Nothing is left unknown but where it is left to double precision alone.
    assert np.isnan(verdict).any() == ("never" in case)


def test_an_unknown_verdict_has_no_margin():
    """A declared mechanism that is none leaves the sample unknown, damped or not."""
    for damping in (None, 0.1 * np.eye(2)):
        for threshold in (0.0, 0.5):
            case = pencils(np.diag([1.0, 2.0]), damping=damping, mechanisms=1)
            spectra = solve(case, growth_threshold=threshold)
            assert np.isnan(spectra.any_unstable[0]) and np.isnan(spectra.margin[0])


def exact_margin(matrix, mechanisms):
    """Return the margin of an undamped matrix by its definition, from enclosed exact roots."""
    with flint.ctx.workprec(200):
        roots = [ball for ball, times in oracle.exact_roots(matrix) for _ in range(times)]
        roots = sorted(roots, key=lambda ball: abs(complex(ball)))[mechanisms:]
        scale = flint.arb(float(np.trace(matrix))) / len(roots)
        line = sorted((ball.real for ball in roots if ball.imag == 0), key=float)
        values = [-((2 * ball.imag / scale) ** 2) for ball in roots if ball.imag != 0]
        values += [((b - a) / scale) ** 2 for a, b in pairwise(line)]
        return min(float(value) for value in [*values, *(w / scale for w in line[:1])])


@pytest.mark.parametrize(
    ("certify", "where", "tolerance"),
    [
        ("auto", "scatter", 1e-6),
        ("auto", "onset", 2e-2),
        # The certificate proves what each root is; its size stays that of double precision.
        ("always", "onset", 0.3),
    ],
)
@pytest.mark.parametrize("preset", PRESETS)
def test_the_margin_is_the_smallest_squared_gap(preset, certify, where, tolerance):
    size = 25
    make = ring if where == "scatter" else near_onsets
    model, samples = make(preset, size, certify=certify)
    case = model.pencils(samples)
    assert len(np.unique(case.mechanisms)) == 3
    matrices, _ = case.reduced()
    expected = [exact_margin(a, int(m)) for a, m in zip(matrices, case.mechanisms, strict=True)]
    margin = solve(case, certify=certify).margin
    assert margin == pytest.approx(np.array(expected), rel=tolerance, abs=0.0)


@pytest.mark.parametrize(("damped", "threshold"), [(True, 0.0), (True, 5.0), (False, 5.0)])
def test_with_damping_or_a_threshold_it_is_the_distance_of_the_largest_growth_rate(damped, threshold):
    """From the eigenvalues of the state space with all its zeros, by LAPACK."""
    model, samples = ring("oberst2016", 60, damped=damped, growth_threshold=threshold)
    case = model.pencils(samples)
    matrices, damping = case.reduced()
    s, n = matrices.shape[:2]
    state = np.zeros((s, 2 * n, 2 * n))
    state[:, :n, n:] = np.eye(n)
    state[:, n:, :n] = -matrices
    state[:, n:, n:] = 0.0 if damping is None else -damping
    values = np.linalg.eigvals(state)
    rate = np.sqrt(np.trace(matrices, axis1=1, axis2=2) / (n - case.mechanisms))
    growth = np.where(np.abs(values) > 1e-3 * rate[:, None], values.real, -np.inf).max(axis=1)
    margin = solve(case, growth_threshold=threshold).margin
    assert margin == pytest.approx((threshold - growth) / rate, abs=1e-6 * 2e-3)


def test_a_negative_root_is_divergence_and_the_smallest_counts():
    assert solve(pencils(np.diag([-0.5, 1.0, 2.5]))).margin[0] == pytest.approx(-0.5)
    # Beside flutter, the smaller of the two counts: squared gap -4 * 0.75 over 9 / 16, and -1 over 3 / 4.
    both = np.zeros((4, 4))
    both[:2, :2], both[2:, 2:] = [[2.0, -1.0], [1.0, 1.0]], np.diag([-1.0, 1.0])
    assert solve(pencils(both)).margin[0] == pytest.approx(-16 / 3)


def test_a_gap_whose_square_underflows_is_negative_still():
    spectra = solve(pencils([[1.0, 1e-165], [-1e-165, 1.0]]), certify="always")
    assert spectra.any_unstable.tolist() == [1]
    assert -1e-300 < spectra.margin[0] < 0


def test_it_is_the_closed_form_through_the_onset_of_two_modes():
    """The discriminant of K over its squared mean: linear in friction (Hoffmann), or quadratic (Hulten)."""
    k11, k12, k22, k3 = 23.25, 2.25 * np.sqrt(3), 18.75, 11.0
    model = hipuq.models.two_dof("hoffmann2002")
    mu = published.HOFFMANN_ONSET * (1 + np.linspace(-1, 1, 40))
    discriminant = (k11 - k22) ** 2 + 4 * k12 * (k12 - mu * k3)
    found = model(model.nominal(friction=mu), ["margin"])["margin"].values
    assert found == pytest.approx(discriminant / 21**2, abs=1e-13)
    p, q = (200 * np.pi) ** 2, (150 * np.pi) ** 2
    model = hipuq.models.two_dof("hulten")
    mu = published.HULTEN_ONSETS[0.0, 0.0] * (1 + np.linspace(-1, 1, 40))
    found = model(model.nominal(friction=mu), ["margin"])["margin"].values
    assert found == pytest.approx(((p - q) ** 2 - 4 * mu**2 * p * q) / ((p + q) / 2) ** 2, abs=1e-13)


def through(model, sample, onset, step):
    """Return the margin at onset * (1 + step * k), k = -2, -1, 1, 2."""
    k = np.array([-2.0, -1.0, 1.0, 2.0])
    rows = sample.isel(sample=np.zeros(4, int)).assign(friction=("sample", onset * (1 + step * k)))
    outcomes = model(rows, ["margin", "any_unstable"])
    assert outcomes["any_unstable"].values.tolist() == [0, 0, 1, 1]
    return outcomes["margin"].values


def assert_linear(margin, tolerance):
    """Assert that values at -2, -1, 1, 2 steps from an onset lie on a falling line through it.

    With a square root on either side the outer values would be 1.41 and not 2 times the inner ones.
    """
    slope = (margin[3] - margin[0]) / 4
    assert slope < 0
    assert margin == pytest.approx(slope * np.array([-2.0, -1.0, 1.0, 2.0]), rel=tolerance)


@pytest.mark.parametrize(
    "options",
    [{}, {"damping_ratio": 1e-4}, {"growth_threshold": 5.0}],
    ids=["undamped", "damped", "threshold"],
)
def test_it_is_linear_through_an_onset_of_a_scattered_ring(options):
    model, samples = ring("oberst2016", 5, **options)
    seen = 0
    for row in range(5):
        sample = samples.isel(sample=[row])
        found = hipuq.unstable_friction(model, sample.drop_vars("friction"), upper=0.1)
        if not found.sizes["boundary"]:
            continue
        assert found["certified"].values[0]
        assert_linear(through(model, sample, found["friction"].values[0], 1e-6), 1e-2)
        seen += 1
    assert seen >= 3


@pytest.mark.parametrize("certify", ["auto", "always"])
@pytest.mark.parametrize("preset", PRESETS)
def test_it_is_linear_through_the_onset_of_the_nominal_ring(preset, certify):
    """There a neighbour rules but for the last 1e-8 before the onset, where the certificate decides."""
    model = hipuq.models.ring(preset, certify=certify)
    onset = next(friction for friction, contact in boundaries(preset) if contact.all())
    sample = model.nominal(friction=onset)
    assert_linear(through(model, sample, onset, 1e-9), 1e-2)
    outcomes = model(model.nominal(friction=onset * (1 - np.array([1e-7, 1e-6]))))
    assert (outcomes["decided_by"].values >= 1).all()
    assert outcomes["margin"].values[1] == pytest.approx(outcomes["margin"].values[0], rel=0.01)


def coupled(t, coupling):
    """Return pencils of roots 1 -+ sqrt(t**2 + coupling), and a third at 2."""
    t = np.atleast_1d(t)
    stiffness = np.zeros((len(t), 3, 3))
    stiffness[:, 0, 0], stiffness[:, 1, 1], stiffness[:, 2, 2] = 1 + t, 1 - t, 2.0
    stiffness[:, 0, 1], stiffness[:, 1, 0] = abs(coupling), np.sign(coupling)
    return pencils(stiffness)


@pytest.mark.parametrize("certify", ["auto", "always"])
def test_zero_decides_nothing_where_roots_cross_without_coupling(certify):
    """0 at the crossing, above it on both sides, and no instability on any."""
    t = np.array([-1e-3, -1e-6, 0.0, 1e-6, 1e-3])
    crossing = coupled(t, 0.0)
    crossing.stiffness[:, 0, 1] = 1.0  # one-sided coupling, which leaves the roots alone
    for case in (coupled(t, 0.0), crossing):
        spectra = solve(case, certify=certify)
        assert spectra.any_unstable.tolist() == [0] * 5
        assert spectra.margin == pytest.approx(np.square(2 * t) / (4 / 3) ** 2, rel=1e-6, abs=0.0)
    assert spectra.decided_by[2] == CERTIFICATE
    # Coupled with one sign the roots veer, with the other they become a pair.
    assert solve(coupled(t, 1e-8), certify=certify).any_unstable.tolist() == [0] * 5
    assert solve(coupled(t, -1e-8), certify=certify).any_unstable.tolist() == [0, 1, 1, 1, 0]


def test_it_has_a_kink_where_another_neighbour_rules():
    """Roots 1, 2 and 3 - t: the gaps are 1 and 1 - t, equal at t = 0; renumbered where the last is 2 or 1."""
    t = np.array([-2e-6, -1e-6, 0.0, 1e-6, 2e-6])

    def margin(t):
        stiffness = np.zeros((len(t), 3, 3))
        stiffness[:, [0, 1, 2], [0, 1, 2]] = np.stack([1 + 0 * t, 2 + 0 * t, 3 - t], axis=1)
        return solve(pencils(stiffness)).margin * np.square((6 - t) / 3)

    assert margin(t) == pytest.approx(np.minimum(1.0, np.square(1 - t)), abs=1e-12)
    assert np.diff(margin(t)) / 1e-6 == pytest.approx([0, 0, -2, -2], abs=1e-4)
    # The pair of 1 and 2 is none while the third root lies between: the neighbours are others then.
    assert margin(np.array([1.5]))[0] == pytest.approx(0.25)


def test_damped_the_mode_of_the_least_damping_rules_until_shortly_before_the_onset():
    """Without friction it is the damping ratio of all modes times the lowest frequency, over the scale."""
    ratio = 2e-3
    model = hipuq.models.ring(damping_ratio=ratio)
    free = model(model.nominal(friction=0.0))
    omega = 2 * np.pi * np.array(published.NATURAL_FREQUENCIES)
    scale = np.sqrt(np.square(omega).mean())
    assert free["margin"].values[0] == pytest.approx(ratio * omega[0] / scale, rel=1e-5)
    onset = hipuq.unstable_friction(model, upper=0.1)["friction"].values[0]
    friction = onset * np.array([0.3, 0.6, 0.9, 0.98, 1.05])
    outcomes = model(model.nominal(friction=friction), ["margin", "growth_rate"])
    rules = outcomes["growth_rate"].values.argmax(axis=1)
    margin = outcomes["margin"].values
    assert rules[:3].tolist() == [0, 0, 0] and (rules[3:] >= 10).all()
    # Flat, then steep.
    assert abs(margin[2] / margin[0] - 1) < 0.05
    assert margin[4] < 0 < margin[3] < 0.5 * margin[2]
