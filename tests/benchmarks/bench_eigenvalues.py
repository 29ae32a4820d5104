"""Eigenvalues of stacks of small matrices, and the assembly of those of the ring: one thread each."""

import numpy as np
import numpy_user
import problems
import pytest

from hipuq.cea import solve
from hipuq.cea.eigenvalues import eigenvalues

STACKS = {4: 2**16, 8: 2**15, 12: 2**14, 24: 2**12, 36: 2**11, 48: 2**10, 64: 2**9}
"""Size -> number of random matrices, of some tenths of a second."""

RING = 2**13


def same_spectra(found, expected):
    """Check that each eigenvalue has a partner, in both directions, in the first matrices."""
    for own, other in zip(found[:64], expected[:64], strict=True):
        distance = np.abs(own[:, None] - other[None, :])
        # Eigenvalues near an onset have a condition of 1e10.
        assert max(distance.min(axis=0).max(), distance.min(axis=1).max()) < 1e-5 * np.abs(other).max()


def versus_lapack(against, name, matrices):
    against(
        f"eigenvalues, {name}",
        lambda: eigenvalues(matrices),
        lambda: np.linalg.eigvals(matrices),
        against="numpy.linalg.eigvals",
        unit="matrix",
        units=len(matrices),
        check=same_spectra,
    )


def bench_eigenvalues_of_the_ring(against, one_thread):
    model = problems.ring()
    matrices = model.pencils(problems.scattered(model, RING)[0]).reduced()[0]
    versus_lapack(against, "18 x 18 of the ring", matrices)


@pytest.mark.parametrize("n", STACKS)
def bench_eigenvalues(against, one_thread, n):
    matrices = np.random.default_rng(n).standard_normal((STACKS[n], n, n))
    versus_lapack(against, f"{n} x {n} random", matrices)


def bench_verdicts(against, one_thread):
    """All that follows from the eigenvalues, with its error bounds, beside the eigenvalues alone."""
    model = problems.ring()
    dataset = problems.scattered(model, RING)[0]
    pencils, matrices = model.compact(model.values(dataset)), model.pencils(dataset).reduced()[0]
    against(
        "eigenvalues, modes and verdicts of the ring",
        lambda: solve(pencils),
        lambda: np.linalg.eigvals(matrices),
        against="numpy.linalg.eigvals alone",
        unit="sample",
        units=RING,
    )


def same_matrix(found, expected):
    """Check the last matrix of the last block."""
    last = found.rows().reduced()[0][-1]
    np.testing.assert_allclose(last, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def bench_assembly(against, samples):
    """From arrays of samples to what eigenvalues are taken of, in blocks: entries here, matrices there."""
    model = problems.ring()
    arrays = problems.scattered(model, samples)[1]
    arrays["friction_angle"] = arrays["contact_angle"] + 90.0
    nominal = {name: own.nominal for name, own in model.parameters.items() if name not in arrays}

    def rows(start, block):
        return {name: values[start : start + block] for name, values in arrays.items()}

    def own():
        for start in range(0, samples, model.block):
            part = rows(start, model.block)
            size = len(part["friction"])
            constant = {name: np.broadcast_to(one, (size, *one.shape)) for name, one in nominal.items()}
            pencils = model.compact(part | constant)
        return pencils

    def other():
        for start in range(0, samples, numpy_user.BLOCK):
            stiffness = numpy_user.system(rows(start, numpy_user.BLOCK))
        return stiffness[-1]

    against(
        "assembly of the ring",
        own,
        other,
        against="NumPy, vectorised",
        unit="sample",
        units=samples,
        check=same_matrix,
    )
