"""Distributions of one variable: chaospy, frozen scipy, anything with ``ppf``, and mixtures of them.

All sampling goes through `Distribution.ppf` of points in the unit interval, so that every design
(random, latin hypercube, Sobol) and every kind of distribution go together.
"""

from hipuq.distributions.adapters import as_distribution
from hipuq.distributions.base import Distribution
from hipuq.distributions.families import FAMILIES, from_family
from hipuq.distributions.lubricated import lubrication
from hipuq.distributions.mixtures import mixture
from hipuq.distributions.rebuilding import from_description
from hipuq.distributions.tables import DISTRIBUTIONS, from_table
from hipuq.distributions.words import Regime, described, regimes, sources

__all__ = [
    "DISTRIBUTIONS",
    "FAMILIES",
    "Distribution",
    "Regime",
    "as_distribution",
    "described",
    "from_description",
    "from_family",
    "from_table",
    "lubrication",
    "mixture",
    "regimes",
    "sources",
]
