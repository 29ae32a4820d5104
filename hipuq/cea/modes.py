"""Mode shapes and the energies in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hipuq.cea.bounds import Complex
from hipuq.cea.numbering import TIE, mode_order
from hipuq.cea.pencils import Array, Pencils
from hipuq.errors import InputError


@dataclass(frozen=True)
class ModeShapes:
    """Mode shapes of one pencil with n modes by ascending frequency.

    Attributes
    ----------
    eigenvalue : (n,) complex array
        Eigenvalue l [1/s], with Im l >= 0.
    shape : (n, n) complex array
        Shape y of each mode along the degrees of freedom [m], normalised to a modal mass ``y^H M y`` of 1 kg
        m^2, turned in phase so that the largest entry is real and positive.
    strain_energy : (n,) array
        Mean over a cycle of the energy in the frictionless springs, ``y^H K0 y / 4`` [J].
    kinetic_energy : (n,) array
        Mean over a cycle, ``Im(l)^2 y^H M y / 4`` [J].
    friction_work : (n,) array
        Work of friction in one cycle, ``-pi Im(y^H mu K1 y)`` [J]: positive feeds the vibration.
    damping_work : (n,) array
        Work of damping in one cycle, ``-pi Im(l) y^H C y`` [J].
    """

    eigenvalue: Complex
    shape: Complex
    strain_energy: Array
    kinetic_energy: Array
    friction_work: Array
    damping_work: Array


def mode_shapes(pencils: Pencils) -> ModeShapes:
    """Compute the mode shapes of one pencil.

    Energies are those of the motion ``Re(y exp(i Im(l) t))``, that is with growth frozen over the
    cycle. The balance of an undamped mode is exact: friction work = 8 pi (Re l / Im l) times the
    mean kinetic energy (take the imaginary part of ``y^H (l^2 M + K) y = 0``).

    Parameters
    ----------
    pencils : Pencils
        One sample.

    Returns
    -------
    ModeShapes
        Of n modes by ascending frequency.

    Raises
    ------
    InputError
        If there is not exactly one sample.
    """
    if len(pencils.stiffness) != 1:
        raise InputError(f"mode shapes need exactly one sample, not {len(pencils.stiffness)}")
    values, vectors = _eigenpairs(pencils)
    mass = pencils.mass[0]
    mass = np.diag(mass) if mass.ndim == 1 else mass
    friction = pencils.friction[0] * pencils.friction_stiffness[0]
    damping = np.zeros_like(mass) if pencils.damping is None else pencils.damping[0]
    shape = vectors.T
    shape = shape / np.sqrt(_form(shape, mass).real)[:, None]
    largest = shape[np.arange(len(shape)), np.abs(shape).argmax(axis=1)]
    shape = shape * (np.abs(largest) / largest)[:, None]
    return ModeShapes(
        eigenvalue=values,
        shape=shape,
        strain_energy=_form(shape, pencils.stiffness[0]).real / 4,
        kinetic_energy=np.square(values.imag) / 4,
        friction_work=-np.pi * _form(shape, friction).imag,
        damping_work=-np.pi * values.imag * _form(shape, damping).real,
    )


def _form(shape: Complex, matrix: Array) -> Complex:
    """Return ``y^H A y`` of each mode, (n,)."""
    values: Complex = np.einsum("ki,ij,kj->k", shape.conj(), matrix, shape)
    return values


def _eigenpairs(pencils: Pencils) -> tuple[Complex, Complex]:
    """Return the n eigenvalues with Im l >= 0 by ascending frequency, and vectors as columns."""
    values: Complex
    vectors: Complex
    stiffness, damping = pencils.reduced()
    n = stiffness.shape[1]
    if damping is None or not damping.any():
        squares, right = np.linalg.eig(stiffness[0])
        vectors = right.astype(np.complex128)
        root = np.sqrt(squares.astype(np.complex128))
        # Of the two roots +-l of a divergent mode the growing one stands for it.
        values = np.where(squares.imag == 0, root.imag + 1j * root.real, 1j * root).astype(np.complex128)
    else:
        rate = np.sqrt(np.linalg.norm(stiffness[0]))
        states = np.block(
            [
                [np.zeros((n, n)), np.eye(n)],
                [-stiffness[0] / rate**2, -damping[0] / rate],
            ]
        )
        roots, right = np.linalg.eig(states)
        values = (roots * rate).astype(np.complex128)
        keep = np.lexsort((-values.real, -np.sign(values.imag)))[:n]
        values, vectors = values[keep], right[:n, keep].astype(np.complex128)
    values[np.argsort(np.abs(values), kind="stable")[: pencils.mechanisms[0]]] = 0.0
    tie = 0.0 if damping is None or not damping.any() else TIE
    frequency = np.where(values == 0, -1.0, values.imag)
    order = mode_order(frequency[None], values.real[None], tie)[0]
    return values[order], _unreduced(pencils.mass[0], vectors[:, order])


def _unreduced(mass: Array, vectors: Complex) -> Complex:
    """Return the vectors in the degrees of freedom of the pencil: ``L^-T z`` with ``M = L L^T``."""
    if mass.ndim == 1:
        return vectors / np.sqrt(mass)[:, None]
    return np.linalg.solve(np.linalg.cholesky(mass).T, vectors).astype(np.complex128)
