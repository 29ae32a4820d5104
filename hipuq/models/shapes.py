"""Mode shapes and energies of one sample, with names and units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.cea import ModeShapes

ENERGIES = {
    "strain_energy": "mean strain energy over a cycle",
    "kinetic_energy": "mean kinetic energy over a cycle",
    "friction_work": "work of friction in a cycle",
    "damping_work": "work of damping in a cycle",
}
"""Energies of a mode -> what they are."""


def labelled_shapes(shapes: ModeShapes, coords: Mapping[str, Any]) -> xr.Dataset:
    """Return mode shapes as a Dataset.

    Parameters
    ----------
    shapes : ModeShapes
        As the kernel gives them.
    coords : mapping
        Coordinates over ``mode``.

    Returns
    -------
    Dataset
        ``shape_real``, ``shape_imag`` over (mode, dof) [m]; ``frequency`` [Hz], ``growth_rate`` [1/s] and the
        energies [J] over mode.
    """
    attrs = {"units": "m", "normalization": "modal mass 1 kg m^2, largest entry real"}
    data: dict[str, Any] = {
        "frequency": ("mode", shapes.eigenvalue.imag / (2 * np.pi), schema.OUTCOMES["frequency"].attrs),
        "growth_rate": ("mode", shapes.eigenvalue.real, schema.OUTCOMES["growth_rate"].attrs),
    }
    for part in ("real", "imag"):
        own = {"long_name": f"mode shape, {part} part", **attrs}
        data[f"shape_{part}"] = (("mode", "dof"), getattr(shapes.shape, part), own)
    for name, long_name in ENERGIES.items():
        data[name] = ("mode", getattr(shapes, name), {"long_name": long_name, "units": "J"})
    numbers = np.arange(1, shapes.shape.shape[1] + 1)
    dof = ("dof", numbers, {"long_name": "degree of freedom", "units": "1"})
    return xr.Dataset(data, coords={**coords, "dof": dof})
