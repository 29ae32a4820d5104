"""The page on long runs: its examples run as they are written, and the rest is at least Python."""

import ast
from pathlib import Path

import numpy as np

import hipuq

PAGE = Path(__file__).parents[1] / "docs" / "howto" / "long-runs.md"


def blocks(text: str) -> list[str]:
    """Return the blocks of Python in a text."""
    return [part.split("```")[0] for part in text.split("```python\n")[1:]]


def test_the_examples_do_what_the_page_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    here, cluster = PAGE.read_text(encoding="utf-8").split("## A cluster with dask")
    names: dict = {}
    first, again, larger, failing = blocks(here)
    exec(first, names)
    whole = names["outcomes"].load()
    assert whole.sizes["sample"] == 8192
    assert 0.4 < names["results"]["probability"] < 0.6
    exec(again, names)
    assert names["outcomes"].equals(whole)
    exec(larger, names)
    assert names["outcomes"].isel(sample=slice(8192)).equals(whole)
    model, design = names["model"], names["design"]
    direct = hipuq.evaluate(model, design, keep=["any_unstable", "margin"], progress=False)
    assert names["outcomes"].equals(direct)

    exec(failing, names)
    outcomes, failed, messages = names["outcomes"], names["failed"].values, names["messages"]
    assert np.array_equal(failed, outcomes["load"] > 1.9)
    assert np.array_equal(np.flatnonzero(failed), names["places"])
    assert np.array_equal(np.isnan(outcomes["rate"]), failed)
    assert len(messages) == failed.sum() > 0
    assert set(messages) == {"RuntimeError: no equilibrium found"}
    for example in blocks(cluster):
        ast.parse(example)
