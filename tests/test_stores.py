"""Outcomes written unit by unit: the same as in memory, resumed, extended, locked, and never half a truth."""

import json
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from same_outcomes import same

import hipuq
from hipuq.designs import Design
from hipuq.errors import InputError, ModelError, StoreError
from hipuq.store import blocks
from hipuq.store.ledger import LINES
from hipuq.store.lock import locked

RING = hipuq.models.ring(oscillators=4)
INPUTS = RING.inputs(
    friction=cp.Uniform(0.0, 1.0),
    contact=hipuq.ContactPatterns((3, 4), oscillators=4),
    contact_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"),
)


class Counting:
    """The ring, in blocks of 16 samples, which counts them."""

    outcomes, label, options = RING.outcomes, RING.label, RING.options
    block = 16

    def __init__(self, last: int | None = None) -> None:
        self.seen, self.last = 0, last

    def __call__(self, samples: xr.Dataset, keep: object = None) -> xr.Dataset:
        if self.last is not None and self.seen >= self.last:
            raise KeyboardInterrupt
        self.seen += samples.sizes["sample"]
        return RING(samples, keep)


def design(n: int = 200, **options: object) -> Design:
    return hipuq.lazy_design("monte_carlo", INPUTS, n, 1, **options)


@pytest.fixture(scope="module")
def whole():
    return hipuq.evaluate(Counting(), design())


def cut(store: Path, last: int = 100, **options: object) -> None:
    """Leave a store of a run that was interrupted."""
    with pytest.raises(KeyboardInterrupt, match=r"of 200 samples are in .*; go on with resume=True"):
        hipuq.evaluate(Counting(last), design(**options), store=store, n_jobs=1)


def test_a_store_holds_what_memory_would(whole, tmp_path):
    same(hipuq.evaluate(Counting(), design(), store=tmp_path / "a.zarr"), whole)
    samples = hipuq.design("monte_carlo", INPUTS, 200, 1)
    same(hipuq.evaluate(Counting(), samples, store=tmp_path / "b.zarr", n_jobs=1), whole)
    found = xr.open_zarr(tmp_path / "a.zarr", chunks=None)
    assert found["margin"].dtype == np.float64
    assert found.attrs["seconds"] > 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.zarr", "b.zarr"]


@pytest.mark.parametrize("block", [1, 7, 64, 1000])
def test_blocks_of_the_store_do_not_change_a_bit(whole, block, tmp_path):
    model = Counting()
    model.block = block
    same(hipuq.evaluate(model, design(), store=tmp_path / "a.zarr"), whole)


def test_executors_do_not_change_a_bit(tmp_path):
    outcomes = hipuq.evaluate(RING, design(), n_jobs=1)
    with ThreadPoolExecutor(3) as threads:
        same(hipuq.evaluate(RING, design(), executor=threads, store=tmp_path / "a.zarr"), outcomes)
    same(hipuq.evaluate(RING, design(), executor="processes", n_jobs=2, store=tmp_path / "b.zarr"), outcomes)
    with pytest.raises(InputError, match=r"cannot be sent to another process.*top level of a module"):
        hipuq.evaluate(lambda samples: samples, design(), executor="processes")


def test_values_of_a_store_are_read_when_they_are_used(tmp_path):
    outcomes = hipuq.evaluate(Counting(), design(), store=tmp_path / "a.zarr")
    assert not outcomes["margin"].variable._in_memory
    results = [
        hipuq.estimate("monte_carlo", own, INPUTS, of="margin", rng=0) for own in (outcomes, outcomes.load())
    ]
    assert results[0]["mean"].values == results[1]["mean"].values


def test_a_run_that_was_cut_off_goes_on(whole, tmp_path):
    store = tmp_path / "a.zarr"
    cut(store)
    with pytest.raises(StoreError, match=r"not complete, 112 of 200 samples are there; .* resume=True"):
        hipuq.load_outcomes(store)
    model = Counting()
    same(hipuq.evaluate(model, design(), store=store, resume=True), whole)
    assert model.seen == 88
    again = Counting()
    same(hipuq.evaluate(again, design(), store=store, resume=True), whole)
    assert again.seen == 0


def test_resume_without_a_store_just_runs(whole, tmp_path):
    same(hipuq.evaluate(Counting(), design(), store=tmp_path / "new" / "a.zarr", resume=True), whole)
    (tmp_path / "empty").mkdir()
    same(hipuq.evaluate(Counting(), design(), store=tmp_path / "empty", resume=True), whole)


