"""What a robot knows, ready to be planned on."""

import math
from itertools import pairwise

import numpy as np
import pytest
from routed_floors import BODY, MARGIN_M, TABLE, WALL, floor_codes, known, seen_cells


def is_driveable(points, boxes, radius=BODY.radius, height=BODY.height):
    """The oracle: a body every centimetre of the route, against all boxes."""
    for a, b in pairwise(points):
        for share in np.linspace(0.0, 1.0, max(math.ceil(np.linalg.norm(b - a) / 0.01), 1) + 1):
            x, y = (a + share * (b - a))[:2]
            for low, high in boxes:
                if low[2] < height and high[2] > 0.05:
                    gap = math.hypot(max(low[0] - x, 0, x - high[0]), max(low[1] - y, 0, y - high[1]))
                    if gap < radius - 1e-9:
                        return False
    return True


def test_without_nodes_a_route_is_straight_or_there_is_none():
    navigation = known(TABLE, np.empty((0, 3)), [[1.5, 1.5, 0.0]])
    assert navigation.graph is None
    assert len(navigation.route(np.array([0.2, 0.2]), np.array([3.0, 0.2])).points) == 2
    assert navigation.route(np.array([0.2, 1.5]), np.array([3.0, 1.5])).reason == "no path"


def test_obstacles_that_stand_there_for_now_are_driven_round():
    codes = floor_codes((0.0, 0.0), (7.0, 5.0))
    navigation = known(np.empty((0, 2, 3)), codes, [[0.5, 2.5, 0.0]])
    start, goal = np.array([0.5, 2.5]), np.array([6.5, 2.5])
    obstacle = np.array([[[3.0, 2.0, 0.0], [3.5, 3.0, 0.6]]])
    blocked = navigation.amid(obstacle)
    route = blocked.route(start, goal)
    assert is_driveable(route.points, obstacle, BODY.radius + MARGIN_M)
    assert not blocked.is_free(navigation.route(start, goal).points[:, :2])
    assert navigation.is_free(navigation.route(start, goal).points[:, :2]), "the map itself is left alone"
    assert navigation.amid(np.empty((0, 2, 3))) is navigation


def test_ground_that_is_unknown_leads_to_goals_that_seen_ground_does_not():
    seen = seen_cells((0, 0, 2, 5))
    navigation = known(WALL, floor_codes((0.0, 0.0), (2.0, 5.0)), [[0.5, 0.5, 0.0]], seen)
    start, goal = np.array([0.5, 0.5]), np.array([6.0, 1.0])
    assert navigation.route(start, goal).reason == "no path"
    route = navigation.hopeful(goal).route(start, goal)
    assert not route.reason
    assert is_driveable(route.points, WALL, BODY.radius + MARGIN_M)
    walled = np.array([[[2.9, -99.0, 0.0], [3.1, 99.0, 2.0]]])
    shut = known(walled, floor_codes((0.0, 0.0), (2.0, 5.0)), [[0.5, 0.5, 0.0]], seen)
    assert shut.hopeful(goal).route(start, goal).reason == "no path"


def test_unknown_ground_counts_where_it_is_joined_to_the_trail_and_large_enough():
    cells = seen_cells((1, 1, 4, 4), (5, 1, 6, 4))
    cells[20, 20] = False
    navigation = known(np.empty((0, 2, 3)), floor_codes((1.0, 1.0), (4.0, 4.0)), [[2.0, 2.5, 0.0]], cells)
    found = navigation.ground.centres(navigation.unknown_ground(0.3).cells)
    assert len(found)
    assert found[:, 0].max() < 4.2, "what is seen apart is no part of it"
    assert not (np.hypot(*(found - (2.05, 2.05)).T) < 0.3).any(), "nobody could stand on one cell"
    assert navigation.ground.are_unknown(found).all()


def test_the_nearest_place_to_stand_is_a_node_within_reach():
    navigation = known(WALL, floor_codes((0.0, 0.0), (7.0, 5.0)), [[0.5, 0.5, 0.0]])
    place = np.array([3.0, 1.0])
    found = navigation.nearest_standing(place, 1.0)
    gaps = np.hypot(*(navigation.graph.nodes[:, :2] - place).T)
    assert math.dist(found, place) == gaps.min()
    assert navigation.nearest_standing(place, 0.1) is None


def test_places_behind_a_wall_without_end_are_cut_off():
    wall = np.array([[[2.9, -1.0, 0.0], [3.1, 6.0, 2.0]]])
    navigation = known(wall, floor_codes((0.0, 0.0), (7.0, 5.0)), [[0.5, 0.5, 0.0]])
    points = np.array([[1.0, 3.0], [5.0, 3.0]])
    assert navigation.are_cut_off(np.array([0.5, 0.5, 0.0]), points).tolist() == [False, True]


def test_the_nearest_view_looks_at_its_points_from_as_near_as_the_robot_can_come():
    wall = np.array([[[2.9, -1.0, 0.0], [3.1, 6.0, 2.0]]])
    navigation = known(wall, floor_codes((0.0, 0.0), (7.0, 5.0)), [[0.5, 0.5, 0.0]])
    view = navigation.nearest_view(np.array([0.5, 0.5, 0.0]), np.array([[5.0, 3.0], [5.5, 3.0]]))
    assert 2.0 < view.place[0] < 2.7
    assert view.place[1] == pytest.approx(3.0, abs=0.4)
    aim = np.array([5.0, 3.0]) - view.place[:2]
    assert view.heading == pytest.approx(math.atan2(aim[1], aim[0]))


def test_samples_are_of_unknown_ground_alone():
    cells = seen_cells((0.0, 0.0, 3.5, 5.0))
    navigation = known(WALL, floor_codes((0.0, 0.0), (3.4, 5.0)), [[0.5, 0.5, 0.0]], cells)
    samples = navigation.unknown_samples()
    assert (samples[:, 0] > 3.5).all()
    # About one on each square of 0.3 m.
    assert len(samples) == pytest.approx(3.5 * 5.0 / 0.09, rel=0.1)
