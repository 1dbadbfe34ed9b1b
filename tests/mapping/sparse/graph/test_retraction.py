"""Nodes beside which a body has no room are moved to where it has."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.sparse.graph.retraction import nodes_with_room, retracted_nodes
from lidarium.mapping.sparse.graph.topological_graph import build_graph
from lidarium.mapping.sparse.planning.requests import plan
from lidarium.mapping.sparse.swept_body import SweptBody, are_free, index_boxes

BODY = SweptBody(radius=0.3, height=1.2)
# A passage of 0.64 m between two blocks, from left to right.
PASSAGE = np.array([[[0.0, -3.0, 0.0], [2.0, -0.32, 1.0]], [[0.0, 0.32, 0.0], [2.0, 3.0, 1.0]]])


def stands(nodes, boxes):
    points = np.asarray(nodes, np.float64).reshape(-1, 3)
    return are_free(index_boxes(boxes), points, points, BODY.numbers)


def test_a_node_beside_the_middle_of_a_passage_moves_there():
    node = np.array([[1.0, 0.2, 0.0]])
    assert not stands(node, PASSAGE).any()
    moved = retracted_nodes(node, index_boxes(PASSAGE), BODY)
    assert stands(moved, PASSAGE).all()
    assert abs(moved[0, 1]) < 0.02
    assert moved[0, 2] == 0.0


def test_nodes_without_room_and_under_boxes_stay():
    table = np.array([[[0.0, 0.0, 0.7], [2.0, 2.0, 0.75]]])
    under = np.array([[1.0, 1.0, 0.0]])
    assert np.array_equal(retracted_nodes(under, index_boxes(table), BODY), under)
    narrow = PASSAGE + np.array([[[0.0, 0.05, 0.0]], [[0.0, -0.05, 0.0]]])
    between = np.array([[1.0, 0.1, 0.0]])
    assert np.array_equal(retracted_nodes(between, index_boxes(narrow), BODY), between)


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
    st.lists(
        st.tuples(st.floats(0.0, 3.5), st.floats(0.0, 3.5), st.floats(0.01, 1.0)), min_size=1, max_size=8
    ),
)
def test_nodes_move_by_at_most_a_radius_and_those_that_are_returned_stand(places, blocks):
    nodes = np.array([[x, y, 0.0] for x, y in places])
    boxes = np.array([[[x, y, 0.0], [x + side, y + 0.5 * side, 1.0]] for x, y, side in blocks])
    index, stood = index_boxes(boxes), stands(nodes, boxes)
    moved = retracted_nodes(nodes, index, BODY)
    assert np.array_equal(moved[stood], nodes[stood])
    assert (np.linalg.norm(moved - nodes, axis=1) <= BODY.radius + 1e-12).all()
    is_moved = (moved != nodes).any(axis=1)
    assert stands(moved[is_moved], boxes).all()
    found = nodes_with_room(nodes, index, BODY, 0.15)
    assert stands(found, boxes).all()
    assert np.array_equal(found[: stood.sum()], nodes[stood])
    added = found[stood.sum() :]
    for k, node in enumerate(added):
        others = np.delete(found, stood.sum() + k, axis=0)
        if len(others):
            assert np.linalg.norm(others - node, axis=1).min() == pytest.approx(0.15, abs=1e-9) or (
                np.linalg.norm(others - node, axis=1).min() > 0.15
            )
