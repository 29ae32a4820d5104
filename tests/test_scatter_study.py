"""The scatter study with few samples: all twelve analyses in one file, indices and report."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hipuq
from hipuq.report.page import write_report
from hipuq.sampling import seed_of

STUDY = Path(__file__).parents[1] / "studies" / "scatter"

SIZES = {
    "monte_carlo": 2048,
    "sobol": 256,
    "chaos": 64,
    "monte_carlo_damped": 512,
    "sobol_damped": 32,
    "chaos_damped": 8,
    "monte_carlo_integrated": 8,
    "sobol_integrated": 4,
    "chaos_integrated": 12,
    "monte_carlo_integrated_damped": 8,
    "sobol_integrated_damped": 4,
    "chaos_integrated_damped": 12,
    "damping_sweep": 64,
}

ENDS = "", "_low", "_high"

PROBABILITY = 0.5093, 0.0011
"""P(any unstable), 200,000 random samples with seed 77, and its standard error."""


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    whole = hipuq.load_study(STUDY)
    assert {analysis.name for analysis in whole.analyses} == set(SIZES)
    small = tuple(replace(analysis, n=SIZES[analysis.name]) for analysis in whole.analyses)
    out = tmp_path_factory.mktemp("scatter")
    tree = hipuq.run_study(replace(whole, analyses=small), out)
    write_report(tree, out)
    return hipuq.load_results(out), out


def test_methods_agree_on_the_probability(results):
    tree, _ = results
    for group, name in (("monte_carlo", "probability"), ("chaos", "probability_overall")):
        found = tree[f"{group}/any_unstable"]
        low, high = (float(found[f"{name}_{end}"]) for end in ("low", "high"))
        # Twice the interval: a limit of 95 % may be missed.
        assert abs((low + high) / 2 - PROBABILITY[0]) < high - low
        assert high - low < 0.05
    integrated = tree["monte_carlo_integrated/probability"]
    assert float(integrated["probability_low"]) < PROBABILITY[0] < float(integrated["probability_high"])


@pytest.fixture(scope="module")
def settled():
    """Return the indices from 4096 base points, of the samples of the study but those for pairs."""
    whole = hipuq.load_study(STUDY)
    ((place, one),) = ((i, one) for i, one in enumerate(whole.analyses) if one.name == "sobol")
    seed = seed_of(np.random.SeedSequence(whole.seed, spawn_key=(place,)))
    samples = hipuq.design("sobol", one.inputs, one.n, seed)
    assert samples.sizes["sample"] == 32_768
    outcomes = hipuq.evaluate(one.model, samples, keep=list(one.of), progress=False)
    return {of: hipuq.estimate("sobol", outcomes, one.inputs, of=of) for of in one.of}


def test_indices_are_settled_after_1024_base_points(settled):
    """Those of 4096 lie inside the 95 % intervals of 1024; of one of 24 the intervals overlap."""
    assert set(settled) == {"any_unstable", "margin"}
    inside, overlap = [], []
    for found in settled.values():
        per_point = found.sizes["parameter"] + 2
        for name in ("S1", "ST"):
            early, late = (
                [found[f"{name}_by_budget{end}"].sel(budget=points * per_point).values for end in ENDS]
                for points in (1024, 4096)
            )
            inside += list((early[1] <= late[0]) & (late[0] <= early[2]))
            overlap += list((early[1] <= late[2]) & (late[1] <= early[2]))
    assert len(inside) == 24
    assert all(overlap)
    assert sum(inside) >= 23


def test_interactions_rule(results):
    """Friction alone explains less than half of the variance, and every parameter takes part in the rest."""
    tree, _ = results
    found = tree["sobol/any_unstable"].to_dataset()
    first, total = found["S1"], found["ST"]
    assert total["parameter"].values[int(total.argmax("parameter"))] == "friction"
    assert 0.25 < float(first.sel(parameter="friction")) < 0.55
    assert float(first.sum()) < 0.75 < float(total.sum()) / 2.5
    assert (found["ST_low"] > 0.15).all()
    assert found["S2"].shape == (6, 6)


def test_a_few_damped_events_give_no_indices(results):
    """Of 64 samples of A and B at 1 % damping hardly one is unstable: undefined, not 0."""
    tree, _ = results
    found = tree["sobol_damped/any_unstable"].to_dataset()
    assert int(found["events"]) < 50
    assert np.isnan(found["ST"]).all()
    assert "of=" in found["ST"].attrs["undefined"] or "samples" in found["ST"].attrs["undefined"]


def test_the_surrogate_says_that_it_is_not_to_be_trusted(results):
    tree, out = results
    for of in ("any_unstable", "margin"):
        found = tree[f"chaos/{of}"].to_dataset()
        assert int(found["trusted"]) == 0
        assert "held-out samples" in found["trusted"].attrs["reasons"]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "not to be trusted" in page
    for picture in ("sobol-indices_any_unstable", "chaos-surrogate_margin", "monte_carlo-convergence_margin"):
        assert (out / "figures" / f"{picture}.png").stat().st_size > 10_000
