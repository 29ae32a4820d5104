"""Results of an older version: they load, are shown, reported, and a study goes on from them.

``tests/older`` holds what `hipuq run` of commit 00f853e left of the study beside it, before results kept
verdict counts, frequencies, onsets, fragility curves and friction limits.
"""

import io
import shutil
from pathlib import Path

import pytest
import xarray as xr
from rich.console import Console

import hipuq
from hipuq.report.page import write_report
from hipuq.report.text import show_results

OLDER = Path(__file__).parent / "older"


@pytest.fixture
def folder(tmp_path) -> Path:
    shutil.copytree(OLDER, tmp_path / "older")
    return tmp_path / "older"


def test_they_are_shown_and_reported(folder):
    tree = hipuq.load_results(folder)
    page = write_report(tree, folder).read_text(encoding="utf-8")
    console = Console(width=100, record=True, file=io.StringIO())
    show_results(tree, console)
    shown = console.export_text()
    for text in (page, shown):
        assert "P(squeak) = 1: all of 8 evaluations are unstable" in text
        assert "0.9050" in text
    assert "of whose outcomes these results hold none" in page


def test_a_study_goes_on_from_them_and_says_what_it_cannot_make(folder):
    before = hipuq.load_results(folder)
    said: list[str] = []
    study = hipuq.load_study(folder)
    tree = hipuq.run_study(study, folder, resume=True, progress=False, say=said.append)
    for name in ("sampled/any_unstable", "integrated/probability", "drivers/any_unstable"):
        xr.testing.assert_identical(tree[name].to_dataset(), before[name].to_dataset())
    told = "\n".join(said)
    assert "integrated: verdicts, fragility, onsets, friction_limit cannot be made from the outcomes" in told
    assert "sampled: verdicts, frequencies cannot be made" in told
    assert "any_unstable" in tree["damping_sweep"].children
