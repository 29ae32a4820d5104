"""A dask cluster of two processes: the same bits as threads, also when a worker is killed."""

import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from helpers import SMALL_STUDY

import hipuq
from hipuq.cli import main
from hipuq.errors import ModelError

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")

STUDY = (
    SMALL_STUDY
    + """
[[analysis]]
name = "small"
method = "monte_carlo"
n = 8
of = "any_unstable"
[report]
damping_samples = 0
"""
)


@pytest.fixture(scope="module")
def client():
    """A client of a cluster of two worker processes, on which a block may cost one process."""
    settings = {"distributed.scheduler.allowed-failures": 1, "distributed.comm.timeouts.connect": "60s"}
    with (
        dask.config.set(settings),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs="CRITICAL"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def deadly(deaths: Path, times: int):
    """Return a model that kills the process that it runs in, so many times; made here, it goes by value."""

    def model(samples):
        model.seen.append(samples.sizes["sample"])
        if 0.5 in samples["x"]:
            for number in range(times):
                try:
                    (deaths / str(number)).touch(exist_ok=False)
                except FileExistsError:
                    continue
                os.kill(os.getpid(), signal.SIGKILL)
        return (np.sin(samples["x"]) ** 2).to_dataset(name="y")

    model.block = 8
    model.seen = []
    return model


@pytest.fixture
def samples():
    """Twelve blocks of 8 and one of 4, which is deadly."""
    return xr.Dataset({"x": ("sample", np.linspace(20.0, 0.5, 100))})


@pytest.fixture
def deaths(tmp_path) -> Path:
    folder = tmp_path / "deaths"
    folder.mkdir()
    return folder


def test_same_bits_as_threads(client, tmp_path):
    model = hipuq.models.ring("oberst2016")
    model.block = 16
    samples = model.nominal(friction=np.linspace(0.0, 0.1, 100))
    whole = hipuq.evaluate(model, samples, progress=False)
    for executor, store in ((client, None), (client.get_executor(), None), (client, tmp_path / "store")):
        assert hipuq.evaluate(model, samples, executor=executor, store=store, progress=False).equals(whole)
    assert 0 < whole["any_unstable"].values.mean() < 1


def test_a_killed_worker_changes_nothing(client, deaths, samples):
    found = hipuq.evaluate(deadly(deaths, 1), samples, executor=client, progress=False)
    assert len(list(deaths.iterdir())) == 1
    assert found.equals(hipuq.evaluate(deadly(deaths, 0), samples, progress=False))


def test_a_block_that_kills_every_worker_ends_the_run_and_loses_nothing(client, tmp_path, deaths, samples):
    store = tmp_path / "store"
    with pytest.raises(ModelError, match=r"the executor failed, KilledWorker: .*died while running"):
        hipuq.evaluate(deadly(deaths, 2), samples, executor=client, store=store, progress=False)
    harmless = deadly(deaths, 0)
    found = hipuq.evaluate(harmless, samples, store=store, resume=True, progress=False)
    assert harmless.seen == [4]
    assert found.equals(hipuq.evaluate(harmless, samples, progress=False))


def steps(client) -> int:
    """Return how many steps of tasks the scheduler has seen."""
    return client.run_on_scheduler(lambda dask_scheduler: dask_scheduler.transition_counter)


def test_the_command_line_takes_the_address_of_a_cluster(client, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    here = hipuq.run_study(hipuq.load_study(folder), tmp_path / "here", progress=False)
    there = tmp_path / "there"
    address = client.scheduler.address
    monkeypatch.setattr(sys, "argv", ["hipuq", "run", str(folder), "--out", str(there), "--dask", address])
    monkeypatch.setattr("hipuq.report.page.write_report", lambda tree, folder: folder)
    before = steps(client)
    with pytest.raises(SystemExit) as caught:
        main()
    assert not caught.value.code, capsys.readouterr().err
    found = hipuq.load_results(there)["small/any_unstable"].to_dataset()
    assert found.drop_vars("seconds").equals(here["small/any_unstable"].to_dataset().drop_vars("seconds"))
    assert steps(client) > before
