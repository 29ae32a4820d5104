"""Results and outcomes come back from disk identical, and foreign files are refused in one line."""

import chaospy as cp
import numpy as np
import pytest
import xarray as xr

import hipuq
from hipuq.errors import StoreError
from hipuq.store import add_results


@pytest.fixture(scope="module")
def outcomes() -> xr.Dataset:
    model = hipuq.models.ring("oberst2016")
    inputs = model.inputs(friction=cp.Uniform(0, 0.1), contact=hipuq.ContactPatterns(in_contact=(7, 8)))
    samples = hipuq.design("monte_carlo", inputs, n=8, rng=0, stratify="contact")
    return hipuq.evaluate(model, samples)


def test_outcomes_come_back_identical_and_can_be_analysed_alone(outcomes, tmp_path):
    hipuq.save_outcomes(outcomes, tmp_path / "outcomes.zarr")
    again = hipuq.load_outcomes(tmp_path / "outcomes.zarr")
    xr.testing.assert_identical(outcomes, again.load())
    inputs = hipuq.Inputs.from_json(again.attrs["inputs"])
    for of in ("unstable", "any_unstable", "margin"):
        there = hipuq.estimate("monte_carlo", outcomes, inputs, of=of)
        here = hipuq.estimate("monte_carlo", again, inputs, of=of)
        xr.testing.assert_identical(there.drop_attrs(deep=False), here.drop_attrs(deep=False))


def test_types_survive(outcomes, tmp_path):
    hipuq.save_outcomes(outcomes, tmp_path / "o.zarr")
    again = hipuq.load_outcomes(tmp_path / "o.zarr")
    assert again["contact"].dtype == bool
    assert again["unstable"].dtype == np.float32
    assert again["status"].dtype == np.int8
    assert again.attrs["seed"] == 0


def test_results_come_back_identical(outcomes, tmp_path):
    inputs = hipuq.Inputs.from_json(outcomes.attrs["inputs"])
    results = {
        f"a/{of}": hipuq.estimate("monte_carlo", outcomes, inputs, of=of) for of in ("unstable", "margin")
    }
    tree = xr.DataTree.from_dict(results)
    hipuq.save_results(tree, tmp_path / "sub" / "results.nc")
    xr.testing.assert_identical(tree, hipuq.load_results(tmp_path / "sub" / "results.nc"))
    xr.testing.assert_identical(tree, hipuq.load_results(tmp_path / "sub"))
    assert not list((tmp_path / "sub").glob("*.part"))


def test_results_can_be_added(outcomes, tmp_path):
    """Group by group gives the same file as all at once, order included; a failure leaves the old file."""
    inputs = hipuq.Inputs.from_json(outcomes.attrs["inputs"])
    results = {
        name: hipuq.estimate("monte_carlo", outcomes, inputs, of=name.split("/")[1])
        for name in ("z/unstable", "z/margin", "a/any_unstable", "a/unstable", "m/margin")
    }
    file = tmp_path / "results.nc"
    root = xr.Dataset(attrs={"title": "study"})
    hipuq.save_results(xr.DataTree.from_dict({"/": root, "z/unstable": results["z/unstable"]}), file)
    for name in list(results)[1:]:
        add_results({name: results[name]}, file)
    tree, again = xr.DataTree.from_dict({"/": root, **results}), hipuq.load_results(file)
    xr.testing.assert_identical(tree, again)
    assert [node.path for node in again.subtree] == [node.path for node in tree.subtree]
    with pytest.raises(StoreError, match="cannot write"):
        add_results({"b/y": xr.Dataset({"y": ("x", [object()])})}, file)
    xr.testing.assert_identical(tree, hipuq.load_results(file))


def test_a_store_is_replaced_but_nothing_else(outcomes, tmp_path):
    hipuq.save_outcomes(outcomes, tmp_path / "o.zarr")
    hipuq.save_outcomes(outcomes.isel(sample=slice(3)), tmp_path / "o.zarr")
    assert hipuq.load_outcomes(tmp_path / "o.zarr").sizes["sample"] == 3
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("keep me")
    with pytest.raises(StoreError, match="not a Zarr store"):
        hipuq.save_outcomes(outcomes, tmp_path / "mine")
    assert (tmp_path / "mine" / "letter.txt").read_text() == "keep me"


def test_foreign_and_broken_files_are_refused(tmp_path):
    missing = tmp_path / "none.nc"
    with pytest.raises(StoreError, match="there are no results at"):
        hipuq.load_results(missing)
    junk = tmp_path / "junk.nc"
    junk.write_bytes(b"not netCDF at all")
    with pytest.raises(StoreError, match="cannot read"):
        hipuq.load_results(junk)
    other = tmp_path / "other.nc"
    xr.Dataset({"x": 1.0}).to_netcdf(other, engine="h5netcdf")
    with pytest.raises(StoreError, match="not a results file of hipuq"):
        hipuq.load_results(other)
    with pytest.raises(StoreError, match="no outcomes"):
        hipuq.load_outcomes(tmp_path)
    xr.Dataset({"x": ("sample", [1.0])}).to_zarr(tmp_path / "x.zarr", zarr_format=2, consolidated=True)
    with pytest.raises(StoreError, match="not a store of hipuq"):
        hipuq.load_outcomes(tmp_path / "x.zarr")


def test_a_truncated_results_file_is_refused(outcomes, tmp_path):
    inputs = hipuq.Inputs.from_json(outcomes.attrs["inputs"])
    results = hipuq.estimate("monte_carlo", outcomes, inputs, of="unstable")
    hipuq.save_results(xr.DataTree.from_dict({"a/unstable": results}), tmp_path / "r.nc")
    whole = (tmp_path / "r.nc").read_bytes()
    (tmp_path / "r.nc").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(StoreError, match="cannot read"):
        hipuq.load_results(tmp_path / "r.nc")
