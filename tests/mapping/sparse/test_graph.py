"""Nodes in the cells of a grid."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from lidarium.mapping.sparse.changing_graph import ChangingGraph
from lidarium.mapping.sparse.graph import (
    GraphSettings,
    _components_of,
    _nearest_of_all,
    _nodes_with_room,
    _retracted_nodes,
    build_graph,
    grid_of_nodes,
    nearest_nodes,
    reduced_nodes,
)
from lidarium.mapping.sparse.planning import plan
from lidarium.mapping.sparse.swept_body import SweptBody, are_free, index_boxes
from lidarium.mapping.sparse.thesis_graph import ThesisGraphSettings, build_thesis_graph


@pytest.mark.parametrize("count", [1, 2, 7, 300])
def test_the_nearest_nodes_are_those_of_a_tree(count):
    nodes = np.random.default_rng(count).normal(size=(count, 3)) * (3.0, 2.0, 0.1)
    near, gaps = _nearest_of_all(grid_of_nodes(nodes), 6)
    distances, _ = cKDTree(nodes).query(nodes, k=range(2, 8))
    assert np.sqrt(gaps) == pytest.approx(distances)
    assert ((near == -1) == np.isinf(gaps)).all()


def test_nodes_far_from_a_query_are_found():
    nodes = np.random.default_rng(0).uniform(0.0, 1.0, (50, 3))
    grid, found, gaps = grid_of_nodes(nodes), np.empty(3, np.int64), np.empty(3)
    for point in ([-40.0, 9.0, 0.0], [0.5, 0.5, 0.0], [3.0, -0.2, 7.0]):
        assert nearest_nodes(grid, np.array(point), found, gaps, -1) == 3
        assert gaps == pytest.approx(np.sort(((nodes - point) ** 2).sum(axis=1))[:3])


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


BODY = SweptBody(radius=0.3, height=1.2)
# A passage of 0.64 m between two blocks, from left to right.
PASSAGE = np.array([[[0.0, -3.0, 0.0], [2.0, -0.32, 1.0]], [[0.0, 0.32, 0.0], [2.0, 3.0, 1.0]]])


def stands(nodes, boxes):
    points = np.asarray(nodes, np.float64).reshape(-1, 3)
    return are_free(index_boxes(boxes), points, points, BODY.numbers)


def test_a_node_beside_the_middle_of_a_passage_moves_there():
    node = np.array([[1.0, 0.2, 0.0]])
    assert not stands(node, PASSAGE).any()
    moved = _retracted_nodes(node, index_boxes(PASSAGE), BODY)
    assert stands(moved, PASSAGE).all()
    assert abs(moved[0, 1]) < 0.02
    assert moved[0, 2] == 0.0


def test_nodes_without_room_and_under_boxes_stay():
    table = np.array([[[0.0, 0.0, 0.7], [2.0, 2.0, 0.75]]])
    under = np.array([[1.0, 1.0, 0.0]])
    assert np.array_equal(_retracted_nodes(under, index_boxes(table), BODY), under)
    narrow = PASSAGE + np.array([[[0.0, 0.05, 0.0]], [[0.0, -0.05, 0.0]]])
    between = np.array([[1.0, 0.1, 0.0]])
    assert np.array_equal(_retracted_nodes(between, index_boxes(narrow), BODY), between)


def test_a_passage_whose_nodes_lie_at_its_sides_is_passed():
    sides = [[x, y, 0.0] for x in np.arange(0.1, 2.0, 0.3) for y in (-0.2, 0.2)]
    free = np.array([[-0.5, 0.0, 0.0], *sides, [2.5, 0.0, 0.0]])
    graph = build_graph(free, PASSAGE, BODY)
    # Without shortcuts the path goes from node to node.
    found = plan(graph, np.array([-0.6, 0.05]), np.array([2.6, -0.05]), shortens=False)
    assert found.is_found
    assert len(found.path) >= 5


@given(
    st.lists(st.tuples(st.floats(0.0, 4.0), st.floats(0.0, 4.0)), min_size=1, max_size=30),
    st.lists(st.tuples(st.floats(0.0, 3.5), st.floats(0.0, 3.5), st.floats(0.01, 1.0)), min_size=1, max_size=8),
)
def test_nodes_move_by_at_most_a_radius_and_those_that_are_returned_stand(places, blocks):
    nodes = np.array([[x, y, 0.0] for x, y in places])
    boxes = np.array([[[x, y, 0.0], [x + side, y + 0.5 * side, 1.0]] for x, y, side in blocks])
    index, stood = index_boxes(boxes), stands(nodes, boxes)
    moved = _retracted_nodes(nodes, index, BODY)
    assert np.array_equal(moved[stood], nodes[stood])
    assert (np.linalg.norm(moved - nodes, axis=1) <= BODY.radius + 1e-12).all()
    is_moved = (moved != nodes).any(axis=1)
    assert stands(moved[is_moved], boxes).all()
    found = _nodes_with_room(nodes, index, BODY, 0.15)
    assert stands(found, boxes).all()
    assert np.array_equal(found[: stood.sum()], nodes[stood])
    added = found[stood.sum() :]
    for k, node in enumerate(added):
        others = np.delete(found, stood.sum() + k, axis=0)
        if len(others):
            assert np.linalg.norm(others - node, axis=1).min() == pytest.approx(0.15, abs=1e-9) or (
                np.linalg.norm(others - node, axis=1).min() > 0.15
            )


WALL = [[2.9, -1.0, 0.0], [3.1, 2.0, 2.5]]
TABLE = [[1.0, 3.0, 0.7], [2.2, 4.0, 0.75]]
BODY_OF_TOPOLOGICAL_GRAPH = SweptBody(radius=0.2, height=1.0)


def room(boxes=(WALL, TABLE), body=BODY_OF_TOPOLOGICAL_GRAPH, **settings):
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
    assert are_free(index, nodes[edges[:, 0]], nodes[edges[:, 1]], BODY_OF_TOPOLOGICAL_GRAPH.numbers).all()
    known = set(map(tuple, edges.tolist()))
    for node in range(0, len(nodes), 7):
        gaps = np.linalg.norm(nodes - nodes[node], axis=1)
        for other in np.argsort(gaps, kind="stable")[1:9].tolist():
            pair = (min(node, other), max(node, other))
            is_open = (
                are_free(index, nodes[[node]], nodes[[other]], BODY_OF_TOPOLOGICAL_GRAPH.numbers)[0]
                and gaps[other] <= 1.0
            )
            assert (pair in known) == is_open


def test_a_table_top_blocks_the_swept_body_and_not_the_cylinder_of_the_thesis():
    # Two nodes on the floor, the top over the middle between them only.
    free = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    top = np.array([[0.8, -0.3, 0.7], [1.2, 0.3, 0.75]])
    swept = build_graph(free, top[None], BODY_OF_TOPOLOGICAL_GRAPH, GraphSettings(longest_edge=3.0))
    assert len(swept.edges) == 0
    points = np.stack(np.meshgrid(np.linspace(0.8, 1.2, 9), np.linspace(-0.3, 0.3, 9), [0.7]), axis=-1).reshape(-1, 3)
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
    assert len(np.unique(_components_of(graph))) == 2


def test_unknown_obstacles_and_maps_without_nodes_are_refused():
    with pytest.raises(ValueError, match="no obstacle 7"):
        ChangingGraph(room()).remove(7)
    with pytest.raises(ValueError, match="no free nodes"):
        build_graph(np.zeros((0, 3)), np.array([WALL]), BODY_OF_TOPOLOGICAL_GRAPH)
    with pytest.raises(ValueError, match="can stand at none"):
        build_graph(np.array([[3.0, 0.0, 0.0]]), np.array([WALL]), BODY_OF_TOPOLOGICAL_GRAPH)
