"""Outcomes that are read when they are used: the same results, and never more than a block in memory."""

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from scipy.stats import qmc
from xarray.backends import BackendArray
from xarray.core import indexing

import hipuq
from hipuq import sampling
from hipuq.errors import SchemaError
from hipuq.estimation import reduction
from hipuq.methods import METHODS
from hipuq.occurring import frequency_ranges, verdict_counts
from hipuq.saltelli import resampling

BLOCK = 64


class Recorded(BackendArray):
    """An array that is read like a file and remembers how many rows each reading took."""

    def __init__(self, array: np.ndarray) -> None:
        self.array, self.shape, self.dtype = array, array.shape, array.dtype
        self.rows: list[int] = []

    def __getitem__(self, key):
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self.read)

    def read(self, key):
        part = self.array[key]
        self.rows.append(len(np.atleast_1d(part)))
        return part


def recorded(outcomes: xr.Dataset) -> tuple[xr.Dataset, dict[str, Recorded]]:
    """Return outcomes whose values over the samples are read when they are used, and the record of each."""
    arrays = {str(name): Recorded(values.values) for name, values in outcomes.variables.items()}
    arrays = {name: arrays[name] for name in arrays if name not in outcomes.indexes}
    lazy = {
        name: xr.Variable(outcomes[name].dims, indexing.LazilyIndexedArray(array), outcomes[name].attrs)
        for name, array in arrays.items()
    }
    return outcomes.assign({n: v for n, v in lazy.items() if n in outcomes.data_vars}).assign_coords(
        {n: v for n, v in lazy.items() if n in outcomes.coords}
    ), arrays


def inputs_with_levels() -> hipuq.Inputs:
    patterns = hipuq.ContactPatterns((1, 3), oscillators=3)
    return hipuq.Inputs(contact=patterns, x=cp.Uniform(0, 1), y=cp.Normal(0, 1))


def assert_same(one: xr.Dataset, other: xr.Dataset) -> None:
    """Assert that two results are identical but for the time in their history."""
    xr.testing.assert_identical(*(part.assign_attrs(history="") for part in (one, other)))


@pytest.mark.parametrize("of", ["any_unstable", "margin"])
@pytest.mark.parametrize("method", METHODS)
def test_stored_outcomes_give_the_same_results(method, of, tmp_path):
    model = hipuq.models.two_dof()
    inputs = model.inputs(friction=cp.Uniform(0.0, 1.0), k3=hipuq.relative(cp.Uniform(-0.1, 0.1)))
    samples = hipuq.design(method, inputs, 64, 1)
    outcomes = hipuq.evaluate(model, samples, keep=[of], progress=False)
    hipuq.save_outcomes(outcomes, tmp_path / "outcomes.zarr")
    stored = hipuq.load_outcomes(tmp_path / "outcomes.zarr")
    one, other = (hipuq.estimate(method, part, inputs, of=of) for part in (outcomes, stored))
    assert_same(one, other)


DESIGNS = {
    "random": {},
    "replicates": {"replicates": 4},
    "strata": {"stratify": "contact"},
    "replicates in strata": {"stratify": "contact", "replicates": 2},
}


@pytest.mark.parametrize("design", DESIGNS)
def test_monte_carlo_reads_every_block_once(design, monkeypatch):
    """Of the outcome, its bounds and the books of the design, never more than a block at a time."""
    monkeypatch.setattr(reduction, "BLOCK", BLOCK)
    inputs = inputs_with_levels()
    options = DESIGNS[design]
    samples = hipuq.design("monte_carlo", inputs, 200 if "stratify" in options else 1000, 1, **options)
    size = samples.sizes["sample"]
    share = samples["x"].where(samples["x"] > 0.1)
    outcomes = samples.assign(
        y=share.assign_attrs(role="probability"),
        y_low=share.fillna(0.0),
        y_high=share.fillna(1.0),
        status=("sample", np.where(share.isnull(), 1, 0).astype(np.int8)),
    )
    lazy, arrays = recorded(outcomes)
    assert_same(
        hipuq.estimate("monte_carlo", lazy, inputs, of="y"),
        hipuq.estimate("monte_carlo", outcomes, inputs, of="y"),
    )
    assert max(max(array.rows, default=0) for array in arrays.values()) <= BLOCK
    for name in ("y", "y_low", "y_high", "status"):
        assert sum(arrays[name].rows) == size, name
    # The replicates are counted first.
    assert sum(arrays["replicate"].rows if "replicate" in arrays else []) <= 2 * size
    assert not arrays["x"].rows


def test_what_says_nothing_of_itself_is_looked_at_block_by_block(monkeypatch):
    monkeypatch.setattr(reduction, "BLOCK", BLOCK)
    inputs = hipuq.Inputs(x=cp.Uniform(0, 1))
    samples = hipuq.design("monte_carlo", inputs, 1000, 1)
    late = (samples["x"] > 0.5).astype(float)
    late[999] = 0.5
    for outcome, quantity in ((late[:999], "probability"), (late, "mean"), (late * np.nan, "probability")):
        lazy, arrays = recorded(samples.isel(sample=slice(len(outcome))).assign(y=outcome.drop_attrs()))
        assert quantity in hipuq.estimate("monte_carlo", lazy, inputs, of="y")
        assert max(arrays["y"].rows) <= BLOCK


