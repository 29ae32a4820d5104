"""The only place that imports SALib, of which only the estimators are used.

Its ``analyze`` gives 0 for outcomes that are constant or hold a NaN, takes seed 0 for none, and has
intervals that are symmetric by construction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def indices(a: Array, ab: Array, ba: Array, b: Array, pairs: Sequence[tuple[int, int]] = ()) -> Array:
    """Return Sobol indices as ``SALib.analyze.sobol`` estimates them.

    First order after Saltelli et al., Comput. Phys. Commun. 181 (2010) 259, total order after Jansen,
    Comput. Phys. Commun. 117 (1999) 35, second order after Saltelli, Comput. Phys. Commun. 145 (2002) 280.

    Parameters
    ----------
    a : (blocks,) array
        Outcomes of the base matrix A, centred and scaled.
    ab : (blocks, groups) array
        Outcomes of A with one group of columns from B.
    ba : (blocks, groups) array
        Outcomes of B with one group of columns from A; used for pairs only.
    b : (blocks,) array
        Outcomes of the base matrix B.
    pairs : sequence of (int, int)
        Groups of which to return second-order indices, the smaller number first.

    Returns
    -------
    (2 groups + pairs,) array
        First order, total order, second order.
    """
    from SALib.analyze.sobol import first_order, second_order, total_order

    groups = range(ab.shape[1])
    return np.array(
        [first_order(a, ab[:, j], b) for j in groups]
        + [total_order(a, ab[:, j], b) for j in groups]
        + [second_order(a, ab[:, j], ab[:, k], ba[:, j], b) for j, k in pairs]
    )
