"""Points in the unit cube and samples, by rows: the same rows whatever the slices they are asked for in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from hipuq import schema
from hipuq.errors import InputError, check_name
from hipuq.inputs import Inputs

Array = NDArray[np.float64]
Seed = int | np.integer | np.random.Generator | np.random.SeedSequence | None

BLOCK = 4096
"""Rows that share a key of the random sampler; designs are made in blocks of this size."""

LATIN_HYPERCUBE_MAXIMUM = 2**22
"""Largest latin hypercube, which has to be made whole."""

LATIN_HYPERCUBE_KEPT = 2**25
"""Most numbers of a latin hypercube that is kept for the next rows asked for (256 MiB)."""

POINTS = 2**21
"""Numbers of points that a design asks for at a time (16 MiB), in whole blocks: a Sobol sequence is scrambled
and run forward anew each time."""

SAMPLERS = ("random", "latin_hypercube", "sobol")


def seed_of(rng: Seed) -> int:
    """Return the one integer that a design is made from.

    Parameters
    ----------
    rng : int, Generator, SeedSequence or None
        An integer from 0 to 2**63 - 1 is the seed itself. A Generator gives one draw, so that two
        designs from one Generator differ. None asks the operating system.

    Returns
    -------
    int

    Raises
    ------
    InputError
        For anything else.
    """
    if rng is None:
        rng = np.random.SeedSequence()
    if isinstance(rng, np.random.SeedSequence):
        rng = np.random.default_rng(rng)
    if isinstance(rng, np.random.Generator):
        return int(rng.integers(0, 2**63, dtype=np.uint64))
    if isinstance(rng, (int, np.integer)) and not isinstance(rng, bool) and 0 <= rng < 2**63:
        return int(rng)
    raise InputError(f"rng is {rng!r}: it must be an integer from 0 to 2**63 - 1 or a numpy Generator")


def spawn(seed: int, *key: int) -> np.random.Generator:
    """Return the Generator that belongs to a key, independent of those of all other keys."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def check_count(name: str, value: object, minimum: int = 1) -> int:
    """Return a number of samples, draws or replicates as int.

    Raises
    ------
    InputError
        If it is not an integer of at least `minimum`.
    """
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool) and value >= minimum:
        return int(value)
    raise InputError(f"{name} is {value!r}: it must be an integer of {minimum} or more")


def check_size(sampler: str, n: int, replicates: int = 1) -> None:
    """Check that a sampler can make a design of n points.

    Parameters
    ----------
    sampler : str
        One of `SAMPLERS`.
    n : int
        Points of one replicate.
    replicates : int
        How many of them there are, for the message.

    Raises
    ------
    UnknownNameError
        If there is no such sampler.
    InputError
        If n does not suit it.
    """
    check_name("sampler", sampler, SAMPLERS)
    if sampler == "latin_hypercube" and n > LATIN_HYPERCUBE_MAXIMUM:
        raise InputError(
            f"a latin hypercube of {n} points has to be made whole: at most "
            f"{LATIN_HYPERCUBE_MAXIMUM}; take sampler 'random' or 'sobol'"
        )
    if sampler == "sobol" and n & (n - 1):
        below = 1 << (n.bit_length() - 1)
        raise InputError(
            f"a Sobol design of {n * replicates} points in {replicates} replicates is not balanced: each "
            f"needs a power of 2, so take {below * replicates} or {2 * below * replicates}"
        )


def unit_points(sampler: str, n: int, dimension: int, seed: int, key: tuple[int, ...], rows: slice) -> Array:
    """Return rows of a design of n points in the unit cube.

    Parameters
    ----------
    sampler : str
        ``"random"``, ``"latin_hypercube"`` or ``"sobol"`` (scrambled: by linear matrices and a digital
        shift, as SciPy does).
    n : int
        Number of points of the whole design; a power of 2 for ``"sobol"``.
    dimension : int
        Number of columns.
    seed : int
        Seed of the design.
    key : tuple of int
        Which design of this seed: level and replicate.
    rows : slice
        Start and stop, both given.

    Returns
    -------
    (rows, dimension) array
        In [0, 1).

    Raises
    ------
    InputError
        If n does not suit the sampler.
    """
    check_size(sampler, n)
    if sampler == "random":
        return _random(dimension, seed, key, rows)
    from scipy.stats import qmc

    if sampler == "latin_hypercube":
        made = _kept_hypercube if n * dimension <= LATIN_HYPERCUBE_KEPT else _hypercube
        return made(n, dimension, seed, key)[rows].copy()
    sequence = qmc.Sobol(dimension, scramble=True, rng=spawn(seed, *key))
    if rows.start:
        sequence.fast_forward(rows.start)
        return np.asarray(sequence.random(rows.stop - rows.start))
    # A first draw of other than a power of 2 points, as a slice may be, would warn: draw one first.
    first = sequence.random(1)
    return np.concatenate([first, sequence.random(rows.stop - 1)]) if rows.stop > 1 else first


