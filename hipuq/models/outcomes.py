"""Spectra of a batch as labelled outcomes."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.cea import Spectra
from hipuq.errors import unknown_name


class Labels(Protocol):
    """What labels outcomes: a model."""

    @property
    def outcomes(self) -> tuple[str, ...]:
        """Names of the outcomes that there are."""

    def mode_coordinates(self) -> dict[str, Any]:
        """Return the coordinates of modes."""


def labelled_outcomes(spectra: Spectra, keep: tuple[str, ...], model: Labels) -> xr.Dataset:
    """Return spectra as the outcomes of a model.

    Parameters
    ----------
    spectra : Spectra
        Of s samples with n modes.
    keep : tuple of str
        Outcomes wanted; ``status`` and ``decided_by`` always come.
    model : Labels
        Gives the outcomes that there are and the coordinates of modes.

    Returns
    -------
    Dataset
        Over ``sample``, and ``mode`` where an outcome is by mode.

    Raises
    ------
    UnknownNameError
        If there is no such outcome.
    """
    any_unstable = spectra.any_unstable
    undecided = np.isnan(any_unstable)
    data: dict[str, Any] = {}
    for name in keep:
        if name in schema.OUTCOMES:
            variable = schema.OUTCOMES[name]
            values = any_unstable if name == "any_unstable" else getattr(spectra, name)
            data[name] = (variable.dims, values, variable.attrs)
        elif name not in ("status", "decided_by"):
            raise unknown_name("outcome", name, model.outcomes)
    status = np.where(undecided, schema.STATUS["undecided"], schema.STATUS["ok"]).astype(np.int8)
    data["status"] = ("sample", status, schema.flag_attrs("status of the sample", schema.STATUS))
    data["decided_by"] = (
        "sample",
        spectra.decided_by,
        schema.flag_attrs("what decided the verdict", schema.DECIDED_BY),
    )
    coords = {}
    if any("mode" in value[0] for value in data.values()):
        coords = model.mode_coordinates()
    return xr.Dataset(data, coords=coords)
