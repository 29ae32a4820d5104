"""What several tests need: pencils from plain matrices, random pencils, comparison of spectra."""

from dataclasses import fields

import numpy as np

from hipuq.cea import Pencils, Spectra


def pencils(
    stiffness, *, mass=None, friction_stiffness=None, friction=0.0, damping=None, mechanisms=0
) -> Pencils:
    """Return pencils of one sample from matrices, or of several from stacks of them."""
    stiffness = np.array(stiffness, dtype=float)
    stiffness = stiffness[None] if stiffness.ndim == 2 else stiffness
    s, n, _ = stiffness.shape

    def stack(matrix):
        return np.broadcast_to(np.array(matrix, dtype=float), (s, n, n)).copy()

    mass = np.ones(n) if mass is None else np.array(mass, dtype=float)
    shape = (s, n, n) if mass.shape[-2:] == (n, n) and mass.ndim > 1 else (s, n)
    return Pencils(
        mass=np.broadcast_to(mass, shape).copy(),
        stiffness=stiffness,
        friction_stiffness=stack(np.zeros((n, n)) if friction_stiffness is None else friction_stiffness),
        friction=np.broadcast_to(np.asarray(friction, dtype=float), (s,)).copy(),
        damping=None if damping is None else stack(damping),
        mechanisms=np.broadcast_to(np.asarray(mechanisms, dtype=np.intp), (s,)).copy(),
    )


def random_pencils(seed: int, s: int, n: int, *, damped: bool = False) -> Pencils:
    """Return pencils with a positive stiffness, nonsymmetric friction and, if asked, damping."""
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(s, n, n))
    return pencils(
        factor @ factor.transpose(0, 2, 1) + np.eye(n),
        mass=rng.uniform(0.5, 2.0, (s, n)),
        friction_stiffness=rng.normal(size=(s, n, n)),
        friction=rng.uniform(0.0, 2.0, s),
        damping=0.05 * (factor @ factor.transpose(0, 2, 1)) if damped else None,
    )


def assert_same_bits(one: Spectra, other: Spectra) -> None:
    """Assert that two spectra are identical to the last bit."""
    for field in fields(Spectra):
        a, b = getattr(one, field.name), getattr(other, field.name)
        assert a.dtype == b.dtype
        assert np.array_equal(a, b, equal_nan=a.dtype.kind == "f"), field.name


def joined(parts: list[Spectra]) -> Spectra:
    """Return the spectra of several batches as one."""
    return Spectra(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Spectra)))


SMALL_STUDY = """
title = "Small"
seed = 3
[model]
name = "ring"
preset = "oberst2016"
[inputs.friction]
distribution = "uniform"
lower = 0.0
upper = 0.1
[inputs.contact]
distribution = "contact_patterns"
in_contact = [8, 9]
"""
"""Head of a study file: a ring with uncertain friction and contact; analyses are to follow."""