def _hypercube(n: int, dimension: int, seed: int, key: tuple[int, ...]) -> Array:
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(dimension, rng=spawn(seed, *key)).random(n))


# A design made by rows asks for slices of the same hypercube one after the other.
_kept_hypercube = lru_cache(maxsize=1)(_hypercube)


def _random(dimension: int, seed: int, key: tuple[int, ...], rows: slice) -> Array:
    points = np.empty((rows.stop - rows.start, dimension))
    for block in range(rows.start // BLOCK, -(-rows.stop // BLOCK)):
        first = block * BLOCK
        stop = min(rows.stop, first + BLOCK)
        drawn = spawn(seed, *key, block).random((stop - first, dimension))
        begin = max(rows.start, first)
        points[begin - rows.start : stop - rows.start] = drawn[begin - first :]
    return points


def rows_of(total: int, rows: slice | None) -> slice:
    """Return `rows` with a start and a stop.

    Raises
    ------
    InputError
        If they are not rows of a design of `total` samples.
    """
    if rows is None:
        return slice(0, total)
    ends = (rows.start, rows.stop) if isinstance(rows, slice) else (rows,)
    if not isinstance(rows, slice) or not all(isinstance(end, (int, type(None))) for end in ends):
        raise InputError(f"rows is {rows!r}: it must be a slice of integers, such as slice(0, 100)")
    start = 0 if rows.start is None else rows.start
    stop = total if rows.stop is None else rows.stop
    if rows.step not in (None, 1) or not 0 <= start < stop <= total:
        raise InputError(f"rows is {rows}: it must be a slice without a step inside 0 to {total}")
    return slice(start, stop)


def samples_by_block(inputs: Inputs, points: Callable[[slice], Array], rows: slice, total: int) -> xr.Dataset:
    """Return rows of a design, mapped to physical values in fixed blocks.

    Quantile functions that iterate to convergence may stop differently in another company, so each
    block is always mapped whole.

    Parameters
    ----------
    inputs : Inputs
    points : callable
        Rows -> points of the unit cube, (rows, dimension).
    rows : slice
        The rows wanted.
    total : int
        Rows of the whole design.

    Returns
    -------
    Dataset
        Over ``sample``, numbered by row.
    """
    parts = []
    step = BLOCK * max(1, POINTS // (BLOCK * max(inputs.dimension, 1)))
    for first in range(rows.start // BLOCK * BLOCK, rows.stop, step):
        last = min(first + step, -(-rows.stop // BLOCK) * BLOCK, total)
        u = points(slice(first, last))
        for start in range(first, last, BLOCK):
            part = inputs.samples(u[start - first : start - first + BLOCK])
            wanted = slice(max(rows.start - start, 0), rows.stop - start)
            # Where a stratum leaves no other input there is no dim either.
            parts.append(part.isel(sample=wanted) if part.sizes else part)
    numbers = ("sample", np.arange(rows.start, rows.stop), schema.COORDINATES["sample"].attrs)
    return _joined(parts).assign_coords(sample=numbers)


def _joined(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return blocks of samples one after the other; xr.concat would align and compare them."""
    joined: dict[Any, Any] = {}
    for name, values in parts[0].variables.items():
        if "sample" in values.dims:
            arrays = [part.variables[name].values for part in parts]
            joined[name] = (values.dims, np.concatenate(arrays, values.dims.index("sample")), values.attrs)
        else:
            joined[name] = values
    coords = {name: joined.pop(name) for name in parts[0].coords}
    return xr.Dataset(joined, coords)
