"""Results files that are broken or made to harm are refused in one line, by Python and the command line."""

import os

import h5py
import numpy as np
import pytest
import xarray as xr
from hostile import garbled
from hypothesis import given, settings
from hypothesis import strategies as st

import hipuq
from hipuq import cli
from hipuq.errors import StoreError
from hipuq.store import check_ours


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> bytes:
    results = xr.Dataset(
        {"probability": ("pattern", [0.25, 0.5])},
        coords={"pattern": [1, 2], "name": ("pattern", ["a", "b"])},
        attrs={"hipuq_version": hipuq.__version__, "of": "any_unstable", "method": "monte_carlo"},
    )
    file = tmp_path_factory.mktemp("whole") / "results.nc"
    hipuq.save_results(xr.DataTree.from_dict({"a/any_unstable": results}), file)
    return file.read_bytes()


@pytest.fixture
def file(whole, tmp_path):
    (tmp_path / "results.nc").write_bytes(whole)
    return tmp_path / "results.nc"


def said(capsys, monkeypatch, *arguments) -> str:
    """Return what the command line says of what it refuses."""
    monkeypatch.setattr("sys.argv", ["hipuq", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    assert caught.value.code == 1
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    assert "unexpected" not in text
    return text


def virtual(group):
    layout = h5py.VirtualLayout((4,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (4,))
    group.create_virtual_dataset("x", layout)


ATTACKS = {
    "external link": (lambda g: g.__setitem__("x", h5py.ExternalLink("other.h5", "x")), "is a link"),
    "soft link": (lambda g: g.__setitem__("x", h5py.SoftLink("/a")), "is a link"),
    "cycle": (lambda g: g.__setitem__("x", g.file["a"]), "groups within each other"),
    "itself": (lambda g: g.__setitem__("x", g.file["/"]), "groups within each other"),
    "deep": (lambda g: g.create_group("/".join("g" * 300)), "groups within each other"),
    "external": (
        lambda g: g.create_dataset("x", (4,), "f8", external=[("/etc/passwd", 0, 32)]),
        "lie in another file",
    ),
    "virtual": (virtual, "lie in another file"),
    "huge": (lambda g: g.create_dataset("x", (10**12,), "f8", chunks=(1024,)), "would take 8,000,"),
    "huge text": (lambda g: g.create_dataset("x", (10**9,), h5py.string_dtype(), chunks=(9,)), "would take"),
    "packed": (
        lambda g: g.create_dataset("x", (10**12,), "i1", chunks=(9,), compression="gzip"),
        "would take 1,000,",
    ),
    "bytes": (lambda g: g.create_dataset("x", data=np.zeros(3, "V8")), "results hold numbers and text"),
    "references": (lambda g: g.create_dataset("x", (3,), h5py.ref_dtype), "results hold numbers and text"),
    "lists": (lambda g: g.create_dataset("x", (3,), h5py.vlen_dtype("f8")), "results hold numbers and text"),
    "records": (lambda g: g.create_dataset("x", (3,), [("a", "f8")]), "results hold numbers and text"),
    "future": (lambda g: g.attrs.__setitem__("hipuq_version", "99.0"), "update hipuq to read it"),
    "no version": (lambda g: g.attrs.__setitem__("hipuq_version", "new"), "which is none"),
    "numbers": (lambda g: g.attrs.__setitem__("method", np.arange(3)), "method of a/any_unstable is no text"),
    "empty": (lambda g: g.attrs.__setitem__("of", h5py.Empty("S1")), "of of a/any_unstable is no text"),
    "no JSON": (lambda g: g.attrs.__setitem__("inputs", "{"), "does not say of which model"),
    "deep JSON": (lambda g: g.attrs.__setitem__("options", '{"a":' * 9000), "does not say of which model"),
    "times": (lambda g: g["probability"].attrs.__setitem__("units", "days since 0000-13-77"), "cannot read"),
    "scale": (lambda g: g["probability"].attrs.__setitem__("scale_factor", "x"), "cannot read"),
}


@pytest.mark.parametrize("name", ATTACKS)
def test_hostile_results_are_refused_in_a_line(file, capsys, monkeypatch, name):
    attack, why = ATTACKS[name]
    with h5py.File(file, "r+") as opened:
        attack(opened["a/any_unstable"])
    with pytest.raises(StoreError, match=why) as caught:
        hipuq.load_results(file)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 700
    for command in ("show", "report"):
        assert said(capsys, monkeypatch, command, file).count("results.nc") == 1


def test_what_is_no_file_is_not_read(file, capsys, monkeypatch):
    for end in ("pipe", "zeros", "loop", "huge", "none"):
        place = file.with_name(f"{end}.nc")
        if end == "pipe":
            os.mkfifo(place)
        elif end == "huge":
            with place.open("wb") as opened:
                opened.truncate(2**31)
        elif end != "none":
            place.symlink_to("/dev/zero" if end == "zeros" else place)
        for command in ("show", "report"):
            assert f"{end}.nc" in said(capsys, monkeypatch, command, place)


def test_of_another_program(tmp_path, capsys, monkeypatch):
    for name, content in {"text": b"hello\n" * 9, "empty": b"", "pickle": b"\x80\x04K\x01."}.items():
        (tmp_path / name).write_bytes(content)
        assert "cannot read" in said(capsys, monkeypatch, "show", tmp_path / name)
    with h5py.File(tmp_path / "plain.h5", "w") as opened:
        opened["x"] = np.arange(3.0)
    assert "is not a results file of hipuq" in said(capsys, monkeypatch, "show", tmp_path / "plain.h5")


def test_a_later_patch_is_read_and_older_results_too(file):
    for version in (f"{hipuq.__version__}.dev9", "0.0.1", "0.1.99"):
        with h5py.File(file, "r+") as opened:
            opened["a/any_unstable"].attrs["hipuq_version"] = version
        check_ours(file)


@given(st.randoms(use_true_random=False))
@settings(max_examples=120)
def test_any_bytes_end_in_results_or_in_one_line(whole, tmp_path_factory, r):
    file = tmp_path_factory.getbasetemp() / "garbled.nc"
    file.write_bytes(garbled(whole, r))
    try:
        tree = hipuq.load_results(file)
    except StoreError as error:
        assert str(error).isprintable()
        assert len(str(error)) < 700
    else:
        assert isinstance(tree, xr.DataTree)
