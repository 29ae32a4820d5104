"""The compiled kernel: eigenvalues of small matrices, several samples in the lanes of a register.

The library is built with the package (`hatch_build.py`). Where it is missing, or switched off by the
environment variable ``HIPUQ_KERNEL=lapack``, `binding.kernel` gives None and LAPACK does the same work.
"""
