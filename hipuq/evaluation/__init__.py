"""Samples and a model give outcomes."""

from hipuq.evaluation.evaluating import MAX_FAILED, How, evaluate, evaluated
from hipuq.evaluation.joining import together

__all__ = ["MAX_FAILED", "How", "evaluate", "evaluated", "together"]
