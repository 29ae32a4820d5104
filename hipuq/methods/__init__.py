"""Methods: each is one file with ``design``, ``estimate`` and ``evaluations``, and one line in `METHODS`."""

from hipuq.methods import exact, monte_carlo
from hipuq.methods.base import Method

METHODS: dict[str, Method] = {
    "monte_carlo": Method(
        title="Monte Carlo",
        design=monte_carlo.design,
        estimate=monte_carlo.estimate,
        evaluations=monte_carlo.evaluations,
    ),
    "exact": Method(
        title="exact",
        design=exact.design,
        estimate=exact.estimate,
        evaluations=exact.evaluations,
        sized=False,
    ),
}
"""Name of a method -> its functions."""

__all__ = ["METHODS", "Method"]
