"""Methods: each is one file with ``design``, ``estimate`` and ``evaluations``, and one line in `METHODS`."""

from hipuq.methods import monte_carlo
from hipuq.methods.base import Method

METHODS: dict[str, Method] = {
    "monte_carlo": Method(
        title="Monte Carlo",
        design=monte_carlo.design,
        estimate=monte_carlo.estimate,
        evaluations=monte_carlo.evaluations,
    ),
}
"""Name of a method -> its functions."""

__all__ = ["METHODS", "Method"]
