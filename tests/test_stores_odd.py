"""Stores in odd places: odd outputs, folders of earlier runs, files that are gone, samples from files."""

import json
import os
import shutil
from pathlib import Path

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from same_outcomes import plain, same

import hipuq
from hipuq import schema
from hipuq.errors import ModelError, SchemaError, StoreError
from hipuq.store import failures, opening
from hipuq.store.ledger import ABOUT, LINES

HOFFMANN = hipuq.models.two_dof("hoffmann2002")


def samples(size: int = 40) -> xr.Dataset:
    return xr.Dataset({"x": ("sample", np.arange(size, dtype=float))})


def square(given: xr.Dataset) -> xr.Dataset:
    return xr.Dataset({"y": given["x"] ** 2})


square.block = 4


def forget(store: Path, kept: int) -> None:
    """Cut off the ledger after some units, as if the run had been killed there."""
    lines = [line for line in (store / LINES).read_text().splitlines() if line]
    units = [line for line in lines if json.loads(line)["unit"] >= 0][:kept]
    start = [line for line in lines if json.loads(line)["unit"] == -2]
    (store / LINES).write_text("\n".join([*start, *units]) + "\n")


@pytest.mark.parametrize("n", [40, 60])
def test_friction_integrated_goes_on_and_is_extended(n, tmp_path):
    """One of its outcomes, `interval`, has the name of one of its dims."""
    exact = hipuq.integrate_friction(HOFFMANN, cp.Uniform(0.0, 2.0))
    exact.block = 8
    inputs = exact.inputs(k3=cp.Uniform(0.5, 2.0))
    store = tmp_path / "a.zarr"
    hipuq.evaluate(exact, hipuq.lazy_design("monte_carlo", inputs, 40, 1), store=store)
    forget(store, 2)
    design = hipuq.lazy_design("monte_carlo", inputs, n, 1)
    same(hipuq.evaluate(exact, design, store=store, resume=True), hipuq.evaluate(exact, design))


def test_what_is_shorter_than_others_in_a_unit_is_missing(tmp_path):
    def model(given: xr.Dataset) -> xr.Dataset:
        length = 1 + int(given["x"].values[0]) // 4 % 3
        return xr.Dataset({"parts": (("sample", "part"), np.ones((given.sizes["sample"], length)))})

    model.block, model.ragged = 4, ("part",)
    size = 4 * 64 * 3
    expected = hipuq.evaluate(model, samples(size))
    assert (expected["status"] == 0).all()
    same(hipuq.evaluate(model, samples(size), store=tmp_path / "a.zarr"), expected)
    assert expected["parts"].isnull().sum() > 0
    # A model without a status of its own, in other blocks.
    model.block = 12
    assert (hipuq.evaluate(model, samples(size))["status"] == 0).all()


def test_one_odd_sample_does_not_make_the_others_fail():
    def model(given: xr.Dataset) -> xr.Dataset:
        rows = [np.ones(4 if x == 7 else 3) for x in given["x"].values]
        return xr.Dataset({"y": (("sample", "part"), np.array(rows))})

    outcomes = hipuq.evaluate(model, samples(50))
    assert np.flatnonzero(outcomes["status"].values == 2).tolist() == [7]
    assert "lengths (4,), not (3,)" in outcomes["failure_message"].values[0]
    with pytest.raises(ModelError, match="1 of 50 samples failed, more than max_failed = 0 allows"):
        hipuq.evaluate(model, samples(50), max_failed=0)

    def named(given: xr.Dataset) -> xr.Dataset:
        if (given["x"] == 7).any() and given.sizes["sample"] > 1:
            raise RuntimeError("not together")
        return xr.Dataset({"b" if (given["x"] == 7).any() else "a": given["x"]})

    outcomes = hipuq.evaluate(named, samples(50))
    assert outcomes["failure_message"].values.tolist() == [
        "the model returned no 'a', which it returned for other samples"
    ]


def test_outputs_of_one_sample_that_are_none_are_a_failure():
    """Of the first sample they end the run: nothing says then that the model is ever right."""

    def model(given: xr.Dataset) -> object:
        return None if given["x"].values[0] == bad else square(given)

    model.block = 1
    bad = 30.0
    outcomes = hipuq.evaluate(model, samples())
    assert outcomes["failed_sample"].values.tolist() == [30]
    assert "must return an xarray Dataset, not NoneType" in outcomes["failure_message"].values[0]
    bad = 0.0
    with pytest.raises(SchemaError, match="must return an xarray Dataset"):
        hipuq.evaluate(model, samples())


