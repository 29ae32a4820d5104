"""What the models built from matrices share: samples in, matrices, kernel, outcomes out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from hipuq import schema
from hipuq.cea import ALWAYS, AUTO, NEVER, CompactPencils, Pencils, mode_shapes, solve
from hipuq.compiled.binding import kernel
from hipuq.errors import InputError, check_name
from hipuq.inputs import Inputs
from hipuq.models.outcomes import labelled_outcomes
from hipuq.models.parameter import Parameter
from hipuq.models.shapes import labelled_shapes
from hipuq.variation import Nominal

Array = NDArray[np.float64]

LINEAR = (
    "The analysis is linear, about steady sliding: it tells whether a vibration begins to grow, neither how "
    "large it becomes nor whether it can be heard",
    "Unstable means a growth rate above the threshold, however small: a mode that grows slowly counts as one "
    "that grows fast",
    "What damps the vibration decides slow growth: a probability holds for the damping that it was computed "
    "with alone",
    "Friction is Coulomb's, with one coefficient that neither speed nor time changes",
)
"""Limits of every complex eigenvalue analysis with friction, a sentence each without a full stop."""


OPTIONS = ("preset", "growth_threshold", "certify")
"""Arguments of models that are no parameters: a misspelt one may be meant for one of them."""


class CEAModel(ABC):
    """A parametric set of matrices, solved by complex eigenvalue analysis.

    A subclass gives `name`, `parameters`, `dofs` and `assemble`; all else is here.

    Parameters
    ----------
    preset : str
        The published set of nominal values.
    parameters : mapping
        Name -> `Parameter`; the schema, or the parameter itself, says what the name means.
    growth_threshold : float, default 0
        Growth rate above which a mode counts as unstable [1/s].
    certify : str, default "auto"
        When verdicts go beyond double precision: ``"auto"``, ``"always"``, ``"never"``.

    Attributes
    ----------
    name : str
        Of the kind of model.
    block : int
        Samples that it takes at a time, at most: enough to forget the cost of a call.
    outcomes : tuple of str
        Names of the outcomes that a call can give.
    limits : tuple of str
        What its results do not tell, a sentence each without a full stop.

    Raises
    ------
    InputError
        If the threshold or a nominal value is not allowed, or nobody says what a parameter is.
    UnknownNameError
        If there is no such way to certify.
    """

    name: ClassVar[str]
    block: int = 4096
    limits: ClassVar[tuple[str, ...]] = LINEAR
    outcomes: ClassVar[tuple[str, ...]] = (*schema.OUTCOMES, "status", "decided_by")

    def __init__(
        self,
        preset: str,
        parameters: Mapping[str, Parameter],
        growth_threshold: float = 0.0,
        certify: str = AUTO,
    ) -> None:
        if not (isinstance(growth_threshold, (int, float)) and 0 <= growth_threshold < np.inf):
            raise InputError(
                f"growth_threshold is {growth_threshold}: it must be a finite number of 1/s, 0 or above"
            )
        check_name("way to certify", certify, (AUTO, ALWAYS, NEVER))
        kernel()  # a library or a switch that is wrong shows here, not in every sample
        self.preset = preset
        self.certify = certify
        self.parameters = dict(parameters)
        self.growth_threshold = float(growth_threshold)
        for name, parameter in self.parameters.items():
            parameter.described(name)
            parameter.check(name, parameter.nominal[None])

    @property
    @abstractmethod
    def dofs(self) -> int:
        """Number of degrees of freedom, and so of modes."""

    @abstractmethod
    def assemble(self, values: Mapping[str, Array]) -> Pencils:
        """Return the matrices of a batch.

        Parameters
        ----------
        values : mapping
            Every parameter, (s,) or (s, size), in the units of its variable.

        Returns
        -------
        Pencils
            Of s samples.
        """

    def compact(self, values: Mapping[str, Array]) -> CompactPencils | None:
        """Return the matrices of a batch by their entries, as the compiled kernel takes them.

        A model may give them beside `assemble`, which every model has; they must be the same to the
        last bit.

        Parameters
        ----------
        values : mapping
            Every parameter, (s,) or (s, size), in the units of its variable.

        Returns
        -------
        CompactPencils or None
            Of s samples; None, as here, where the model does not give them for these values.
        """
        return None

    @property
    def label(self) -> str:
        """Name and preset, for attributes and titles."""
        return f"{self.name}({self.preset})"

    @property
    def options(self) -> dict[str, Any]:
        """The model as JSON-able options: what rebuilds it."""
        changed = {name: p.nominal.tolist() for name, p in self.parameters.items()}
        return {
            "model": self.name,
            "preset": self.preset,
            "growth_threshold": self.growth_threshold,
            "certify": self.certify,
            "nominal": changed,
        }

    def inputs(self, /, **distributions: object) -> Inputs:
        """Return inputs that know this model's nominal values and lengths.

        Parameters
        ----------
        **distributions
            Parameter name = a distribution, `relative`, `shift` or `ContactPatterns`.

        Returns
        -------
        Inputs
            What is uncertain; the rest keeps its nominal value.

        Raises
        ------
        UnknownNameError
            If the model has no such parameter.
        """
        nominal = {
            name: Nominal(parameter.nominal, parameter.described(name).dims[1:], parameter.described(name))
            for name, parameter in self.parameters.items()
        }
        for name in distributions:
            check_name("parameter", name, nominal)
        return Inputs.around(distributions, nominal)

    def nominal(self, /, **changes: ArrayLike) -> xr.Dataset:
        """Return one sample at the nominal values, with `changes`.

        Parameters
        ----------
        **changes
            Parameter name = value, a number or one for each element. Several samples come from an
            array with the sample first: one-dimensional for a scalar parameter.

        Returns
        -------
        Dataset
            Over ``sample``, one variable for each parameter changed; valid samples.

        Raises
        ------
        UnknownNameError
            If the model has no such parameter.
        InputError
            If a value has another shape than the parameter.
        """
        arrays = {
            check_name("parameter", name, self.parameters): np.asarray(value)
            for name, value in changes.items()
        }
        size = max((len(a) for n, a in arrays.items() if a.ndim > self.parameters[n].nominal.ndim), default=1)
        data: dict[str, Any] = {}
        for name, array in arrays.items():
            parameter = self.parameters[name]
            variable, shape = parameter.described(name), parameter.nominal.shape
            try:
                values = np.broadcast_to(array, (size, *shape)).copy()
            except ValueError:
                takes = shape or "one number"
                raise InputError(
                    f"{name} has the shape {array.shape}: it takes {takes} for each of {size} samples"
                ) from None
            data[name] = (variable.dims, values, variable.attrs)
        samples = xr.Dataset(
            data, coords={"sample": ("sample", np.arange(size), schema.COORDINATES["sample"].attrs)}
        )
        return schema.stamp(samples, f"nominal values of {self.label}", model=self.label)

    def pencils(self, samples: xr.Dataset) -> Pencils:
        """Return the matrices of the samples; what is not in them takes its nominal value.

        Parameters
        ----------
        samples : Dataset
            Parameters over ``sample``.

        Returns
        -------
        Pencils
            Of all samples.

        Raises
        ------
        UnknownNameError
            If a variable is none of the model's parameters.
        SchemaError
            If a shape does not fit.
        InputError
            If a value is not allowed.
        """
        return self.assemble(self.values(samples))

    def values(self, samples: xr.Dataset) -> dict[str, Array]:
        """Return the checked values of every parameter, nominal ones where the samples have none.

        Parameters
        ----------
        samples : Dataset
            Parameters over ``sample``.

        Returns
        -------
        dict of str to array
            (s,) or (s, size), in the units of the parameter.

        Raises
        ------
        UnknownNameError, SchemaError, InputError
            As `pencils`.
        """
        size = schema.check_samples(samples, self.parameters)
        return {
            name: parameter.values(name, samples)
            if name in samples
            else np.broadcast_to(parameter.nominal, (size, *parameter.nominal.shape))
            for name, parameter in self.parameters.items()
        }

    def check(self, samples: xr.Dataset) -> None:
        """Check all samples at once, so that an error names the sample by its place in the whole.

        Parameters
        ----------
        samples : Dataset
            Parameters over ``sample``.

        Raises
        ------
        UnknownNameError, SchemaError, InputError
            As `pencils`.
        """
        schema.check_samples(samples, self.parameters)
        for name in samples.data_vars:
            self.parameters[str(name)].values(str(name), samples)

    def __call__(self, samples: xr.Dataset, keep: Iterable[str] | None = None) -> xr.Dataset:
        """Return the outcomes of the samples.

        Parameters
        ----------
        samples : Dataset
            Parameters over ``sample``.
        keep : iterable of str, optional
            Outcomes wanted; all by default. ``status`` and ``decided_by`` always come.

        Returns
        -------
        Dataset
            Over ``sample`` and ``mode``.
        """
        values = self.values(samples)
        pencils = self.compact(values) or self.assemble(values)
        spectra = solve(pencils, growth_threshold=self.growth_threshold, certify=self.certify)
        return labelled_outcomes(spectra, self.outcomes if keep is None else tuple(keep), self)

    def mode_coordinates(self) -> dict[str, Any]:
        """Return the coordinate ``mode`` and the pair that each mode closes by flutter.

        The growing mode of a coalesced pair (i, i + 1) is i + 1, so flutter of mode j is always
        that of the pair (j - 1, j).

        Returns
        -------
        dict
            ``mode``, the numbers from 1, and ``pair``, its modes as text.
        """
        pairs = ["1", *(f"{j - 1}-{j}" for j in range(2, self.dofs + 1))]
        return {
            "mode": schema.index("mode", self.dofs),
            "pair": ("mode", pairs, {"long_name": "pair of modes that coalesces", "units": "1"}),
        }

    def mode_shapes(self, sample: xr.Dataset) -> xr.Dataset:
        """Return the mode shapes and energies of one sample.

        Parameters
        ----------
        sample : Dataset
            One sample, as from `nominal`.

        Returns
        -------
        Dataset
            ``shape_real``, ``shape_imag`` over (mode, dof), normalised to a modal mass of
            1 kg m^2 with the largest entry real and positive; ``frequency``, ``growth_rate``,
            ``strain_energy``, ``kinetic_energy``, ``friction_work``, ``damping_work`` over mode.
        """
        found = labelled_shapes(mode_shapes(self.pencils(sample)), self.mode_coordinates())
        options = {"model": self.options}
        return schema.stamp(found, "mode shapes", model=self.label, options=options, like=sample.attrs)

    def __repr__(self) -> str:
        return f"<hipuq model {self.label}: {self.dofs} modes, parameters {', '.join(self.parameters)}>"
