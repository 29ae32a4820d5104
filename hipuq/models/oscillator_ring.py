"""Ring of oscillators in a rotating socket: the planar model of hip squeak.

Oberst, Zhang, Campbell, Morlock, Lai, Hoffmann, "Towards the understanding of hip squeak in total
hip arthroplasty using analytical contact models with uncertainty", INTER-NOISE 2016, p. 5539,
equations 2 to 7 and Table 1.

N point masses sit in a rigid socket and are joined to their neighbours, the first and the last to
ground, by N + 1 springs. Each mass in contact is pressed by a contact spring along
n = (cos b, sin b); friction pulls it with mu times the contact force along t = (cos f, sin f). The
four entries of equation 7 are mu kc t n^T, because cos^2 b + sin^2 b = 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from hipuq import schema
from hipuq.cea import CompactPencils, Pencils
from hipuq.compiled.angles import cosine_and_sine
from hipuq.errors import InputError, check_name
from hipuq.models.base import LINEAR, OPTIONS, CEAModel
from hipuq.models.blocks import at_blocks, dyads, sample_last
from hipuq.models.damping import DAMPING, damping_matrices
from hipuq.models.parameter import Parameter
from hipuq.sampling import check_count

Array = NDArray[np.float64]

PRESETS: dict[str, dict[str, float]] = {
    # As printed: m = 22.22 kg, k = 1.05e9 N/m, kc = 3.98e9 N/m; kc / k = 3.79 lies beside a
    # singular point of the model, where the first onset falls to nearly zero friction.
    "oberst2016": {"mass": 22.22, "spring_stiffness": 1.05e9, "contact_stiffness": 3.98e9},
    # kc / k = 4.38 reproduces the printed lock-in of mode 15 (mu = 0.056) and the printed mode
    # shapes, dominated by the leftmost oscillator; the printed ratio reproduces neither.
    "oberst2016-calibrated": {
        "mass": 22.22,
        "spring_stiffness": 1.05e9,
        "contact_stiffness": 4.38 * 1.05e9,
    },
}
"""Published sets of nominal values, [kg] and [N/m]."""

FILTER = 3e-5
"""Radius, relative to the norm, within which eigenvalues of the ring need no condition number.

