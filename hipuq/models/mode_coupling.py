"""Mode-coupling models with two degrees of freedom and closed-form onsets.

- N. Hoffmann, M. Fischer, R. Allgaier, L. Gaul, "A minimal model for studying properties of the
  mode-coupling type instability in friction induced oscillations", Mech. Res. Commun. 29 (2002)
  197: a unit mass on two springs at angles 1, 2 and a contact spring 3 along y; friction pulls
  along x. Its onset is ``mu_c = (k12^2 + (k11 - k22)^2 / 4) / (k12 k3)``.
- J. Hulten, SAE 932965 (1993), as used by J.-J. Sinou and L. Jezequel, "Mode coupling instability
  in friction-induced vibrations and its dependency on system parameters including damping", Eur. J.
  Mech. A 26 (2007) 106: two modes coupled by friction, with damping. Its undamped onset is
  ``mu_0 = |w1^2 - w2^2| / (2 w1 w2)``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hipuq.cea import Pencils
from hipuq.compiled.angles import cosine_and_sine
from hipuq.errors import InputError, check_name
from hipuq.models.base import LINEAR, OPTIONS, CEAModel
from hipuq.models.parameter import Parameter

Array = NDArray[np.float64]

PRESETS: dict[str, dict[str, float]] = {
    "hoffmann2002": {
        "friction": 0.0,
        "k1": 11.0,
        "k2": 20.0,
        "k3": 11.0,
        "angle_1": 150.0,
        "angle_2": 30.0,
    },
    "hulten": {
        "friction": 0.0,
        "frequency_1": 100.0,
        "frequency_2": 75.0,
        "damping_1": 0.0,
        "damping_2": 0.0,
    },
}
"""Nominal values: unit mass, stiffness [N/m], angles [deg], frequencies [Hz], damping c / (m w) [1]."""

LIMITS = ("Two modes show how friction couples them; they stand for no implant",)
"""Limits of both models."""

_POSITIVE = ("k1", "k2", "k3", "frequency_1", "frequency_2")
_NOT_NEGATIVE = ("damping_1", "damping_2")


class Hoffmann(CEAModel):
    """Unit mass on two inclined springs with frictional contact (Hoffmann et al. 2002)."""

    name = "two_dof"
    limits: ClassVar[tuple[str, ...]] = (*LIMITS, *LINEAR)

    @property
    def dofs(self) -> int:
        """Number of degrees of freedom, 2."""
        return 2

    def assemble(self, values: Mapping[str, Array]) -> Pencils:
        """Return ``K = [[k11, k12 - mu k3], [k12, k22]]`` and unit mass.

        Parameters
        ----------
        values : mapping
            ``friction``, ``k1``, ``k2``, ``k3``, ``angle_1``, ``angle_2``, each (s,), in the units of the
            schema.

        Returns
        -------
        Pencils
            Of s samples with 2 degrees of freedom.
        """
        size = len(values["k1"])
        stiffness = np.zeros((size, 2, 2))
        for k, angle in ((values["k1"], values["angle_1"]), (values["k2"], values["angle_2"])):
            c, s = cosine_and_sine(angle)
            stiffness[:, 0, 0] += k * c * c
            stiffness[:, 1, 1] += k * s * s
            stiffness[:, 0, 1] += k * s * c
        stiffness[:, 1, 0] = stiffness[:, 0, 1]
        stiffness[:, 1, 1] += values["k3"]
        friction = np.zeros((size, 2, 2))
        friction[:, 0, 1] = -values["k3"]
        return _unit_mass(stiffness, friction, values["friction"], None)


class Hulten(CEAModel):
    """Two damped modes coupled by friction (Hulten 1993; Sinou and Jezequel 2007)."""

    name = "two_dof"
    limits: ClassVar[tuple[str, ...]] = (*LIMITS, *LINEAR)

    @property
    def dofs(self) -> int:
        """Number of degrees of freedom, 2."""
        return 2

    def assemble(self, values: Mapping[str, Array]) -> Pencils:
        """Return ``K = [[w1^2, -mu w2^2], [mu w1^2, w2^2]]``, ``C = diag(e1 w1, e2 w2)``, unit mass.

        Parameters
        ----------
        values : mapping
            ``friction``, ``frequency_1``, ``frequency_2``, ``damping_1``, ``damping_2``, each (s,), in the
            units of the schema.

        Returns
        -------
        Pencils
            Of s samples with 2 degrees of freedom.
        """
        w1, w2 = (2 * np.pi * values[name] for name in ("frequency_1", "frequency_2"))
        size = len(w1)
        stiffness, friction, damping = np.zeros((3, size, 2, 2))
        stiffness[:, 0, 0], stiffness[:, 1, 1] = w1**2, w2**2
        friction[:, 0, 1], friction[:, 1, 0] = -(w2**2), w1**2
        damping[:, 0, 0] = values["damping_1"] * w1
        damping[:, 1, 1] = values["damping_2"] * w2
        return _unit_mass(stiffness, friction, values["friction"], damping)


def _unit_mass(stiffness: Array, friction_stiffness: Array, mu: Array, damping: Array | None) -> Pencils:
    """Return pencils of unit mass without mechanisms."""
    size, n, _ = stiffness.shape
    return Pencils(
        mass=np.ones((size, n)),
        stiffness=stiffness,
        friction_stiffness=friction_stiffness,
        friction=np.array(mu),
        damping=damping if damping is not None and damping.any() else None,
        mechanisms=np.zeros(size, np.intp),
    )


def two_dof(
    preset: str = "hoffmann2002",
    *,
    growth_threshold: float = 0.0,
    certify: str = "auto",
    **nominal: float,
) -> CEAModel:
    """Return a mode-coupling model with two degrees of freedom, whose onset is known in closed form.

    Parameters
    ----------
    preset : str
        ``"hoffmann2002"``: a unit mass on two springs and a contact spring (Hoffmann et al., Mech. Res.
        Commun. 29 (2002) 197). ``"hulten"``: two modes coupled by friction, with damping (Hulten, SAE 932965
        (1993), as used by Sinou and Jezequel, Eur. J. Mech. A 26 (2007) 106).
    growth_threshold : float, default 0
        Growth rate above which a mode counts as unstable [1/s].
    certify : str, default "auto"
        ``"auto"``: verdicts that double precision leaves open are decided by the structured solver
        or by exact arithmetic. ``"always"``: all by exact arithmetic. ``"never"``: they stay unknown.
    **nominal
        Other nominal values of the preset's parameters, one number each, in the units of the schema.

    Returns
    -------
    CEAModel
        Samples in, outcomes out.

    Raises
    ------
    UnknownNameError
        If there is no such preset or parameter.
    InputError
        If a value is not allowed.

    Examples
    --------
    >>> import hipuq
    >>> model = hipuq.models.two_dof("hulten")
    >>> list(model.parameters)
    ['friction', 'frequency_1', 'frequency_2', 'damping_1', 'damping_2']
    >>> found = hipuq.unstable_friction(model, upper=1.0)
    >>> found["start"].values.round(6)  # 7 / 24
    array([0.291667])
    """
    check_name("preset of two_dof", preset, PRESETS)
    values = dict(PRESETS[preset])
    for name, value in nominal.items():
        check_name(f"parameter of {preset}", name, [*values, *OPTIONS])
        if np.ndim(value) != 0 or not isinstance(value, (int, float, np.number)):
            raise InputError(f"{name} is {value!r}: it must be one number")
        values[name] = float(value)
    parameters = {}
    for name, value in values.items():
        minimum = 0.0 if name in _POSITIVE + _NOT_NEGATIVE else -np.inf
        parameters[name] = Parameter(np.array(value), minimum, open=name in _POSITIVE)
    return {"hoffmann2002": Hoffmann, "hulten": Hulten}[preset](preset, parameters, growth_threshold, certify)
