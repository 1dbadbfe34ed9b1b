"""A memory that relies on the robot's map."""

import functools
import math
from itertools import pairwise

import numpy as np
from seen_from_nodes import box_view, node
from srt_halls import RADIUS, RESOLUTION, hall

from lidarium.agents.srt.memories import MapMemory, RegionMemory
from lidarium.envs.onboard.navigation import NavigationMap


def test_ways_between_frontiers_are_no_longer_than_past_the_robot():
    frontiers = hall([(1.0, 2.0), (5.0, 6.0), (10.0, 11.0)]).frontiers(np.array([5.0, 3.0]), 0.8, 14)
    assert len(frontiers.sizes) == 3
    assert (np.diff(frontiers.costs) >= 0.0).all()
    between = frontiers.between(np.arange(3))
    assert (between <= frontiers.costs[:, None] + frontiers.costs[None] + 1e-9).all()
    np.testing.assert_array_equal(between, between.T)
    np.testing.assert_array_equal(frontiers.between(np.array([0, 2])), between[::2, ::2])
    assert len(hall([(1.0, 2.0), (5.0, 6.0), (10.0, 11.0)]).frontiers(np.array([5.0, 3.0]), 0.8, 2).sizes) == 2


# Places are counted from the map's first cell: the hall's lower left corner is at (1, 1) m.


@functools.cache
def memory_of_hall():
    return hall([(3.0, 4.0)])


def test_space_is_seen_where_it_is_known_beside_walls_and_beyond_the_map():
    points = np.array([[5.0, 3.0], [4.5, 5.5], [4.1, 5.03], [-1.0, 3.0], [12.0, 5.5]])
    assert memory_of_hall().is_seen(points, None).tolist() == [True, False, True, True, False]


def test_a_straight_way_is_clear_over_free_cells_with_room_for_the_body():
    here = np.array([2.0, 3.0])
    assert memory_of_hall().is_clear(here, np.array([9.0, 3.0]))
    assert not memory_of_hall().is_clear(here, np.array([9.0, 1.15]))
    assert not memory_of_hall().is_clear(here, np.array([4.5, 5.5]))
    # A robot may begin nearer to a wall than it would go.
    assert memory_of_hall().is_clear(np.array([2.0, 1.15]), np.array([2.0, 3.0]))


def is_clear_by_points(memory, start, end):
    """Whether a way is clear, by all points on it at once."""
    resolution = memory._map.resolution
    count = max(math.ceil(math.dist(start, end) / (0.5 * resolution)), 1)
    rows, columns, is_inside = memory._cells(start + (end - start) * np.linspace(0.0, 1.0, count + 1)[:, None])
    has_room = memory._clearance(rows, columns) >= memory._body
    is_near_start = np.arange(count + 1) * 0.5 * resolution < memory._body
    return bool((is_inside & (memory._map.log_odds[rows, columns] < 0) & (has_room | is_near_start)).all())


def test_ways_are_clear_as_all_their_points_are():
    generator = np.random.default_rng(3)
    ways = generator.uniform((-0.5, -0.5), (14.0, 6.0), (400, 2, 2))
    found = [memory_of_hall().is_clear(start, end) for start, end in ways]
    assert found == [is_clear_by_points(memory_of_hall(), start, end) for start, end in ways]
    assert 40 < sum(found) < 360


def test_a_way_goes_round_what_is_in_between_in_clear_legs():
    log_odds = memory_of_hall()._map.log_odds.copy()
    log_odds[20:80, 120:130] = 40
    navigation = NavigationMap(log_odds, RESOLUTION)
    navigation.changed((0, 120, 0, 320))
    memory, start, end = MapMemory(navigation, RADIUS), np.array([4.0, 2.0]), np.array([9.0, 2.0])
    assert not memory.is_clear(start, end)
    legs = memory.way(start, end)
    np.testing.assert_allclose(legs[-1], end)
    assert max(leg[1] for leg in legs) > 4.0
    for a, b in pairwise([start, *legs]):
        assert memory.is_clear(a, b) or np.hypot(*(b - a)) < 0.1


def test_there_is_no_way_to_what_is_not_free():
    for end in ((4.5, 5.5), (4.0, 1.0), (50.0, 3.0)):
        assert memory_of_hall().way(np.array([2.0, 3.0]), np.array(end)) is None


def test_a_frontier_is_found_with_the_way_to_it_if_it_is_long_enough():
    found = memory_of_hall().frontiers(np.array([2.0, 3.0]), 0.5, 5)
    assert len(found.sizes) == 1
    assert 4.0 <= found.focuses[0, 0] <= 5.0
    assert memory_of_hall().frontiers(np.array([2.0, 3.0]), 2.0, 5) is None
    np.testing.assert_allclose(
        found.legs(0)[-1], memory_of_hall().frontiers(found.legs(0)[-1], 0.5, 5).ahead[0], atol=0.1
    )


FIRST, SECOND = node(0, (0.0, 0.0), box_view()), node(1, (1.5, 0.0), box_view())
REGION_MEMORY_MEMORY = RegionMemory([FIRST, SECOND])


def test_space_is_seen_where_another_node_is_safe():
    points = np.array([[2.5, 0.0], [0.5, 0.0], [-1.0, 0.0]])
    assert REGION_MEMORY_MEMORY.is_seen(points, FIRST).tolist() == [True, True, False]
    assert REGION_MEMORY_MEMORY.is_seen(points, SECOND).tolist() == [False, True, True]


def test_a_node_made_again_at_its_place_does_not_see_for_itself():
    again = node(2, (0.0, 0.0), box_view())
    assert not RegionMemory([FIRST, again]).is_seen(np.array([[0.5, 0.0]]), FIRST).any()


def test_a_way_is_clear_from_a_node_within_its_safe_region():
    assert REGION_MEMORY_MEMORY.is_clear(np.array([0.0, 0.04]), np.array([1.0, 0.5]))
    assert not REGION_MEMORY_MEMORY.is_clear(np.array([0.0, 0.3]), np.array([1.0, 0.5]))
    assert not REGION_MEMORY_MEMORY.is_clear(np.array([0.0, 0.0]), np.array([2.5, 0.0]))
    assert not RegionMemory([]).is_clear(np.zeros(2), np.zeros(2))


def test_regions_know_no_ways_and_no_frontiers():
    assert REGION_MEMORY_MEMORY.way(np.zeros(2), np.ones(2)) is None
    assert REGION_MEMORY_MEMORY.frontiers(np.zeros(2), 0.3, 5) is None
    REGION_MEMORY_MEMORY.give_up(np.ones(2))
    assert not REGION_MEMORY_MEMORY.is_frontier(np.ones(2))
