"""Faults of a model: what fails is marked and told, the rest goes on; stores end as results in memory do."""

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from scipy import stats

import hipuq
from hipuq import schema
from hipuq.errors import InputError, ModelError, SchemaError

FAILED = schema.STATUS["failed"]


def samples(size: int = 20) -> xr.Dataset:
    return xr.Dataset({"x": ("sample", np.arange(size, dtype=float))})


class Faulty:
    """y = 2 x and a count of two modes, but for a few samples."""

    block = 8

    def __init__(self, **faults: list[float]) -> None:
        self.faults = faults
        self.calls = 0

    def __call__(self, given: xr.Dataset) -> xr.Dataset:
        self.calls += 1
        x = given["x"].values
        if np.isin(x, self.faults.get("raises", [])).any():
            raise ZeroDivisionError("no\nmore")
        if np.isin(x, self.faults.get("ends", [])).any():
            raise SystemExit(3)
        length = len(x) + np.isin(x, self.faults.get("length", [])).sum()
        modes = 3 if np.isin(x, self.faults.get("shape", [])).any() else 2
        y = np.where(np.isin(x, self.faults.get("nan", [])), np.nan, 2 * x)
        data = {
            "y": ("sample", np.resize(y, length)),
            "count": ("sample", np.ones(length, np.int64)),
            "flag": ("sample", np.ones(length, bool)),
            "frequency": (("sample", "mode"), np.ones((length, modes))),
        }
        return xr.Dataset(data)


FAULTS = {"raises": [3.0], "ends": [9.0], "length": [11.0], "shape": [12.0], "nan": [19.0]}
MESSAGES = {
    3: "ZeroDivisionError: no more",
    9: "SystemExit: 3",
    11: "output 'y' of the model has the dims {'sample': 2}: it needs 'sample' of length 1",
    12: "output 'frequency' of the model has the lengths (3,), not (2,)",
    19: "the model gave nan in 'y'",
}


def in_memory_or_store(place, tmp_path):
    return {"store": tmp_path / "outcomes.zarr"} if place == "store" else {}


@pytest.mark.parametrize("place", ["memory", "store"])
def test_faults_of_single_samples_are_marked_and_told(place, tmp_path):
    outcomes = hipuq.evaluate(Faulty(**FAULTS), samples(), **in_memory_or_store(place, tmp_path))
    told = dict(zip(outcomes["failed_sample"].values, outcomes["failure_message"].values, strict=True))
    assert told == MESSAGES
    failed = np.isin(outcomes["x"].values, list(MESSAGES))
    assert np.array_equal(outcomes["status"] == FAILED, failed)
    assert (outcomes["status"].values[~failed] == schema.STATUS["ok"]).all()
    for name in ("y", "count", "flag"):
        assert np.isnan(outcomes[name].values[[3, 9, 11, 12]]).all()
    assert np.array_equal(outcomes["y"].values[~failed], 2 * outcomes["x"].values[~failed])
    # Numbers of all kinds can be missing, so they are floating point whether or not some are.
    assert outcomes["count"].dtype == np.float64
    assert outcomes["flag"].dtype == np.float32
    assert outcomes["flag"].attrs["role"] == schema.VERDICT
    assert (outcomes["count"].values[~failed] == 1).all()
    assert outcomes["frequency"].shape == (20, 2)


def test_nothing_failed_has_no_table():
    outcomes = hipuq.evaluate(Faulty(), samples())
    assert "failure_message" not in outcomes
    assert outcomes["count"].dtype == np.float64


def test_few_calls_are_made_to_find_what_fails():
    model = Faulty(raises=[3.0])
    hipuq.evaluate(model, samples(8))
    # Eight, then the half with the fault and the half without, three times over.
    assert model.calls == 7


def test_an_error_can_end_the_run():
    model = Faulty(raises=[13.0, 15.0])
    with pytest.raises(ModelError, match=r"sample 13: ZeroDivisionError: no more; its inputs are x=13"):
        hipuq.evaluate(model, samples(), on_error="raise")
    with pytest.raises(ModelError, match=r"failed on sample 13: the model gave nan in 'y'.*x=13"):
        hipuq.evaluate(Faulty(nan=[13.0]), samples(), on_error="raise")
    with pytest.raises(InputError, match=r"unknown way to take errors, on_error, 'stop'.*mark, raise"):
        hipuq.evaluate(model, samples(), on_error="stop")


