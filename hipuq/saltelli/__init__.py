"""Saltelli's design on arrays: its rows, the estimators of Sobol indices on it, and their bootstrap."""
