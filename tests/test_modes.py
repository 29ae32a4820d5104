"""Mode shapes: they solve the eigenvalue problem, are normalised, and their energies balance."""

import numpy as np
import pytest
from helpers import pencils, random_pencils

import hipuq
from hipuq.cea import mode_shapes, solve
from hipuq.errors import InputError


def cases():
    """Return pencils of one sample: stable, fluttering, damped, with a mechanism, full mass."""
    ring = hipuq.models.ring()
    hulten = hipuq.models.two_dof("hulten", damping_1=0.02, damping_2=0.06)
    contact = [True] * 3 + [False] + [True] * 3 + [False] * 2
    full_mass = pencils(
        [[2.0, -1.0], [-1.0, 1.0]],
        mass=[[3, 1], [1, 1]],
        friction_stiffness=[[-1, 1], [0, 0]],
        friction=3.0,
    )
    return {
        "ring stable": ring.pencils(ring.nominal(friction=0.0)),
        "ring flutter": ring.pencils(ring.nominal(friction=0.1)),
        "ring damped": ring.pencils(ring.nominal(friction=0.1, damping_ratio=0.01)),
        "ring mechanisms": ring.pencils(ring.nominal(friction=0.05, contact=np.array(contact))),
        "hulten": hulten.pencils(hulten.nominal(friction=0.4)),
        "ziegler": full_mass,
        "random": random_pencils(3, 1, 6, damped=True),
    }


CASES = cases()


def matrices(case):
    mass = np.diag(case.mass[0]) if case.mass.ndim == 2 else case.mass[0]
    damping = np.zeros_like(mass) if case.damping is None else case.damping[0]
    return mass, damping, case.stiffness[0], case.friction[0] * case.friction_stiffness[0]


@pytest.mark.parametrize("name", CASES)
def test_shapes_solve_the_eigenvalue_problem(name):
    shapes = mode_shapes(CASES[name])
    mass, damping, stiffness, friction = matrices(CASES[name])
    for value, y in zip(shapes.eigenvalue, shapes.shape, strict=True):
        terms = [value**2 * mass @ y, value * damping @ y, (stiffness + friction) @ y]
        scale = np.linalg.norm(stiffness) * np.linalg.norm(y)
        assert np.linalg.norm(sum(terms)) < 1e-11 * scale


@pytest.mark.parametrize("name", CASES)
def test_shapes_are_normalised(name):
    """Unit modal mass, the largest entry real and positive."""
    shapes = mode_shapes(CASES[name])
    mass = matrices(CASES[name])[0]
    assert np.einsum("ki,ij,kj->k", shapes.shape.conj(), mass, shapes.shape) == pytest.approx(1)
    largest = shapes.shape[np.arange(len(shapes.shape)), np.abs(shapes.shape).argmax(axis=1)]
    assert (largest.real > 0).all()
    assert np.abs(largest.imag).max() < 1e-12 * largest.real.max()


@pytest.mark.parametrize("name", CASES)
def test_shapes_are_numbered_as_the_spectrum(name):
    shapes, spectra = mode_shapes(CASES[name]), solve(CASES[name])
    scale = np.abs(shapes.eigenvalue).max()
    assert shapes.eigenvalue.imag / (2 * np.pi) == pytest.approx(spectra.frequency[0], rel=1e-6)
    assert shapes.eigenvalue.real == pytest.approx(spectra.growth_rate[0], abs=1e-6 * scale)


@pytest.mark.parametrize("name", CASES)
def test_energies_balance(name):
    """Work of friction and damping in a cycle raises the kinetic energy: 8 pi growth / omega times it.

    Both parts of y^H (l^2 M + l C + K0 + mu K1) y = 0 with l = g + i w and y^H M y = 1.
    """
    shapes = mode_shapes(CASES[name])
    _, damping, _, friction = matrices(CASES[name])
    moving = shapes.eigenvalue.imag > 0
    assert moving.sum() >= 2
    g, w, y = shapes.eigenvalue.real[moving], shapes.eigenvalue.imag[moving], shapes.shape[moving]
    work = shapes.friction_work[moving] + shapes.damping_work[moving]
    scale = np.pi * w.max() ** 2
    assert work == pytest.approx(8 * np.pi * g / w * shapes.kinetic_energy[moving], abs=1e-9 * scale)
    drag = np.einsum("ki,ij,kj->k", y.conj(), damping, y).real
    pull = np.einsum("ki,ij,kj->k", y.conj(), friction, y).real
    strain = (w**2 - g**2 - g * drag - pull) / 4
    assert shapes.strain_energy[moving] == pytest.approx(strain, abs=1e-9 * scale)


def test_friction_feeds_the_growing_mode_only():
    shapes = mode_shapes(CASES["ring flutter"])
    growing = shapes.eigenvalue.real > 1
    decaying = shapes.eigenvalue.real < -1
    assert growing.sum() == decaying.sum() == 4
    assert (shapes.friction_work[growing] > 0).all() and (shapes.friction_work[decaying] < 0).all()


def test_damping_takes_energy():
    assert (mode_shapes(CASES["ring damped"]).damping_work < 0).all()


def test_one_sample_is_asked_for():
    with pytest.raises(InputError, match="exactly one sample, not 3"):
        mode_shapes(random_pencils(0, 3, 2))


def test_labelled_shapes_agree_with_the_kernel():
    """The wrapper of the ring gives the same numbers over (mode, oscillator, axis)."""
    model = hipuq.models.ring()
    labelled = model.mode_shapes(model.nominal(friction=0.1))
    plain = mode_shapes(CASES["ring flutter"])
    assert labelled["displacement_real"].dims == ("mode", "oscillator", "axis")
    assert np.array_equal(labelled["displacement_imag"].values.reshape(18, 18), plain.shape.imag)
    assert np.array_equal(labelled["friction_work"], plain.friction_work)
    radius = np.hypot(*labelled["position"].transpose("axis", "oscillator").values)
    assert radius == pytest.approx(1)


def test_modes_have_the_numbers_that_the_kernel_gives():
    """Damped pairs whose frequencies agree but for rounding, and divergent modes of frequency 0."""
    ring = hipuq.models.ring(mass_damping=20.0)
    for friction in np.linspace(0.05, 0.2, 20):
        case = ring.pencils(ring.nominal(friction=friction))
        assert mode_shapes(case).eigenvalue.real == pytest.approx(solve(case).growth_rate[0], abs=1e-3)
    for drag in (None, 1e-9 * np.eye(3)):
        case = pencils(np.diag([-1.0, -4.0, 9.0]), damping=drag)
        assert solve(case).growth_rate[0] == pytest.approx([1, 2, 0], abs=1e-8)
        assert mode_shapes(case).eigenvalue.real == pytest.approx([1, 2, 0], abs=1e-8)
