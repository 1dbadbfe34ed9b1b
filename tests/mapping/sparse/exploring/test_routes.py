"""Routes can be driven, keep to ground that was seen, and lead out of where a robot cannot stand."""

import math
from itertools import pairwise

import numpy as np
import pytest
from routed_floors import BODY, MARGIN_M, TABLE, WALL, floor_codes, known, seen_cells

from lidarium.mapping.sparse.exploring.routes import is_route_free, path_to_stand
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
    assert not is_free(
        navigation.index, np.array([*start, 0.0]), np.array([*start, 0.0]), navigation.body.numbers
    )
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
    way = path_to_stand(navigation.graph, start, navigation.trail)
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
    assert is_route_free(index, body, np.array([[0.2, 0.2, 0.0]]))
    assert not is_route_free(index, body, np.array([[1.5, 1.5, 0.0]]))
