"""Nodes along a path, and the motions between them."""

import numpy as np
import pytest

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.graph.node_graph import NodeGraph
from lidarium.mapping.localization.settings import GraphSettings


def test_all_but_the_first_node_move_together_to_where_the_first_map_begins():
    graph = NodeGraph(GraphSettings(), None, np.array([1.0, 2.0, 0.5]))
    covariance = np.diag([0.01, 0.01, 0.001]) ** 2
    for motion in np.random.default_rng(0).normal(0.0, 0.5, (6, 3)):
        graph.add(motion, covariance)
    before, since = graph.nodes.copy(), np.array([0.02, -0.01, 0.03])
    graph.begin_at(since)
    assert (graph.nodes[0] == before[0]).all()
    assert graph.nodes[1] == pytest.approx(composed(before[0], since))
    assert relative(graph.nodes[1], graph.nodes[2:]) == pytest.approx(relative(before[1], before[2:]))
    moved = graph.nodes.copy()
    graph.settle(0)
    assert graph.nodes == pytest.approx(moved, abs=1e-9)


def test_how_well_a_node_is_known_from_another_is_what_the_motions_between_leave_open():
    generator = np.random.default_rng(1)
    motions, deviations = generator.normal(0.0, 0.5, (8, 3)), np.array([0.02, 0.01, 0.02])
    graph = NodeGraph(GraphSettings(), None, np.array([1.0, 2.0, 0.5]))
    for motion in motions:
        graph.add(motion, np.diag(deviations**2))
    ends = np.zeros((20000, 3))
    for motion in motions[3:]:
        ends = composed(ends, motion + generator.normal(0.0, 1.0, ends.shape) * deviations)
    assert graph.covariance_since(3) == pytest.approx(np.cov(ends.T), abs=0.03 * np.cov(ends.T).max())
    assert (graph.covariance_since(8) == 0.0).all()
