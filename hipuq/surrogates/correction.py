"""Where true evaluations mend the probability of a surrogate: more of them near the limit state."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.inputs import Inputs
from hipuq.sampling import spawn, unit_points
from hipuq.surrogates.limit_state import LimitState
from hipuq.surrogates.options import STRATA, Basis
from hipuq.surrogates.surrogate import fitted
from hipuq.surrogates.training import FIT, HELD_OUT

Array = NDArray[np.float64]


def corrections(
    outcomes: xr.Dataset,
    inputs: Inputs,
    values: xr.DataArray,
    state: LimitState,
    basis: Basis,
    nodes: Array | None,
    wanted: int,
    population: int,
    seed: int,
) -> xr.Dataset:
    """Return samples for true evaluations: random ones in strata of equal predictions.

    Parameters
    ----------
    outcomes : Dataset
        Of the design.
    inputs : Inputs
    values : (s,) DataArray
        The outcome.
    state : LimitState
    basis : Basis
        What the fit may use.
    nodes : (s,) array or None
        Quadrature weights.
    wanted : int
        Number of samples, as `check_correction` allows it.
    population : int
        Points, a power of 2, that the samples are taken from.
    seed : int

    Returns
    -------
    Dataset
        With the coords ``round``, 1, ``stratum``, from 1, and ``stratum_weight`` over sample.
    """
    y = values.values.astype(np.float64)[:, None]
    stratum = outcomes["stratum"].values
    surrogate = fitted(outcomes, y, stratum == FIT, inputs, basis, nodes)
    held = stratum == HELD_OUT
    u = unit_points("sobol", population, inputs.dimension, seed, (0,), slice(0, population))
    samples = inputs.samples(u)
    distance = state.distance(surrogate.at(samples, inputs)[:, 0])
    checked = state.distance(surrogate.at(outcomes.isel(sample=held), inputs)[:, 0])
    number, count = strata_of(distance, checked, state.event(y[held, 0]), wanted)
    members = [np.flatnonzero(number == k) for k in range(len(count))]
    rows = np.concatenate(
        [
            spawn(seed, 1, k).choice(own, size, replace=False)
            for k, (own, size) in enumerate(zip(members, count, strict=True))
        ]
    )
    share = np.bincount(number, minlength=len(count)) / len(number)
    books = {
        "sample": outcomes["sample"].values.max() + 1 + np.arange(len(rows)),
        "round": np.ones(len(rows), np.int64),
        "stratum": number[rows] + 1,
        "stratum_weight": share[number[rows]],
    }
    return samples.isel(sample=rows).assign_coords(
        {key: ("sample", book, schema.COORDINATES[key].attrs) for key, book in books.items()}
    )


def strata_of(
    distance: Array, held: Array, event: Array, wanted: int
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Return the stratum of each point and how many true evaluations each stratum should get.

    Half of them go to all strata alike, for the interval must not rest on trust in the surrogate; the
    other half where the events of the held-out samples are most mixed (Neyman's allocation).

    Parameters
    ----------
    distance : (points,) array
        Predicted distance to the limit state.
    held : (h,) array
        The same of held-out samples.
    event : (h,) array
        Whether they are events; NaN where unknown.
    wanted : int
        True evaluations, as `check_correction` allows them.

    Returns
    -------
    stratum : (points,) array of int
        From 0.
    count : (strata,) array of int
        Adds up to `wanted`.

    """
    edges = np.quantile(distance, np.arange(1, STRATA) / STRATA)
    stratum = np.searchsorted(edges, distance, side="right")
    known = ~np.isnan(event)
    where = np.searchsorted(edges, held[known], side="right")
    hits = np.bincount(where, event[known], STRATA) + 0.5
    n = np.bincount(where, minlength=STRATA) + 1.0
    size = np.bincount(stratum, minlength=STRATA)
    spread = size * np.sqrt(hits / n * (1 - hits / n))
    share = 0.5 * size / size.sum() + 0.5 * spread / spread.sum()
    return stratum, _whole(share * wanted, size)


def _whole(exact: Array, most: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return whole numbers near `exact` with the same sum, none above `most`."""
    wanted = round(exact.sum())
    count = np.minimum(np.floor(exact).astype(np.int64), most)
    while (left := wanted - int(count.sum())) > 0:
        # One more for each stratum that has room, those first that are the furthest below their share.
        room = np.flatnonzero(count < most)
        count[room[np.argsort((count - exact)[room], kind="stable")[:left]]] += 1
    return count
