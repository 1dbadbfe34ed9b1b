"""Graphs have the edges that a body can be driven along, and are repaired beside obstacles."""

import numpy as np
import pytest

from lidarium.mapping.sparse.graph.obstacles import ChangingGraph
from lidarium.mapping.sparse.graph.thesis_graph import ThesisGraphSettings, build_thesis_graph
from lidarium.mapping.sparse.graph.topological_graph import GraphSettings, build_graph, components_of
from lidarium.mapping.sparse.swept_body import SweptBody, are_free, index_boxes

WALL = [[2.9, -1.0, 0.0], [3.1, 2.0, 2.5]]
TABLE = [[1.0, 3.0, 0.7], [2.2, 4.0, 0.75]]
BODY = SweptBody(radius=0.2, height=1.0)


def room(boxes=(WALL, TABLE), body=BODY, **settings):
    generator = np.random.default_rng(0)
    free = np.column_stack([generator.uniform(0.0, 6.0, (900, 2)), np.zeros(900)])
    return build_graph(free, np.array(boxes).reshape(-1, 2, 3), body, GraphSettings(**settings))


def test_each_edge_is_listed_at_both_ends_with_its_length():
    graph = room()
    firsts = np.repeat(np.arange(len(graph.nodes)), np.diff(graph.starts))
    listed = set(zip(firsts.tolist(), graph.ends.tolist(), strict=True))
    assert listed == {(b, a) for a, b in listed}
    lengths = np.linalg.norm(graph.nodes[graph.ends] - graph.nodes[firsts], axis=1)
    assert graph.weights == pytest.approx(lengths)
    assert len(graph.edges) * 2 == len(graph.ends)


def test_no_edge_meets_a_box_and_no_free_one_is_left_out():
    graph = room()
    index = index_boxes(np.array([WALL, TABLE]))
    nodes, edges = graph.nodes, graph.edges
    assert are_free(index, nodes[edges[:, 0]], nodes[edges[:, 1]], BODY.numbers).all()
    known = set(map(tuple, edges.tolist()))
    for node in range(0, len(nodes), 7):
        gaps = np.linalg.norm(nodes - nodes[node], axis=1)
        for other in np.argsort(gaps, kind="stable")[1:9].tolist():
            pair = (min(node, other), max(node, other))
            is_open = are_free(index, nodes[[node]], nodes[[other]], BODY.numbers)[0] and gaps[other] <= 1.0
            assert (pair in known) == is_open


def test_a_table_top_blocks_the_swept_body_and_not_the_cylinder_of_the_thesis():
    # Two nodes on the floor, the top over the middle between them only.
    free = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    top = np.array([[0.8, -0.3, 0.7], [1.2, 0.3, 0.75]])
    swept = build_graph(free, top[None], BODY, GraphSettings(longest_edge=3.0))
    assert len(swept.edges) == 0
    points = np.stack(
        np.meshgrid(np.linspace(0.8, 1.2, 9), np.linspace(-0.3, 0.3, 9), [0.7]), axis=-1
    ).reshape(-1, 3)
    printed = build_thesis_graph(free, points, ThesisGraphSettings(longest_edge=3.0, collision_radius=0.2))
    assert len(printed.edges) == 1


def test_edges_beside_walls_cost_more_where_clearance_counts():
    plain, careful = room(), room(clearance_weight=2.0, clearance_m=0.5)
    assert (careful.weights >= plain.weights - 1e-12).all()
    middles = (plain.nodes[plain.edges[:, 0]] + plain.nodes[plain.edges[:, 1]]) / 2.0
    firsts = np.repeat(np.arange(len(plain.nodes)), np.diff(plain.starts))
    ratio = (careful.weights / plain.weights)[firsts < plain.ends]
    far = (middles[:, 0] < 1.5) & (middles[:, 1] < 1.5)
    assert ratio[far] == pytest.approx(np.ones(far.sum()), abs=2e-3)
    assert ratio.max() > 2.5


def test_a_wall_parts_the_graph():
    graph = room(boxes=[[[2.9, -1.0, 0.0], [3.1, 7.0, 2.5]]])
    assert len(np.unique(components_of(graph))) == 2


def test_unknown_obstacles_and_maps_without_nodes_are_refused():
    with pytest.raises(ValueError, match="no obstacle 7"):
        ChangingGraph(room()).remove(7)
    with pytest.raises(ValueError, match="no free nodes"):
        build_graph(np.zeros((0, 3)), np.array([WALL]), BODY)
    with pytest.raises(ValueError, match="can stand at none"):
        build_graph(np.array([[3.0, 0.0, 0.0]]), np.array([WALL]), BODY)
