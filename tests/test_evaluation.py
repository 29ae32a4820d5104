"""Evaluation: the same bits however it is divided, plain functions as models, failures with names."""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from scipy import stats

import hipuq
from hipuq import schema
from hipuq.errors import InputError, ModelError, SchemaError, UnknownNameError
from hipuq.evaluation import evaluating
from hipuq.models import CEAModel

SIZE = 2500  # more than two blocks


@pytest.fixture(scope="module")
def study():
    """Return a model, samples near and around the onset, damped and undamped, and the outcomes."""
    model = hipuq.models.ring(oscillators=5)
    inputs = model.inputs(
        friction=cp.Uniform(0.0, 1.0),
        contact=hipuq.ContactPatterns((4, 5), oscillators=5),
        contact_stiffness=hipuq.relative(cp.Normal(0.0, 1e-3), each="oscillator"),
        damping_ratio=cp.Uniform(0.0, 0.02),
    )
    samples = hipuq.design("monte_carlo", inputs, SIZE, 1)
    half = samples["damping_ratio"].where(samples["sample"] % 2 == 0, 0.0)
    samples = samples.assign(damping_ratio=half)
    return model, samples, hipuq.evaluate(model, samples, n_jobs=1)


@pytest.mark.parametrize("jobs", [2, 3])
def test_threads_do_not_change_a_bit(study, jobs):
    model, samples, expected = study
    assert hipuq.evaluate(model, samples, n_jobs=jobs).equals(expected)


def test_an_executor_of_threads_does_not_change_a_bit(study):
    model, samples, expected = study
    with ThreadPoolExecutor(2) as executor:
        assert hipuq.evaluate(model, samples, executor=executor).equals(expected)


def test_processes_do_not_change_a_bit(study):
    model, samples, expected = study
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as executor:
        assert hipuq.evaluate(model, samples, executor=executor).equals(expected)


@pytest.mark.parametrize("block", [7, 100, 5000])
def test_blocks_do_not_change_a_bit(study, block, monkeypatch):
    model, samples, expected = study
    seen, whole = [], CEAModel.__call__

    def call(self, given, keep=None):
        seen.append(given.sizes["sample"])
        return whole(self, given, keep)

    monkeypatch.setattr(CEAModel, "block", block)
    monkeypatch.setattr(CEAModel, "__call__", call)
    assert hipuq.evaluate(model, samples, n_jobs=2).equals(expected)
    # Models of ours take more at a time than this, but few samples are divided for all cores.
    assert max(seen) == min(block, 1024)


def test_outcomes_hold_samples_outputs_and_status(study):
    model, samples, outcomes = study
    assert set(outcomes.data_vars) == set(samples.data_vars) | set(model.outcomes)
    assert outcomes.drop_vars(model.outcomes).drop_vars(["mode", "pair"]).equals(samples)
    verdict = outcomes["any_unstable"].values
    assert (verdict == 1).any() and (verdict == 0).any()
    assert np.array_equal(outcomes["status"] == schema.STATUS["undecided"], np.isnan(verdict))
    assert np.array_equal(outcomes["decided_by"] == -1, np.isnan(verdict))
    assert outcomes["status"].attrs["flag_meanings"] == "ok undecided failed"
    assert outcomes.attrs["seconds"] > 0
    assert outcomes.attrs["model"] == "ring(oberst2016)"
    assert outcomes.attrs["seed"] == 1


def test_only_what_is_kept_is_there(study):
    model, samples, expected = study
    outcomes = hipuq.evaluate(model, samples, keep=["any_unstable", "margin"])
    added = set(outcomes.data_vars) - set(samples.data_vars)
    assert added == {"any_unstable", "margin", "status", "decided_by"}
    for name in added:
        assert outcomes[name].equals(expected[name])
    assert "mode" not in outcomes.coords


def test_undecided_samples_have_a_status():
    """On an onset nothing is claimed: the verdict is missing, and the status says why."""
    model = hipuq.models.two_dof("hulten", certify="never")
    outcomes = hipuq.evaluate(model, model.nominal(friction=[0.1, 7 / 24, 0.5]))
    assert outcomes["status"].values.tolist() == [0, 1, 0]
    assert np.isnan(outcomes["any_unstable"].values[1])
    assert outcomes["any_unstable"].values[[0, 2]].tolist() == [0, 1]


