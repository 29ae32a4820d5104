"""Zarr stores that are broken or made to harm are refused in one line, before anything in them is opened."""

import json
import os
import pickle
import shutil

import numpy as np
import pytest
import xarray as xr

import hipuq
from hipuq.errors import StoreError
from hipuq.store.guarding import check_store


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    outcomes = xr.Dataset(
        {"margin": ("sample", np.arange(8.0)), "note": ("sample", list("abcdefgh"))},
        coords={"sample": np.arange(8), "pattern": ("sample", np.arange(8))},
        attrs={"hipuq_version": hipuq.__version__},
    )
    folder = tmp_path_factory.mktemp("stores") / "outcomes.zarr"
    hipuq.save_outcomes(outcomes, folder)
    return folder


@pytest.fixture
def store(whole, tmp_path):
    shutil.copytree(whole, tmp_path / "o.zarr")
    return tmp_path / "o.zarr"


def change(store, name, **own):
    """Write something into the metadata of an array, in its own file and in the joined one."""
    joined = json.loads((store / ".zmetadata").read_text())
    entry = joined["metadata"].setdefault(f"{name}/.zarray", {})
    entry |= own
    (store / ".zmetadata").write_text(json.dumps(joined))
    if (store / name).is_dir():
        (store / name / ".zarray").write_text(json.dumps(entry))


def attributes(store, **own):
    joined = json.loads((store / ".zmetadata").read_text())
    joined["metadata"][".zattrs"] |= own
    (store / ".zmetadata").write_text(json.dumps(joined))


def cut(file):
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def replaced(file, make):
    shutil.rmtree(file) if file.is_dir() else file.unlink()
    make(file)


ATTACKS = {
    "cut .zmetadata": (lambda s: cut(s / ".zmetadata"), "cannot read"),
    "cut .zattrs": (lambda s: cut(s / ".zattrs"), "cannot read"),
    "cut .zarray": (lambda s: cut(s / "margin" / ".zarray"), "cannot read"),
    "empty .zmetadata": (lambda s: (s / ".zmetadata").write_text("{}"), "holds no metadata"),
    "deep .zmetadata": (lambda s: (s / ".zmetadata").write_text("[" * 100_000), "cannot read"),
    "large .zmetadata": (lambda s: os.truncate(s / ".zmetadata", 10**9), "at most"),
    "pickle as filter": (
        lambda s: change(s, "margin", dtype="|O", filters=[{"id": "pickle"}]),
        "codec 'pickle'",
    ),
    "pickle as compressor": (lambda s: change(s, "margin", compressor={"id": "pickle"}), "codec 'pickle'"),
    "unknown codec": (lambda s: change(s, "margin", compressor={"id": "os.system"}), "codec 'os.system'"),
    "objects": (lambda s: change(s, "margin", dtype="|O", filters=None), "neither of numbers"),
    "records": (lambda s: change(s, "margin", dtype=[["a", "<f8"]]), "cannot be used"),
    "negative shape": (lambda s: change(s, "margin", shape=[-1]), "do not go together"),
    "huge chunk": (lambda s: change(s, "margin", chunks=[10**12]), "chunks .* too large"),
    "huge array": (lambda s: change(s, "margin", shape=[10**15]), "shape .* too large"),
    "huge index": (lambda s: change(s, "sample", shape=[10**11]), "shape .* too large"),
    "shape of words": (lambda s: change(s, "margin", shape=["many"]), "do not go together"),
    "no shape": (lambda s: change(s, "other", zarr_format=2), "not complete"),
    "name that leads out": (lambda s: change(s, "../../other", shape=[1]), "can be no array"),
    "absolute name": (lambda s: change(s, "/etc", shape=[1]), "can be no array"),
    "name of two parts": (lambda s: change(s, "a/b", shape=[1]), "can be no array"),
    "link for a chunk": (
        lambda s: replaced(s / "margin" / "0", lambda f: f.symlink_to("/etc/passwd")),
        "links",
    ),
    "link for an array": (lambda s: replaced(s / "margin", lambda f: f.symlink_to(s / "pattern")), "links"),
    "pipe for a chunk": (lambda s: replaced(s / "margin" / "0", os.mkfifo), "pipes"),
    "pipe for metadata": (lambda s: replaced(s / ".zmetadata", os.mkfifo), "pipes"),
    "file for the store": (lambda s: replaced(s, lambda f: f.write_text("x")), "not a folder"),
    "pipe for the store": (lambda s: replaced(s, os.mkfifo), "not a folder"),
    "format 3 beside it": (lambda s: (s / "zarr.json").write_text("{}"), "format 3"),
    "from the future": (lambda s: attributes(s, hipuq_version="99.0"), "update hipuq"),
    "of no version": (lambda s: attributes(s, hipuq_version=[1]), "which is none"),
}


@pytest.mark.parametrize("name", ATTACKS)
def test_a_hostile_store_is_refused_in_a_line(store, name):
    attack, why = ATTACKS[name]
    attack(store)
    with pytest.raises(StoreError, match=why) as caught:
        check_store(store)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 700


def test_a_store_of_ours_passes(store):
    check_store(store)
    assert hipuq.load_outcomes(store).load()["note"].values.tolist() == list("abcdefgh")


class Harm:
    def __reduce__(self):
        return (os.mkdir, (os.environ["HARM"],))


def test_nothing_is_unpickled(store, tmp_path, monkeypatch):
    """A chunk that would make a folder when it is unpickled, under a codec that unpickles."""
    monkeypatch.setenv("HARM", str(tmp_path / "harm"))
    change(
        store, "margin", dtype="|O", filters=[{"id": "pickle", "protocol": 5}], compressor=None, fill_value=0
    )
    (store / "margin" / "0").write_bytes(pickle.dumps(Harm()))
    with pytest.raises(StoreError, match="codec 'pickle'"):
        hipuq.load_outcomes(store).load()
    assert not (tmp_path / "harm").exists()
