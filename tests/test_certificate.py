"""Certified verdicts: known answers, an independent oracle, both sides of every known onset."""

import numpy as np
import oracle
import published
import pytest
from helpers import pencils
from validate_filter import exact_growing

import hipuq
from hipuq.cea import Pencils, solve
from hipuq.cea.bounds import CERTIFICATE, DOUBLE, EPS, STRUCTURED
from hipuq.cea.certificate import certify_damped, certify_undamped

ROTATION = np.array([[1.0, -1.0], [1.0, 1.0]])
FREE = np.array([[1.0, -1.0], [-1.0, 1.0]])


def lapack(matrix: np.ndarray) -> np.ndarray:
    return np.linalg.eigvals(matrix).astype(complex)


def counts(matrix, mechanisms: int = 0, start=None) -> tuple[int, int, int] | None:
    """Return how many roots are certified as complex, negative and zero; None if that is not known."""
    matrix = np.array(matrix, dtype=float)
    proof = certify_undamped(matrix, lapack(matrix) if start is None else start, mechanisms)
    assert len(proof.values) == len(proof.known) == len(matrix)
    if not proof.known.all():
        assert not proof.known.any()
        return None
    values = proof.values
    # Complex ones stand above and below the axis alike.
    assert (values.imag > 0).sum() == (values.imag < 0).sum()
    real = values.imag == 0
    return int((~real).sum()), int((real & (values.real < 0)).sum()), int((values == 0).sum())


def companion_roots(stiffness: np.ndarray, damping: np.ndarray) -> np.ndarray:
    n = len(stiffness)
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    return lapack(companion)


def jordan(size: int, value: float = 1.0) -> np.ndarray:
    return value * np.eye(size) + np.eye(size, k=1)


def blocks(*parts: np.ndarray) -> np.ndarray:
    n = sum(len(part) for part in parts)
    whole, i = np.zeros((n, n)), 0
    for part in parts:
        whole[i : i + len(part), i : i + len(part)] = part
        i += len(part)
    return whole


def symmetric(n: int, seed: int = 0) -> np.ndarray:
    factor = np.random.default_rng(seed).normal(size=(n, n))
    return factor @ factor.T + np.eye(n)


KNOWN = {
    "one, positive": ([[2.0]], (0, 0, 0)),
    "one, negative": ([[-2.0]], (0, 1, 0)),
    "one, zero": ([[0.0]], (0, 0, 1)),
    "rotation": (ROTATION, (2, 0, 0)),
    "purely imaginary": ([[0.0, -1.0], [1.0, 0.0]], (2, 0, 0)),
    "two rotations alike": (np.kron(np.eye(2), ROTATION), (4, 0, 0)),
    "two rotations, coupled, alike": (
        np.kron(jordan(2), np.eye(2)) + np.kron(np.eye(2), ROTATION),
        (4, 0, 0),
    ),
    "diagonal": (np.diag([1.0, 2.0, -3.0, -4.0]), (0, 2, 0)),
    "identity": (np.eye(5), (0, 0, 0)),
    "negative identity": (-np.eye(5), (0, 5, 0)),
    "symmetric": (symmetric(8), (0, 0, 0)),
    "symmetric of 30": (symmetric(30), (0, 0, 0)),
    "negative of 30": (-symmetric(30), (0, 30, 0)),
    "zero": (np.zeros((4, 4)), (0, 0, 4)),
    "Jordan of 2": (jordan(2), (0, 0, 0)),
    "Jordan of 3": (jordan(3), (0, 0, 0)),
    "Jordan of 4": (jordan(4), (0, 0, 0)),
    "Jordan of 4, negative": (jordan(4, -1.0), (0, 4, 0)),
    "Jordan of 3 at zero": (jordan(3, 0.0), (0, 0, 3)),
    "Jordan beside rotation": (blocks(jordan(3), ROTATION), (2, 0, 0)),
    "a double root, coupled and not": (blocks(jordan(2, 3.0), 3.0 * np.eye(2), [[-1.0]]), (0, 1, 0)),
    "integers": ([[2.0, 1, 0], [-1, 2, 0], [5, 7, -4]], (2, 1, 0)),
    "large integers": ([[2.0**52 + 1, 1.0], [0.0, 2.0**52]], (0, 0, 0)),
    "one unit in the last place apart": (np.diag([1.0, 1.0 + EPS]), (0, 0, 0)),
    "coupled by less than rounding": ([[1.0, 1e-20], [-1e-20, 1.0]], (2, 0, 0)),
    "coupled by less than rounding, real": ([[1.0, 1e-20], [1e-20, 1.0]], (0, 0, 0)),
    "an undeclared mechanism": (FREE, (0, 0, 1)),
    "entries of all sizes": ([[1.0, 1e-200], [1e-200, 2.0]], (0, 0, 0)),
    "a subnormal entry": ([[1.0, 5e-324], [0.0, 2.0]], (0, 0, 0)),
}