def test_an_infinite_value_of_any_block_is_counted(monkeypatch):
    monkeypatch.setattr(reduction, "BLOCK", BLOCK)
    values = np.ones(200)
    values[[3, 190, 191]] = np.inf
    outcomes = xr.Dataset({"y": ("sample", values, {"units": "1"})})
    with pytest.raises(hipuq.HipuqError, match=r"y is infinite in 3 samples \(1.50%\)"):
        hipuq.estimate("monte_carlo", outcomes, hipuq.Inputs(x=cp.Uniform(0, 1)), of="y")


def test_sobol_indices_read_by_block_in_any_order(monkeypatch):
    monkeypatch.setattr(reduction, "BLOCK", BLOCK)
    inputs = hipuq.Inputs(a=cp.Uniform(0, 1), b=cp.Normal(0, 1))
    samples = hipuq.design("sobol", inputs, 64, 1, second_order=True)
    outcomes = samples.assign(y=samples["a"] * (1 + samples["b"]))
    order = sampling.spawn(0).permutation(outcomes.sizes["sample"])
    lazy, arrays = recorded(outcomes.isel(sample=order))
    found = hipuq.estimate("sobol", lazy, inputs, of="y", resamples=20)
    assert_same(found, hipuq.estimate("sobol", outcomes, inputs, of="y", resamples=20))
    assert max(max(array.rows, default=0) for array in arrays.values()) <= BLOCK
    twice = xr.concat([outcomes, outcomes.isel(sample=[301])], "sample")
    with pytest.raises(SchemaError, match="block 50 has several samples of the matrix 'AB:a'"):
        hipuq.estimate("sobol", twice, inputs, of="y")


def test_resamples_of_many_blocks_are_made_in_pieces(monkeypatch):
    rng = sampling.spawn(0)
    outcomes = rng.normal(size=(100, 6))
    times = next(resampling.multiplicities(1, 100, 20))
    whole = resampling.resampled(outcomes, 2, times, [(0, 1)])
    monkeypatch.setattr(resampling, "PIECE", 7)
    assert resampling.resampled(outcomes, 2, times, [(0, 1)]) == pytest.approx(whole, rel=1e-9, abs=1e-12)


def test_what_occurs_is_counted_block_by_block(monkeypatch):
    rng = sampling.spawn(0)
    dims, shape = ("sample", "mode"), (300, 3)
    flag = np.where(rng.random(shape) < 0.1, np.nan, rng.random(shape) < [0.0, 0.2, 0.9]).astype(np.float32)
    outcomes = xr.Dataset(
        {
            "frequency": (dims, rng.normal(100, 5, shape)),
            "unstable": (dims, flag),
            "status": ("sample", rng.integers(0, 3, 300).astype(np.int8)),
        },
        {"mode": [1, 2, 3], "weight": ("sample", rng.random(300))},
    )
    whole = [count(outcomes) for count in (frequency_ranges, verdict_counts)]
    monkeypatch.setattr(reduction, "BLOCK", BLOCK)
    lazy, arrays = recorded(outcomes)
    for count, expected in zip((frequency_ranges, verdict_counts), whole, strict=True):
        assert_same(count(lazy), expected)
    assert max(max(arrays[name].rows) for name in ("frequency", "unstable", "status")) <= BLOCK


def test_a_latin_hypercube_is_made_once_for_all_its_rows(monkeypatch):
    made = []
    original = qmc.LatinHypercube
    monkeypatch.setattr(qmc, "LatinHypercube", lambda *a, **k: made.append(a) or original(*a, **k))
    sampling._kept_hypercube.cache_clear()
    inputs = hipuq.Inputs(a=cp.Uniform(0, 1), b=cp.Normal(0, 1))

    def rows(start, stop):
        options = {"sampler": "latin_hypercube", "replicates": 2}
        return hipuq.design("monte_carlo", inputs, 20_000, 1, rows=slice(start, stop), **options)

    parts = [rows(start, min(start + 4096, 20_000)) for start in range(0, 20_000, 4096)]
    assert len(made) == 2
    # One that is too large to be kept is the same.
    monkeypatch.setattr(sampling, "LATIN_HYPERCUBE_KEPT", 0)
    whole = rows(0, 20_000)
    assert len(made) == 4
    assert xr.concat(parts, "sample").equals(whole)


def test_what_is_kept_of_a_latin_hypercube_cannot_be_changed():
    first = sampling.unit_points("latin_hypercube", 8, 2, 1, (0,), slice(0, 8))
    kept = first.copy()
    first[:] = 0.0
    assert np.array_equal(sampling.unit_points("latin_hypercube", 8, 2, 1, (0,), slice(0, 8)), kept)


@pytest.mark.parametrize("sampler", sampling.SAMPLERS)
def test_points_asked_for_in_other_portions_are_the_same(sampler, monkeypatch):
    inputs = hipuq.Inputs(a=cp.Uniform(0, 1), b=cp.Beta(2, 3))
    options = {"sampler": sampler, "replicates": 2}
    at_once = hipuq.design("monte_carlo", inputs, 2**14, 1, rows=slice(1000, 2**14 - 7), **options)
    monkeypatch.setattr(sampling, "POINTS", 1)
    by_block = hipuq.design("monte_carlo", inputs, 2**14, 1, rows=slice(1000, 2**14 - 7), **options)
    assert at_once.equals(by_block)
