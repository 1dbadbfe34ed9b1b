"""Free nodes are reduced in their order, and found among their neighbours."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.sparse.graph.nodes import reduced_nodes


def reduced_plainly(nodes, radius):
    """The thesis's algorithm, corrected: the count begins at one, the seed's distance decides."""
    left, means = list(range(len(nodes))), []
    while left:
        seed = left[0]
        near = [n for n in left if n == seed or np.linalg.norm(nodes[n] - nodes[seed]) < radius]
        means.append(sum(nodes[n] for n in near) / len(near))
        left = [n for n in left if n not in near]
    return np.array(means)


@given(st.lists(st.tuples(*[st.floats(-1.0, 1.0).map(lambda v: round(v, 2))] * 3), min_size=1, max_size=40))
def test_nodes_are_reduced_as_by_the_plain_algorithm(points):
    nodes = np.array(points)
    assert reduced_nodes(nodes, 0.3) == pytest.approx(reduced_plainly(nodes, 0.3))


def test_a_node_alone_stays_and_two_close_ones_give_their_middle():
    alone, first, second = (5.0, 5.0, 0.0), (0.0, 0.0, 0.0), (0.135, 0.0, 0.0)
    assert reduced_nodes(np.array([alone, first, second]), 0.15).tolist() == [
        list(alone),
        pytest.approx([0.0675, 0.0, 0.0]),
    ]
    assert len(reduced_nodes(np.array([first, second]), 0.135)) == 2