@pytest.mark.parametrize("name", KNOWN)
def test_known_answers(name):
    matrix, answer = KNOWN[name]
    assert counts(matrix) == answer


@pytest.mark.parametrize("scale", [1e-300, 1e-150, 1e-9, 1e12, 1e150, 1e300])
def test_scale_does_not_matter(scale):
    for name in ("rotation", "diagonal", "symmetric", "Jordan of 3", "an undeclared mechanism"):
        matrix, answer = KNOWN[name]
        assert counts(scale * np.array(matrix)) == answer, name


@pytest.mark.parametrize("name", ["rotation", "Jordan of 4", "symmetric", "integers", "diagonal"])
@pytest.mark.parametrize("start", ["zeros", "equal", "random", "tiny", "huge", "real line"])
def test_bad_start_values_do_no_harm(name, start):
    matrix, answer = KNOWN[name]
    n = len(matrix)
    noise = np.random.default_rng(1).normal(size=(2, n))
    values = {
        "zeros": np.zeros(n, complex),
        "equal": np.full(n, 1 + 1j),
        "random": 5 * (noise[0] + 1j * noise[1]),
        "tiny": 1e-200 * (noise[0] + 1j * noise[1]),
        "huge": 1e200 * (noise[0] + 1j * noise[1]),
        "real line": np.arange(n) + 0j,
    }[start]
    before = values.copy()
    assert counts(matrix, start=values) == answer
    assert np.array_equal(values, before)


@pytest.mark.parametrize("n", [16, 20, 22, 24, 26])
@pytest.mark.parametrize("distance", [1e-16, 1e-14, 1e-12])
def test_start_values_within_a_tight_cluster_do_no_harm(n, distance):
    """Products of so many small gaps leave the range of doubles, and must not be taken for zero."""
    matrix = np.eye(n)
    even = np.arange(0, n, 2)
    matrix[even, even + 1] = -distance * (even + 1)
    matrix[even + 1, even] = distance * (even + 1)
    assert counts(matrix) == (n, 0, 0)
    for line in (1 + distance * (np.arange(n) - n / 2), 1 + EPS * np.arange(n)):
        assert counts(matrix, start=line.astype(complex)) == (n, 0, 0)


def test_mechanisms_declared_right_too_many_and_undeclared():
    chain = np.array([[1.0, -1, 0], [-1, 2, -1], [0, -1, 1]]) / 3
    assert counts(chain, 1) == (0, 0, 1)
    assert counts(chain, 2) is None
    assert counts(chain) == (0, 0, 1)
    two = blocks(chain, FREE, ROTATION)
    assert counts(two, 2) == (2, 0, 2)
    assert counts(two, 1) == (2, 0, 2)
    assert counts(two, 3) is None
    assert counts(np.diag([1.0, 2.0]), 1) is None


@pytest.mark.parametrize("count", [6, 7])
def test_mechanisms_of_the_ring(count):
    """Rounding of the entries makes most of these zeros negative: no divergence, declared or not."""
    model = hipuq.models.ring()
    samples = hipuq.ContactPatterns(count).samples()
    samples = samples.assign(friction=("sample", np.full(samples.sizes["sample"], 0.004)))
    matrices, _ = model.pencils(samples.isel(sample=slice(None, None, 4))).reduced()
    for matrix in matrices:
        declared = 8 - count
        assert counts(matrix, declared) == (0, 0, declared)
        assert counts(matrix, declared + 1) is None
        assert counts(matrix) == (0, 0, declared)
        # Without the rule the sign of the rounding would decide.
        real = [ball.real for ball, _ in oracle.exact_roots(matrix)]
        assert min(abs(float(value.mid())) for value in real) > 0


