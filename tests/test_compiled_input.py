"""The compiled kernel and what may be handed to it: odd numbers, odd arrays, places outside the matrix."""

import numpy as np
import pytest

import hipuq
from hipuq.cea import CompactPencils, Entries, Pencils, solve
from hipuq.cea.bounds import norms
from hipuq.cea.spectra import Spectra
from hipuq.compiled import binding
from hipuq.compiled.angles import cosine_and_sine
from hipuq.errors import InputError


def pencils(matrices, filter_radius=0.0, **changed):
    """Return pencils of unit mass without friction."""
    s, n = matrices.shape[:2]
    parts = {
        "mass": np.ones((s, n)),
        "stiffness": matrices,
        "friction_stiffness": np.zeros_like(matrices),
        "friction": np.zeros(s),
        "damping": None,
        "mechanisms": np.zeros(s, int),
        "filter_radius": filter_radius,
    }
    return Pencils(**parts | changed)


def graded(rng, s, n):
    """Return sparse matrices with entries over thirty decades."""
    entries = rng.normal(size=(s, n, n)) * 10.0 ** rng.integers(-30, 1, (s, n, n))
    return entries * (rng.random((s, n, n)) < 0.6) + np.eye(n) * rng.integers(1, 3)


def scaled(rng, s, n):
    """Return integer matrices in a basis that stretches over fifty powers of two."""
    scale = 2.0 ** rng.integers(-25, 26, (s, n))
    return (rng.integers(-1, 2, (s, n, n)) + 4.0 * np.eye(n)) * scale[:, :, None] / scale[:, None, :]


