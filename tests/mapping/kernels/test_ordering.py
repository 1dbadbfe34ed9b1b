"""Kernels sort as numpy does."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.kernels.ordering import stable_order


@given(st.lists(st.integers(-5, 5), max_size=40), st.sampled_from([np.float64, np.int64]))
def test_equal_numbers_keep_their_order(values, dtype):
    values = np.array(values, dtype)
    assert np.array_equal(stable_order(values), np.argsort(values, kind="stable"))


def test_infinite_and_signed_zero_values_are_ordered():
    values = np.array([np.inf, 0.0, -0.0, -np.inf, 1e-320])
    assert stable_order(values).tolist() == [3, 1, 2, 4, 0]