Twenty times the largest distance from the real axis at which LAPACK was wrong, 1.4e-6, among 88,000
rings of up to nine oscillators judged by exact arithmetic (nominal, scattered, near an onset, damped);
``tests/validate_filter.py`` repeats it. With 20 oscillators it is 1.0e-5, so larger rings do without."""

FILTER_OSCILLATORS = 9
"""Largest ring for which the filter is validated with that margin."""

LIMITS = (
    "The ring is a planar model of a mechanism, the coupling of modes by friction: it is not the model of "
    "one "
    "implant, and its masses and stiffnesses are not measured on one",
    "Friction uniform from 0 to 0.1 is the choice of Oberst et al. (2016); it lies below every critical "
    "friction "
    "measured at the onset of squeak, 0.29 to 0.39 (Fan et al., J. Orthop. Res. 31 (2013) 1627)",
    "Without damping the nominal ring of both presets was unstable in each of the 130 contact patterns at "
    "every friction tried from 0.1 to 1, so with the film lost (friction 0.3 and above) the undamped model "
    "answers almost surely",
    "Calibrated means calibrated to a published simulation, the lock-in and the mode shapes of Oberst et al. "
    "(2016), not to hips",
    "The growth behind that is small: calibrated, all nine in contact, 1.7 1/s at a friction of 0.054 and "
    "96 1/s "
    "at 0.1, which about 0.7 % modal damping removes; so damping decides, and it is hardly known",
)
"""Limits of the ring."""


class OscillatorRing(CEAModel):
    """Ring of N oscillators with 2 N degrees of freedom (x1, y1, ..., xN, yN). Made by `ring`.

    Attributes
    ----------
    friction_follows : bool
        Whether the friction direction stays perpendicular to the contact direction.
    """

    name = "ring"
    limits: ClassVar[tuple[str, ...]] = (*LIMITS, *LINEAR)

    @property
    def options(self) -> dict[str, Any]:
        """The model as JSON-able options: what rebuilds it."""
        options = super().options
        nominal = dict(options["nominal"])
        if self.friction_follows:
            del nominal["friction_angle"]
        return options | {"oscillators": self.oscillators, "nominal": nominal}

    @property
    def oscillators(self) -> int:
        """Number of oscillators N."""
        return len(self.parameters["mass"].nominal)

    @property
    def dofs(self) -> int:
        """Number of degrees of freedom 2 N."""
        return 2 * self.oscillators

    def values(self, samples: xr.Dataset) -> dict[str, Array]:
        """Return the values of every parameter, see `CEAModel.values`.

        ``friction_angle`` follows ``contact_angle`` + 90 deg unless the samples hold it.

        Parameters
        ----------
        samples : Dataset
            Parameters over ``sample``.

        Returns
        -------
        dict of str to array
            (s,), (s, N) or (s, N + 1), in the units of the schema.
        """
        values = super().values(samples)
        if "contact_angle" in samples and "friction_angle" not in samples and self.friction_follows:
            values["friction_angle"] = values["contact_angle"] + 90.0
        return values

    friction_follows: bool = True

    def mode_shapes(self, sample: xr.Dataset) -> xr.Dataset:
        """Return the mode shapes and energies of one sample.

        Parameters
        ----------
        sample : Dataset
            One sample, as from `nominal`.

        Returns
        -------
        Dataset
            As `CEAModel.mode_shapes`, with ``displacement_real``, ``displacement_imag`` over (mode,
            oscillator, axis) in place of the shapes over dof, and ``position(oscillator, axis)`` of
            the undeformed ring, in radii: masses sit where their contact direction points.
        """
        shapes = super().mode_shapes(sample)
        count = self.oscillators
        for part in ("real", "imag"):
            flat = shapes[f"shape_{part}"]
            shapes[f"displacement_{part}"] = (
                ("mode", "oscillator", "axis"),
                flat.values.reshape(-1, count, 2),
                flat.attrs,
            )
        has_angle = "contact_angle" in sample
        angle = sample["contact_angle"].values[0] if has_angle else self.parameters["contact_angle"].nominal
        position = np.stack(cosine_and_sine(angle), axis=1)
        attrs = {"long_name": "position in the undeformed ring, in radii", "units": "1"}
        shapes["position"] = (("oscillator", "axis"), position, attrs)
        axis = ("axis", ["x", "y"], {"long_name": "axis", "units": "1"})
        index = schema.index("oscillator", count)
        return shapes.drop_dims("dof").assign_coords(oscillator=index, axis=axis)

    def assemble(self, values: Mapping[str, Array]) -> Pencils:
        """Return the matrices of a batch (Oberst et al. 2016, equations 3 to 7).

        Parameters
        ----------
        values : mapping
            Every parameter of the ring, (s,), (s, N) or (s, N + 1), in the units of the schema.

        Returns
        -------
        Pencils
            Of s samples with 2 N degrees of freedom.
        """
        pencils = self.entries(values).rows()
        return replace(pencils, damping=damping_matrices(pencils.mass, pencils.stiffness, values))

    def compact(self, values: Mapping[str, Array]) -> CompactPencils | None:
        """Return the undamped matrices of a batch by their entries, None if any sample is damped.

        Parameters
        ----------
        values : mapping
            Every parameter of the ring, (s,), (s, N) or (s, N + 1), in the units of the schema.

        Returns
        -------
        CompactPencils or None
            The matrices of `assemble`, to the last bit.
        """
        return None if any(values[name].any() for name in DAMPING) else self.entries(values)

    def entries(self, values: Mapping[str, Array]) -> CompactPencils:
        """Return the matrices but for damping by their entries (equations 3 to 7).

        Parameters
        ----------
        values : mapping
            Every parameter of the ring, (s,), (s, N) or (s, N + 1), in the units of the schema.

        Returns
        -------
        CompactPencils
            Of s samples with 2 N degrees of freedom.
        """
        own = {name: sample_last(values[name]) for name in values if values[name].ndim == 2}
        count = self.oscillators
        spring = cosine_and_sine(own["spring_angle"])
        contact, friction = cosine_and_sine(own["contact_angle"]), cosine_and_sine(own["friction_angle"])
        springs = dyads(own["spring_stiffness"], spring, spring)
        force = own["contact_stiffness"] * own["contact"]
        contacts = dyads(force, contact, contact)
        blocks = springs[:, :, :-1] + springs[:, :, 1:]
        blocks = np.add(blocks, contacts, out=contacts if contacts.shape == blocks.shape else None)
        beside = np.negative(springs, out=springs)
        stiffness = (
            at_blocks(blocks, [(i, i) for i in range(count)]),
            at_blocks(beside, [(i, i + 1) for i in range(count - 1)], first=1),
            at_blocks(beside, [(i + 1, i) for i in range(count - 1)], first=1),
        )
        friction_stiffness = (at_blocks(dyads(force, friction, contact), [(i, i) for i in range(count)]),)
        # Springs and contacts are N + 1 + contacts constraints on 2 N degrees of freedom; friction
        # acts through the same contact normals, so it removes no mechanism.
        contact_count = values["contact"].sum(axis=1).astype(np.intp)
        return CompactPencils(
            mass=np.repeat(own["mass"], 2, axis=0),
            stiffness=stiffness,
            friction_stiffness=friction_stiffness,
            friction=np.array(values["friction"]),
            mechanisms=np.maximum(0, 2 * count - (count + 1) - contact_count),
            filter_radius=FILTER if count <= FILTER_OSCILLATORS else 0.0,
        )


def ring(
    preset: str = "oberst2016",
    *,
    oscillators: int = 9,
    growth_threshold: float = 0.0,
    certify: str = "auto",
    **nominal: ArrayLike,
) -> OscillatorRing:
    """Return a ring of oscillators: the planar model of hip squeak of Oberst et al. 2016.

    Equations 2 to 7 and Table 1 of INTER-NOISE 2016, p. 5539. Each oscillator in contact is pressed into the
    socket by a contact spring, and friction couples its two directions; springs join it to its neighbours.

    Parameters
    ----------
    preset : str
        ``"oberst2016"`` as printed, or ``"oberst2016-calibrated"``, whose contact stiffness
        reproduces the printed lock-in and mode shapes.
    oscillators : int, default 9
        Number N, at least 2. Angles are then spread with the step 180 / (N - 1) deg.
    growth_threshold : float, default 0
        Growth rate above which a mode counts as unstable [1/s].
    certify : str, default "auto"
        ``"auto"``: verdicts that double precision leaves open are decided by the structured solver
        or by exact arithmetic. ``"always"``: all by exact arithmetic. ``"never"``: they stay unknown.
    **nominal
        Other nominal values: ``friction``, ``contact``, ``mass``, ``spring_stiffness``,
        ``contact_stiffness``, ``spring_angle``, ``contact_angle``, ``friction_angle``,
        ``damping_ratio``, ``mass_damping``, ``stiffness_damping``; one number or one for each
        element, in the units of the schema. Nominal friction is 0.

    Returns
    -------
    OscillatorRing
        A `CEAModel`: samples in, outcomes out.

    Raises
    ------
    UnknownNameError
        If there is no such preset or parameter.
    InputError
        If a value is not allowed or its length does not fit.

    Examples
    --------
    >>> import hipuq
    >>> model = hipuq.models.ring("oberst2016-calibrated", damping_ratio=0.001)
    >>> model.dofs, model.parameters["contact_stiffness"].nominal[0].item()
    (18, 4599000000.0)
    >>> found = hipuq.unstable_friction(model, upper=0.1)
    >>> found["start"].values.round(4)  # friction at the onset
    array([0.0628])
    """
    check_name("preset of the ring", preset, PRESETS)
    n = check_count("oscillators", oscillators, 2)
    step = 180.0 / (n - 1)
    published = PRESETS[preset]
    contact_angle = 180.0 + step * np.arange(n)
    base: dict[str, tuple[ArrayLike, int, dict[str, Any]]] = {
        "friction": (0.0, 0, {}),
        "contact": (1.0, n, {"boolean": True}),
        "mass": (published["mass"], n, {"minimum": 0.0, "open": True}),
        "spring_stiffness": (published["spring_stiffness"], n + 1, {"minimum": 0.0, "open": True}),
        "contact_stiffness": (published["contact_stiffness"], n, {"minimum": 0.0, "open": True}),
        "spring_angle": (90.0 - step / 2 + step * np.arange(n + 1), n + 1, {}),
        "contact_angle": (contact_angle, n, {}),
        "friction_angle": (contact_angle + 90.0, n, {}),
        "damping_ratio": (0.0, 0, {"minimum": 0.0}),
        "mass_damping": (0.0, 0, {"minimum": 0.0}),
        "stiffness_damping": (0.0, 0, {"minimum": 0.0}),
    }
    follows = "friction_angle" not in nominal
    if "contact_angle" in nominal and follows:
        nominal = {**nominal, "friction_angle": np.asarray(nominal["contact_angle"]) + 90.0}
    parameters = {}
    for name in nominal:
        check_name("parameter of the ring", name, [*base, *OPTIONS, "oscillators"])
    for name, (value, size, rule) in base.items():
        parameters[name] = Parameter(_nominal(name, nominal.get(name, value), size), **rule)
    model = OscillatorRing(preset, parameters, growth_threshold, certify)
    model.friction_follows = follows
    return model


def _nominal(name: str, value: ArrayLike, size: int) -> Array:
    """Return a nominal value with the right length, `size` 0 for a number."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} is {value!r}: it must be numbers") from None
    allowed = [()] if size == 0 else [(), (size,)]
    if array.shape not in allowed:
        want = "one number" if size == 0 else f"one number or {size} numbers"
        raise InputError(f"{name} has the shape {array.shape}: it takes {want}")
    return np.array(np.broadcast_to(array, (size,))) if size else array
