"""Models: each is one file, and one line in `MODELS`.

A model is any callable that takes a samples Dataset and returns a Dataset of outcomes over the same
samples. The ones here are built from matrices, see :class:`hipuq.models.base.CEAModel`.
"""

from collections.abc import Callable

from hipuq.models import mode_coupling, oscillator_ring
from hipuq.models.base import CEAModel
from hipuq.models.matrices import from_matrices
from hipuq.models.mode_coupling import two_dof
from hipuq.models.onset import unstable_friction
from hipuq.models.oscillator_ring import ring
from hipuq.models.parameter import Parameter
from hipuq.models.sensitivity import onset_sensitivity

MODELS: dict[str, Callable[..., CEAModel]] = {
    "ring": ring,
    "two_dof": two_dof,
}
"""Name of a model -> function that builds it from a preset and options."""

PRESETS: dict[str, list[str]] = {
    "ring": list(oscillator_ring.PRESETS),
    "two_dof": list(mode_coupling.PRESETS),
}
"""Name of a model -> its presets."""

__all__ = [
    "MODELS",
    "PRESETS",
    "CEAModel",
    "Parameter",
    "from_matrices",
    "onset_sensitivity",
    "ring",
    "two_dof",
    "unstable_friction",
]