@pytest.mark.parametrize("place", ["memory", "store"])
def test_too_many_failures_end_the_run(place, tmp_path):
    where = in_memory_or_store(place, tmp_path)
    model = Faulty(raises=[3.0, 9.0, 12.0])
    with pytest.raises(ModelError, match=r"3 of 16 samples failed, more than max_failed = 0\.1 .* of 20;"):
        hipuq.evaluate(model, samples(), max_failed=0.1, **where)
    resume = {"resume": True} if where else {}
    outcomes = hipuq.evaluate(model, samples(), max_failed=0.15, **where, **resume)
    assert int((outcomes["status"] == FAILED).sum()) == 3


def test_a_model_that_always_fails_is_found_out_soon():
    def model(given: xr.Dataset) -> xr.Dataset:
        return xr.Dataset({"y": given["z"]})

    with pytest.raises(ModelError, match=r"all of the first 1,024 samples; sample 0: KeyError: .*z"):
        hipuq.evaluate(model, samples(100_000), max_failed=1.0, n_jobs=1)
    with pytest.raises(ModelError, match=r"failed on all of the first 4 samples; sample 0: KeyError"):
        hipuq.evaluate(model, samples(4), max_failed=1.0)
    with pytest.raises(InputError, match=r"max_failed is 1\.5: it must be a share"):
        hipuq.evaluate(model, samples(4), max_failed=1.5)


def test_nan_is_an_answer_and_never_ends_a_run():
    outcomes = hipuq.evaluate(Faulty(nan=list(range(20))), samples(), max_failed=0.0)
    assert (outcomes["status"] == FAILED).all()
    assert outcomes["failure_message"].sizes == {"failure": 20}


def test_models_and_samples_that_do_not_go_together_are_no_faults():
    """They fail for all samples alike, and the error says so at once."""
    with pytest.raises(SchemaError, match="must return an xarray Dataset"):
        hipuq.evaluate(lambda given: 1.0, samples(1000), max_failed=1.0)
    ring = hipuq.models.ring()
    with pytest.raises(InputError, match="damping_ratio is -1 in sample 1"):
        hipuq.evaluate(ring, ring.nominal(damping_ratio=[0.1, -1.0]))


def test_a_rare_value_that_the_model_refuses_fails_by_itself(tmp_path):
    """A design made by rows is looked at first of all, and not as a whole."""
    model = hipuq.models.two_dof("hoffmann2002")
    inputs = model.inputs(k1=cp.Normal(10.0, 8.0))
    design = hipuq.lazy_design("monte_carlo", inputs, n=20_000, rng=0)
    with pytest.raises(InputError, match="k1 is -"):
        hipuq.evaluate(model, design, store=tmp_path / "often.zarr", keep=["any_unstable"])
    rare = model.inputs(k1=cp.Normal(10.0, 2.7))
    design = hipuq.lazy_design("monte_carlo", rare, n=20_000, rng=0)
    values = design.rows(0, 20_000)["k1"].values
    assert 1 <= (values < 0).sum() < 8
    assert (values[:1024] > 0).all()
    outcomes = hipuq.evaluate(model, design, store=tmp_path / "rare.zarr", keep=["any_unstable"])
    assert np.array_equal(outcomes["status"] == FAILED, values < 0)
    assert np.array_equal(outcomes["failed_sample"], np.flatnonzero(values < 0))
    for message in outcomes["failure_message"].values:
        assert message.startswith("k1 is -")
        assert message.endswith(" N/m: it must be a finite number above 0 N/m")


def test_failed_samples_widen_the_bounds_of_a_probability():
    inputs = hipuq.Inputs(x=stats.uniform())

    def model(given: xr.Dataset) -> xr.Dataset:
        if (given["x"] < 0.2).any():
            raise RuntimeError("lost")
        return xr.Dataset({"bad": ("sample", given["x"].values > 0.5)})

    kwargs = {"method": "monte_carlo", "n": 400, "of": "bad", "rng": 0}
    results = hipuq.run(model, inputs, **kwargs)
    share = int(results["failed"]) / 400
    assert 0.15 < share < 0.25
    assert float(results["probability"]) == pytest.approx(0.5 / 0.8, abs=0.06)
    known = float(results["probability"]) * (1 - share)
    assert float(results["probability_low"]) < known
    assert float(results["probability_high"]) > known + share
    with pytest.raises(ModelError, match="its inputs are x="):
        hipuq.run(model, inputs, on_error="raise", **kwargs)


def test_rounds_of_a_sequential_method_keep_their_failures():
    """A table of failures numbers the samples of all rounds."""
    first, more = (hipuq.evaluate(Faulty(raises=[2.0]), samples(size)) for size in (5, 4))
    whole = hipuq.evaluation.together(first, more)
    assert whole["failed_sample"].values.tolist() == [2, 7]
    assert (whole["status"].values[[2, 7]] == FAILED).all()
