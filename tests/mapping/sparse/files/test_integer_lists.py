"""Edges are kept as differences."""

import numpy as np
import pytest

from lidarium.mapping.sparse.files.integer_lists import coded_edges, decoded_edges


@pytest.mark.parametrize("count", [0, 1, 200])
def test_edges_come_back(count):
    generator = np.random.default_rng(count)
    first = np.sort(generator.integers(0, 1000, count))
    edges = np.stack([first, first + generator.integers(1, 90, count)], axis=1)
    np.testing.assert_array_equal(decoded_edges(coded_edges(edges)), edges)


def test_edges_in_order_are_coded_by_small_numbers_from_zero():
    edges = np.array([[3, 7], [3, 9], [5, 6]])
    assert coded_edges(edges).tolist() == [[3, 4], [0, 6], [2, 1]]
