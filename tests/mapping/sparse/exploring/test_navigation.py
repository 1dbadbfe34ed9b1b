"""Routes can be driven, keep to ground that was seen, and lead out of where a robot cannot stand."""

import math
from itertools import pairwise

import numpy as np
import pytest
from routed_floors import BODY, MARGIN_M, TABLE, WALL, floor_codes, known, seen_cells

from lidarium.mapping.sparse.exploring.navigation import _is_route_free, _path_to_stand
from lidarium.mapping.sparse.exploring.views import Sight
from lidarium.mapping.sparse.swept_body import is_free


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


@pytest.mark.parametrize("goal", [(6.0, 1.0), (5.0, 4.5), (3.6, 0.4), (2.4, 2.4)])
def test_routes_keep_the_body_and_its_margin_off_all_boxes(goal):
    boxes = np.concatenate([WALL, TABLE])
    navigation = known(boxes, floor_codes((0.0, 0.0), (7.0, 5.0)), [[0.5, 0.5, 0.0]])
    route = navigation.route(np.array([0.5, 0.5]), np.array(goal))
    assert not route.reason
    assert route.points[0][:2] == pytest.approx([0.5, 0.5])
    assert route.points[-1][:2] == pytest.approx(goal)
    assert is_driveable(route.points, boxes, BODY.radius + MARGIN_M)
    assert navigation.is_free(route.points[:, :2])
    assert len(route.room) == len(route.points)
    assert (route.room >= MARGIN_M).all()
    assert route.length >= math.dist((0.5, 0.5), goal) - 1e-9


def test_the_room_along_a_route_is_what_is_left_beside_the_body():
    passage = np.array([[[0.0, 1.0, 0.0], [4.0, 1.1, 1.0]], [[0.0, 2.0, 0.0], [4.0, 2.1, 1.0]]])
    navigation = known(passage, floor_codes((0.1, 0.35), (7.0, 3.0), 0.4), [[0.5, 1.55, 0.0]])
    room = navigation.route(np.array([0.5, 1.55]), np.array([3.5, 1.55])).room
    # Of a gap of 0.9 m the body takes 0.4 m.
    assert room == pytest.approx(np.full(len(room), 0.25), abs=0.03)
    assert navigation.route(np.array([5.5, 1.5]), np.array([6.5, 1.5])).room == pytest.approx(0.35, abs=0.01)


def test_routes_are_cut_short_over_seen_ground_alone():
    codes = floor_codes((0.0, 0.0), (7.0, 5.0))
    is_ring = (codes[:, 1] < 0.9) | (codes[:, 0] > 5.0)
    ring = seen_cells((0, 0, 7, 1), (5, 0, 7, 5))
    start, goal = np.array([0.5, 0.5]), np.array([6.0, 4.5])
    around = known(np.empty((0, 2, 3)), codes[is_ring], [[0.5, 0.5, 0.0]], ring).route(start, goal)
    across = known(np.empty((0, 2, 3)), codes, [[0.5, 0.5, 0.0]]).route(start, goal)
    assert len(across.points) == 2
    assert around.length > across.length + 1.0
    for a, b in pairwise(around.points):
        for share in np.linspace(0.0, 1.0, 50):
            x, y = (a + share * (b - a))[:2]
            assert ring[int(y / 0.1), int(x / 0.1)]


def test_a_robot_too_near_to_a_wall_first_goes_to_where_it_can_stand():
    navigation = known(WALL, floor_codes((0.0, 0.0), (7.0, 5.0)), [[0.5, 1.5, 0.0]])
    start = np.array([2.75, 1.5])
    assert not is_free(navigation.index, np.array([*start, 0.0]), np.array([*start, 0.0]), navigation.body.numbers)
    route = navigation.route(start, np.array([0.5, 0.5]))
    assert not route.reason
    assert route.points[0][:2] == pytest.approx(start)
    out = route.points[1]
    assert np.linalg.norm(out[:2] - start) < 0.6
    assert is_driveable(route.points[1:], WALL)


def test_a_robot_that_the_map_has_in_a_box_goes_back_the_way_it_came():
    trail = [[0.5, 1.5, 0.0], [1.5, 1.5, 0.0], [2.2, 1.5, 0.0], [2.8, 1.5, 0.0], [3.0, 1.5, 0.0]]
    navigation = known(WALL, floor_codes((0.0, 0.0), (7.0, 5.0)), trail)
    start = np.array([3.0, 1.5, 0.0])
    way = _path_to_stand(navigation.graph, start, navigation.trail)
    assert way[0] == pytest.approx(start)
    assert way[1:].tolist() == [trail[4], trail[3], trail[2]]
    assert not navigation.route(start[:2], np.array([0.5, 0.5])).reason


def test_where_no_way_out_is_known_the_reason_is_a_start_in_collision():
    codes = floor_codes((5.0, 0.0), (7.0, 5.0))
    navigation = known(np.array([[[0.0, 0.0, 0.0], [2.0, 2.0, 1.0]]]), codes, [[1.0, 1.0, 0.0]])
    assert navigation.route(np.array([1.0, 1.0]), np.array([6.0, 4.0])).reason == "start in collision"


def test_goals_in_boxes_and_behind_walls_have_their_reasons():
    wall = np.array([[[2.9, -9.0, 0.0], [3.1, 9.0, 2.0]]])
    navigation = known(np.concatenate([wall, TABLE]), floor_codes((0.0, 0.0), (7.0, 5.0)), [[0.5, 0.5, 0.0]])
    start = np.array([0.5, 0.5])
    assert navigation.route(start, np.array([1.5, 1.5])).reason == "goal in collision"
    assert navigation.route(start, np.array([5.0, 1.5])).reason == "no path"
    assert len(navigation.route(start, np.array([5.0, 1.5])).points) == 0
    near = navigation.nearest_standing(np.array([1.5, 0.9]), 0.6)
    assert not navigation.route(start, near).reason
    assert navigation.nearest_standing(np.array([1.5, 1.5]), 0.3) is None


def test_a_route_of_one_point_is_free_where_the_body_can_stand():
    index, body = known(TABLE, np.empty((0, 3)), [[0.1, 0.1, 0.0]]).index, BODY.numbers
    assert _is_route_free(index, body, np.array([[0.2, 0.2, 0.0]]))
    assert not _is_route_free(index, body, np.array([[1.5, 1.5, 0.0]]))


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
    sight = Sight(0.3, 2.0, 3.0, 0.5, 0.5, 0.1, 0.5, 0.2, 0.3, 4.0, 0.3)
    view = navigation.nearest_view(np.array([0.5, 0.5, 0.0]), np.array([[5.0, 3.0], [5.5, 3.0]]), sight)
    assert 2.0 < view.place[0] < 2.7
    assert view.place[1] == pytest.approx(3.0, abs=0.4)
    aim = np.array([5.0, 3.0]) - view.place[:2]
    assert view.heading + sight.bearing == pytest.approx(math.atan2(aim[1], aim[0]))


def test_samples_are_of_unknown_ground_alone():
    cells = seen_cells((0.0, 0.0, 3.5, 5.0))
    navigation = known(WALL, floor_codes((0.0, 0.0), (3.4, 5.0)), [[0.5, 0.5, 0.0]], cells)
    samples = navigation.unknown_samples()
    assert (samples[:, 0] > 3.5).all()
    # About one on each square of 0.3 m.
    assert len(samples) == pytest.approx(3.5 * 5.0 / 0.09, rel=0.1)