@pytest.mark.parametrize("certify", ["never", "auto", "always"])
def test_slow_modes_of_a_stiff_system_are_no_mechanisms(certify):
    """Roots far above the rounding of the entries keep their own verdict beside a stiff spring."""
    stiff = np.array([[1e13]])
    cases = {1.0: (ROTATION, [1.0]), 2.0: ([[-1.0]], [1.0]), 3.0: ([[1.0]], [0.0])}
    for slow, verdict in cases.values():
        spectra = solve(pencils(blocks(stiff, np.array(slow))), certify=certify)
        assert spectra.any_unstable.tolist() == verdict
        assert spectra.mechanisms.tolist() == [0]


def strongly_coupled(rng: np.random.Generator, n: int, strength: float) -> np.ndarray:
    """Return a dense matrix of known spread, far from normal."""
    turned = np.linalg.qr(rng.normal(size=(n, n)))[0]
    middle = np.diag(np.sort(rng.uniform(-0.3, 1.0, n))) + strength * np.triu(rng.normal(size=(n, n)), 1)
    return turned @ middle @ turned.T


@pytest.mark.parametrize("n", [2, 5, 9, 14])
@pytest.mark.parametrize("strength", [0.0, 0.3, 3.0])
def test_agreement_with_the_oracle(n, strength):
    rng = np.random.default_rng(100 * n + int(10 * strength))
    seen = set()
    for _ in range(12):
        matrix = strongly_coupled(rng, n, strength)
        expected = oracle.exact_counts(matrix)
        seen.add(expected)
        assert counts(matrix) == (*expected, 0)
        assert counts(matrix, start=rng.normal(size=n) + 1j * rng.normal(size=n)) == (*expected, 0)
    assert len(seen) > 1


