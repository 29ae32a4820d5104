"""Matrices of any origin, such as a finite-element program, as a model."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from hipuq import schema
from hipuq.cea import Pencils
from hipuq.cea.sensitivity import Derivatives
from hipuq.errors import InputError
from hipuq.models.base import LINEAR, CEAModel
from hipuq.models.damping import DAMPING, damping_derivative, damping_matrices
from hipuq.models.matrix_input import (
    KINDS,
    check_definite,
    check_mechanisms,
    checked,
    nominal_values,
    without_damping,
)
from hipuq.models.parameter import Parameter
from hipuq.sampling import check_count

Array = NDArray[np.float64]
Matrices = Mapping[str, Array]

NUMBERS = 2**22
"""Numbers that one matrix of all samples of a block has at most: 32 MiB."""

LIMITS = (
    "Verdicts hold for the matrices as they were given: they tell nothing of the mesh, of a reduction to "
    "few modes, or of the state of sliding that the matrices were taken at",
)
"""Limits of every model made from matrices."""


class MatrixModel(CEAModel):
    """Constant matrices, and parts of them that parameters scale. Made by `from_matrices`."""

    name = "matrices"
    limits: ClassVar[tuple[str, ...]] = (*LIMITS, *LINEAR)

    def __init__(
        self,
        base: Matrices,
        parts: Mapping[str, Matrices],
        parameters: Mapping[str, Parameter],
        mechanisms: int,
        **options: Any,
    ) -> None:
        super().__init__(parameters=parameters, **options)
        self.base, self.parts, self.mechanisms = dict(base), dict(parts), mechanisms
        self.block = min(CEAModel.block, max(1, NUMBERS // self.dofs**2))

    @property
    def dofs(self) -> int:
        """Number of degrees of freedom."""
        return len(self.base["stiffness"])

    @property
    def label(self) -> str:
        """What `from_matrices` was told to call it."""
        return self.preset

    @property
    def options(self) -> dict[str, Any]:
        """The model as JSON-able options: of each matrix the SHA-256 of its numbers."""
        matrices = dict(self.base) | {
            f"{name}.{kind}": matrix for name, part in self.parts.items() for kind, matrix in part.items()
        }
        digests = {name: _digest(matrix) for name, matrix in matrices.items()}
        return super().options | {"mechanisms": self.mechanisms, "matrices": digests}

    def assemble(self, values: Mapping[str, Array]) -> Pencils:
        """Return the matrices of a batch: the constant ones, and value times matrix of every part.

        Parameters
        ----------
        values : mapping
            Every parameter, each (s,).

        Returns
        -------
        Pencils
        """
        mass, stiffness, friction_stiffness = (self.total(kind, values) for kind in KINDS[:3])
        if "damping" in self.base:
            damping: Array | None = self.total("damping", values)
        else:
            damping = damping_matrices(mass, stiffness, values)
        return Pencils(
            mass=mass,
            stiffness=stiffness,
            friction_stiffness=friction_stiffness,
            friction=np.array(values["friction"]),
            damping=damping if damping is not None and damping.any() else None,
            mechanisms=np.full(len(stiffness), self.mechanisms, np.intp),
        )

    def total(self, kind: str, values: Mapping[str, Array]) -> Array:
        """Return the matrices of one kind, (s, n, n), or (s, n) for masses if all of them are diagonal.

        Parameters
        ----------
        kind : str
            One of `hipuq.models.matrix_input.KINDS`, and of those that the model has.
        values : mapping
            As `assemble`.
        """
        base = self.base[kind]
        total = np.repeat(base[None], len(values["friction"]), axis=0)
        for name, part in self.parts.items():
            if kind in part:
                # One after the other, not as one product: numbers must not depend on the batch.
                total += values[name].reshape(-1, *[1] * base.ndim) * part[kind]
        return total

    def derivatives(self, values: Mapping[str, Array], names: Iterable[str]) -> Derivatives:
        """Return the exact derivatives of the matrices of one sample.

        Parameters
        ----------
        values : mapping
            Every parameter, each (1,).
        names : iterable of str
            Parameters with respect to which, all but friction.

        Returns
        -------
        Derivatives
        """
        mass, stiffness = self.total("mass", values), self.total("stiffness", values)
        found: dict[str, list[Array]] = {kind: [] for kind in KINDS}
        for name in names:
            part = self.parts.get(name, {})
            own = {kind: part.get(kind, np.zeros_like(base)) for kind, base in self.base.items()}
            if "damping" not in self.base:
                if name in DAMPING:  # in each of them it is linear
                    made = damping_matrices(mass, stiffness, {name: np.ones(1)})
                    assert made is not None
                    own["damping"] = made[0]
                else:
                    changes = own["mass"], own["stiffness"]
                    own["damping"] = damping_derivative(mass[0], stiffness[0], *changes, values)
            for kind, one in own.items():
                found[kind].append(one)
        return Derivatives(**{kind: np.stack(every) for kind, every in found.items()})


def from_matrices(
    mass: object,
    stiffness: object,
    friction_stiffness: object,
    damping: object = None,
    *,
    parts: Mapping[str, Mapping[str, object]] | None = None,
    nominal: Mapping[str, float] | None = None,
    mechanisms: int = 0,
    label: str = "matrices",
    growth_threshold: float = 0.0,
    certify: str = "auto",
) -> CEAModel:
    """Return a model made of matrices, such as those that a finite-element program exports.

    It solves ``l^2 M + l C + K0 + mu K1``. With parts, each of these matrices is the one given and, for
    every part that has a matrix of that kind, value times matrix: ``K0 = stiffness + sum p_i K_i``. So what
    varies is left out of `stiffness` itself; a part with the nominal value 0 is a change of it instead.

    Parameters
    ----------
    mass : (n, n) or (n,) array
        M, symmetric positive definite, or the masses of a diagonal one [kg].
    stiffness : (n, n) array
        K0, the stiffness at steady sliding without friction [N/m]. It need not be symmetric.
    friction_stiffness : (n, n) array
        K1 = dK / dmu [N/m], which makes K nonsymmetric; the stiffness must be linear in mu.
    damping : (n, n) array, optional
        C [N s/m].
    parts : mapping, optional
        Name of a parameter, one that hipuq does not use itself -> the matrices that it scales: ``"mass"``,
        ``"stiffness"``, ``"friction_stiffness"``, ``"damping"``, one or several, such as those of one
        contact.
    nominal : mapping, optional
        Nominal values other than 1 for a part [1], and 0 for ``friction`` and the damping parameters, in the
        units of the schema.
    mechanisms : int, default 0
        Number of motions that neither stiffness nor friction resists, at any value of the parameters:
        of rigid bodies, of parts without a spring. Rounding hides them from the solver. Too few are an
        error here, at nominal values; too many leave samples undecided, or take a soft motion for one that
        nothing resists: count them from the structure, not from the message.
    label : str, default "matrices"
        What results call it.
    growth_threshold : float, default 0
        Growth rate above which a mode counts as unstable [1/s].
    certify : str, default "auto"
        ``"auto"``: verdicts that double precision leaves open are decided by the structured solver
        or by exact arithmetic. ``"always"``: all by exact arithmetic. ``"never"``: they stay unknown.

    Returns
    -------
    CEAModel
        Its parameters are ``friction``, a factor for each part, and without any damping matrix
        ``mass_damping`` and ``stiffness_damping``, and ``damping_ratio`` if every stiffness is symmetric.

    Raises
    ------
    InputError
        If a matrix or a value cannot be used; the message names it.
    UnknownNameError
        If a part has a matrix, or `nominal` a parameter, that there is not.

    Notes
    -----
    Matrices are arrays, what NumPy makes an array of, or sparse ones of SciPy; they are copied, and made
    dense. One whose halves differ by less than 1e-12 of its largest entry is taken as symmetric. Other units
    than these are possible if they go together, as N, mm, t and s do.

    The cost of a sample grows with the third power of n, and faster where friction is integrated: reduce
    large models to some ten modes first. Verdicts hold for the matrices as given, not for the reduction.

    Values at which a part that holds the structure vanishes have more mechanisms than declared, and verdicts
    there are worth nothing: leave them out.

    Examples
    --------
    The model of Hoffmann et al. (2002), whose contact spring comes with its friction:

    >>> import hipuq
    >>> contact = {
    ...     "stiffness": [[0, 0], [0, 11]],
    ...     "friction_stiffness": [[0, -11], [0, 0]],
    ... }
    >>> springs = [[23.25, 3.897114317029974], [3.897114317029974, 7.75]]
    >>> model = hipuq.models.from_matrices(
    ...     [1, 1], springs, [[0, 0], [0, 0]], parts={"contact_factor": contact}
    ... )
    >>> round(hipuq.unstable_friction(model, upper=0.8)["friction"].item(), 12)
    0.472377492973
    """
    if not isinstance(label, str) or not label.isprintable() or not label.strip():
        raise InputError(f"label is {label!r}: it must be a name, in one line")
    given = zip(KINDS, (mass, stiffness, friction_stiffness, damping), strict=True)
    base, scaled = checked(dict(given), parts)
    missing = without_damping(base, scaled)
    values = {"friction": 0.0} | dict.fromkeys(scaled, 1.0)
    values |= dict.fromkeys([name for name in DAMPING if name not in missing], 0.0)
    values |= nominal_values(nominal, values, missing)
    parameters = {}
    for name, value in values.items():
        variable = schema.Variable(f"factor of {name}") if name in scaled else None
        parameters[name] = Parameter(np.array(value), 0.0 if name in DAMPING else -np.inf, variable=variable)
    size = len(base["stiffness"])
    if check_count("mechanisms", mechanisms, 0) >= size:
        raise InputError(f"mechanisms is {mechanisms}: the matrices have {size} rows, so it must be less")
    model = MatrixModel(
        base,
        scaled,
        parameters,
        int(mechanisms),
        preset=label,
        growth_threshold=growth_threshold,
        certify=certify,
    )
    own = model.values(model.nominal())
    check_definite(model.total("mass", own)[0])
    check_mechanisms(model.assemble(own))
    return model


def _digest(matrix: Array) -> str:
    """Return the SHA-256 of the numbers of a matrix."""
    return hashlib.sha256(matrix.astype("<f8").tobytes()).hexdigest()