def test_a_status_that_is_none_is_a_failure():
    def model(given: xr.Dataset) -> xr.Dataset:
        status = np.where(given["x"] == 3, np.nan, np.where(given["x"] == 5, 2.0, 0.0))
        return square(given).assign(status=("sample", status))

    outcomes = hipuq.evaluate(model, samples(8))
    assert outcomes["status"].values.tolist() == [0, 0, 0, 2, 0, 2, 0, 0]
    assert outcomes["status"].attrs["flag_meanings"] == "ok undecided failed"
    assert outcomes["failure_message"].values.tolist() == [
        "the model gave the status nan: it must be one of 0 (ok), 1 (undecided), 2 (failed)"
    ]


def test_samples_with_other_variables_or_coordinates_are_refused(tmp_path):
    store = tmp_path / "a.zarr"
    more = samples().assign(z=("sample", np.ones(40))).assign_coords(weight=("sample", np.full(40, 0.5)))
    hipuq.evaluate(square, more, store=store)
    for other, message in (
        (more.drop_vars("z"), r"variables of the samples\[?.*'x', 'z'"),
        (more.assign(w=more["z"]), "variables of the samples"),
        (more.assign_coords(weight=more["weight"] * 2), "weight of sample 0 is 0.5 there, 1.0 here"),
        (xr.concat([more.drop_vars("z")] * 2, "sample"), "variables of the samples"),
    ):
        with pytest.raises(StoreError, match=message):
            hipuq.evaluate(square, other, store=store, resume=True)


def test_samples_from_a_file_are_stored(tmp_path):
    """Attributes come back from netCDF as numbers of numpy."""
    inputs = HOFFMANN.inputs(friction=cp.Uniform(0.0, 1.0))
    hipuq.design("monte_carlo", inputs, 50, 1).to_netcdf(tmp_path / "s.nc", engine="h5netcdf")
    given = xr.load_dataset(tmp_path / "s.nc", engine="h5netcdf").assign_attrs(mine=np.arange(3))
    for _ in range(2):
        outcomes = hipuq.evaluate(HOFFMANN, given, store=tmp_path / "a.zarr", resume=True)
    assert outcomes.attrs["seed"] == 1
    assert list(outcomes.attrs["mine"]) == [0, 1, 2]


def test_names_and_sizes_of_arrays(tmp_path, monkeypatch):
    monkeypatch.setattr("hipuq.store.blocks.CHUNK_BYTES", 64)

    def wide(given: xr.Dataset) -> xr.Dataset:
        return xr.Dataset({"größe": (("sample", "part"), given["x"].values[:, None] + np.arange(9.0))})

    wide.block = 4
    same(hipuq.evaluate(wide, samples(), store=tmp_path / "a.zarr"), hipuq.evaluate(wide, samples()))
    assert len(list((tmp_path / "a.zarr" / "größe").glob("0.*"))) > 1
    with pytest.raises(StoreError, match="'a/b' cannot be stored: a name begins with"):
        hipuq.evaluate(lambda given: xr.Dataset({"a/b": given["x"]}), samples(), store=tmp_path / "b.zarr")


def test_a_store_that_was_only_begun_is_no_obstacle(tmp_path):
    store = tmp_path / "a.zarr"
    store.mkdir()
    (store / f"{ABOUT}.hipuq-part").write_text('{"defin')
    assert hipuq.evaluate(square, samples(), store=store, resume=True).sizes["sample"] == 40


