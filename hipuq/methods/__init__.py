"""Methods: each is one file with ``design``, ``estimate`` and ``evaluations``, and one line in `METHODS`."""

from hipuq.methods import chaos, monte_carlo, sobol
from hipuq.methods.base import Method

METHODS: dict[str, Method] = {
    "monte_carlo": Method(
        title="Monte Carlo",
        design=monte_carlo.design,
        estimate=monte_carlo.estimate,
        evaluations=monte_carlo.evaluations,
    ),
    "chaos": Method(
        title="polynomial chaos",
        design=chaos.design,
        estimate=chaos.estimate,
        evaluations=chaos.evaluations,
        refine=chaos.refine,
        validate=chaos.validate,
    ),
    "sobol": Method(
        title="Sobol indices",
        design=sobol.design,
        estimate=sobol.estimate,
        evaluations=sobol.evaluations,
        validate=sobol.validate,
    ),
}
"""Name of a method -> its functions."""

__all__ = ["METHODS", "Method"]
