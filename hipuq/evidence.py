"""What was measured in patients and on the bench, to be set beside a prediction.

Figures that were read at their source, but for those that say who cites them. They are of other things than
a probability of instability in a model: an incidence is the share of patients who heard their implant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from hipuq import schema
from hipuq.errors import check_name

LITERATURE = "literature"
"""Group of what is published, in the results of a study; no analysis may have its name."""

NAN = float("nan")


@dataclass(frozen=True)
class Published:
    """One published figure.

    Attributes
    ----------
    source : str
        What it is of, in short.
    value : float
        NaN where only a range is given.
    low, high : float
        Range, or value plus and minus the error, as published; NaN where there is none.
    reference : str
        Where it is published.
    """

    source: str
    value: float
    low: float
    high: float
    reference: str


OBERST = "as cited by Oberst et al., INTER-NOISE 2016, p. 5539"
LEE = "Lee et al., Hip & Pelvis 26 (2014) 92"
JOSR = "J. Orthop. Surg. Res. 2018, doi 10.1186/s13018-018-0841-y"
PARVIZI = "Parvizi et al., Clin. Orthop. Relat. Res. 469 (2011) 1598"
WALTER = "Walter et al. 2008, PMC2899857"
DAMM = "Damm et al., PLoS ONE 2013"
FAN = "Fan et al., J. Orthop. Res. 31 (2013) 1627"
BENCH = "O'Dwyer Lancaster-Jones and Reddiough, J. Mech. Behav. Biomed. Mater. 138 (2023) 105616"

FIGURES: Mapping[str, tuple[str, str, tuple[Published, ...]]] = {
    "incidence": (
        "share of ceramic-on-ceramic hips reported to squeak",
        "1",
        (
            Published("Asian patients", 0.027, NAN, NAN, LEE),
            Published("fourth generation", 0.03, NAN, NAN, JOSR),
            Published("Western patients", 0.031, NAN, NAN, LEE),
            Published("one series, 92 of 1507", 92 / 1507, NAN, NAN, PARVIZI),
            Published("highest reported", 0.209, NAN, NAN, OBERST),
        ),
    ),
    "critical_friction": (
        "friction coefficient at which squeak set in on the bench (with the range published)",
        "1",
        (
            Published("long Ti stem", 0.29, 0.27, 0.31, FAN),
            Published("long CoCr stem", 0.32, 0.30, 0.34, FAN),
            Published("short Ti stem", 0.39, 0.37, 0.41, FAN),
        ),
    ),
    "squeak_frequency": (
        "frequency of squeak on the bench",
        "Hz",
        (
            Published("dry, standard gait", NAN, 2000.0, 8000.0, BENCH),
            Published("dry, edge loading", NAN, 5000.0, 9000.0, BENCH),
        ),
    ),
    "friction": (
        "friction coefficient",
        "1",
        (
            Published("natural joint", NAN, 0.001, 0.006, OBERST),
            Published("in vivo, ceramic on polyethylene, first in the step", 0.04, 0.03, 0.06, DAMM),
            Published("ceramic on ceramic, good film", 0.06, NAN, NAN, WALTER),
            Published("in vivo, ceramic on polyethylene, second in the step", 0.06, 0.04, 0.08, DAMM),
            Published("in vivo, ceramic on polyethylene, third in the step", 0.14, 0.09, 0.23, DAMM),
            Published("ceramic on ceramic, film lost, up to", NAN, 0.7, 1.0, WALTER),
        ),
    ),
}
"""Quantity -> its long name, unit and figures."""


def literature(quantity: str) -> xr.Dataset:
    """Return what is published of a quantity.

    Parameters
    ----------
    quantity : str
        ``"incidence"``, ``"critical_friction"``, ``"squeak_frequency"`` or ``"friction"``.

    Returns
    -------
    Dataset
        ``value``, ``low``, ``high`` over ``source``, [1], or [Hz] of a frequency, NaN where the source does
        not give it; coord ``reference(source)``.

    Raises
    ------
    UnknownNameError
        If there is nothing of the quantity.

    Examples
    --------
    >>> import hipuq
    >>> published = hipuq.literature("critical_friction")
    >>> published["value"].to_series().to_dict()
    {'long Ti stem': 0.29, 'long CoCr stem': 0.32, 'short Ti stem': 0.39}
    >>> str(published["reference"].values[0])
    'Fan et al., J. Orthop. Res. 31 (2013) 1627'
    """
    long_name, units, figures = FIGURES[check_name("published quantity", quantity, FIGURES)]
    data: dict[str, Any] = {
        name: (
            "source",
            np.array([getattr(one, name) for one in figures], np.float64),
            {"long_name": long_name + text, "units": units},
        )
        for name, text in (("value", ""), ("low", ", low"), ("high", ", high"))
    }
    coords: dict[str, Any] = {
        name: ("source", np.array([getattr(one, name) for one in figures]), {"long_name": text, "units": ""})
        for name, text in (("source", "what it is of"), ("reference", "where it is published"))
    }
    found = xr.Dataset(data, coords=coords, attrs={"quantity": quantity})
    # They are what they are at any time.
    history = f"published figures of {quantity}"
    return schema.stamp(found, history).assign_attrs(history=history)