def test_an_extension_that_cannot_begin_leaves_what_was_there(tmp_path, monkeypatch):
    store = tmp_path / "a.zarr"
    before = hipuq.evaluate(square, samples(), store=store)

    def full(*arguments: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(opening, "write_about", full)
        with pytest.raises(StoreError, match="No space left on device"):
            hipuq.evaluate(square, samples(80), store=store, resume=True)
    same(hipuq.load_outcomes(store), before)
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


def test_what_lies_aside_of_something_else_is_no_obstacle(tmp_path):
    store, aside = tmp_path / "a.zarr", tmp_path / ".a.zarr.hipuq-old"
    hipuq.evaluate(square, samples().assign(x=lambda given: given["x"] + 1), store=store)
    store.rename(aside)
    hipuq.evaluate(square, samples(), store=store, resume=True)
    forget(store, 3)
    hipuq.evaluate(square, samples().assign(z=lambda given: given["x"]), store=tmp_path / "b.zarr")
    (tmp_path / "b.zarr").rename(aside)
    same(hipuq.evaluate(square, samples(), store=store, resume=True), hipuq.evaluate(square, samples()))
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


def test_a_store_that_is_replaced_stays_until_the_new_one_has_outcomes(tmp_path):
    how = {"store": tmp_path / "a.zarr", "replace": True}
    before = plain(hipuq.evaluation.evaluated(square, samples(), None, hipuq.evaluation.How(**how)))
    # A run that was killed before its first unit left the folder like this.
    aside = tmp_path / ".a.zarr.hipuq-replaced"
    (tmp_path / "a.zarr").rename(aside)
    (tmp_path / "a.zarr").mkdir()
    shutil.copy(aside / ABOUT, tmp_path / "a.zarr" / ABOUT)
    with pytest.raises(ModelError):
        hipuq.evaluation.evaluated(failing, samples(), None, hipuq.evaluation.How(**how))
    same_as = plain(hipuq.load_outcomes(tmp_path / "a.zarr"))
    xr.testing.assert_identical(same_as, before)


def failing(given: xr.Dataset) -> xr.Dataset:
    raise ArithmeticError


def test_a_kill_while_a_store_is_finished_loses_nothing(tmp_path):
    calls = []

    def model(given: xr.Dataset) -> xr.Dataset:
        calls.append(given.sizes["sample"])
        return square(given).where(given["x"] != 3)

    model.block = 4
    store = tmp_path / "a.zarr"
    before = plain(hipuq.evaluate(model, samples(), store=store))
    forget(store, 10)
    (store / "failed_sample" / ".zattrs").unlink()
    calls.clear()
    found = hipuq.evaluate(model, samples(), store=store, resume=True)
    xr.testing.assert_identical(plain(found), before)
    assert calls == []


def test_labels_and_coordinates_that_are_damaged_are_found_out(tmp_path):
    store = tmp_path / "a.zarr"
    given = samples().assign_coords(label=("sample", [f"patient {i}" for i in range(40)]), part=[1.5, 2.5])

    def model(part: xr.Dataset) -> xr.Dataset:
        parts = xr.DataArray([1.0, 2.0], dims="part", coords={"part": [1.5, 2.5]})
        return xr.Dataset({"y": part["x"] + parts})

    before = plain(hipuq.evaluate(model, given, store=store))
    for victim in ("label", "part"):
        (store / victim / "0").unlink()
        with pytest.raises(StoreError, match="missing or damaged"):
            hipuq.load_outcomes(store)
        found = hipuq.evaluate(model, given, store=store, resume=True)
        xr.testing.assert_identical(plain(found), before)


def test_links_and_current_folders(tmp_path, monkeypatch):
    (tmp_path / "disk").mkdir()
    (tmp_path / "link.zarr").symlink_to(tmp_path / "disk" / "a.zarr")
    hipuq.evaluate(square, samples(), store=tmp_path / "link.zarr")
    same(
        hipuq.evaluate(square, samples(80), store=tmp_path / "link.zarr", resume=True),
        hipuq.evaluate(square, samples(80)),
    )
    assert [path.name for path in (tmp_path / "disk").iterdir()] == ["a.zarr"]
    monkeypatch.chdir(tmp_path)

    def wandering(given: xr.Dataset) -> xr.Dataset:
        os.chdir("/")
        return square(given)

    wandering.block = 4
    hipuq.evaluate(wandering, samples(), store="here.zarr", n_jobs=1)
    assert hipuq.load_outcomes(tmp_path / "here.zarr").sizes["sample"] == 40
    (tmp_path / "inside").mkdir()
    monkeypatch.chdir(tmp_path / "inside")
    assert hipuq.evaluate(square, samples(), store=".").sizes["sample"] == 40


def test_rounds_are_repaired_and_extended(tmp_path):
    inputs = HOFFMANN.inputs(friction=cp.Uniform(0.0, 1.0), k3=cp.Uniform(1.0, 2.0))
    kwargs = {"method": "chaos", "of": "margin", "rng": 1, "correction": 128, "degree": 2}
    store = tmp_path / "a.zarr"
    expected = hipuq.run(HOFFMANN, inputs, n=64, store=store, **kwargs)
    chunk = store / "margin" / "0"
    chunk.write_bytes(chunk.read_bytes()[:-5])
    results = hipuq.run(HOFFMANN, inputs, n=64, store=store, resume=True, **kwargs)
    xr.testing.assert_equal(results.drop_vars("seconds"), expected.drop_vars("seconds"))
    larger = hipuq.run(HOFFMANN, inputs, n=80, store=store, resume=True, **kwargs)
    anew = hipuq.run(HOFFMANN, inputs, n=80, **kwargs)
    xr.testing.assert_equal(larger.drop_vars("seconds"), anew.drop_vars("seconds"))


def test_the_table_of_failures_goes_with_its_samples(tmp_path):
    def model(given: xr.Dataset) -> xr.Dataset:
        return square(given).where(given["x"] % 10 != 7)

    outcomes = hipuq.evaluate(model, samples())
    assert outcomes["failed_sample"].values.tolist() == [7, 17, 27, 37]
    part = failures.part_of(outcomes, slice(10, 30))
    assert part["failed_sample"].values.tolist() == [7, 17]
    assert (part["status"].values[[7, 17]] == schema.STATUS["failed"]).all()
    part = failures.part_of(outcomes, np.array([17, 18, 37]))
    assert part["failed_sample"].values.tolist() == [0, 2]
    assert "failure_message" not in failures.part_of(outcomes, slice(0, 5))


def test_only_so_many_messages_are_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(failures, "MOST", 5)
    monkeypatch.setattr("hipuq.store.blocks.MOST", 5)

    def model(given: xr.Dataset) -> xr.Dataset:
        return square(given).where(given["x"] < 2)

    model.block = 4
    expected = hipuq.evaluate(model, samples())
    assert expected["failed_sample"].values.tolist() == [2, 3, 4, 5, 6]
    assert int((expected["status"] == schema.STATUS["failed"]).sum()) == 38
    same(hipuq.evaluate(model, samples(), store=tmp_path / "a.zarr"), expected)


def test_limits_hold_for_failures_that_are_there(tmp_path):
    def model(given: xr.Dataset) -> xr.Dataset:
        if (given["x"] == 7).any():
            raise ArithmeticError("seven")
        return square(given)

    model.block = 4
    store = tmp_path / "a.zarr"
    hipuq.evaluate(model, samples(), store=store)
    with pytest.raises(ModelError, match=r"failed on sample 7, as .* tells: ArithmeticError: seven"):
        hipuq.evaluate(model, samples(), store=store, resume=True, on_error="raise")
    with pytest.raises(ModelError, match="1 of 40 samples failed, more than max_failed = 0 allows"):
        hipuq.evaluate(model, samples(), store=store, resume=True, max_failed=0)


def test_errors_that_cannot_be_told_are_failures():
    class Mute(Exception):
        def __str__(self) -> str:
            raise ValueError

    def model(given: xr.Dataset) -> xr.Dataset:
        if (given["x"] == 1).any():
            raise Mute
        if (given["x"] == 2).any():
            raise ValueError("\x1b[31mred\x07\n" + "long " * 500)
        return square(given)

    outcomes = hipuq.evaluate(model, samples())
    mute, loud = outcomes["failure_message"].values
    assert mute == "Mute"
    assert loud.isprintable()
    assert len(loud) <= 500
    assert loud.startswith("ValueError: ")


def test_a_saved_store_is_put_back_if_its_replacement_was_cut_off(tmp_path):
    store = tmp_path / "a.zarr"
    first = hipuq.evaluate(square, samples())
    hipuq.save_outcomes(first, store)
    store.rename(tmp_path / ".a.zarr.hipuq-saved")
    second = hipuq.evaluate(square, samples(10))
    hipuq.save_outcomes(second, store)
    assert hipuq.load_outcomes(store).sizes["sample"] == 10
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


def test_a_model_may_change_what_it_gets(tmp_path):
    """As when it converts units in place; blocks, halving and stores change no number by that."""

    def model(given: xr.Dataset) -> xr.Dataset:
        if (given["x"] == 9).any():
            raise ArithmeticError
        given["x"].values *= 0.5
        given["more"] = given["x"]
        return xr.Dataset({"y": ("sample", given["x"].values * 2)})

    mine = samples()
    for block in (1, 7, 1024):
        model.block = block
        for store in (None, tmp_path / f"{block}.zarr"):
            outcomes = hipuq.evaluate(model, mine, store=store)
            known = outcomes["status"].values == 0
            assert known.sum() == 39
            assert np.array_equal(outcomes["y"].values[known], outcomes["x"].values[known])
    xr.testing.assert_identical(mine, samples())


def test_failed_samples_can_be_tried_again(tmp_path):
    licensed = False
    calls = []

    def model(given: xr.Dataset) -> xr.Dataset:
        calls.extend(given["x"].values.tolist())
        if not licensed and (given["x"] > 33).any():
            raise OSError("no licence")
        return square(given)

    model.block = 4
    store = tmp_path / "a.zarr"
    assert "failure_message" in hipuq.evaluate(model, samples(), store=store)
    licensed = True
    calls.clear()
    assert "failure_message" in hipuq.evaluate(model, samples(), store=store, resume=True)
    assert calls == []
    outcomes = hipuq.evaluate(model, samples(), store=store, resume=True, retry_failed=True)
    assert calls == list(range(32, 40))
    same(outcomes, hipuq.evaluate(model, samples()))
    with pytest.raises(hipuq.HipuqError, match="retry_failed needs resume"):
        hipuq.evaluate(model, samples(), retry_failed=True)
