"""Surrogates: fitted to outcomes, held against true values, told as labelled results."""
