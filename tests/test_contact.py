"""Contact patterns: enumeration, ranking, weights and quantiles of the discrete distribution."""

import itertools
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hipuq import ContactPatterns
from hipuq.errors import InputError


@st.composite
def patterns(draw, largest=12, weighted=True):
    """Return contact patterns of a few oscillators, with or without weights of either kind."""
    n = draw(st.integers(1, largest))
    counts = draw(st.lists(st.integers(0, n), min_size=1, max_size=4, unique=True))
    weights = None
    if weighted and draw(st.booleans()):
        total = sum(math.comb(n, count) for count in counts)
        size = draw(st.sampled_from([len(counts), total])) if total < 200 else len(counts)
        weights = draw(st.lists(st.floats(0.0, 10.0), min_size=size, max_size=size))
        if not sum(weights) > 1e-6:
            weights[0] = 1.0
    return ContactPatterns(counts, oscillators=n, weights=weights)


@given(patterns(weighted=False))
def test_patterns_are_enumerated_by_count_then_lexicographically(contact):
    n = contact.oscillators
    expected = []
    for count in sorted(contact.in_contact):
        for chosen in itertools.combinations(range(n), count):
            expected.append([i in chosen for i in range(n)])
    assert contact.size == len(expected) == int(contact.sizes.sum())
    numbers = np.arange(1, contact.size + 1)
    assert contact.patterns(numbers).tolist() == expected
    assert contact.index(expected).tolist() == numbers.tolist()


@given(st.integers(1, 60), st.data())
def test_number_and_pattern_are_inverse(n, data):
    """Also where there are far too many patterns to list them."""
    counts = data.draw(st.lists(st.integers(0, n), min_size=1, max_size=3, unique=True))
    contact = ContactPatterns(counts, oscillators=n)
    numbers = data.draw(st.lists(st.integers(1, contact.size), min_size=1, max_size=20))
    chosen = contact.patterns(numbers)
    assert set(chosen.sum(axis=1).tolist()) <= set(counts)
    assert contact.index(chosen).tolist() == numbers


@given(patterns(weighted=False))
def test_a_pattern_that_is_not_among_them_has_the_number_0(contact):
    other = [count for count in range(contact.oscillators + 1) if count not in contact.in_contact]
    for count in other:
        pattern = np.arange(contact.oscillators) < count
        assert contact.index([pattern]).tolist() == [0]


@given(patterns(largest=8))
def test_frequencies_of_quantiles_are_the_weights(contact):
    """On a fine grid every pattern takes up its weight of the unit interval."""
    size = 20_000
    numbers = contact.ppf((np.arange(size) + 0.5) / size)
    assert (np.diff(numbers) >= 0).all()
    share = np.bincount(numbers, minlength=contact.size + 1)[1:] / size
    assert share == pytest.approx(contact.weight, abs=2.0 / size)
    assert (share[contact.weight == 0] == 0).all()


@given(patterns())
def test_the_ends_of_the_unit_interval_are_patterns(contact):
    numbers = contact.ppf(np.array([0.0, 2.0**-64, 1 - 2.0**-53, 1.0]))
    assert (numbers >= 1).all() and (numbers <= contact.size).all()
    if contact.size <= 200:
        assert (contact.weight[numbers - 1] > 0).all()


@given(patterns(largest=8))
def test_levels_are_labelled_and_weigh_one(contact):
    levels = contact.levels()
    assert float(levels["weight"].sum()) == pytest.approx(1.0)
    assert (levels["weight"] >= 0).all()
    assert levels["contact"].dims == ("pattern", "oscillator")
    assert levels["pattern"].values.tolist() == list(range(1, contact.size + 1))
    assert np.array_equal(levels["in_contact"], levels["contact"].sum("oscillator"))
    for name in ("contact", "weight", "pattern", "in_contact", "oscillator"):
        assert {"long_name", "units"} <= set(levels[name].attrs)


@given(patterns())
def test_json_round_trip(contact):
    """The description, through JSON, gives back equal patterns: weights to the last bit."""
    again = ContactPatterns.from_dict(json.loads(json.dumps(contact.to_dict())))
    assert again == contact


def test_weights_for_each_count_follow_the_order_given():
    """0.7 belongs to 9 and 0.3 to 8, whichever is named first; patterns of a count share its weight."""
    one = ContactPatterns((9, 8), weights=(0.7, 0.3))
    other = ContactPatterns((8, 9), weights=(3, 7))
    assert one.weight == pytest.approx(other.weight)
    assert one.weight == pytest.approx([0.3 / 9] * 9 + [0.7])


def test_by_default_every_count_has_the_same_probability():
    weight = ContactPatterns((6, 7, 8, 9)).weight
    assert weight == pytest.approx(np.repeat(0.25 / np.array([84, 36, 9, 1]), [84, 36, 9, 1]))


def test_the_patterns_of_the_published_study():
    contact = ContactPatterns(in_contact=(6, 7, 8, 9))
    assert contact.size == 130
    assert contact.sizes.tolist() == [84, 36, 9, 1]
    assert contact.patterns([1])[0].tolist() == [True] * 6 + [False] * 3
    assert contact.patterns([130])[0].tolist() == [True] * 9
    samples = contact.samples()
    assert samples["contact"].dims == ("sample", "oscillator")
    assert samples["pattern"].values.tolist() == list(range(1, 131))
    assert set(samples.coords) >= {"in_contact", "pattern"}


def test_bad_patterns_are_named():
    cases = [
        ("oscillators is 0", {"in_contact": 1, "oscillators": 0}),
        ("oscillators is 61", {"in_contact": 1, "oscillators": 61}),
        ("in_contact holds 10: allowed are integers from 0 to 9", {"in_contact": (9, 10)}),
        ("in_contact holds 6.5", {"in_contact": (6.5,)}),
        ("in_contact holds True", {"in_contact": [True]}),
        ("it needs different numbers", {"in_contact": (6, 6)}),
        ("it needs different numbers, at least one", {"in_contact": ()}),
        ("it needs 2 values, one for each number", {"in_contact": (8, 9), "weights": (1, 2, 3)}),
        ("must not be negative", {"in_contact": (8, 9), "weights": (1, -1)}),
        ("not all 0", {"in_contact": (8, 9), "weights": (0, 0)}),
        ("must not be negative", {"in_contact": (8, 9), "weights": (1, np.nan)}),
    ]
    for message, arguments in cases:
        with pytest.raises(InputError, match=message):
            ContactPatterns(**arguments)


@pytest.mark.parametrize("number", [0, 131, -1])
def test_pattern_numbers_have_a_range(number):
    with pytest.raises(InputError, match="between 1 and 130"):
        ContactPatterns((6, 7, 8, 9)).patterns([number])


def test_too_many_patterns_are_not_listed():
    with pytest.raises(InputError, match="too many to list"):
        ContactPatterns(20, oscillators=40).levels()
