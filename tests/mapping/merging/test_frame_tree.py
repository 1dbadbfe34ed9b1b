import itertools
import math

import numpy as np
import pytest

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.frame_tree import Edge, FrameTree

A_FROM_B, B_FROM_C = Transform(1.0, 2.0, 0.3), Transform(-2.0, 0.5, 1.2)


def chain(*edges):
    tree = FrameTree()
    for edge in edges:
        tree.add_edge(edge)
    return tree


def near(first, second):
    assert first is not None
    distance, angle = first.difference(second)
    return distance < 1e-9 and angle < 1e-9


def test_a_chain_of_three_maps_is_looked_up_in_all_directions():
    tree = chain(Edge("a", "b", A_FROM_B, 5.0), Edge("b", "c", B_FROM_C, 4.0))
    assert near(tree.lookup("a", "c"), A_FROM_B @ B_FROM_C)
    assert near(tree.lookup("c", "a"), (A_FROM_B @ B_FROM_C).inverse())
    assert near(tree.lookup("b", "b"), Transform())
    assert near(tree.pose_in("a", "c", Transform(1.0, 0.0, 0.1)), A_FROM_B @ B_FROM_C @ Transform(1.0, 0.0, 0.1))
    assert tree.groups() == [["a", "b", "c"]]


def test_a_cycle_that_does_not_close_loses_its_weakest_edge():
    wrong = Transform(4.0, 4.0, 0.0)
    edges = [Edge("a", "b", A_FROM_B, 5.0), Edge("b", "c", B_FROM_C, 4.0), Edge("a", "c", wrong, 3.0)]
    for order in itertools.permutations(edges):
        tree = chain(*order)
        assert [edge.weight for edge in tree.dropped] == [3.0]
        assert near(tree.lookup("a", "c"), A_FROM_B @ B_FROM_C)
        assert tree.has_edge("b", "a")
        assert tree.has_edge("b", "c")
        assert not tree.has_edge("a", "c")


def test_a_cycle_that_closes_keeps_all_edges():
    tree = chain(
        Edge("a", "b", A_FROM_B, 5.0),
        Edge("b", "c", B_FROM_C, 4.0),
        Edge("c", "a", (A_FROM_B @ B_FROM_C).inverse(), 3.0),
    )
    assert tree.dropped == []
    assert len(tree.edges) == 3


def test_misses_around_a_cycle_are_taken_where_the_maps_overlap():
    """Far from the origin a small angle is a long way, which says nothing of the overlap."""
    place = (100.0, 0.0)
    turn = Transform(0.0, 0.0, math.radians(1.0))
    shift = np.array(place) - turn.apply(place)
    about_place = Transform(float(shift[0]), float(shift[1]), turn.theta)
    tree = chain(
        Edge("a", "b", Transform(), 2.0),
        Edge("b", "c", Transform(), 2.0),
        Edge("a", "c", about_place, 1.0, place),
    )
    assert tree.dropped == []
    tree = chain(Edge("a", "b", Transform(), 2.0), Edge("b", "c", Transform(), 2.0), Edge("a", "c", about_place, 1.0))
    assert len(tree.dropped) == 1


def test_two_groups_have_no_common_frame():
    tree = chain(Edge("a", "b", A_FROM_B, 1.0), Edge("c", "d", A_FROM_B, 1.0))
    tree.add_map("e")
    assert tree.groups() == [["a", "b"], ["c", "d"], ["e"]]
    assert tree.lookup("a", "c") is None
    assert tree.pose_in("a", "e", Transform()) is None
    with pytest.raises(ValueError, match="no map 'z'"):
        tree.lookup("a", "z")


def test_the_world_stays_where_it_is_while_groups_join_and_edges_improve():
    tree = FrameTree()
    for name in "abcd":
        tree.add_map(name)
    tree.add_edge(Edge("c", "d", A_FROM_B, 1.0))
    assert tree.groups()[0] == ["c", "d"]
    tree.add_edge(Edge("a", "b", A_FROM_B, 9.0))
    tree.add_edge(Edge("b", "c", B_FROM_C, 2.0))
    assert tree.groups()[0][0] == "c"
    assert near(tree.lookup("c", "d"), A_FROM_B)
    tree.add_edge(Edge("c", "d", Transform(9.0, 9.0, 0.0), 0.5))
    assert near(tree.lookup("c", "d"), A_FROM_B)
    better = Transform(1.01, 2.0, 0.3)
    tree.add_edge(Edge("c", "d", better, 3.0))
    assert near(tree.lookup("c", "d"), better)
    tree.remove_edge("b", "c")
    assert tree.groups() == [["c", "d"], ["a", "b"]]


@pytest.mark.parametrize("edge", [Edge("a", "a", Transform(), 1.0), Edge("a", "b", Transform(math.nan, 0.0, 0.0), 1.0)])
def test_bad_edges_are_refused(edge):
    with pytest.raises(ValueError, match=r"itself|finite"):
        FrameTree().add_edge(edge)
