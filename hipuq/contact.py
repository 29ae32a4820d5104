"""Contact patterns: which oscillators touch the socket, as one discrete input."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from hipuq import schema
from hipuq.errors import InputError

CONTACT_PATTERNS = "contact_patterns"
"""Their name in study files and in the descriptions of inputs."""

LEVELS_MAXIMUM = 100_000
"""Most patterns that are written out one by one."""


@dataclass(frozen=True)
class ContactPatterns:
    """All choices of a number of oscillators in contact, as a discrete distribution.

    Patterns are numbered from 1: by number in contact, then lexicographically by the numbers of the
    oscillators in contact, so that 1, 2, 3 comes before 1, 2, 4. By default every number in contact
    has the same probability, and every pattern of a number the same share of it.

    Parameters
    ----------
    in_contact : int or iterable of int
        Numbers of oscillators in contact.
    oscillators : int, default 9
        Number of oscillators N.
    weights : sequence of float, optional
        Relative probabilities [1], one for each number in contact in the order of `in_contact`, or one
        for each pattern in the order of the enumeration.

    Raises
    ------
    InputError
        If a number in contact lies outside 0 to N or is given twice, or weights do not fit.

    Examples
    --------
    >>> import hipuq
    >>> patterns = hipuq.ContactPatterns(in_contact=(6, 7, 8, 9))
    >>> patterns.size, patterns.sizes.tolist()
    (130, [84, 36, 9, 1])
    >>> patterns.patterns([1, 130]).astype(int)
    array([[1, 1, 1, 1, 1, 1, 0, 0, 0],
           [1, 1, 1, 1, 1, 1, 1, 1, 1]])
    >>> dict(patterns.samples().sizes)
    {'sample': 130, 'oscillator': 9}
    """

    in_contact: tuple[int, ...]
    oscillators: int = 9
    weights: tuple[float, ...] | None = field(default=None)

    def __init__(
        self,
        in_contact: int | Iterable[int],
        oscillators: int = 9,
        weights: Sequence[float] | None = None,
    ) -> None:
        if isinstance(in_contact, (int, np.integer)):
            in_contact = [int(in_contact)]
        if not isinstance(in_contact, Iterable) or isinstance(in_contact, str):
            raise InputError(f"in_contact is {in_contact!r}: it must be an integer or a list of them")
        counts = list(in_contact)
        if not _is_count(oscillators) or not 1 <= oscillators <= 60:
            raise InputError(f"oscillators is {oscillators!r}: it must be an integer from 1 to 60")
        for count in counts:
            if not _is_count(count) or not 0 <= count <= oscillators:
                raise InputError(f"in_contact holds {count!r}: allowed are integers from 0 to {oscillators}")
        if not counts or len(set(counts)) != len(counts):
            raise InputError(f"in_contact is {counts}: it needs different numbers, at least one")
        order = np.argsort(counts)
        object.__setattr__(self, "in_contact", tuple(int(counts[i]) for i in order))
        object.__setattr__(self, "oscillators", int(oscillators))
        object.__setattr__(self, "weights", self._checked(weights, order))

    def _checked(self, weights: Sequence[float] | None, order: NDArray[np.intp]) -> tuple[float, ...] | None:
        if weights is None:
            return None
        try:
            values = np.asarray(weights, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(f"weights are {weights!r}: they must be numbers") from None
        allowed = {len(order), self.size}
        if values.ndim != 1 or len(values) not in allowed:
            raise InputError(
                f"weights has the shape {values.shape}: it needs {len(order)} values, one for each "
                f"number in contact, or {self.size}, one for each pattern"
            )
        if not np.isfinite(values).all() or (values < 0).any() or values.sum() <= 0:
            raise InputError(f"weights are {values.tolist()}: they must not be negative, and not all 0")
        if len(values) == len(order):
            values = values[order]
        # Weights that are normalised but for rounding stay as they are: a description rebuilds its own.
        total = values.sum()
        return tuple((values if abs(total - 1) < 1e-14 else values / total).tolist())

    @property
    def sizes(self) -> NDArray[np.int64]:
        """Number of patterns for each number in contact, (numbers,), in the order of `in_contact`."""
        return np.array([math.comb(self.oscillators, count) for count in self.in_contact], np.int64)

    @property
    def size(self) -> int:
        """Number of patterns."""
        return int(self.sizes.sum())

    def patterns(self, index: ArrayLike) -> NDArray[np.bool_]:
        """Return the patterns of the given numbers.

        Parameters
        ----------
        index : (s,) array of int
            Pattern numbers, from 1.

        Returns
        -------
        (s, N) array of bool
            Which of the N oscillators are in contact.

        Raises
        ------
        InputError
            If there is no pattern of a number.
        """
        number = np.asarray(index, dtype=np.int64) - 1
        if ((number < 0) | (number >= self.size)).any():
            raise InputError(f"pattern numbers must lie between 1 and {self.size}")
        starts = np.concatenate([[0], np.cumsum(self.sizes)])
        group = np.searchsorted(starts, number, side="right") - 1
        rank = number - starts[group]
        left = np.array(self.in_contact)[group]
        contact = np.zeros((len(number), self.oscillators), bool)
        for i in range(self.oscillators):
            rest = self.oscillators - i - 1
            # Lexicographic order: of the patterns still possible, those with oscillator i come first.
            table = np.array([0] + [math.comb(rest, k) for k in range(rest + 1)], np.int64)
            first = np.where(left > 0, table[np.minimum(left, rest + 1)], 0)
            taken = rank < first
            contact[:, i] = taken
            rank = np.where(taken, rank, rank - first)
            left = left - taken
        return contact

    def index(self, contact: ArrayLike) -> NDArray[np.int64]:
        """Return the numbers of the given patterns, the inverse of `patterns`.

        Parameters
        ----------
        contact : (s, N) array of bool
            Which of the N oscillators are in contact.

        Returns
        -------
        (s,) array of int
            From 1; 0 for a pattern that is not among them.
        """
        chosen = np.asarray(contact, dtype=bool)
        left = chosen.sum(axis=1)
        starts = np.concatenate([[0], np.cumsum(self.sizes)])
        group = np.searchsorted(self.in_contact, left).clip(0, len(self.in_contact) - 1)
        among = np.array(self.in_contact)[group] == left
        rank = starts[group].astype(np.int64)
        for i in range(self.oscillators):
            rest = self.oscillators - i - 1
            table = np.array([0] + [math.comb(rest, k) for k in range(rest + 1)], np.int64)
            rank += np.where(chosen[:, i] | (left == 0), 0, table[np.minimum(left, rest + 1)])
            left = left - chosen[:, i]
        return np.where(among, rank + 1, 0)

    @property
    def weight(self) -> NDArray[np.float64]:
        """Probability of each pattern [1], (size,); more than `LEVELS_MAXIMUM` of them are an InputError."""
        if self.size > LEVELS_MAXIMUM:
            raise InputError(f"{self.size} patterns are too many to list, at most {LEVELS_MAXIMUM}")
        if self.weights is not None and len(self.weights) == self.size:
            return np.array(self.weights)
        return np.repeat(self._count_weight / self.sizes, self.sizes)

    @property
    def _count_weight(self) -> NDArray[np.float64]:
        counts = len(self.in_contact)
        return np.full(counts, 1 / counts) if self.weights is None else np.array(self.weights)

    def ppf(self, u: ArrayLike) -> NDArray[np.int64]:
        """Return the pattern numbers at points of the unit interval.

        Parameters
        ----------
        u : (s,) array
            Probabilities [1], from 0 to below 1.

        Returns
        -------
        (s,) array of int
            Pattern numbers, from 1.
        """
        points = np.asarray(u, dtype=np.float64)
        if self.weights is not None and len(self.weights) == self.size:
            return _steps(np.array(self.weights), points) + 1
        weight = self._count_weight
        group = _steps(weight, points)
        below = np.concatenate([[0.0], np.cumsum(weight)])[group]
        share = np.clip((points - below) / weight[group], 0.0, 1.0)
        rank = np.minimum((share * self.sizes[group]).astype(np.int64), self.sizes[group] - 1)
        number: NDArray[np.int64] = np.concatenate([[0], np.cumsum(self.sizes)])[group] + rank + 1
        return number

    def variables(self, name: str, index: ArrayLike, dim: str) -> xr.Dataset:
        """Return the patterns of the given numbers as a Dataset along `dim`.

        Parameters
        ----------
        name : str
            Name of the variable.
        index : (s,) array of int
            Pattern numbers.
        dim : str
            ``"sample"`` or ``"pattern"``.

        Returns
        -------
        Dataset
            The patterns over (dim, oscillator), with the coord ``in_contact`` over dim.
        """
        contact = self.patterns(index)
        attrs = schema.PARAMETERS["contact"].attrs
        count = contact.sum(axis=1)
        return xr.Dataset(
            {name: ((dim, "oscillator"), contact, attrs)},
            coords={
                "in_contact": (dim, count, schema.COORDINATES["in_contact"].attrs),
                "oscillator": schema.index("oscillator", self.oscillators),
            },
        )

    def levels(self, name: str = "contact") -> xr.Dataset:
        """Return every level with its weight.

        Parameters
        ----------
        name : str
            Name of the variable.

        Returns
        -------
        Dataset
            ``contact(pattern, oscillator)``, ``weight(pattern)``, coord ``in_contact(pattern)``; its
            attributes name the coord by which levels are summed up and the dim that this gives.
        """
        weight = self.weight
        number = np.arange(1, self.size + 1)
        levels = self.variables(name, number, "pattern")
        return (
            levels.assign(weight=("pattern", weight, schema.COORDINATES["weight"].attrs))
            .assign_coords(pattern=("pattern", number, schema.COORDINATES["pattern"].attrs))
            .assign_attrs(dim="pattern", group="in_contact", group_dim="count")
        )

    def samples(self, name: str = "contact") -> xr.Dataset:
        """Return every pattern once, as samples.

        Parameters
        ----------
        name : str
            Name of the variable.

        Returns
        -------
        Dataset
            ``contact(sample, oscillator)`` with coords ``in_contact`` and ``pattern`` over sample.
        """
        levels = self.levels(name).drop_vars("weight").drop_attrs(deep=False)
        samples = levels.rename(pattern="sample").assign_coords(
            sample=("sample", np.arange(self.size), schema.COORDINATES["sample"].attrs),
            pattern=("sample", levels["pattern"].values, schema.COORDINATES["pattern"].attrs),
        )
        return schema.stamp(samples, f"every contact pattern, {self.size} samples")

    def to_dict(self) -> dict[str, Any]:
        """Return the description that `from_dict` takes.

        Returns
        -------
        dict
            JSON-able: ``in_contact``, ``oscillators``, and ``weights`` if there are any.
        """
        data: dict[str, Any] = {"in_contact": list(self.in_contact), "oscillators": self.oscillators}
        return data if self.weights is None else data | {"weights": list(self.weights)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> ContactPatterns:
        """Return the patterns that `to_dict` describes.

        Parameters
        ----------
        data : mapping
            As from `to_dict`; a key ``kind`` is ignored.

        Returns
        -------
        ContactPatterns
            The same patterns with the same weights.
        """
        return cls(**{key: value for key, value in data.items() if key != "kind"})


def _is_count(value: object) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def _steps(weight: NDArray[np.float64], u: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the index of the step of the cumulated weights that holds each u; never one of weight 0."""
    edges = np.cumsum(weight)
    last = int(np.flatnonzero(weight)[-1])
    return np.minimum(np.searchsorted(edges / edges[-1], u, side="right"), last)
