"""Matrices as users give them, checked one by one and made arrays of doubles."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hipuq import schema
from hipuq.cea import Pencils
from hipuq.cea.bounds import EPS
from hipuq.cea.pencils import LARGEST
from hipuq.errors import InputError, check_name
from hipuq.models.damping import DAMPING

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
    *(*schema.RESULT_DIMS, "status", "decided_by", "pair", "failure_message", "failed_sample"),
    *("seconds", "failed", "undecided", "evaluations"),
}
"""Names that mean something else in samples, outcomes or results."""


def checked(
    given: Mapping[str, object], parts: object
) -> tuple[dict[str, Array], dict[str, dict[str, Array]]]:
    """Return matrices and their parts as arrays of their own, all of one size.

    Parameters
    ----------
    given : mapping
        Kind -> matrix; the damping may be None, for none.
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
    for kind, one in given.items():
        if one is None and kind != "damping":
            raise InputError(f"{kind} is missing: give zeros if parts hold all of it")
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
    n = len(singular)
    # Relative to the norm, not to entries: a projection leaves rounding of that size in every entry.
    found = int((singular <= 10 * n * EPS * singular[0]).sum())
    if found == n:
        raise InputError("nothing is resisted: stiffness and friction are zero at the nominal values")
    if found > pencils.mechanisms[0]:
        raise InputError(
            f"at the nominal values stiffness and friction resist {found} of {n} motions by less than "
            f"rounding shows, and mechanisms is {pencils.mechanisms[0]}: if nothing ever resists them give "
            f"mechanisms={found}; if a part does that is 0 there, give it a value; if they are only soft, "
            "reduce the matrices to modes, or soften what stands for a rigid joint"
        )


def without_damping(base: Mapping[str, Array], scaled: Mapping[str, Mapping[str, Array]]) -> dict[str, str]:
    """Return the damping parameters that matrices leave no room for, each with the reason.

    Parameters
    ----------
    base, scaled : mapping
        As `checked` returns them.
    """
    if "damping" in base:
        reason = "is none where damping matrices are given: scale one of these by a part"
        return {name: f"{name} {reason}" for name in DAMPING}
    for of, own in {"": base, **{f" of {name}": part for name, part in scaled.items()}}.items():
        apart = _halves_apart(own["stiffness"]) if "stiffness" in own else 0.0
        if apart > 0:
            text = (
                f"damping_ratio needs a symmetric stiffness: the halves of stiffness{of} differ by "
                f"{apart:.2g} of its largest entry; give (K + K.T) / 2 if that is rounding"
            )
            return {"damping_ratio": text}
    return {}


def nominal_values(nominal: object, allowed: Iterable[str], missing: Mapping[str, str]) -> dict[str, float]:
    """Return nominal values as numbers.

    Parameters
    ----------
    nominal : mapping or None
        Name of a parameter -> number.
    allowed : iterable of str
        Names of parameters.
    missing : mapping
        Name of a parameter that there could be -> why it is not there.

    Raises
    ------
    InputError, UnknownNameError
        If one cannot be used.
    """
    if nominal is None:
        return {}
    if not isinstance(nominal, Mapping):
        raise InputError(f"nominal is {type(nominal).__name__}: it must map parameters to numbers")
    found = {}
    for name, value in nominal.items():
        if name in missing:
            raise InputError(missing[name])
        check_name("parameter", name, allowed)
        if not isinstance(value, Real) or isinstance(value, bool):
            raise InputError(f"nominal {name} is {value!r}: it must be one number")
        try:
            found[name] = float(value)
        except OverflowError:
            raise InputError(f"nominal {name} does not fit a double") from None
    return found


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
    if value is None:
        raise InputError(f"{what} is None: leave it out")
    if np.ma.is_masked(value):
        raise InputError(f"{what} has masked entries: it must have all of them")
    try:
        array = np.array(value.toarray() if hasattr(value, "toarray") else value)
    except ValueError:
        raise InputError(f"{what} is no matrix: its rows have different lengths") from None
    if array.dtype.kind == "c":
        raise InputError(f"{what} is complex: it must be real, structural damping goes into damping")
    try:
        if array.dtype.kind not in "biufO":
            raise TypeError
        with np.errstate(over="ignore"):
            # Plus zero, so that -0 and 0 are the same matrix.
            array = array.astype(np.float64) + 0.0
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what} holds {array.dtype}: it must hold numbers that fit a double") from None
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
    if np.abs(array).max() > LARGEST:
        raise InputError(f"{what} holds a value above {LARGEST:g}: choose other units")
    apart = _halves_apart(array)
    if kind == "mass" and apart > SYMMETRIC:
        raise InputError(
            f"{what} is not symmetric, its halves differ by {apart:.2g} of its largest entry: give both, "
            "and their mean, (mass + mass.T) / 2, if they differ by the rounding of another program"
        )
    return (array + array.T) / 2 if apart <= SYMMETRIC else array


def _halves_apart(matrix: Array) -> float:
    """Return the largest difference of an entry and its mirror image, relative to the largest entry."""
    return float(np.abs(matrix - matrix.T).max() / (np.abs(matrix).max() or 1.0))


def _is_diagonal(matrix: Array) -> bool:
    return not np.count_nonzero(matrix - np.diag(np.diagonal(matrix)))
