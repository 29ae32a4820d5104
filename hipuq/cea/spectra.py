"""Spectra of a batch: frequencies, growth rates, verdicts and margins."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from hipuq.cea.pencils import Array


@dataclass(frozen=True)
class Spectra:
    """Spectra of a batch of s samples with n modes by ascending frequency.

    Inside a coalesced pair the decaying eigenvalue comes first and the growing one second.
    Mechanisms come first of all, with frequency, growth rate and verdict 0.

    Attributes
    ----------
    frequency : (s, n) array
        Im l / (2 pi) [Hz].
    growth_rate : (s, n) array
        Re l [1/s].
    unstable : (s, n) array of float32
        Verdict [1]: 1 if the growth rate is above the threshold, 0 if not, NaN if that is not known.
    margin : (s,) array
        Stability margin [1], negative exactly where unstable, NaN where that is unknown. Undamped
        and without a threshold it is the smallest of: the squared gap of neighbouring real
        eigenvalues w = -l**2, minus the squared gap of each complex pair (both over the squared
        mean of w), and the smallest real w over that mean. Otherwise it is
        (threshold - largest growth rate) / root mean w.
    mechanisms : (s,) array of int
        Number of rigid mechanisms: those that the model declares, or more if more were found.
    decided_by : (s,) array of int8
        `DOUBLE`, `STRUCTURED` or `CERTIFICATE` of `hipuq.cea.bounds`; -1 where nothing decided.
    """

    frequency: Array
    growth_rate: Array
    unstable: NDArray[np.float32]
    margin: Array
    mechanisms: NDArray[np.intp]
    decided_by: NDArray[np.int8]

    @classmethod
    def empty(cls, samples: int, modes: int) -> Self:
        """Return arrays of these sizes to be filled.

        Parameters
        ----------
        samples : int
            Number of samples s.
        modes : int
            Number of modes n.

        Returns
        -------
        Spectra
            Its numbers are whatever the memory held.
        """
        shape = (samples, modes)
        return cls(
            np.empty(shape),
            np.empty(shape),
            np.empty(shape, np.float32),
            np.empty(samples),
            np.empty(samples, np.intp),
            np.empty(samples, np.int8),
        )

    def put(self, rows: NDArray[np.intp], part: Spectra) -> None:
        """Set some samples to those of another batch.

        Parameters
        ----------
        rows : (k,) array of int
            Places of the samples.
        part : Spectra
            Of k samples with as many modes.
        """
        for field in fields(self):
            getattr(self, field.name)[rows] = getattr(part, field.name)

    @property
    def any_unstable(self) -> NDArray[np.float32]:
        """1 if a mode is known to be unstable, 0 if all are known to be stable, else NaN; (s,) [1]."""
        # The sample last: reductions over a few modes at a time are slow. A maximum is NaN if any is.
        modes = np.ascontiguousarray(self.unstable.T)
        return np.where(np.fmax.reduce(modes) == 1, np.float32(1), np.maximum.reduce(modes))

    @property
    def unstable_count(self) -> NDArray[np.float32]:
        """Number of unstable modes, NaN if any mode is unknown; (s,) [1]."""
        count: NDArray[np.float32] = self.unstable.sum(axis=1, dtype=np.float32)
        return count
