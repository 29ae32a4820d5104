"""Matrices as users give them, checked one by one and made arrays of doubles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq import schema
from hipuq.cea import Pencils
from hipuq.cea.bounds import EPS
from hipuq.errors import InputError, check_name

Array = NDArray[np.float64]

KINDS = ("mass", "stiffness", "friction_stiffness", "damping")
"""Matrices that a model is made of."""

SYMMETRIC = 1e-12
"""Largest difference of the halves of a matrix, relative to the largest entry, that counts as rounding."""

ANY_FRICTION = 1 / np.pi
"""Friction at which mechanisms are counted: one at which no structure diverges by design."""

TAKEN = {
    *(schema.PARAMETERS | schema.OUTCOMES | schema.INTEGRATED | schema.COORDINATES),
    *(dim for variable in schema.INTEGRATED.values() for dim in variable.dims),
    *(*schema.RESULT_DIMS, "status", "decided_by", "pair"),
}
"""Names that mean something else in samples, outcomes or results."""


def checked(
    given: Mapping[str, object], parts: object
) -> tuple[dict[str, Array], dict[str, dict[str, Array]]]:
    """Return matrices and their parts as arrays of their own, all of one size.

    Parameters
    ----------
    given : mapping
        Kind -> matrix, None for one that there is not.
    parts : mapping or None
        Name of a parameter -> matrices by kind.

    Returns
    -------
    base : dict
        Kind -> (n, n) array, exactly symmetric if it was so but for rounding; masses (n,) if all of them
        are diagonal.
    scaled : dict of dict
        The same for each part.

    Raises
    ------
    InputError, UnknownNameError
        If one cannot be used.
    """
    size = len(_matrix("stiffness", given["stiffness"]))
    base = {kind: _matrix(kind, one, size) for kind, one in given.items() if one is not None}
    scaled = {
        name: {kind: _matrix(kind, one, size, f" of {name}") for kind, one in part.items()}
        for name, part in _checked_parts(parts).items()
    }
    if any("damping" in part for part in scaled.values()):
        base.setdefault("damping", np.zeros((size, size)))
    with_mass = [own for own in (base, *scaled.values()) if "mass" in own]
    if all(_is_diagonal(own["mass"]) for own in with_mass):
        for own in with_mass:
            own["mass"] = np.diagonal(own["mass"]).copy()
    return base, scaled


def check_definite(mass: Array) -> None:
    """Raise an InputError if a mass, (n,) or (n, n), is not positive definite, or only by rounding."""
    values = np.sort(mass) if mass.ndim == 1 else np.linalg.eigvalsh(mass)
    rounding = 0.0 if mass.ndim == 1 else len(mass) * EPS
    if values[0] <= rounding * values[-1]:
        raise InputError(
            f"mass is not positive definite, its eigenvalues are {values[0]:g} to {values[-1]:g}: condense "
            "the degrees of freedom that have no mass, or reduce the matrices to modes"
        )


def check_mechanisms(pencils: Pencils) -> None:
    """Raise an InputError if matrices, (1, n, n), have more mechanisms than they say, or have by rounding.

    The sign of a zero that rounding left would be a verdict.
    """
    stiffness = replace(pencils, friction=np.array([ANY_FRICTION])).reduced()[0][0]
    singular = np.linalg.svd(stiffness, compute_uv=False)
    found = int((singular <= 10 * len(singular) * EPS * singular[0]).sum())
    if found > pencils.mechanisms[0]:
        raise InputError(
            f"stiffness and friction resist {found} motions by rounding only, and mechanisms is "
            f"{pencils.mechanisms[0]}: give mechanisms={found}, or hold the structure"
        )


def _checked_parts(parts: object) -> Mapping[str, Mapping[str, object]]:
    """Return parts once their names, and those of their matrices, are known to be possible."""
    if parts is None:
        return {}
    if not isinstance(parts, Mapping):
        raise InputError(f"parts are {type(parts).__name__}: they must map names to matrices by their kind")
    for name, part in parts.items():
        if not isinstance(name, str) or not name.isidentifier():
            raise InputError(f"a part cannot be called {name!r}: its name must be one that Python takes")
        if name in TAKEN:
            raise InputError(
                f"a part cannot be called {name!r}, which means something else here: "
                f"take another name, such as {name + '_factor'!r}"
            )
        if not isinstance(part, Mapping) or not part:
            raise InputError(f"part {name!r} has no matrices: it must map at least one of {', '.join(KINDS)}")
        for kind in part:
            check_name(f"matrix in part {name!r}", kind, KINDS)
    return parts


def _matrix(kind: str, value: Any, size: int | None = None, of: str = "") -> Array:
    """Return a matrix as an array of its own; a mass may be given by its diagonal."""
    what = f"{kind}{of}"
    try:
        array = np.array(value.toarray() if hasattr(value, "toarray") else value)
    except ValueError:
        raise InputError(f"{what} is no matrix: its rows have different lengths") from None
    if array.dtype.kind == "c":
        raise InputError(f"{what} is complex: it must be real, structural damping goes into damping")
    if array.dtype.kind not in "biuf":
        raise InputError(f"{what} holds {array.dtype}: it must hold numbers")
    if kind == "mass" and array.ndim == 1:
        array = np.diag(array)
    if array.ndim != 2 or array.shape[0] != array.shape[1] or not array.size:
        raise InputError(f"{what} has the shape {array.shape}: it must be a square matrix")
    if size not in (None, len(array)):
        raise InputError(f"{what} has {len(array)} rows, stiffness has {size}: they must be alike")
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        row, column = bad[0]
        value = array[row, column]
        raise InputError(f"{what} is {value} in row {row + 1}, column {column + 1}: it must be finite")
    # Plus zero, so that -0 and 0 are the same matrix.
    array = array.astype(np.float64) + 0.0
    apart = np.abs(array - array.T).max() / (np.abs(array).max() or 1.0)
    if kind == "mass" and apart > SYMMETRIC:
        raise InputError(
            f"{what} is not symmetric, its halves differ by {apart:.2g} of its largest entry: give both, "
            "and their mean, (mass + mass.T) / 2, if they differ by the rounding of another program"
        )
    return (array + array.T) / 2 if apart <= SYMMETRIC else array


def _is_diagonal(matrix: Array) -> bool:
    return not np.count_nonzero(matrix - np.diag(np.diagonal(matrix)))
