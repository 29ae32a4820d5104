"""Complex eigenvalue analysis: matrices in, spectra out; NumPy only, nothing of uncertainty.

The eigenvalue problem is ``(l**2 M + l C + K0 + mu K1) y = 0`` (Oberst et al., INTER-NOISE 2016,
eq. 1). Frequency is ``Im l / (2 pi)``, growth rate ``Re l``, damping ratio ``-Re l / abs(l)``.
"""

from hipuq.cea.bounds import ALWAYS, AUTO, NEVER
from hipuq.cea.compact import CompactPencils
from hipuq.cea.entries import Entries
from hipuq.cea.modes import ModeShapes, mode_shapes
from hipuq.cea.pencils import Pencils
from hipuq.cea.spectra import Spectra
from hipuq.cea.spectrum import damping_ratio, solve

__all__ = [
    "ALWAYS",
    "AUTO",
    "NEVER",
    "CompactPencils",
    "Entries",
    "ModeShapes",
    "Pencils",
    "Spectra",
    "damping_ratio",
    "mode_shapes",
    "solve",
]