@pytest.mark.parametrize("certify", ["auto", "always"])
def test_small_integer_matrices_are_never_wrong(certify):
    """Multiple roots, zeros, singular and decoupled blocks of one to three: all paths together."""
    rng = np.random.default_rng(17)
    stack = {}
    for trial in range(400):
        b, count = 1 + trial % 3, int(rng.integers(3, 6))
        n = b * count
        matrix = np.zeros((n, n))
        for i in range(count):
            own, other = slice(i * b, (i + 1) * b), slice((i + 1) * b, (i + 2) * b)
            matrix[own, own] = rng.integers(-1, 3, (b, b)) + 2 * np.eye(b)
            if i < count - 1:
                matrix[own, other] = rng.integers(-1, 2, (b, b)) * rng.integers(0, 2)
                matrix[other, own] = rng.integers(-1, 2, (b, b)) * rng.integers(0, 2)
        stack.setdefault(n, []).append(matrix * 10.0 ** rng.integers(-3, 4))
    for matrices in stack.values():
        expected = np.array([oracle.exact_counts(matrix) for matrix in matrices])
        spectra = solve(pencils(np.array(matrices)), certify=certify)
        assert np.array_equal(spectra.unstable_count, expected[:, 0] // 2 + expected[:, 1])
        assert np.array_equal(spectra.any_unstable, expected.any(axis=1))


def around(onset: float, distance: float) -> np.ndarray:
    return onset * np.array([1 - distance, 1 + distance])


def hulten(friction: np.ndarray, damping: tuple[float, float]) -> Pencils:
    model = hipuq.models.two_dof("hulten", damping_1=damping[0], damping_2=damping[1])
    return model.pencils(model.nominal(friction=friction))


def damped_verdicts(case: Pencils, threshold: float = 0.0) -> list[int | None]:
    """Return how many roots certify_damped proves to grow, from LAPACK's values; None if unknown."""
    found: list[int | None] = []
    for stiffness, damping in zip(*case.reduced(), strict=True):
        values = companion_roots(stiffness, damping)
        known = certify_damped(stiffness, damping, threshold, values)
        found.append(int((values.real > threshold).sum()) if known.all() else None)
    return found


@pytest.mark.parametrize("damping", [key for key in published.HULTEN_ONSETS if any(key)])
@pytest.mark.parametrize("distance", [1e-6, 1e-9])
def test_damped_closed_forms_are_certified(damping, distance):
    case = hulten(around(published.HULTEN_ONSETS[damping], distance), damping)
    assert damped_verdicts(case) == [0, 2]
    for certify in ("auto", "always"):
        spectra = solve(case, certify=certify)
        assert spectra.any_unstable.tolist() == [0, 1]
        assert (np.sign(spectra.margin) == [1, -1]).all()
    assert spectra.decided_by.tolist() == [CERTIFICATE] * 2


def test_vanishing_damping():
    onset = published.HULTEN_ONSET_VANISHING_DAMPING
    assert damped_verdicts(hulten(around(onset, 1e-6), (1e-6, 1e-6))) == [0, 2]


@pytest.mark.parametrize("distance", [1e-3, 1e-6, 1e-9])
def test_undamped_onsets_of_closed_forms(distance):
    """One in a billion from the onset; at 1e-6 the closed form itself has digits to spare."""
    hoffmann = hipuq.models.two_dof("hoffmann2002")
    below, above = around(published.HOFFMANN_ONSET, distance)
    case = hoffmann.pencils(hoffmann.nominal(friction=np.array([below, above])))
    for matrices in (case.reduced()[0], hulten(around(7 / 24, distance), (0.0, 0.0)).reduced()[0]):
        assert [counts(matrix) for matrix in matrices] == [(0, 0, 0), (2, 0, 0)]


@pytest.mark.parametrize("distance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("certify", ["auto", "always"])
def test_growth_thresholds_on_both_sides(certify, distance):
    """The closed-form growth rate, a little above and below the threshold, damped and not."""
    for case in (
        hulten(np.array([0.5, 0.4]), (0.0, 0.0)),
        hulten(np.array([0.5, 0.4]), (0.02, 0.06)),
        ring_near("oberst2016-calibrated", 1.2, damping_ratio=1e-3),
    ):
        growth = solve(case).growth_rate[0].max()
        one = case.rows([0])
        for side in (-1, 1):
            threshold = growth * (1 + side * distance)
            spectra = solve(one, growth_threshold=threshold, certify=certify)
            assert spectra.any_unstable.tolist() == [side < 0]
            assert (spectra.margin[0] < 0) == (side < 0)


def test_damped_counts_of_random_pencils_against_the_oracle():
    rng = np.random.default_rng(8)
    seen = set()
    for n in (1, 2, 4, 7):
        for _ in range(8):
            stiffness = strongly_coupled(rng, n, 0.5) + 0.5 * np.eye(n)
            damping = 0.05 * symmetric(n, int(rng.integers(1000))) / n
            for threshold in (0.0, 0.2):
                expected = exact_growing(stiffness, damping, threshold)
                seen.add(expected)
                values = companion_roots(stiffness, damping)
                assert certify_damped(stiffness, damping, threshold, values).all()
                assert (values.real > threshold).sum() == expected
                # Approximations on the wrong side are not confirmed.
                wrong = certify_damped(stiffness, damping, threshold, values + 10.0)
                assert not wrong.all() or expected == 2 * n
                wrong = certify_damped(stiffness, damping, threshold, values - 10.0)
                assert not wrong.all() or expected == 0
    assert len(seen) > 3


def test_a_root_on_the_border_stays_unknown():
    """Not right and not left of it: neither stable nor unstable is proved."""
    circle = np.array([[4.0, 0.0], [0.0, 1.0]])
    undamped = np.zeros((2, 2))
    assert not certify_damped(circle, undamped, 0.0, companion_roots(circle, undamped)).any()
    # One of two oscillators rests undamped: l = +-i exactly.
    half = np.diag([0.5, 0.0])
    spectra = solve(pencils(circle, damping=half), certify="always")
    assert np.isnan(spectra.any_unstable).all() and spectra.decided_by.tolist() == [-1]
    # Divergence at exactly the threshold: w = -4 grows with 2 / s.
    diverging = pencils(np.diag([-4.0, 1.0]))
    for certify in ("auto", "always"):
        assert np.isnan(solve(diverging, growth_threshold=2.0, certify=certify).any_unstable[0])
        assert solve(diverging, growth_threshold=1.999, certify=certify).any_unstable.tolist() == [1]
        assert solve(diverging, growth_threshold=2.001, certify=certify).any_unstable.tolist() == [0]


def ring_near(preset: str, factor, **values) -> Pencils:
    """Return nominal pencils of the ring at multiples of its first onset."""
    model = hipuq.models.ring(preset)
    friction = published.ONSETS[preset][0] * np.atleast_1d(factor)
    return model.pencils(model.nominal(friction=friction, **values))


@pytest.mark.parametrize("certify", ["auto", "always"])
@pytest.mark.parametrize("preset", published.ONSETS)
def test_verdicts_on_both_sides_of_every_onset(preset, certify):
    """Each onset makes one more pair unstable; printed digits allow a distance of 1e-6."""
    model = hipuq.models.ring(preset)
    onsets = np.array(published.ONSETS[preset])
    # The calibrated onsets are printed to six digits: half a unit of the last is 1e-6 of them.
    distance = 1e-6 if preset == "oberst2016" else 2e-6
    friction = (onsets[:, None] * np.array([1 - distance, 1 + distance])).ravel()
    spectra = solve(model.pencils(model.nominal(friction=friction)), certify=certify)
    assert spectra.unstable_count.tolist() == [0, 1, 1, 2, 2, 3, 3, 4]
    assert np.array_equal(spectra.margin < 0, spectra.any_unstable == 1)


@pytest.mark.parametrize("certify", ["auto", "always"])
def test_verdicts_on_both_sides_of_the_onsets_with_eight_in_contact(certify):
    model = hipuq.models.ring()
    missing, onsets = (np.array(list(part)) for part in (
        published.FIRST_ONSET_WITHOUT, published.FIRST_ONSET_WITHOUT.values()
    ))  # fmt: skip
    contact = np.arange(1, 10) != np.repeat(missing, 2)[:, None]
    friction = (onsets[:, None] * np.array([1 - 1e-6, 1 + 1e-6])).ravel()
    spectra = solve(model.pencils(model.nominal(friction=friction, contact=contact)), certify=certify)
    assert spectra.unstable_count.tolist() == [0, 1] * 9


def mixed_ring(kind: str) -> Pencils:
    """Return 100 pencils of the ring: nominal near the onset, scattered, or damped."""
    rng = np.random.default_rng(21)
    model = hipuq.models.ring("oberst2016-calibrated")
    onset = published.ONSETS["oberst2016-calibrated"][0]
    values = {"friction": onset * rng.uniform(0.9, 1.1, 100)}
    if kind == "scattered":
        patterns = hipuq.ContactPatterns((6, 7, 8, 9))
        values["contact"] = patterns.patterns(patterns.ppf(rng.random(100)))
        values["friction"] = rng.uniform(0, 0.1, 100)
        values["contact_stiffness"] = 4.599e9 * (1 + 0.05 * rng.uniform(-1, 1, (100, 9)))
    if kind == "damped":
        values["damping_ratio"] = 10.0 ** rng.uniform(-6, -2, 100)
    return model.pencils(model.nominal(**values))


@pytest.mark.parametrize("kind", ["nominal", "scattered", "damped"])
def test_always_and_auto_agree(kind):
    case = mixed_ring(kind)
    for threshold in (0.0, 5.0):
        auto = solve(case, growth_threshold=threshold)
        always = solve(case, growth_threshold=threshold, certify="always")
        assert np.isfinite(auto.unstable).all() and np.isfinite(always.unstable).all()
        assert np.array_equal(auto.any_unstable, always.any_unstable)
        assert np.array_equal(auto.unstable_count, always.unstable_count)
        assert np.array_equal(np.sign(auto.margin), np.sign(always.margin))
        assert np.array_equal(auto.mechanisms, always.mechanisms)
        assert (always.decided_by == CERTIFICATE).all()
        if threshold == 0:
            assert 0 < auto.any_unstable.mean() < 1


def test_decided_by_says_the_path():
    """A clear case, one that needs the structure, one that needs exact arithmetic, one of nobody."""
    onset = published.ONSETS["oberst2016-calibrated"][0]
    ring = ring_near("oberst2016-calibrated", [0.5, 0.98, 1 - 1e-6])
    assert solve(ring).decided_by.tolist()[:2] == [DOUBLE, STRUCTURED]
    assert solve(ring, certify="never").decided_by.tolist() == [DOUBLE, -1, -1]
    assert solve(ring, certify="always").decided_by.tolist() == [CERTIFICATE] * 3
    assert onset > 0
    # Dense: no structure to keep.
    assert solve(pencils(jordan(3) + 1e-17)).decided_by.tolist() == [CERTIFICATE]
    assert solve(pencils(np.diag([1.0, 2.0]), mechanisms=1)).decided_by.tolist() == [-1]


def test_a_certified_spectrum_is_that_of_the_plain_one_where_that_is_good():
    """Well separated: the certificate's centres are eigenvalues, not only verdicts."""
    rng = np.random.default_rng(4)
    case = pencils(np.array([strongly_coupled(rng, 6, 0.2) + np.eye(6) for _ in range(20)]))
    plain, proved = solve(case, certify="never"), solve(case, certify="always")
    assert proved.frequency == pytest.approx(plain.frequency, rel=1e-9)
    assert proved.growth_rate == pytest.approx(plain.growth_rate, abs=1e-9)
    assert proved.margin == pytest.approx(plain.margin, rel=1e-6)
