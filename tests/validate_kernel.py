#!/usr/bin/env python
"""Compare the errors of the compiled kernel with LAPACK's, against 50 digits.

    python tests/validate_kernel.py [MATRICES] [SEED]

Solves random matrices (normal entries) and ring matrices with scattered stiffness and angles by the
compiled kernel and by LAPACK, and again with enclosures of at least 50 digits (python-flint,
``acb_mat.eig``). The error of a matrix is the largest distance of a computed eigenvalue from the true one,
matched one to one so that distances add up to the least, over the largest modulus. Prints the largest, mean
and median error of each, and in how many matrices the kernel's error is the smaller one.
"""

import argparse
import sys
from pathlib import Path

import chaospy as cp
import flint
import numpy as np
from scipy.optimize import linear_sum_assignment

sys.path.insert(0, str(Path(__file__).parent))

import hipuq
from hipuq.cea.eigenvalues import eigenvalues
from hipuq.compiled.binding import kernel_name

SIZE = 18


def ring_matrices(count: int, seed: int) -> np.ndarray:
    """Return stiffness matrices for unit mass of rings with friction from 0 to 0.1, all else scattered."""
    model = hipuq.models.ring("oberst2016")
    inputs = model.inputs(
        friction=cp.Uniform(0.0, 0.1),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
        contact_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"),
        spring_angle=hipuq.shift(cp.Uniform(-1.0, 1.0), each="spring"),
        contact_angle=hipuq.shift(cp.Uniform(-1.0, 1.0), each="oscillator"),
    )
    samples = hipuq.design("monte_carlo", inputs, count, seed)
    return model.pencils(samples).reduced()[0]


def true_eigenvalues(matrix: np.ndarray, digits: int = 50) -> np.ndarray:
    """Return the eigenvalues of a matrix of doubles, from enclosures of at least 50 digits' work."""
    n = len(matrix)
    before = flint.ctx.dps
    try:
        while digits <= 1600:
            flint.ctx.dps = digits
            exact = flint.acb_mat(flint.arb_mat(n, n, [flint.arb(float(x)) for x in matrix.ravel()]))
            try:
                found = exact.eig(multiple=False)
            except ValueError:  # not separated yet
                digits *= 2
                continue
            return np.array([complex(float(w.real.mid()), float(w.imag.mid())) for w in found])
    finally:
        flint.ctx.dps = before
    raise ValueError("eigenvalues are not simple")


def error(computed: np.ndarray, true: np.ndarray) -> float:
    """Return the largest distance of matched eigenvalues over the largest modulus."""
    distance = np.abs(computed[:, None] - true[None, :])
    return float(distance[linear_sum_assignment(distance)].max() / np.abs(true).max())


def main(count: int, seed: int) -> None:
    """Print a line for each kind of matrix."""
    random = np.random.default_rng(seed).standard_normal((count, SIZE, SIZE))
    for name, matrices in (("random", random), ("ring", ring_matrices(count, seed))):
        true = [true_eigenvalues(matrix) for matrix in matrices]
        errors = {
            own: np.array([error(*pair) for pair in zip(values, true, strict=True)])
            for own, values in (
                (kernel_name(), eigenvalues(matrices)),
                ("LAPACK", np.linalg.eigvals(matrices)),
            )
        }
        for own, values in errors.items():
            print(
                f"{name}, {count} matrices, {own}: largest {values.max():.2e}, mean {values.mean():.2e}, "
                f"median {np.median(values):.2e}"
            )
        ours, lapack = errors.values()
        print(f"{name}: the first is the more accurate one in {np.mean(ours < lapack):.1%}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("matrices", type=int, nargs="?", default=1000)
    parser.add_argument("seed", type=int, nargs="?", default=1)
    options = parser.parse_args()
    main(options.matrices, options.seed)