def test_what_was_damaged_is_made_again(whole, tmp_path):
    """A power cut leaves a line without all of its data, or half a line."""
    store = tmp_path / "a.zarr"
    hipuq.evaluate(Counting(), design(), store=store)
    victims = [store / "margin" / "3", store / "friction" / "12", store / ".zmetadata", store / ".zattrs"]
    for victim, expected in zip(victims, (16, 8, 0, 0), strict=True):
        data = victim.read_bytes()
        for damage in (data[: len(data) // 2], data[:-1] + bytes([data[-1] ^ 1]), None):
            victim.unlink() if damage is None else victim.write_bytes(damage)
            if damage is None or len(damage) < len(data) or victim.name.startswith(".z"):
                with pytest.raises(StoreError, match="missing or damaged"):
                    hipuq.load_outcomes(store)
            model = Counting()
            same(hipuq.evaluate(model, design(), store=store, resume=True), whole)
            assert model.seen == expected
    ledger = store / LINES
    lines = [line for line in ledger.read_text().splitlines() if line]
    ledger.write_text("\n".join(lines[:4]) + "\n" + lines[4][:40])
    model = Counting()
    same(hipuq.evaluate(model, design(), store=store, resume=True), whole)
    assert 0 < model.seen < 200
    (store / "margin" / ".zarray").write_text('{"sha')
    model = Counting()
    same(hipuq.evaluate(model, design(), store=store, resume=True), whole)
    assert model.seen == 200


OTHERS = [
    ("seed 1, not 2", RING, hipuq.lazy_design("monte_carlo", INPUTS, 200, 2), None),
    ("samples 200, not 100", RING, hipuq.lazy_design("monte_carlo", INPUTS, 100, 1), None),
    ("method 'monte_carlo', not 'sobol'", RING, hipuq.lazy_design("sobol", INPUTS, 64, 1), None),
    (
        "design.sampler 'random', not 'latin_hypercube'",
        RING,
        hipuq.lazy_design("monte_carlo", INPUTS, 200, 1, sampler="latin_hypercube"),
        None,
    ),
    ("keep None, not", RING, hipuq.lazy_design("monte_carlo", INPUTS, 200, 1), ["margin"]),
    (
        "model_options.growth_threshold 0.0, not 1.0",
        hipuq.models.ring(oscillators=4, growth_threshold=1.0),
        hipuq.lazy_design("monte_carlo", INPUTS, 200, 1),
        None,
    ),
    (
        "friction of sample 3 is ",
        RING,
        hipuq.design("monte_carlo", INPUTS, 200, 1).assign(
            friction=lambda given: given["friction"].where(given["sample"] != 3, 0.5)
        ),
        None,
    ),
]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    store = tmp_path_factory.mktemp("finished") / "a.zarr"
    hipuq.evaluate(RING, design(), store=store)
    return store


@pytest.mark.parametrize(("message", "model", "samples", "keep"), OTHERS)
def test_a_store_of_something_else_is_refused(finished, message, model, samples, keep):
    before = {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()}
    with pytest.raises(StoreError, match=message):
        hipuq.evaluate(model, samples, keep=keep, store=finished, resume=True)
    with pytest.raises(StoreError, match=r"there is a store at .* already: go on with resume=True"):
        hipuq.evaluate(model, samples, keep=keep, store=finished)
    assert {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("attribute", ["schema.VERSION", "evaluation.evaluating.__version__"])
def test_a_store_of_another_version_is_refused(finished, attribute, monkeypatch):
    monkeypatch.setattr(f"hipuq.{attribute}", 99)
    with pytest.raises(StoreError, match=r"was made with (schema_version 1|hipuq_version '.*'), not 99"):
        hipuq.evaluate(RING, design(), store=finished, resume=True)


def test_what_is_no_store_is_refused(tmp_path):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "mine").write_text("mine")
    for name in ("file", "folder"):
        for resume in (False, True):
            with pytest.raises(StoreError, match=r"something that is not a store of hipuq is there"):
                hipuq.evaluate(RING, design(), store=tmp_path / name, resume=resume)
    assert (tmp_path / "folder" / "mine").read_text() == "mine"
    with pytest.raises(StoreError, match="cannot lock"):
        hipuq.evaluate(RING, design(), store=tmp_path / "file" / "a.zarr")
    with pytest.raises(InputError, match="resume needs a store"):
        hipuq.evaluate(RING, design(), resume=True)


MORE = [
    ("random", 200, 300, {}, 100),
    ("sobol", 128, 256, {"sampler": "sobol", "replicates": 1}, 128),
    ("replicates", 128, 256, {"sampler": "sobol", "replicates": 8}, 128),
    ("strata", 10, 25, {"stratify": True}, 75),
    ("latin hypercube", 64, 128, {"sampler": "latin_hypercube", "replicates": 1}, 128),
]


@pytest.mark.parametrize(("name", "few", "many", "options", "new"), MORE, ids=[case[0] for case in MORE])
@pytest.mark.parametrize("made", ["rows", "whole"])
def test_more_samples_take_over_those_that_are_there(name, few, many, options, new, made, tmp_path):
    """What was evaluated is found by its values, wherever it lies in the larger design."""
    store = tmp_path / "a.zarr"

    def samples(n):
        make = hipuq.lazy_design if made == "rows" else hipuq.design
        return make("monte_carlo", INPUTS, n, 1, **options)

    hipuq.evaluate(Counting(), samples(few), store=store)
    model = Counting()
    larger = hipuq.evaluate(model, samples(many), store=store, resume=True)
    same(larger, hipuq.evaluate(RING, samples(many)))
    assert model.seen == new
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


def test_sobol_indices_are_extended_by_doubling(tmp_path):
    inputs = RING.inputs(friction=cp.Uniform(0.0, 1.0), damping_ratio=cp.Uniform(0.0, 0.02))
    kwargs = {"method": "sobol", "of": "margin", "rng": 1, "store": tmp_path / "a.zarr", "resamples": 10}
    hipuq.run(RING, inputs, n=32, **kwargs)
    model = Counting()
    results = hipuq.run(model, inputs, n=64, resume=True, **kwargs)
    assert model.seen == 32 * 4
    kwargs.pop("store")
    xr.testing.assert_equal(
        results.drop_vars("seconds"), hipuq.run(RING, inputs, n=64, **kwargs).drop_vars("seconds")
    )


def test_an_extension_that_was_cut_off_goes_on(tmp_path):
    store = tmp_path / "a.zarr"
    hipuq.evaluate(Counting(), design(200), store=store)
    with pytest.raises(KeyboardInterrupt, match="of 400 samples"):
        hipuq.evaluate(Counting(64), design(400), store=store, resume=True, n_jobs=1)
    with pytest.raises(StoreError, match="being extended, to 400 samples: go on with that first"):
        hipuq.evaluate(Counting(), design(500), store=store, resume=True)
    model = Counting()
    larger = hipuq.evaluate(model, design(400), store=store, resume=True)
    same(larger, hipuq.evaluate(RING, design(400)))
    assert 100 <= model.seen < 200
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


def test_an_extension_of_which_nothing_came_leaves_what_was_there(whole, tmp_path):
    store = tmp_path / "a.zarr"
    cut(store)
    with pytest.raises(ModelError):
        hipuq.evaluate(Counting(), design(400), store=store, resume=True, executor=Broken())
    model = Counting()
    same(hipuq.evaluate(model, design(), store=store, resume=True), whole)
    assert model.seen == 88


class Broken(ThreadPoolExecutor):
    """An executor that takes nothing."""

    def submit(self, *args, **kwargs):
        raise RuntimeError("no more")


def test_rounds_of_a_sequential_method_are_stored(tmp_path):
    inputs = RING.inputs(friction=cp.Uniform(0.0, 1.0), damping_ratio=cp.Uniform(0.0, 0.02))
    kwargs = {"method": "chaos", "n": 64, "of": "margin", "rng": 1, "correction": 128, "degree": 2}
    expected = hipuq.run(RING, inputs, **kwargs)
    store = tmp_path / "a.zarr"
    for stop in (40, 120, None):
        model = Counting(stop)
        try:
            results = hipuq.run(model, inputs, store=store, resume=True, n_jobs=1, **kwargs)
        except KeyboardInterrupt:
            assert stop is not None
    assert hipuq.load_outcomes(store).sizes["sample"] == 64 + 13 + 128
    again = Counting()
    results = [results, hipuq.run(again, inputs, store=store, resume=True, **kwargs)]
    assert again.seen == 0
    for one in results:
        xr.testing.assert_equal(one.drop_vars("seconds"), expected.drop_vars("seconds"))


def test_labels_that_are_no_numbers_are_stored(tmp_path):
    samples = hipuq.design("monte_carlo", INPUTS, 200, 1)
    names = [f"patient {'x' * (i % 5)}{i}" for i in range(200)]
    samples = samples.assign_coords(name=("sample", names))
    outcomes = hipuq.evaluate(Counting(), samples, store=tmp_path / "a.zarr")
    assert outcomes["name"].values.tolist() == names
    same(outcomes, hipuq.evaluate(RING, samples))


def test_outputs_of_different_lengths_are_stored(tmp_path):
    """A model says which dims depend on the samples, as intervals of friction do."""

    def model(samples: xr.Dataset) -> xr.Dataset:
        length = 1 + int(samples["x"].values[0]) % 7
        parts = np.arange(length) + samples["x"].values[:, None]
        return xr.Dataset(
            {"parts": (("sample", "part"), parts), "rest": (("side", "sample"), parts[:, :1].T)}
        )

    model.block, model.ragged = 4, ("part",)
    samples = xr.Dataset({"x": ("sample", np.arange(30.0))})
    expected = hipuq.evaluate(model, samples)
    known = expected["parts"].notnull().sum("part").values
    assert known.tolist() == [1 + i // 4 * 4 % 7 for i in range(30)]
    same(hipuq.evaluate(model, samples, store=tmp_path / "a.zarr"), expected)
    assert set(hipuq.integrate_friction(RING, cp.Uniform(0.0, 1.0)).ragged) == {"interval"}
    model.ragged = ()
    with pytest.raises(ModelError, match=r"output 'parts' of the model has the lengths .*, not \(1,\)"):
        hipuq.evaluate(model, samples)


def test_one_run_at_a_time(tmp_path):
    store = tmp_path / "a.zarr"
    with locked(store), pytest.raises(StoreError, match=r"another run is writing to .*a.zarr"):
        hipuq.evaluate(RING, design(), store=store)
    hold = "import sys, time, pathlib; from hipuq.store.lock import locked\n"
    hold += "with locked(pathlib.Path(sys.argv[1])):\n    print('held', flush=True)\n    time.sleep(60)"
    process = subprocess.Popen([sys.executable, "-c", hold, str(store)], stdout=subprocess.PIPE)
    assert process.stdout is not None
    with process, process.stdout:
        assert process.stdout.readline() == b"held\n"
        with pytest.raises(StoreError, match="another run is writing"):
            hipuq.evaluate(RING, design(), store=store)
        process.send_signal(signal.SIGKILL)
        process.wait()
        # The lock ended with its process.
        hipuq.evaluate(RING, design(), store=store)
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


def held_in_a_fork(store: Path) -> None:
    with locked(store):
        child = os.fork()
        if not child:
            time.sleep(30)
            os._exit(0)
        print(child, flush=True)
        os.kill(os.getpid(), signal.SIGKILL)


def test_a_lock_is_not_inherited(tmp_path):
    """Workers that outlive a killed run do not keep others out."""
    store = tmp_path / "a.zarr"
    process = multiprocessing.get_context("spawn").Process(target=held_in_a_fork, args=(store,))
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL
    with locked(store):
        pass


def limited(store: Path) -> str:
    """Evaluate where no file may be larger than a few kilobytes, as on a full disk."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8000, resource.RLIM_INFINITY))
    try:
        hipuq.evaluate(Counting(), design(), store=store, n_jobs=1)
    except StoreError as error:
        return str(error)
    return ""


def test_a_full_disk_loses_nothing(whole, tmp_path):
    store = tmp_path / "a.zarr"
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        message = pool.submit(limited, store).result()
    assert message.startswith(f"cannot write {store}: ")
    assert message.endswith("what was complete stays: go on with resume=True, or --resume")
    same(hipuq.evaluate(Counting(), design(), store=store, resume=True), whole)


def test_units_are_a_64th_of_all_at_most():
    assert blocks.units_of(10, 1024) == blocks.units_of(10, 4096) == 1024
    assert blocks.units_of(100_000, 1) == 64
    assert blocks.units_of(10_000_000, 1024) == blocks.units_of(10_000_000, 4096) == 65_536
    assert blocks.units_of(10_000_000, 16) == 1024
    assert blocks.units_of(1_000_000, 1024) == 16_384


def test_a_store_can_be_of_anything_that_says_what_it_is(tmp_path):
    """What a store is of is plain JSON beside the data."""
    hipuq.evaluate(Counting(), design(), store=tmp_path / "a.zarr")
    about = json.loads((tmp_path / "a.zarr" / "hipuq.json").read_text())["definition"]
    assert about["samples"] == 200
    assert about["model"] == RING.label
    assert about["inputs"].keys() == {"friction", "contact", "contact_stiffness"}