def plain(samples: xr.Dataset) -> xr.Dataset:
    """A model of the user's own: no attributes, no coords, no classes."""
    return xr.Dataset({"y": ("sample", samples["x"].values ** 2)})


def square_samples(size: int = 10) -> xr.Dataset:
    return xr.Dataset({"x": ("sample", np.arange(size, dtype=float))})


def test_a_plain_function_is_a_model(monkeypatch):
    monkeypatch.setattr(evaluating, "BLOCK", 4)
    outcomes = hipuq.evaluate(plain, square_samples(), keep=["y"])
    assert outcomes["y"].values.tolist() == [i**2 for i in range(10)]
    assert (outcomes["status"] == 0).all()
    assert outcomes.attrs["model"] == "plain"


def test_outputs_that_count_or_compare_may_be_made_from_the_samples():
    """They carry the coordinate of their block with them, and there is more than one block."""
    samples = xr.Dataset({"load": ("sample", np.linspace(0.0, 2.0, SIZE))}, {"sample": np.arange(SIZE)})
    outcomes = hipuq.evaluate(
        lambda part: xr.Dataset({"high": part["load"] > 1.5, "whole": part["load"].astype(int)}), samples
    )
    assert np.array_equal(outcomes["high"], samples["load"] > 1.5)
    assert np.array_equal(outcomes["whole"], np.floor(samples["load"]))


def test_outputs_may_have_dims_and_missing_values():
    """A verdict may be unknown; any other number that is missing is a failure."""

    def model(samples):
        x = samples["x"].values
        parts = np.stack([x, np.where(x == 1, np.nan, -x)], axis=1)
        return xr.Dataset(
            {
                "parts": (("sample", "part"), parts),
                "any_unstable": ("sample", np.where(x == 2, np.nan, 1.0)),
                "own": ("sample", np.where(x == 3, np.nan, 0.0), {"role": schema.VERDICT}),
            },
            coords={"part": ["a", "b"]},
        )

    outcomes = hipuq.evaluate(model, square_samples(4))
    assert outcomes["part"].values.tolist() == ["a", "b"]
    assert outcomes["parts"].sel(part="a").values.tolist() == [0, 1, 2, 3]
    names = [list(schema.STATUS)[status] for status in outcomes["status"].values]
    assert names == ["ok", "failed", "undecided", "undecided"]
    assert outcomes["failed_sample"].values.tolist() == [1]
    assert outcomes["failure_message"].values.tolist() == ["the model gave nan in 'parts'"]


def test_hand_made_samples_need_no_attributes():
    """Neither attrs nor coords nor any order of dims."""
    model = hipuq.models.ring()
    mass = np.full((9, 3), 20.0)
    samples = xr.Dataset({"friction": ("sample", [0.0, 0.05, 0.1]), "mass": (("oscillator", "sample"), mass)})
    outcomes = hipuq.evaluate(model, samples)
    direct = model(model.nominal(friction=[0.0, 0.05, 0.1], mass=mass.T))
    assert np.array_equal(outcomes["frequency"], direct["frequency"])


def test_nothing_given_is_changed():
    model = hipuq.models.ring()
    samples = model.nominal(friction=np.linspace(0, 0.1, 20))
    kept = samples.copy(deep=True)
    for values in samples.data_vars.values():
        values.values.flags.writeable = False
    outcomes = hipuq.evaluate(model, samples)
    assert samples.identical(kept)
    assert "frequency" in outcomes and "frequency" not in samples


def test_models_that_break_the_contract_are_named(monkeypatch):
    monkeypatch.setattr(evaluating, "BLOCK", 4)

    def uneven(samples):
        dim = "sample" if samples["x"].values[0] == 0 else ("other", "sample")
        values = np.zeros(4 if dim == "sample" else (1, samples.sizes["sample"]))
        return xr.Dataset({"y": (dim, values)})

    cases = [
        ("must return an xarray Dataset, not ndarray", lambda s: s["x"].values),
        ("'x', which is a name in the samples", lambda s: s),
        ("needs 'sample' of length 1", lambda s: xr.Dataset({"y": ("sample", [1.0, 2.0, 3.0])})),
        ("needs 'sample' of length 4", lambda s: xr.Dataset({"y": 1.0})),
    ]
    for message, model in cases:
        with pytest.raises(SchemaError, match=message):
            hipuq.evaluate(model, square_samples(), n_jobs=1)
    with pytest.raises(ModelError, match=r"6 of 10 samples failed.* different dims in different blocks"):
        hipuq.evaluate(uneven, square_samples(), n_jobs=1)


