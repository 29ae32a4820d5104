"""A batch of pencils ``l**2 M + l C + K0 + mu K1`` and its reduction to unit mass."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq.errors import InputError

Array = NDArray[np.float64]


LARGEST = 1e140
"""Largest entry: squares of entries must stay in the range of doubles."""


def as_doubles(values: Array) -> Array:
    """Return values as native doubles, themselves if they are that."""
    return np.require(values, np.float64, "A")


@dataclass(frozen=True)
class Pencils:
    """Matrices of a batch of s samples with n degrees of freedom.

    Attributes
    ----------
    mass : (s, n) or (s, n, n) array
        Masses of a diagonal M, or symmetric positive definite M [kg].
    stiffness : (s, n, n) array
        K0, the stiffness without friction [N/m].
    friction_stiffness : (s, n, n) array
        K1 = dK / dmu [N/m]; what makes K nonsymmetric.
    friction : (s,) array
        Friction coefficient mu [1].
    damping : (s, n, n) array or None
        C [N s/m]; None without damping.
    mechanisms : (s,) array of int
        Number of rigid mechanisms: dimension of the null space that K0 + mu K1 has for every mu by
        construction. Floating point cannot find it, so the model declares it.
    filter_radius : float
        Radius, relative to the norm [1], that was shown by exact arithmetic to hold the errors of
        eigenvalues of this family of matrices, LAPACK's and the compiled kernel's, where no verdict is closer
        to changing. 0 for matrices of which nothing is known: every verdict then needs condition numbers.

    Raises
    ------
    InputError
        If shapes do not fit, values are not finite or above 1e140, masses of a diagonal M are not positive,
        or mechanisms are not from 0 to n - 1.
    """

    mass: Array
    stiffness: Array
    friction_stiffness: Array
    friction: Array
    damping: Array | None
    mechanisms: NDArray[np.intp]
    filter_radius: float = 0.0

    def __post_init__(self) -> None:
        for name in ("mass", "stiffness", "friction_stiffness", "friction", "damping"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, as_doubles(getattr(self, name)))
        shape = self.stiffness.shape
        if len(shape) != 3 or shape[1] != shape[2]:
            raise InputError(f"stiffness must have the shape (samples, n, n), not {shape}")
        s, n, _ = shape
        expected: dict[str, tuple[tuple[int, ...], ...]] = {
            "mass": ((s, n), (s, n, n)),
            "friction_stiffness": ((s, n, n),),
            "friction": ((s,),),
            "damping": ((s, n, n),),
            "mechanisms": ((s,),),
        }
        for name, shapes in expected.items():
            value = getattr(self, name)
            if value is not None and value.shape not in shapes:
                allowed = " or ".join(map(str, shapes))
                raise InputError(f"{name} must have the shape {allowed}, not {value.shape}")
        for name in ("mass", "stiffness", "friction_stiffness", "friction", "damping"):
            value = getattr(self, name)
            if value is not None and not np.isfinite(value).all():
                bad = int(np.argmin(np.isfinite(value).reshape(s, -1).all(axis=1)))
                raise InputError(f"{name} holds a value that is not finite, first in sample {bad}")
            if value is not None and np.abs(value).max(initial=0.0) > LARGEST:
                raise InputError(f"{name} holds a value above {LARGEST:g}: choose other units")
        if self.mass.ndim == 2 and not (self.mass > 0).all():
            bad = int(np.argmin((self.mass > 0).all(axis=1)))
            raise InputError(f"mass must be positive, it is {self.mass[bad].min()} in sample {bad}")
        if (self.mechanisms < 0).any() or (self.mechanisms >= n).any():
            raise InputError(f"mechanisms must lie between 0 and {n - 1}, they are {self.mechanisms}")

    @property
    def size(self) -> int:
        """Number of degrees of freedom n."""
        return int(self.stiffness.shape[1])

    @property
    def damped(self) -> NDArray[np.bool_]:
        """Whether a sample has any damping, (s,)."""
        if self.damping is None:
            return np.zeros(len(self.friction), np.bool_)
        return np.asarray(self.damping.any(axis=(1, 2)), np.bool_)

    @property
    def total_stiffness(self) -> Array:
        """K = K0 + mu K1, (s, n, n) [N/m]."""
        total: Array = self.friction_stiffness * self.friction[:, None, None]
        total += self.stiffness
        return total

    def reduced(self) -> tuple[Array, Array | None]:
        """Return ``A = L^-1 K L^-T`` and ``D = L^-1 C L^-T`` with ``M = L L^T``.

        Congruence keeps a symmetric matrix symmetric, and with it the accuracy of its eigenvalues,
        which ``M^-1 K`` would lose.

        Returns
        -------
        stiffness : (s, n, n) array
            A [1/s^2].
        damping : (s, n, n) array or None
            D [1/s].

        Raises
        ------
        InputError
            If a mass matrix is not positive definite.
        """
        stiffness = self.total_stiffness
        if self.mass.ndim == 2:
            scale = 1.0 / np.sqrt(self.mass)
            weight = scale[:, :, None] * scale[:, None, :]
            stiffness *= weight
            return stiffness, None if self.damping is None else self.damping * weight
        try:
            inverse = np.linalg.inv(np.linalg.cholesky(self.mass))
        except np.linalg.LinAlgError as error:
            raise InputError("mass matrix is not positive definite") from error
        damping = None if self.damping is None else _congruent(inverse, self.damping)
        return _congruent(inverse, stiffness), damping

    def reduced_parts(self) -> tuple[Array, Array]:
        """Return ``L^-1 K0 L^-T`` and ``L^-1 K1 L^-T``, the parts of A = A0 + mu A1.

        Returns
        -------
        constant : (s, n, n) array
            A0 [1/s^2].
        slope : (s, n, n) array
            A1 [1/s^2].

        Raises
        ------
        InputError
            If a mass matrix is not positive definite.
        """
        none = np.zeros_like(self.friction_stiffness)
        parts = (
            replace(self, stiffness=part, friction_stiffness=none, damping=None)
            for part in (self.stiffness, self.friction_stiffness)
        )
        constant, slope = (part.reduced()[0] for part in parts)
        return constant, slope

    def rows(self, index: Any) -> Pencils:
        """Return the pencils of the samples that `index` selects.

        Parameters
        ----------
        index : (k,) array of int or bool, or slice
            Which samples.

        Returns
        -------
        Pencils
            Of these samples, in the order of `index`.
        """
        return Pencils(
            self.mass[index],
            self.stiffness[index],
            self.friction_stiffness[index],
            self.friction[index],
            None if self.damping is None else self.damping[index],
            self.mechanisms[index],
            self.filter_radius,
        )


def _congruent(inverse: Array, matrices: Array) -> Array:
    """Return ``X K X^T`` of a batch, symmetric to the last bit where K is."""
    found = inverse @ matrices @ inverse.transpose(0, 2, 1)
    symmetric = (matrices == matrices.transpose(0, 2, 1)).all(axis=(1, 2))
    found[symmetric] = (found[symmetric] + found[symmetric].transpose(0, 2, 1)) / 2
    return found
