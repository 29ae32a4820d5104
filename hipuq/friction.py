"""Friction integrated exactly: what is left to sample is smooth, and for some studies nothing is left.

For fixed other parameters the unstable set of friction coefficients is a union of intervals, so with
any distribution F of friction the probability of instability is the sum of F(end) - F(start): no
sampling error. This is conditional Monte Carlo, or preintegration (Griewank, Kuo, Leovey, Sloan,
J. Comput. Appl. Math. 344 (2018) 259).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from hipuq import schema
from hipuq.cea.boundary import SIDE
from hipuq.cea.bounds import CERTIFICATE, STRUCTURED
from hipuq.cea.cells import Cells, stability_cells
from hipuq.distributions import Distribution, as_distribution
from hipuq.errors import InputError, check_name
from hipuq.friction_range import covered, with_atoms
from hipuq.inputs import Inputs
from hipuq.models.base import CEAModel

Array = NDArray[np.float64]

FRICTION = "friction"

INTEGRATED_OUTCOME = {"any_unstable": "probability", "unstable": "probability_by_mode"}
"""Outcome that is sampled -> the one that gives its probability with friction integrated."""

OF_ANY_MODE = ("any_unstable", INTEGRATED_OUTCOME["any_unstable"])
"""Outcomes whose probability is that of any unstable mode: sampled, and with friction integrated."""


def integrate_friction(model: CEAModel, distribution: object) -> FrictionIntegrated:
    """Return the model with friction integrated over its distribution.

    Parameters
    ----------
    model : CEAModel
        A model built from matrices that has the parameter ``friction``.
    distribution : object
        Of the friction coefficient: a chaospy distribution, a frozen scipy one, or anything with
        ``ppf`` and ``cdf``.

    Returns
    -------
    FrictionIntegrated
        A model like any other: of samples without friction it gives ``probability``, ``onset`` and the other
        outcomes of `hipuq.schema.INTEGRATED`. It is conditional Monte Carlo, or preintegration (Griewank,
        Kuo, Leovey, Sloan, J. Comput. Appl. Math. 344 (2018) 259), once the rest is sampled.

    Raises
    ------
    InputError
        If the model is not of that kind, or the distribution has no ``cdf``.

    Examples
    --------
    >>> import chaospy as cp
    >>> import hipuq
    >>> model = hipuq.models.ring("oberst2016")
    >>> exact = hipuq.integrate_friction(model, cp.Uniform(0.0, 0.1))
    >>> outcomes = hipuq.evaluate(exact, exact.nominal())
    >>> outcomes["probability"].values.round(10)
    array([0.90502728])
    """
    if not isinstance(model, CEAModel) or FRICTION not in model.parameters:
        raise InputError(
            f"friction cannot be integrated for {model!r}: it takes a hipuq model built from matrices, "
            "such as hipuq.models.ring(...), not integrated before"
        )
    found = as_distribution(distribution, "distribution of friction")
    if found.cdf is None:
        raise InputError(
            f"the distribution of friction {found.source!r} has no cdf: friction is integrated by it"
        )
    return FrictionIntegrated(model, found)


class FrictionIntegrated:
    """A model without the parameter friction, made by `integrate_friction`.

    The sweep covers the support of the distribution up to a modulus of 1000; an infinite end is cut where
    1e-9 of the probability is left (`hipuq.friction_range`). What is cut off goes into the bounds
    ``probability_low`` and ``_high``. A boundary itself is stable, and so is an atom of the distribution
    within 1e-12 of it, relatively.

    Attributes
    ----------
    model : CEAModel
        The model with friction.
    distribution : Distribution
        Of the friction coefficient [1].
    outcomes : tuple of str
        Names of the outcomes that a call can give.
    parameters : dict
        Name -> `hipuq.models.Parameter`, those of the model but friction.
    lower, upper : float
        Range of friction that is swept [1].
    block : int
        Samples that it takes at a time, at most.
    ragged : tuple of str
        Dims whose length depends on the samples.

    Raises
    ------
    InputError
        If the distribution leaves nothing to integrate over.
    """

    outcomes = (*schema.INTEGRATED, "status", "decided_by")
    block = 128
    """Samples that it takes at a time: each is worth hundreds."""
    ragged = ("interval",)
    """Dims whose length depends on the samples."""

    def __init__(self, model: CEAModel, distribution: Distribution) -> None:
        self.model = model
        self.distribution = distribution
        self.parameters = {name: p for name, p in model.parameters.items() if name != FRICTION}
        self.lower, self.upper = covered(distribution)

    @property
    def label(self) -> str:
        """Name and preset, for attributes and titles."""
        return f"{self.model.label}, friction integrated"

    @property
    def options(self) -> dict[str, Any]:
        """The model as JSON-able options: what rebuilds it."""
        return {**self.model.options, "integrated": {FRICTION: dict(self.distribution.description)}}

    def inputs(self, /, **distributions: object) -> Inputs:
        """Return inputs that know the model's nominal values, see `CEAModel.inputs`.

        Parameters
        ----------
        **distributions
            Parameter name = a distribution, `relative`, `shift` or `ContactPatterns`; not friction. There may
            be none: then nothing is left to chance.

        Returns
        -------
        Inputs
            To be given to `hipuq.design` or `hipuq.run`.

        Raises
        ------
        InputError
            If friction is among them, or a distribution cannot be used.
        UnknownNameError
            If the model has no such parameter.
        """
        self._refuse(distributions)
        return self.model.inputs(**distributions) if distributions else Inputs.from_json("{}")

    def nominal(self, /, **changes: ArrayLike) -> xr.Dataset:
        """Return one sample at the nominal values with changes, see `CEAModel.nominal`.

        Parameters
        ----------
        **changes
            Parameter name = value, in the units of the schema; not friction.

        Returns
        -------
        Dataset
            Over ``sample``, one variable for each parameter changed.

        Raises
        ------
        InputError
            If friction is among them, or a shape does not fit.
        UnknownNameError
            If the model has no such parameter.
        """
        self._refuse(changes)
        return self.model.nominal(**changes)

    def check(self, samples: xr.Dataset) -> None:
        """Check all samples at once, see `CEAModel.check`.

        Parameters
        ----------
        samples : Dataset
            Parameters over ``sample``, without friction.

        Raises
        ------
        InputError
            If friction is among them, or a value is not allowed.
        UnknownNameError
            If a variable is none of the model's parameters.
        SchemaError
            If a shape does not fit.
        """
        self._refuse_samples(samples)
        self.model.check(samples)

    def _refuse_samples(self, samples: xr.Dataset) -> None:
        # As a coordinate too friction would be taken to count.
        self._refuse(
            [FRICTION] if FRICTION in samples.variables else samples.data_vars, "parameter in samples"
        )

    def _refuse(self, names: Iterable[object], what: str = "parameter") -> None:
        """Raise an error for friction, or a name that is no parameter: friction is none to choose."""
        for name in names:
            if name == FRICTION:
                raise InputError(
                    "friction is integrated over its distribution: take it out of inputs and samples"
                )
            check_name(what, str(name), self.parameters)

    def __call__(self, samples: xr.Dataset, keep: Iterable[str] | None = None) -> xr.Dataset:
        """Return the outcomes of the samples.

        Parameters
        ----------
        samples : Dataset
            Parameters over ``sample``, without friction.
        keep : iterable of str, optional
            Outcomes wanted; all by default. ``status`` and ``decided_by`` always come.

        Returns
        -------
        Dataset
            Over ``sample``, ``mode`` and ``interval``; see `hipuq.schema.INTEGRATED`. A probability is
            the share among the friction whose verdict is known, NaN where none is; a sample of which a
            part of the sweep is not known has the status ``undecided``.
        """
        self._refuse_samples(samples)
        wanted = [
            check_name("outcome", name, self.outcomes) for name in (self.outcomes if keep is None else keep)
        ]
        cells = stability_cells(
            self.model.pencils(samples),
            *with_atoms(self.distribution, self.lower, self.upper),
            growth_threshold=self.model.growth_threshold,
            by_mode="probability_by_mode" in wanted,
        )
        cells = [replace(one, edges=one.edges.clip(self.lower, self.upper)) for one in cells]
        return self._outcomes(cells, wanted)

    def _outcomes(self, cells: list[Cells], wanted: list[str]) -> xr.Dataset:
        mass = self._mass(cells)
        unstable, decided = _shares(mass, [one.any_unstable[:, None] for one in cells])
        by_mode, modes_decided = _shares(mass, [one.unstable for one in cells])
        known = np.array([not np.isnan(one.any_unstable).any() for one in cells])
        intervals = [one.intervals(one.any_unstable) for one in cells]
        onsets = [_onset(one) for one in cells]
        longest = max((len(own) for own in intervals), default=0)
        padded = np.full((len(cells), longest, 2), np.nan)
        for row, own in zip(padded, intervals, strict=True):
            row[: len(own)] = own
        values = {
            "probability": (unstable / decided)[:, 0],
            "probability_low": unstable[:, 0],
            "probability_high": 1.0 - np.fmax(decided - unstable, 0.0)[:, 0],
            "probability_by_mode": by_mode / modes_decided,
            "onset": np.array(onsets),
            "interval": padded,
            "interval_count": np.where(known, [float(len(own)) for own in intervals], np.nan),
        }
        data: dict[str, Any] = {
            name: (schema.INTEGRATED[name].dims, values[name], schema.INTEGRATED[name].attrs)
            for name in wanted
            if name in values
        }
        for name in data.keys() & {"interval", "onset"}:
            dims, array, attrs = data[name]
            data[name] = (dims, array, {**attrs, "range": [self.lower, self.upper]})
        status = np.where(known, schema.STATUS["ok"], schema.STATUS["undecided"]).astype(np.int8)
        data["status"] = ("sample", status, schema.flag_attrs("status of the sample", schema.STATUS))
        proved = [CERTIFICATE if all(b.certified for b in one.boundaries) else STRUCTURED for one in cells]
        decided = np.where(known, proved, -1).astype(np.int8)
        attrs = schema.flag_attrs("what decided the boundaries", schema.DECIDED_BY)
        data["decided_by"] = ("sample", decided, attrs)
        coords = self.model.mode_coordinates() if "probability_by_mode" in wanted else {}
        return xr.Dataset(data, coords=coords)

    def _mass(self, cells: list[Cells]) -> list[Array]:
        """Return the probability that friction is in each cell; a boundary goes to the stabler side."""
        cdf = self.distribution.cdf
        assert cdf is not None
        first = float(cdf(np.array([np.nextafter(self.lower, -np.inf)]))[0])
        last = float(cdf(np.array([self.upper]))[0])
        places = []
        for one in cells:
            rises = one.count[1:] > one.count[:-1]
            inner = one.edges[1:-1]
            places.append(inner + np.where(rises, SIDE, -SIDE) * np.abs(inner))
        ends = np.cumsum([len(own) for own in places])
        together = np.concatenate(places)
        split = np.split(cdf(together) if together.size else together, ends[:-1])
        # Boundaries nearer to each other, or to an end, than SIDE must not change places.
        ascending = [np.maximum.accumulate(np.clip(own, first, last)) for own in split]
        return [np.diff(np.concatenate([[first], own, [last]])) for own in ascending]


def _shares(mass: list[Array], verdicts: list[Array]) -> tuple[Array, Array]:
    """Return the probability of a verdict of 1, and of any; verdicts are (cells, k), results (samples, k)."""
    # Differences of probabilities may add up to 1 and a little.
    pairs = [(m @ (one == 1), m @ ~np.isnan(one)) for m, one in zip(mass, verdicts, strict=True)]
    unstable, decided = (np.minimum(np.stack(part), 1.0) for part in zip(*pairs, strict=True))
    return np.minimum(unstable, decided), np.where(decided > 0, decided, np.nan)


def _onset(cells: Cells) -> float:
    """Return where the first unstable cell begins, infinity if none does, NaN behind an unknown one."""
    verdict = cells.any_unstable
    first = int(np.argmax(verdict == 1)) if (verdict == 1).any() else len(verdict)
    if np.isnan(verdict[:first]).any():
        return np.nan
    return float(cells.edges[first]) if first < len(verdict) else np.inf
