"""Products of small matrices: those of numpy, each row by itself, in one order."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.kernels.products import product


def drawn(rows, inner, columns, seed=0):
    generator = np.random.default_rng(seed)
    left = generator.normal(size=(rows, inner)) * (generator.random((rows, inner)) < 0.6)  # some zeros
    return left.astype(np.float32), generator.normal(size=(inner, columns)).astype(np.float32)


def plain(left, right):
    """Return the product, summed term by term."""
    found = np.zeros((len(left), right.shape[1]), np.float32)
    for k in range(left.shape[1]):
        found += left[:, k, None] * right[k]
    return found


@given(st.integers(0, 6), st.integers(0, 40), st.integers(0, 20), st.integers(0, 2**32 - 1))
def test_numbers_are_summed_in_the_order_of_terms(rows, inner, columns, seed):
    left, right = drawn(rows, inner, columns, seed)
    found = product(left, right)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, plain(left, right))
    np.testing.assert_allclose(found, left.astype(np.float64) @ right, rtol=1e-5, atol=1e-5)


def test_a_row_does_not_depend_on_the_others():
    left, right = drawn(31, 128, 64)
    whole = product(left, right)
    for row in range(len(left)):
        np.testing.assert_array_equal(product(left[row : row + 1], right)[0], whole[row])


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_numbers_that_are_none_are_not_lost(number):
    left, right = drawn(2, 5, 3)
    left[0, 1] = number
    assert not np.isfinite(product(left, right)[0]).any()
    assert np.isfinite(product(left, right)[1]).all()
