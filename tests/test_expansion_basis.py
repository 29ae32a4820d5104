"""Multi-indices against brute force, and products of univariate polynomials."""

from itertools import product
from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hipuq.errors import InputError
from hipuq.expansion.basis import MOST_TERMS, count, leading, multi_indices, norms, tensor


@given(
    st.integers(1, 4),
    st.integers(0, 5),
    st.sampled_from([1.0, 0.9, 0.75, 0.5, 0.3]),
    st.one_of(st.none(), st.integers(1, 4)),
    st.one_of(st.none(), st.lists(st.integers(0, 4), min_size=4, max_size=4)),
)
def test_the_set_is_that_of_brute_force(dimension, degree, q, interaction, caps):
    caps = None if caps is None else caps[:dimension]
    indices = multi_indices(dimension, degree, q=q, interaction=interaction, largest=caps)
    expected = {
        alpha
        for alpha in product(range(degree + 1), repeat=dimension)
        if sum(a**q for a in alpha) ** (1 / q) <= degree + 1e-6
        and (interaction is None or sum(a > 0 for a in alpha) <= interaction)
        and (caps is None or all(a <= cap for a, cap in zip(alpha, caps, strict=True)))
    }
    assert {tuple(row) for row in indices.tolist()} == expected
    assert len(indices) == len(expected)
    assert count(dimension, degree, q=q, interaction=interaction, largest=caps) == len(expected)
    assert not indices[0].any()
    assert (np.diff(norms(indices, q)) > -1e-8).all()


@pytest.mark.parametrize(
    "dimension, degree, terms", [(1, 15, 16), (3, 10, 286), (39, 2, 820), (12, 4, 1820), (39, 3, 11480)]
)
def test_total_degree_has_the_number_of_terms_that_it_must(dimension, degree, terms):
    assert terms == comb(dimension + degree, degree)
    assert len(multi_indices(dimension, degree)) == count(dimension, degree) == terms


def test_interactions_are_kept_and_dropped():
    """39 inputs at degree 3: with q = 0.75 the terms of one variable and of first powers of two."""
    indices = multi_indices(39, 3, q=0.75)
    assert len(indices) == 1 + 3 * 39 + comb(39, 2)
    assert len(multi_indices(39, 3, interaction=2)) == 1 + 3 * 39 + 3 * comb(39, 2)
    assert len(multi_indices(39, 3, interaction=1)) == 1 + 3 * 39


def test_the_order_is_by_norm_then_by_variables():
    indices = multi_indices(2, 3)
    assert indices.tolist() == [
        [0, 0],
        [1, 0],
        [0, 1],
        [2, 0],
        [0, 2],
        [1, 1],
        [3, 0],
        [0, 3],
        [2, 1],
        [1, 2],
    ]
    assert leading(indices, 1.0) == [(1, 0), (3, 1), (6, 2), (10, 3)]


@pytest.mark.parametrize("q", [1.0, 0.75, 0.5])
def test_leading_terms_are_the_smaller_bases(q):
    indices = multi_indices(3, 6, q=q, largest=[6, 2, 1])
    for terms, degree in leading(indices, q):
        assert np.array_equal(indices[:terms], multi_indices(3, degree, q=q, largest=[6, 2, 1]))
    capped = multi_indices(2, 5, largest=[1, 0])
    assert leading(capped, 1.0) == [(1, 0), (2, 1)]


def test_a_basis_that_cannot_be_held_is_refused_at_once():
    for dimension, degree in ((39, 4), (300, 3), (39, 50)):
        assert count(dimension, degree) == MOST_TERMS + 1
        with pytest.raises(InputError, match=f"degree {degree} in {dimension} inputs has more than 20000"):
            multi_indices(dimension, degree)


def test_what_cannot_be_used_is_named():
    cases = [
        ({"degree": 2, "q": 0.0}, "q is 0.0"),
        ({"degree": 2, "q": 1.5}, "q is 1.5"),
        ({"degree": -1}, "degree is -1"),
        ({"degree": 2, "interaction": 0}, "interaction is 0"),
    ]
    for options, message in cases:
        with pytest.raises(InputError, match=message):
            multi_indices(3, **options)
        with pytest.raises(InputError, match=message):
            count(3, **options)


def test_terms_are_products_over_their_variables():
    rng = np.random.default_rng(0)
    univariate = rng.normal(size=(3, 5, 20))
    univariate[:, 0] = 1
    # What no term needs may be missing.
    univariate[2, 3:] = np.nan
    indices = multi_indices(3, 4, largest=[4, 4, 2])
    expected = np.prod([univariate[i, indices[:, i]] for i in range(3)], axis=0).T
    assert tensor(univariate, indices) == pytest.approx(expected, rel=1e-14)
    # Terms need not hold their own parts.
    assert tensor(univariate, indices[[0, 7]]) == pytest.approx(expected[:, [0, 7]], rel=1e-14)
