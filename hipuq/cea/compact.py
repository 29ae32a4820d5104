"""A batch of pencils by the entries of its matrices: a fraction of their numbers, the sample last."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.entries import Entries, dense
from hipuq.cea.pencils import LARGEST, Array, Pencils, as_doubles
from hipuq.errors import InputError


@dataclass(frozen=True)
class CompactPencils:
    """Undamped pencils ``l**2 M + K0 + mu K1`` of s samples with n degrees of freedom, by their entries.

    Attributes
    ----------
    mass : (n, s) or (n, 1) array
        Masses of a diagonal M [kg].
    stiffness, friction_stiffness : tuple of Entries
        K0 and K1 [N/m], sums of their parts.
    friction : (s,) array
        Friction coefficient mu [1].
    mechanisms : (s,) array of int
        As in `Pencils`.
    filter_radius : float
        As in `Pencils` [1].
    trusted : bool
        Whether the numbers were checked before; shapes always are.

    Raises
    ------
    InputError
        As `Pencils`.
    """

    mass: Array
    stiffness: tuple[Entries, ...]
    friction_stiffness: tuple[Entries, ...]
    friction: Array
    mechanisms: NDArray[np.intp]
    filter_radius: float = 0.0
    trusted: bool = False

    @property
    def size(self) -> int:
        """Number of degrees of freedom n."""
        return len(self.mass)

    def __post_init__(self) -> None:
        for name in ("mass", "friction"):
            object.__setattr__(self, name, as_doubles(getattr(self, name)))
        samples, parts = self.friction.size, (*self.stiffness, *self.friction_stiffness)
        shapes = self.friction.shape, self.mechanisms.shape
        columns = {part.values.shape[1] for part in parts} | set(self.mass.shape[1:])
        if shapes != ((samples,), (samples,)) or self.mass.ndim != 2 or not columns <= {1, samples}:
            raise InputError(
                f"friction and mechanisms must have one length, values and masses that many columns or one: "
                f"their shapes are {shapes}, the columns {columns}"
            )
        reach = max((part.reach for part in parts), default=-1)
        if reach >= self.size:
            raise InputError(f"entries reach to row or column {reach}: there are {self.size} masses")
        if self.trusted:
            return
        numbers = [part.values for part in parts]
        fine = all(
            values.max(initial=0.0) <= LARGEST and values.min(initial=0.0) >= -LARGEST
            for values in (*numbers, self.friction)
        )
        fine &= bool(((self.mass > 0) & (self.mass <= LARGEST)).all())
        fine &= bool(((self.mechanisms >= 0) & (self.mechanisms < len(self.mass))).all())
        if not fine:
            self.rows()

    @classmethod
    def of(cls, pencils: Pencils) -> CompactPencils:
        """Return the same matrices without their damping, without a copy of diagonal masses and stiffness.

        Parameters
        ----------
        pencils : Pencils
            Of s samples; a mass matrix that is not diagonal is reduced to unit mass.

        Returns
        -------
        CompactPencils
            Of the same samples.
        """
        rest = pencils.friction, pencils.mechanisms, pencils.filter_radius, True
        if pencils.mass.ndim == 2:
            stiffness, friction_stiffness = Entries.whole(pencils.stiffness), pencils.friction_stiffness
            return cls(pencils.mass.T, (stiffness,), (Entries.whole(friction_stiffness),), *rest)
        reduced = Entries.whole(replace(pencils, damping=None).reduced()[0])
        return cls(np.ones((pencils.stiffness.shape[1], 1)), (reduced,), (), *rest)

    def rows(self, samples: NDArray[np.intp] | slice = slice(None)) -> Pencils:
        """Return the matrices of some samples, all by default.

        Parameters
        ----------
        samples : (k,) array of int or slice
            Which samples.

        Returns
        -------
        Pencils
            Of these samples, in the same order.

        Raises
        ------
        InputError
            As `Pencils`, whose messages name what is wrong.
        """
        friction = self.friction[samples]
        size, count = len(self.mass), len(friction)
        mass = self.mass if self.mass.shape[1] == 1 else self.mass[:, samples]
        stiffness, friction_stiffness = (
            dense([part.of(samples) for part in parts], count, size)
            for parts in (self.stiffness, self.friction_stiffness)
        )
        return Pencils(
            mass=np.ascontiguousarray(np.broadcast_to(mass, (size, count)).T),
            stiffness=stiffness,
            friction_stiffness=friction_stiffness,
            friction=friction,
            damping=None,
            mechanisms=self.mechanisms[samples],
            filter_radius=self.filter_radius,
        )
