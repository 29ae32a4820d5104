"""Analyses of outcomes that are there already, polynomial chaos and Sobol indices: one thread each."""

import chaos_user
import numpy as np
import problems
import pytest
from SALib.analyze import sobol

import hipuq

FITTED = 4096
"""Samples of the fit: five for each of the 820 terms of degree 2 in 39 inputs."""

BASE = 1024
"""Base points of the Sobol design: 41 samples each."""

RESAMPLES = 1000


@pytest.fixture(scope="module")
def chaos():
    """Return the outcomes of a design of chaos, and arguments of the references."""
    model = problems.ring()
    inputs = problems.inputs_of(model)
    samples = hipuq.design("chaos", inputs, n=FITTED, rng=1)
    outcomes = hipuq.evaluate(model, samples, keep=["margin"], progress=False)
    x, y = problems.unit(model, samples), outcomes["margin"].values
    # hipuq fits margin where the model lost nothing: all samples here.
    assert np.isfinite(y).all()
    fit = samples["stratum"].values == -1
    members = np.split(np.arange(39), [1, 11, 20, 30])
    return inputs, outcomes, (x[fit], y[fit], (x[~fit], y[~fit]), [list(part) for part in members])


def same_moments(found, expected):
    for name in ("mean", "variance", *({"S1", "ST"} & expected.keys())):
        np.testing.assert_allclose(found[name].values, expected[name], rtol=1e-6, atol=1e-9)


def analysis(inputs, outcomes):
    return hipuq.estimate("chaos", outcomes, inputs, of="margin", degree=2, population=chaos_user.POINTS)


def bench_chaos(against, one_thread, chaos):
    inputs, outcomes, given = chaos
    against(
        f"chaos of degree 2, 39 inputs, {FITTED:,} samples",
        lambda: analysis(inputs, outcomes),
        lambda: chaos_user.chaos(*given),
        against="NumPy: QR, the same quantities",
        check=same_moments,
    )


def bench_chaos_chaospy(against, one_thread, chaos):
    inputs, outcomes, given = chaos
    against(
        f"chaos of degree 2, 39 inputs, {FITTED:,} samples",
        lambda: analysis(inputs, outcomes),
        lambda: chaos_user.chaospy_fit(*given[:2]),
        against="chaospy: expansion and fit alone",
        check=same_moments,
    )


def same_indices(found, expected):
    for name in ("S1", "ST"):
        np.testing.assert_allclose(found[name].values, expected[name], rtol=1e-6, atol=1e-9)


def bench_sobol(against, one_thread):
    model = problems.ring()
    inputs = problems.inputs_of(model)
    samples = hipuq.design("sobol", inputs, n=BASE, rng=1, groups=False)
    outcomes = hipuq.evaluate(model, samples, keep=["margin"], progress=False)
    values = outcomes["margin"].values
    problem = {"num_vars": 39, "names": list(inputs.elements), "bounds": [[0, 1]] * 39}
    against(
        f"Sobol indices of 39 inputs, {len(values):,} samples, {RESAMPLES} resamples",
        lambda: hipuq.estimate("sobol", outcomes, inputs, of="margin", resamples=RESAMPLES),
        lambda: sobol.analyze(problem, values, calc_second_order=False, num_resamples=RESAMPLES, seed=1),
        against="SALib",
        check=same_indices,
    )
