"""How a distribution applies to a nominal value: relative to it, or as a shift of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hipuq.distributions import Distribution, as_distribution
from hipuq.schema import Variable

Array = NDArray[np.float64]

# What is too large for numbers is refused for what it then is, not warned of.
UNWARNED = np.errstate(all="ignore")


@dataclass(frozen=True)
class Nominal:
    """What a model says of its parameter: nominal value, dims of its elements, meaning and unit."""

    values: Array
    dims: tuple[str, ...]
    variable: Variable | None = None


@dataclass(frozen=True)
class Variation:
    """A distribution of the change of a nominal value. Made by `relative` and `shift`."""

    how: Literal["relative", "shift"]
    distribution: Distribution
    each: str | None
    nominal: Any


@UNWARNED
def relative(distribution: object, *, each: str | None = None, nominal: ArrayLike | None = None) -> Variation:
    """Vary a parameter around its nominal value: nominal value times (1 + draw).

    Parameters
    ----------
    distribution : object
        Distribution of the draw [1], such as ``cp.Uniform(-0.1, 0.1)`` for +-10 %: of chaospy, a frozen one
        of scipy, or anything with ``ppf``.
    each : str, optional
        Dim of the elements: one independent draw for each of them. Without it one shared draw.
    nominal : float or (size,) array, optional
        The nominal value where no model knows it, in the unit of the parameter: a number, or one for each
        element.

    Returns
    -------
    Variation
        To be given to `Inputs` or ``model.inputs``.

    Raises
    ------
    InputError
        If it is not a distribution, or of several variables.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> ten_percent = cp.Uniform(-0.1, 0.1)
    >>> around = hipuq.relative(ten_percent, nominal=2000.0)
    >>> inputs = hipuq.Inputs(stiffness=around)
    >>> inputs.samples([[0.0], [0.5], [1.0]])["stiffness"].values.round(6)
    array([1800., 2000., 2200.])
    >>> model = hipuq.models.ring("oberst2016")
    >>> each = hipuq.relative(ten_percent, each="oscillator")
    >>> model.inputs(contact_stiffness=each).dimension
    9
    """
    return Variation("relative", as_distribution(distribution, "relative distribution"), each, nominal)


@UNWARNED
def shift(distribution: object, *, each: str | None = None, nominal: ArrayLike | None = None) -> Variation:
    """Vary a parameter around its nominal value: nominal value plus draw.

    Parameters
    ----------
    distribution : object
        Distribution of the draw, in the unit of the parameter: of chaospy, a frozen one of scipy, or anything
        with ``ppf``.
    each : str, optional
        Dim of the elements: one independent draw for each of them. Without it one shared draw.
    nominal : float or (size,) array, optional
        The nominal value where no model knows it, in the unit of the parameter: a number, or one for each
        element.

    Returns
    -------
    Variation
        To be given to `Inputs` or ``model.inputs``.

    Raises
    ------
    InputError
        If it is not a distribution, or of several variables.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.ring("oberst2016")
    >>> half = hipuq.shift(cp.Uniform(-0.5, 0.5), each="oscillator")
    >>> samples = model.inputs(contact_angle=half).samples([[0.0, 0.5] + 7 * [1.0]])
    >>> samples["contact_angle"].values.round(4)
    array([[179.5, 202.5, 225.5, 248. , 270.5, 293. , 315.5, 338. , 360.5]])
    """
    return Variation("shift", as_distribution(distribution, "shift distribution"), each, nominal)