def nearly_defective(rng, s, n):
    """Return turned triangles with equal eigenvalues and little below the diagonal."""
    diagonal = np.repeat(rng.integers(1, 4, (s, (n + 1) // 2)), 2, axis=1)[:, :n]
    matrices = np.triu(rng.normal(size=(s, n, n)), 1) + diagonal[:, :, None] * np.eye(n)
    matrices += np.tril(rng.normal(size=(s, n, n)), -1) * 10.0 ** rng.uniform(-17, -3, (s, 1, 1))
    turn = np.linalg.qr(rng.normal(size=(s, n, n)))[0]
    return turn @ matrices @ turn.transpose(0, 2, 1)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("kind", [graded, scaled, nearly_defective])
def test_what_is_known_is_so(kind):
    """Balancing hides how ill-conditioned a matrix is: a bound must hold in the basis that rounds."""
    rng = np.random.default_rng(7)
    known = 0
    for n in (2, 3, 5, 7):
        matrices = kind(rng, 40, n)
        found, exact = (solve(pencils(matrices), certify=how) for how in ("never", "always"))
        both = ~np.isnan(found.any_unstable) & ~np.isnan(exact.any_unstable)
        assert np.array_equal(found.any_unstable[both], exact.any_unstable[both])
        known += both.sum()
    assert known > 50


@pytest.mark.parametrize("size", [1e-150, 1e-158, 1e-160, 1e-161, 1e-162, 1e-300])
@pytest.mark.parametrize("filter_radius", [0.0, 1e-8])
def test_a_column_whose_squares_lose_digits(size, filter_radius):
    rng = np.random.default_rng(0)
    matrices = np.zeros((40, 4, 4))
    matrices[:, 0, 0] = 0.5
    matrices[:, 1:, 1:] = rng.normal(size=(40, 3, 3)) + 3 * np.eye(3)
    matrices[:, 1:, 0] = size * rng.normal(size=(40, 3))
    found = solve(pencils(matrices, filter_radius)).any_unstable
    assert np.array_equal(found, solve(pencils(matrices), certify="always").any_unstable)


@pytest.mark.parametrize("dtype", ["f4", ">f8", "i8", "i4"])
def test_other_types_of_number(dtype):
    rng = np.random.default_rng(1)
    root = rng.integers(-3, 4, (50, 4, 4))
    stiffness, slope = (
        root @ root.transpose(0, 2, 1) + 5 * np.eye(4, dtype=int),
        rng.integers(-9, 9, (50, 4, 4)),
    )
    expected, found = (
        solve(
            pencils(
                stiffness.astype(own),
                friction_stiffness=slope.astype(own),
                friction=np.ones(50, own),
                mass=np.full((50, 4), 2, own),
            )
        )
        for own in ("f8", dtype)
    )
    assert 0 < expected.any_unstable.mean() < 1
    for name in Spectra.__dataclass_fields__:
        assert np.array_equal(getattr(found, name), getattr(expected, name), equal_nan=True)


@pytest.mark.parametrize("size", [1e-161, 1e-170, 1e-3, 1e130])
def test_odd_units(size):
    """Squares of roots leave the range of doubles: the verdict and the frequencies do not."""
    matrices = size * np.array([[[2.0, -0.5], [0.25, 1.0]], [[2.0, -4.0], [4.0, 1.0]]])
    found = solve(pencils(matrices))
    assert found.any_unstable.tolist() == [0.0, 1.0]
    expected = np.sort(np.sqrt(np.linalg.eigvals(matrices[0] / size))) * np.sqrt(size) / (2 * np.pi)
    assert found.frequency[0] == pytest.approx(expected, rel=1e-12)
    assert norms(matrices) == pytest.approx(size * norms(matrices / size), rel=1e-15)


def test_a_light_mass_matrix_may_make_large_entries():
    stiffness, mass = np.diag([1e135, 4e135])[None], 1e-10 * np.eye(2)[None]
    whole, diagonal = (solve(pencils(stiffness, mass=own)) for own in (mass, np.full((1, 2), 1e-10)))
    assert whole.frequency == pytest.approx(diagonal.frequency, rel=1e-14)


def entries(**changed):
    values = {
        "values": np.ones((2, 3)),
        "source": np.array([0, 1]),
        "row": np.array([0, 1]),
        "column": np.array([0, 1]),
    }
    return Entries(**values | changed)


@pytest.mark.parametrize(
    "changed, message",
    [
        ({"source": np.array([0, 2])}, "take one of 2 values"),
        ({"source": np.array([0, -1])}, "from 0 on"),
        ({"row": np.array([0, -1])}, "from 0 on"),
        ({"row": np.array([0, 1, 1])}, "of one length"),
        ({"values": np.ones(3)}, "values \\(m, samples\\)"),
    ],
)
def test_places_of_entries_are_checked(changed, message):
    with pytest.raises(InputError, match=message):
        entries(**changed)


@pytest.mark.parametrize(
    "changed, message",
    [
        ({"stiffness": (entries(row=np.array([0, 2])),)}, "reach to row or column 2: there are 2 masses"),
        ({"friction_stiffness": (entries(column=np.array([9, 0])),)}, "column 9"),
        ({"stiffness": (entries(values=np.ones((2, 7))),)}, "one length"),
        ({"mass": np.ones((2, 7))}, "one length"),
        ({"mechanisms": np.zeros(2, int)}, "one length"),
        ({"friction": np.zeros((3, 1))}, "one length"),
    ],
)
def test_shapes_of_compact_pencils_are_checked(changed, message):
    parts = {
        "mass": np.ones((2, 1)),
        "stiffness": (entries(),),
        "friction_stiffness": (),
        "friction": np.zeros(3),
        "mechanisms": np.zeros(3, int),
    }
    assert solve(CompactPencils(**parts)).any_unstable.tolist() == [0.0] * 3
    with pytest.raises(InputError, match=message):
        CompactPencils(**parts | changed)


def test_places_of_any_integers_are_taken():
    wide = {name: np.array([0, 9, 1, 9], np.int64)[::2] for name in ("source", "row", "column")}
    assert entries(**wide).row.tolist() == [0, 1]
    assert entries(**wide).row.dtype == np.int32


def test_the_angle_may_be_one_number():
    cosine, sine = cosine_and_sine(np.array(60.0))
    assert cosine.shape == sine.shape == ()
    assert cosine == pytest.approx(0.5)


def test_a_root_that_happens_to_be_zero_is_no_mechanism():
    """Two oscillators stand in line with their springs, so modes across them have no stiffness."""
    model = hipuq.models.ring(oscillators=2, growth_threshold=5.0, damping_ratio=0.003)
    outcomes = model(model.nominal(friction=np.linspace(0.0, 0.5, 20)))
    certified = outcomes["decided_by"] == 2
    assert (outcomes["mechanisms"].where(~certified, 0) == 0).all()


def test_a_library_that_does_not_load_is_told_of(monkeypatch, tmp_path):
    (tmp_path / binding.FILE).write_bytes(b"no library")
    monkeypatch.setattr(binding, "__file__", str(tmp_path / "binding.py"))
    monkeypatch.delenv(binding.SWITCH, raising=False)
    with pytest.warns(RuntimeWarning, match="does not load"):
        assert binding.kernel.__wrapped__() is None
