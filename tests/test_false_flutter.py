"""Verdicts against exact arithmetic where double precision shows flutter that is not there.

Beside an onset the last modes of the ring form a nearly defective cluster, and rounding splits real
eigenvalues into complex pairs. Every verdict that is given as known has to be the exact one, of the
characteristic polynomial over the rationals; the rest has to be unknown.
"""

import numpy as np
import oracle
import published
import pytest

import hipuq
from hipuq.cea import solve

ONSET_CALIBRATED = published.ONSETS["oberst2016-calibrated"][0]


def near_onset(preset: str, seed: int, size: int):
    """Return nominal pencils with 8 or 9 in contact and friction within 15 % of the first onset."""
    rng = np.random.default_rng(seed)
    model = hipuq.models.ring(preset)
    missing = rng.integers(0, 10, size)  # 0: none is missing
    contact = np.arange(1, 10) != missing[:, None]
    first = published.ONSETS[preset][0]
    if preset == "oberst2016":
        onset = np.array([first, *published.FIRST_ONSET_WITHOUT.values()])[missing]
    else:
        onset = np.full(size, first)
    friction = onset * rng.uniform(0.85, 1.15, size)
    return model.pencils(model.nominal(friction=friction, contact=contact))


@pytest.mark.parametrize("preset", published.ONSETS)
def test_known_verdicts_near_an_onset_are_exact(preset):
    pencils = near_onset(preset, 7, 125)
    matrices, _ = pencils.reduced()
    spectra = solve(pencils, certify="never")
    verdict, count = spectra.any_unstable, spectra.unstable_count
    flutter = np.array([oracle.exact_counts(matrix) for matrix in matrices])
    exact = flutter.sum(axis=1) > 0
    known = ~np.isnan(verdict)
    assert np.array_equal(verdict[known] == 1, exact[known])
    # A complex pair is one unstable mode, and so is a negative real root.
    counted = ~np.isnan(count)
    assert np.array_equal(count[counted], (flutter[:, 0] // 2 + flutter[:, 1])[counted])
    # The test is only worth something where it hurts.
    assert 0.05 < np.mean(~known) < 0.6
    assert 0.1 < exact.mean() < 0.9
    plain = np.array([oracle.lapack_unstable(matrix) for matrix in matrices])
    assert (plain != exact).any()
    # With the structured solver and the certificate nothing stays open, and nothing is wrong.
    for certify in ("auto", "always"):
        proved = solve(pencils, certify=certify)
        assert np.array_equal(proved.any_unstable, exact)
        assert np.array_equal(proved.unstable_count, flutter[:, 0] // 2 + flutter[:, 1])
        assert np.array_equal(proved.margin < 0, exact)


def test_false_flutter_of_plain_eigenvalues_is_not_believed():
    """kc / k = 1 / 0.2283 at friction 0.0525: LAPACK shows pairs, exact arithmetic has none."""
    ratio, friction = published.FALSE_FLUTTER
    model = hipuq.models.ring(contact_stiffness=ratio * published.SPRING_STIFFNESS)
    sample = model.nominal(friction=friction)
    matrix = model.pencils(sample).reduced()[0][0]
    assert oracle.exact_counts(matrix) == (0, 0)
    assert np.iscomplex(np.linalg.eigvals(matrix)).any()
    outcomes = model(sample)
    assert (outcomes["any_unstable"].values != 1).all()
    assert not (outcomes["unstable"].values == 1).any()


@pytest.mark.parametrize("count", [6, 7])
def test_mechanisms_are_no_flutter(count):
    """Rounding splits the double zero of two mechanisms into a tiny pair; declared, it is nothing."""
    model = hipuq.models.ring("oberst2016-calibrated")
    samples = hipuq.ContactPatterns(count).samples()
    size = samples.sizes["sample"]
    samples = samples.assign(friction=("sample", np.full(size, 0.3 * ONSET_CALIBRATED)))
    matrices, _ = model.pencils(samples).reduced()
    outcomes = model(samples)
    exact = np.array([oracle.exact_unstable(matrix) for matrix in matrices])
    verdict = outcomes["any_unstable"].values
    known = ~np.isnan(verdict)
    assert known.mean() > 0.9
    assert np.array_equal(verdict[known] == 1, exact[known])
    roots = np.linalg.eigvals(matrices)
    assert (np.sqrt(-roots.astype(complex)).real > 0).any(axis=1).any()


def test_the_oracle_knows_the_closed_forms():
    """The oracle itself: a rotation-like coupling is flutter, a diagonal is not, a zero is nothing."""
    assert oracle.exact_counts(np.array([[1.0, -1.0], [1.0, 1.0]])) == (2, 0)
    assert oracle.exact_counts(np.diag([1.0, 2.0, -3.0])) == (0, 1)
    assert oracle.exact_counts(np.diag([0.0, 2.0, 2.0])) == (0, 0)
    model = hipuq.models.two_dof("hoffmann2002")
    for side in (-1, 1):
        mu = published.HOFFMANN_ONSET * (1 + side * 1e-12)
        matrix = model.pencils(model.nominal(friction=mu)).reduced()[0][0]
        assert oracle.exact_unstable(matrix) is (side > 0)
