"""Nodes in the cells of a grid."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from lidarium.mapping.sparse.graph.node_grid import grid_of_nodes, nearest_nodes
from lidarium.mapping.sparse.graph.topological_graph import nearest_of_all


@pytest.mark.parametrize("count", [1, 2, 7, 300])
def test_the_nearest_nodes_are_those_of_a_tree(count):
    nodes = np.random.default_rng(count).normal(size=(count, 3)) * (3.0, 2.0, 0.1)
    near, gaps = nearest_of_all(grid_of_nodes(nodes), 6)
    distances, _ = cKDTree(nodes).query(nodes, k=range(2, 8))
    assert np.sqrt(gaps) == pytest.approx(distances)
    assert ((near == -1) == np.isinf(gaps)).all()


def test_nodes_far_from_a_query_are_found():
    nodes = np.random.default_rng(0).uniform(0.0, 1.0, (50, 3))
    grid, found, gaps = grid_of_nodes(nodes), np.empty(3, np.int64), np.empty(3)
    for point in ([-40.0, 9.0, 0.0], [0.5, 0.5, 0.0], [3.0, -0.2, 7.0]):
        assert nearest_nodes(grid, np.array(point), found, gaps, -1) == 3
        assert gaps == pytest.approx(np.sort(((nodes - point) ** 2).sum(axis=1))[:3])
