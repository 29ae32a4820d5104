"""Polynomial chaos on arrays: germs, multi-indices, fits, and moments from coefficients.

An outcome is written as a sum of polynomials that are orthonormal for the inputs (Ghanem and Spanos,
Stochastic Finite Elements, 1991; Xiu and Karniadakis, SIAM J. Sci. Comput. 24 (2002) 619), so that
its mean, variance and Sobol indices are sums over coefficients.
"""
