"""What it costs to come to each node."""

import numpy as np
import pytest

from lidarium.mapping.sparse.graph.topological_graph import GraphSettings, build_graph
from lidarium.mapping.sparse.planning.reach import costs_from
from lidarium.mapping.sparse.planning.requests import plan
from lidarium.mapping.sparse.swept_body import SweptBody

BODY = SweptBody(radius=0.25, height=1.0)
WALL = np.array([[[2.9, -1.0, 0.0], [3.1, 4.0, 2.5]]])


@pytest.mark.parametrize("seed", range(4))
def test_costs_are_those_of_the_paths_that_are_planned(seed):
    generator = np.random.default_rng(seed)
    free = np.column_stack([generator.uniform(0.0, 6.0, (400, 2)), np.zeros(400)])
    graph = build_graph(free, WALL, BODY, GraphSettings())
    start = np.array([1.0, 1.0, 0.0])
    costs = costs_from(graph, start)
    assert costs.shape == (len(graph.nodes),)
    for node in range(0, len(graph.nodes), 7):
        planned = plan(graph, start, graph.nodes[node], shortens=False)
        # A request also goes straight from a neighbour of the goal, which no edge may do.
        assert planned.is_found == np.isfinite(costs[node])
        assert planned.length <= costs[node] + 1e-9
        assert costs[node] <= planned.length + 0.5
    assert costs.min() < 0.5


def test_what_lies_behind_a_wall_is_out_of_reach():
    free = np.array([[x, y, 0.0] for x in np.arange(0.0, 6.0, 0.4) for y in np.arange(0.0, 2.0, 0.4)])
    graph = build_graph(free, np.array([[[2.9, -9.0, 0.0], [3.1, 9.0, 2.5]]]), BODY)
    costs = costs_from(graph, np.array([1.0, 1.0, 0.0]))
    assert np.isfinite(costs[graph.nodes[:, 0] < 2.6]).all()
    assert np.isinf(costs[graph.nodes[:, 0] > 3.4]).all()
