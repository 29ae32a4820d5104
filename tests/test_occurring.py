"""Frequencies of unstable modes, counts of verdicts, and what is published beside them."""

import chaospy as cp
import numpy as np
import pytest
import xarray as xr

import hipuq
from hipuq.errors import InputError, SchemaError
from hipuq.evidence import FIGURES
from hipuq.occurring import verdict_counts


def outcomes_of(frequency, unstable) -> xr.Dataset:
    dims = ("sample", "mode")
    return xr.Dataset(
        {
            "frequency": (dims, np.asarray(frequency, float), {"units": "Hz"}),
            "unstable": (dims, np.asarray(unstable, float)),
        },
        {"mode": [1, 2]},
    )


def test_ranges_are_those_of_the_unstable_samples_alone():
    frequency = np.stack([np.arange(1.0, 101.0), np.full(100, 7.0)], axis=1)
    unstable = np.stack([np.arange(100) >= 50, np.zeros(100)], axis=1)
    found = hipuq.frequency_ranges(outcomes_of(frequency, unstable))
    assert found["unstable_samples"].values.tolist() == [50, 0]
    # Of 51 to 100 the third is the first below or at which 5 % lie, the 25th has half of them.
    assert [float(found[f"frequency_{end}"][0]) for end in ("low", "median", "high")] == [53.0, 75.0, 98.0]
    assert np.isnan(found["frequency_median"][1])
    assert found["frequency_low"].attrs["units"] == "Hz"


def test_unknown_verdicts_are_not_unstable():
    found = hipuq.frequency_ranges(outcomes_of([[1.0, 2.0]], [[np.nan, 1.0]]))
    assert found["unstable_samples"].values.tolist() == [0, 1]
    assert found["known_samples"].values.tolist() == [0, 1]
    assert float(found["frequency_median"][1]) == 2.0


def test_samples_count_by_their_weight():
    outcomes = outcomes_of([[1.0, 2.0], [3.0, 4.0]], np.ones((2, 2)))
    found = hipuq.frequency_ranges(outcomes.assign_coords(weight=("sample", [0.9, 0.1])))
    assert float(found["frequency_median"][0]) == 1.0


def test_missing_outcomes_are_told():
    with pytest.raises(SchemaError, match="need 'unstable' over sample and mode"):
        hipuq.frequency_ranges(outcomes_of([[1.0, 2.0]], [[1.0, 1.0]]).drop_vars("unstable"))


def test_verdicts_add_up():
    ring = hipuq.models.ring("oberst2016")
    samples = hipuq.design("monte_carlo", ring.inputs(friction=cp.Uniform(0.0, 0.1)), n=50, rng=1)
    counts = verdict_counts(hipuq.evaluate(ring, samples, keep=["any_unstable"]))
    assert int(counts["samples"].sum()) == 50
    assert int(counts["decided"].sum()) == int(counts["samples"].sel(status="ok"))
    assert counts["decided_by"].values.tolist() == ["double", "structured", "certificate"]


def test_a_model_without_certificates_has_a_status_alone():
    outcomes = xr.Dataset({"status": ("sample", np.array([0, 1, 2, 0], np.int8))})
    counts = verdict_counts(outcomes)
    assert counts["samples"].values.tolist() == [2, 1, 1]
    assert "decided" not in counts


@pytest.mark.parametrize("quantity", FIGURES)
def test_every_published_figure_names_its_source(quantity):
    found = hipuq.literature(quantity)
    assert found["value"].attrs["long_name"] and found["value"].attrs["units"]
    assert all(found["reference"].values)
    assert len(set(found["source"].values)) == found.sizes["source"]
    given = found["value"].notnull() | (found["low"].notnull() & found["high"].notnull())
    assert bool(given.all())
    assert not bool((found["low"] > found["high"]).any())
    assert not bool((found["value"] < found["low"]).any() | (found["value"] > found["high"]).any())


def test_published_incidence_is_as_cited():
    # Lee et al. 2014; doi 10.1186/s13018-018-0841-y; Parvizi et al. 2011; Oberst et al. 2016.
    assert hipuq.literature("incidence")["value"].values.round(4).tolist() == [
        0.027,
        0.03,
        0.031,
        0.061,
        0.209,
    ]


def test_an_unknown_quantity_is_one_line():
    with pytest.raises(InputError, match="did you mean 'incidence'"):
        hipuq.literature("incidense")
