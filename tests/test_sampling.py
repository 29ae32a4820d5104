"""Points in the unit cube: the same rows in any slices, independent designs, seeds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest

from hipuq.errors import InputError, UnknownNameError
from hipuq.sampling import SAMPLERS, check_count, seed_of, spawn, unit_points

N = 8192  # two blocks of the random sampler, and a power of 2


def points(sampler, rows=slice(0, N), seed=0, key=(0, 0), dimension=3):
    return unit_points(sampler, N, dimension, seed, key, rows)


@pytest.fixture(scope="module")
def whole():
    return {sampler: points(sampler) for sampler in SAMPLERS}


@pytest.mark.parametrize("sampler", SAMPLERS)
@settings(max_examples=30)
@given(data=st.data())
def test_slices_are_rows_of_the_whole(whole, sampler, data):
    start = data.draw(st.one_of(st.integers(0, N - 1), st.sampled_from([0, 4095, 4096, 4097])))
    stop = data.draw(st.integers(start + 1, min(N, start + 5000)))
    assert np.array_equal(points(sampler, slice(start, stop)), whole[sampler][start:stop])


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_points_are_uniform(whole, sampler):
    part = whole[sampler]
    assert part.shape == (N, 3)
    assert (part >= 0).all() and (part < 1).all()
    for column in part.T:
        assert kstest(column, "uniform").pvalue > 1e-4
    assert np.abs(np.corrcoef(part.T) - np.eye(3)).max() < 0.05


def test_balanced_designs_are_balanced(whole):
    """One point in each of n equal intervals of every column."""
    for sampler in ("latin_hypercube", "sobol"):
        for column in whole[sampler].T:
            assert np.array_equal(np.sort((column * N).astype(int)), np.arange(N))


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_seeds_and_keys_give_different_designs(whole, sampler):
    """Another seed, level or replicate is another design; the same one is the same."""
    assert np.array_equal(points(sampler), whole[sampler])
    for change in ({"seed": 1}, {"key": (1, 0)}, {"key": (0, 1)}):
        assert not np.array_equal(points(sampler, **change), whole[sampler])
    swapped = points(sampler, key=(1, 0)), points(sampler, key=(0, 1))
    assert not np.array_equal(*swapped)


def test_the_random_sampler_does_not_repeat_itself_between_blocks(whole):
    assert len(np.unique(whole["random"][:, 0])) == N


@given(st.integers(0, 2**63 - 1))
def test_an_integer_is_its_own_seed(seed):
    assert seed_of(seed) == seed
    assert seed_of(np.uint64(seed)) == seed


def test_seeds_of_generators():
    """A Generator gives a new seed each time, the same ones after the same start; None a new one."""
    one, other = np.random.default_rng(3), np.random.default_rng(3)
    seeds = [seed_of(one) for _ in range(3)]
    assert len(set(seeds)) == 3
    assert seeds == [seed_of(other) for _ in range(3)]
    assert seed_of(np.random.SeedSequence(4)) == seed_of(np.random.SeedSequence(4))
    assert seed_of(None) != seed_of(None)
    assert all(0 <= seed < 2**63 for seed in seeds)


@pytest.mark.parametrize("rng", [-1, 2**63, 1.0, True, "1", [1]])
def test_anything_else_is_no_seed(rng):
    with pytest.raises(InputError, match="rng is"):
        seed_of(rng)


def test_spawned_generators_belong_to_their_key():
    assert spawn(1, 2, 3).random() == spawn(1, 2, 3).random()
    drawn = {spawn(seed, *key).random() for seed in (0, 1) for key in ((), (0,), (1,), (0, 1), (1, 0))}
    assert len(drawn) == 10


@pytest.mark.parametrize("value", [0, -1, 1.0, True, None, "3"])
def test_counts_are_positive_integers(value):
    with pytest.raises(InputError, match="replicates is"):
        check_count("replicates", value)


def test_bad_designs_are_named():
    with pytest.raises(InputError, match="take 64 or 128"):
        unit_points("sobol", 100, 2, 0, (0,), slice(0, 100))
    with pytest.raises(InputError, match="has to be made whole"):
        unit_points("latin_hypercube", 2**23, 2, 0, (0,), slice(0, 1))
    with pytest.raises(UnknownNameError, match="did you mean 'random'"):
        unit_points("randon", 8, 2, 0, (0,), slice(0, 8))
