"""A memory that relies on the safe regions of nodes alone."""

import numpy as np
from seen_from_nodes import box_view, node

from lidarium.agents.srt.memories.region_memory import RegionMemory

FIRST, SECOND = node(0, (0.0, 0.0), box_view()), node(1, (1.5, 0.0), box_view())
MEMORY = RegionMemory([FIRST, SECOND])


def test_space_is_seen_where_another_node_is_safe():
    points = np.array([[2.5, 0.0], [0.5, 0.0], [-1.0, 0.0]])
    assert MEMORY.is_seen(points, FIRST).tolist() == [True, True, False]
    assert MEMORY.is_seen(points, SECOND).tolist() == [False, True, True]


def test_a_node_made_again_at_its_place_does_not_see_for_itself():
    again = node(2, (0.0, 0.0), box_view())
    assert not RegionMemory([FIRST, again]).is_seen(np.array([[0.5, 0.0]]), FIRST).any()


def test_a_way_is_clear_from_a_node_within_its_safe_region():
    assert MEMORY.is_clear(np.array([0.0, 0.04]), np.array([1.0, 0.5]))
    assert not MEMORY.is_clear(np.array([0.0, 0.3]), np.array([1.0, 0.5]))
    assert not MEMORY.is_clear(np.array([0.0, 0.0]), np.array([2.5, 0.0]))
    assert not RegionMemory([]).is_clear(np.zeros(2), np.zeros(2))


def test_regions_know_no_ways_and_no_frontiers():
    assert MEMORY.way(np.zeros(2), np.ones(2)) is None
    assert MEMORY.frontiers(np.zeros(2), 0.3, 5) is None
    MEMORY.give_up(np.ones(2))
    assert not MEMORY.is_frontier(np.ones(2))