def test_wrong_samples_are_named():
    model = hipuq.models.ring()
    with pytest.raises(UnknownNameError, match="'frictoin': did you mean 'friction'"):
        hipuq.evaluate(model, xr.Dataset({"frictoin": ("sample", [0.1])}))
    with pytest.raises(InputError, match="friction is nan in sample 1500"):
        friction = np.where(np.arange(2000) == 1500, np.nan, 0.05)
        hipuq.evaluate(model, xr.Dataset({"friction": ("sample", friction)}))
    cases = [
        ("must be an xarray Dataset", {"x": [1.0]}),
        ("need the dim 'sample'", xr.Dataset({"x": ("s", [1.0])})),
        ("samples are empty", xr.Dataset({"x": ("sample", np.zeros(0))})),
        ("'y' needs the dim 'sample'", square_samples().assign(y=1.0)),
        ("'y' must hold numbers", square_samples(1).assign(y=("sample", ["a"]))),
    ]
    for message, samples in cases:
        with pytest.raises(SchemaError, match=message):
            hipuq.evaluate(plain, samples)


def test_wrong_options_are_named():
    model = hipuq.models.ring()
    samples = model.nominal(friction=0.1)
    with pytest.raises(UnknownNameError, match="did you mean 'margin'"):
        hipuq.evaluate(model, samples, keep=["margins"])
    with pytest.raises(UnknownNameError, match="unknown outcome in keep 'z'"):
        hipuq.evaluate(plain, square_samples(), keep=["z"])
    with pytest.raises(InputError, match=r"it must be a list of outcome names, \['margin'\]"):
        hipuq.evaluate(model, samples, keep="margin")
    with pytest.raises(InputError, match="keep is empty"):
        hipuq.evaluate(model, samples, keep=[])
    with pytest.raises(InputError, match="n_jobs is 0"):
        hipuq.evaluate(model, samples, n_jobs=0)
    with pytest.raises(InputError, match=r"a concurrent\.futures\.Executor"):
        hipuq.evaluate(model, samples, executor="thread")


def test_a_model_that_sorts_its_samples_is_put_in_order():
    def sorting(samples: xr.Dataset) -> xr.Dataset:
        return xr.Dataset({"y": 2 * samples.sortby("x")["x"]})

    inputs = hipuq.Inputs(x=stats.uniform())
    samples = hipuq.design("monte_carlo", inputs, n=50, rng=0)
    outcomes = hipuq.evaluate(sorting, samples)
    assert np.array_equal(outcomes["y"], 2 * outcomes["x"])
    other = samples.assign_coords(sample=np.arange(50) + 7)

    def relabelling(given: xr.Dataset) -> xr.Dataset:
        return xr.Dataset({"y": given["x"].assign_coords(sample=given["sample"] + 1)})

    with pytest.raises(SchemaError, match="other labels"):
        hipuq.evaluate(
            lambda given: xr.Dataset({"y": given["x"].assign_coords(sample=given["sample"] + 1)}), other
        )


def test_an_output_does_not_inherit_name_and_unit():
    """Arithmetic of xarray hands on attributes; a share must not become a mean by that."""
    model = hipuq.models.ring()
    samples = model.nominal(friction=np.linspace(0, 1, 10))
    outcomes = hipuq.evaluate(
        lambda given: xr.Dataset({"y": (given["friction"] > 0.3).astype(float)}), samples
    )
    assert outcomes["y"].attrs == {}
    inputs = model.inputs(friction=stats.uniform())
    assert "probability" in hipuq.estimate("monte_carlo", outcomes, inputs, of="y")


def test_outputs_that_are_no_numbers_are_refused():
    with pytest.raises(SchemaError, match="must hold numbers"):
        hipuq.evaluate(lambda given: xr.Dataset({"y": ("sample", ["a"] * 10)}), square_samples())
