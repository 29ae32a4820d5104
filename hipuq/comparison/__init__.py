"""Comparison of methods on problems with a known answer.

A contender is a method with its options; it runs again and again within budgets of evaluations, and what
it says is held against the reference. Runs are kept one by one, so that a comparison can go on.
"""

from hipuq.comparison.comparing import compare, race
from hipuq.comparison.contender import QUANTITIES, Contender
from hipuq.comparison.reference import Reference, reference_from
from hipuq.comparison.running import Race

__all__ = ["QUANTITIES", "Contender", "Race", "Reference", "compare", "race", "reference_from"]
