"""The graph of a team: parents, bridges, shortest ways."""

import math

import pytest
from seen_from_nodes import box_view, node

from lidarium.agents.srt.tree import Tree, way_to


def test_a_tree_has_parents_bridges_and_shortest_ways():
    tree, known = Tree(), set[int]()
    for number, (place, parent) in enumerate([((0, 0), None), ((1, 0), 0), ((2, 0), 1), ((2, 1), 2), ((0, 1.2), 3)]):
        tree.add(
            node(number, place, box_view(), parent),
            lambda first, second: math.dist(first.place, second.place) < 1.3,
            known,
        )
        known.add(number)
    assert tree.chain(4) == [4, 3, 2, 1, 0]
    assert set(tree.nodes[4].neighbours) == {3, 0}
    lengths, before = tree.ways(4, known)
    assert way_to(1, before) == [0, 1]
    assert lengths[1] == pytest.approx(2.2)
    tree.disconnect(4, 0)
    assert way_to(0, tree.ways(4, known)[1]) == [3, 2, 1, 0]
    assert 0 not in tree.ways(4, {4, 3})[0]


def test_a_tree_refuses_a_wrong_number_and_an_unknown_parent():
    with pytest.raises(ValueError, match="number of the node is 3"):
        Tree().add(node(3, (0, 0), box_view()), None, ())
    with pytest.raises(ValueError, match="parent of node 0 is 2"):
        Tree().add(node(0, (0, 0), box_view(), 2), None, ())
