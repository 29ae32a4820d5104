"""Figures: one function each, Dataset in, matplotlib Axes out."""
