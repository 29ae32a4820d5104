"""A range of friction cut into cells in which the same modes are unstable throughout.

The cells end where the number of unstable modes changes. Within them the verdict of one place is that
of all, and each cell is looked at: where what is found does not fit the boundaries, it is unknown.
Modes are numbered by frequency at each friction, so a cell also ends where an unstable mode overtakes
a stable one.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.boundary import Boundary, inside
from hipuq.cea.bounds import AUTO, NEVER
from hipuq.cea.damped_onset import damped_boundaries
from hipuq.cea.onset import check_range, search
from hipuq.cea.overtaking import Change, located
from hipuq.cea.pencils import Array, Pencils
from hipuq.cea.spectrum import solve
from hipuq.errors import InputError

Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]

BLOCK = 1024
"""Frictions looked at together."""

LOOKS = 9
"""Places at which each cell is looked at."""

LOOKS_BY_MODE = 33
"""The same where modes are told apart: one that overtakes another twice between two of them is not seen."""

SURE = 3
"""Every so manieth of those is solved by all means. At the others double precision is asked; where it knows
nothing the modes that grow fastest are taken, as many as there are, if that agrees with the neighbours."""

FINEST = 1e-10
"""Width to which an overtaking is located, as part of the range."""


@dataclass(frozen=True)
class Cells:
    """The cells of one sample over a range of friction.

    Attributes
    ----------
    edges : (k + 1,) array
        Ends of the cells, ascending, those of the range included [1].
    count : (k,) array
        Number of unstable modes in each cell, NaN where that is not known.
    unstable : (k, n) array
        1 where a mode is unstable in a cell, 0 where not, NaN where that is not known.
    boundaries : tuple of Boundary
        Where the number of unstable modes changes, ascending.
    """

    edges: Array
    count: Array
    unstable: Array
    boundaries: tuple[Boundary, ...]

    @property
    def any_unstable(self) -> Array:
        """1, 0 or NaN for each cell, (k,)."""
        return np.minimum(self.count, 1.0)

    def intervals(self, verdict: Array) -> Array:
        """Return the intervals in which a verdict is 1, neighbouring cells joined, (m, 2).

        Parameters
        ----------
        verdict : (k,) array
            Such as `any_unstable`, or a column of `unstable`.
        """
        inside = np.concatenate([[False], verdict == 1, [False]])
        change = np.flatnonzero(inside[1:] != inside[:-1])
        found: Array = self.edges[change].reshape(-1, 2)
        return found


def stability_cells(
    pencils: Pencils, lower: float, upper: float, *, growth_threshold: float = 0.0, by_mode: bool = True
) -> list[Cells]:
    """Cut a range of friction into cells in which the same modes are unstable.

    Parameters
    ----------
    pencils : Pencils
        s samples; their own friction is not used.
    lower, upper : float
        Range of friction, lower < upper [1].
    growth_threshold : float
        Growth rate above which a mode is unstable [1/s].
    by_mode : bool
        Whether cells end where an unstable mode overtakes a stable one. Without that only the number of
        unstable modes is that of the whole cell.

    Returns
    -------
    list of Cells

    Raises
    ------
    InputError
        If the range is not one, or a threshold is negative.
    """
    check_range(lower, upper)
    found, unresolved = _all_boundaries(pencils, lower, upper, growth_threshold)
    edges = [np.array([lower, *(one.friction for one in own or ()), upper]) for own in found]
    row = np.repeat(np.arange(len(edges)), [len(own) - 1 for own in edges])
    start, end = (np.concatenate([own[part] for own in edges]) for part in (slice(-1), slice(1, None)))
    looks = _looks(LOOKS_BY_MODE if by_mode else LOOKS)
    friction = start[:, None] + (end - start)[:, None] * looks
    unstable = _looked(pencils, row, friction, growth_threshold, by_mode)
    fits = np.zeros(friction.shape, bool)
    for i, own in enumerate(found):
        if own is not None:
            fits[row == i] = _fitting(unstable[row == i].sum(axis=2), own)
    pieces = [
        _pieces(*cell, by_mode) for cell in zip(row.tolist(), start, friction, unstable, fits, strict=True)
    ]
    # Not below the distance of doubles, where nothing lies between two frictions.
    finest = max(FINEST * (upper - lower), 4 * float(np.spacing(max(abs(lower), abs(upper)))))
    _locate(pencils, pieces, growth_threshold, finest)
    cells = []
    for i, own in enumerate(found):
        parts = [part for j in np.flatnonzero(row == i) for part in pieces[j]]
        at = np.array([part.start for part in parts] + [upper])
        count = np.array([part.count for part in parts])
        whole = Cells(at, count, np.stack([part.unstable for part in parts]), tuple(own or ()))
        cells.append(_without(whole, unresolved[i]))
    return cells


def _without(cells: Cells, unresolved: Array) -> Cells:
    """Return cells of which nothing is known in some intervals of friction, (k, 2)."""
    if not len(unresolved):
        return cells
    edges = np.union1d(cells.edges, unresolved.clip(cells.edges[0], cells.edges[-1]))
    middle = (edges[:-1] + edges[1:]) / 2
    here = np.searchsorted(cells.edges, middle) - 1
    lost = ((unresolved[:, :1] < middle) & (middle < unresolved[:, 1:])).any(axis=0)
    count = np.where(lost, np.nan, cells.count[here])
    return Cells(edges, count, np.where(lost[:, None], np.nan, cells.unstable[here]), cells.boundaries)


@dataclass(frozen=True)
class _Piece:
    """A part of a cell from `start` on, with the modes unstable there, looked at up to `last`."""

    row: int
    start: float
    first: float
    last: float
    count: float
    unstable: Array


def _all_boundaries(
    pencils: Pencils, lower: float, upper: float, growth_threshold: float
) -> tuple[list[tuple[Boundary, ...] | None], list[Array]]:
    """Return the boundaries of each sample, None where they cannot be told apart, and what is unresolved."""
    samples = len(pencils.stiffness)
    damped = np.full(samples, growth_threshold > 0)
    if pencils.damping is not None:
        damped |= pencils.damping.any(axis=(1, 2))
    found: list[tuple[Boundary, ...] | None] = [None] * samples
    unresolved = [np.empty((0, 2))] * samples

    def look(rows: Rows) -> None:
        own = pencils.rows(rows)
        if damped[rows].any():
            parts = damped_boundaries(own, lower, upper, growth_threshold)
            parts = [inside(part, lower, upper) for part in parts]
        else:
            both = search(replace(own, damping=None), lower, upper)
            parts = both.boundaries
            for i, left in zip(rows, both.unresolved, strict=True):
                unresolved[i] = left
        for i, part in zip(rows, parts, strict=True):
            found[i] = tuple(part)

    for rows in (np.flatnonzero(~damped), np.flatnonzero(damped)):
        try:
            if rows.size:
                look(rows)
        except InputError:
            # One sample that cannot be searched takes no other with it.
            for i in rows:
                with suppress(InputError):
                    look(np.array([i]))
    return found, unresolved


def _looks(count: int) -> Array:
    """Return places in a cell of length 1, denser towards its ends."""
    places: Array = (1 - np.cos(np.pi * (np.arange(count) + 0.5) / count)) / 2
    return places


def _looked(pencils: Pencils, row: Rows, friction: Array, growth_threshold: float, by_mode: bool) -> Array:
    """Return which modes are unstable at the looks of cells, (cells, looks, n); NaN where not known."""
    places = np.arange(friction.shape[1])
    sure = places % SURE == 1 if by_mode else np.ones(len(places), bool)
    rows = np.repeat(row[:, None], len(places), axis=1)
    made = np.full((*friction.shape, pencils.size), np.nan)
    made[:, sure] = _seen(pencils, rows[:, sure], friction[:, sure], growth_threshold).unstable
    if sure.all():
        return made
    quick = _seen(pencils, rows[:, ~sure], friction[:, ~sure], growth_threshold, NEVER)
    # Where double precision leaves it open: the modes that seem to grow fastest, as many as there are.
    count = np.nan_to_num(np.fmax.reduce(made[:, sure].sum(axis=2), axis=1))
    rank = np.argsort(np.argsort(-quick.growth_rate, axis=2, kind="stable"), axis=2)
    open_: Mask = np.asarray(np.isnan(quick.unstable).any(axis=2))
    guess = np.where(open_[:, :, None], rank < count[:, None, None], quick.unstable)
    last = np.searchsorted(places[sure], places[~sure])
    for beside in (last - 1, last):
        near = made[:, sure][:, beside.clip(0, sure.sum() - 1)]
        odd = open_ & (guess != near).any(axis=2)
        guess[odd] = _seen(pencils, rows[:, ~sure][odd], friction[:, ~sure][odd], growth_threshold).unstable
        open_ &= ~odd
    made[:, ~sure] = guess
    return made


class _Seen(NamedTuple):
    """What is seen of modes, each of the shape of the frictions and one more axis, (..., n)."""

    unstable: Array
    """NaN where not known."""
    frequency: Array
    """[Hz]"""
    growth_rate: Array
    """[1/s]"""


def _seen(
    pencils: Pencils, row: Rows, friction: Array, growth_threshold: float, certify: str = AUTO
) -> _Seen:
    """Return what is seen of the modes of samples at frictions."""
    seen = _Seen(*np.empty((3, friction.size, pencils.size)))
    for part, own in _blocks(pencils, row, friction):
        spectra = solve(own, growth_threshold=growth_threshold, certify=certify)
        for into, name in zip(seen, _Seen._fields, strict=True):
            into[part] = getattr(spectra, name)
    return _Seen(*(into.reshape(*friction.shape, pencils.size) for into in seen))


def _blocks(pencils: Pencils, row: Rows, friction: Array) -> Iterator[tuple[slice, Pencils]]:
    """Give the pencils of samples at frictions in blocks."""
    row, friction = row.ravel(), friction.ravel()
    for start in range(0, len(row), BLOCK):
        part = slice(start, start + BLOCK)
        yield part, replace(pencils.rows(row[part]), friction=friction[part])


def _fitting(count: Array, found: tuple[Boundary, ...]) -> Mask:
    """Say at which looks (cells, looks) the number of unstable modes is what the boundaries say."""
    change = np.cumsum([0, *(one.direction for one in found)])[:, None]
    at_start = count - change
    known = at_start[~np.isnan(at_start)]
    if not known.size:
        return np.zeros(count.shape, bool)
    values, times = np.unique(known, return_counts=True)
    return np.asarray(at_start == values[times.argmax()])


def _pieces(
    row: int, start: float, friction: Array, unstable: Array, fits: Mask, by_mode: bool
) -> list[_Piece]:
    """Return the parts of a cell in which its looks show the same modes unstable."""
    # A verdict that contradicts the boundaries shows that one was missed: then nothing is known.
    if not fits.any() or not (fits | np.isnan(unstable).any(axis=1)).all():
        return [_Piece(row, start, start, start, np.nan, np.full(unstable.shape[1], np.nan))]
    x, shown = friction[fits], unstable[fits]
    changes = np.flatnonzero((shown[1:] != shown[:-1]).any(axis=1)) + 1 if by_mode else np.empty(0, np.intp)
    count = float(shown[0].sum())
    return [
        _Piece(row, start if first == 0 else float(x[first]), float(x[first]), float(x[end - 1]), count, own)
        for first, end, own in zip([0, *changes], [*changes, len(x)], shown[[0, *changes]], strict=True)
    ]


def _locate(pencils: Pencils, pieces: list[list[_Piece]], growth_threshold: float, finest: float) -> None:
    """Move the starts of pieces to where unstable modes overtake others, in place.

    What lies between two looks that cannot be told becomes a piece of which the number of unstable modes
    is known, but not which.
    """

    def look(cells: list[int], friction: Array) -> tuple[Array, Array]:
        seen = _seen(pencils, np.array([pieces[k][0].row for k in cells]), friction, growth_threshold)
        return seen.unstable, seen.frequency

    changes = [
        Change(k, [a.last, b.first], [a.unstable, b.unstable])
        for k, own in enumerate(pieces)
        for a, b in pairwise(own)
    ]
    for k in {one.cell for one in changes}:
        del pieces[k][1:]
    for one in located(changes, look, finest):
        own, (low, high), above = pieces[one.cell], one.ends, one.shown[1]
        if one.known:
            own.append(replace(own[0], start=(low + high) / 2, unstable=above))
        else:
            own.append(replace(own[0], start=low, unstable=np.full_like(above, np.nan)))
            own.append(replace(own[0], start=high, unstable=above))
