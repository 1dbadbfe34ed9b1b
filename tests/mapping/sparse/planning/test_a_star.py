"""A* finds the cheapest path."""

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from lidarium.mapping.sparse.graph.topological_graph import GraphSettings, build_graph
from lidarium.mapping.sparse.planning.a_star import pop, push, shortest_path
from lidarium.mapping.sparse.swept_body import SweptBody

BODY = SweptBody(radius=0.25, height=1.0)


@pytest.mark.parametrize("seed", range(20))
def test_costs_are_those_of_dijkstra(seed):
    generator = np.random.default_rng(seed)
    for _ in range(10):
        count = int(generator.integers(2, 120))
        nodes = generator.uniform(0.0, 5.0, (count, 3))
        graph = build_graph(nodes, np.zeros((0, 2, 3)), BODY, GraphSettings(merge_radius=0.0, neighbours=3))
        first, last = np.full(count, np.inf), np.full(count, np.inf)
        source, target = generator.integers(count, size=2)
        first[source] = last[target] = 0.0
        path, cost = shortest_path(
            graph.nodes, graph.starts, graph.ends, graph.weights, first, last, graph.nodes[target]
        )
        matrix = csr_array((graph.weights, graph.ends, graph.starts), shape=(count, count))
        expected = dijkstra(matrix, indices=int(source))[target]
        assert cost == pytest.approx(expected)
        if np.isfinite(expected):
            steps = np.linalg.norm(np.diff(graph.nodes[path], axis=0), axis=1)
            assert steps.sum() == pytest.approx(expected)
        else:
            assert len(path) == 0


def test_a_heap_gives_its_nodes_back_in_order():
    generator = np.random.default_rng(1)
    costs = generator.integers(0, 50, 200).astype(float)
    heap, keys, size = np.empty(200, np.int64), np.empty(200), 0
    for node, cost in enumerate(costs.tolist()):
        size = push(heap, keys, size, node, cost)
    taken = []
    while size > 0:
        taken.append((float(keys[0]), int(heap[0])))
        size = pop(heap, keys, size)
    assert [key for key, _ in taken] == sorted(costs.tolist())
    assert sorted(node for _, node in taken) == list(range(200))
    assert all(costs[node] == key for key, node in taken)


def test_of_several_first_and_last_nodes_the_cheapest_pair_is_taken():
    nodes = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    starts, ends = np.array([0, 1, 3, 5, 6]), np.array([1, 0, 2, 1, 3, 2])
    weights, goal = np.ones(6), np.array([3.5, 0.0, 0.0])
    first = np.array([0.5, 2.0, np.inf, np.inf])
    path, cost = shortest_path(
        nodes, starts, ends, weights, first, np.array([np.inf, np.inf, 1.6, 0.5]), goal
    )
    assert (path.tolist(), cost) == ([0, 1, 2, 3], 4.0)
    path, cost = shortest_path(nodes, starts, ends, weights, first, np.array([np.inf, 2.5, 1.6, 0.5]), goal)
    assert (path.tolist(), cost) == ([0, 1], 4.0)
    path, cost = shortest_path(nodes, starts, ends, weights, np.full(4, np.inf), np.zeros(4), goal)
    assert (len(path), cost) == (0, np.inf)
