"""What a robot knows by its camera is asked and answered in its own map frame."""

import math

import numpy as np
import pytest
from ground_views import looking
from routed_floors import WALL, floor_codes, known, seen_cells

from lidarium.envs.onboard.sparse_belief import SparseBelief
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.sparse.exploring.views import Sight

FRAME = Transform(10.0, -4.0, math.pi / 2)
SIGHT = Sight(0.3, 2.0, 3.0, 0.5, 0.0, 0.1, 0.5, 0.2, 0.3, 4.0, 0.3)
START, GOAL = np.array([0.5, 0.5]), np.array([2.0, 4.0])
TRAIL = [[0.5, 0.5, 0.0]]


@pytest.fixture(scope="module")
def belief():
    """A wall, seen ground before it and unknown ground behind, in a frame turned by a quarter."""
    navigation = known(WALL, floor_codes((0.0, 0.0), (3.0, 5.0)), TRAIL, seen_cells((0, 0, 3.4, 5)))
    return SparseBelief(navigation, FRAME, looking(), 3)


def out(points):
    """Points of the map in the frame of the robot, written out."""
    x, y = np.moveaxis(np.asarray(points, float)[..., :2], -1, 0)
    return np.stack([10.0 - y, -4.0 + x], axis=-1)


def test_routes_are_those_of_the_map_in_the_frame_of_the_robot(belief):
    route, own = belief.route(out(START), out(GOAL)), belief.navigation.route(START, GOAL)
    assert not route.reason
    assert route.points == pytest.approx(out(own.points))
    assert route.points[0] == pytest.approx(out(START))
    assert route.points[-1] == pytest.approx(out(GOAL))
    assert belief.is_free(route.points)
    assert not belief.is_free(out([[2.0, 1.0], [4.0, 1.0]]))


def test_bodies_that_stand_there_for_now_are_in_the_way(belief):
    place = out([1.0, 2.0])
    amid = belief.amid(place[None], 0.2, 0.5)
    assert belief.is_free(out([[1.0, 1.5], [1.0, 2.5]]))
    assert not amid.is_free(out([[1.0, 1.5], [1.0, 2.5]]))
    assert amid.is_free(out([[2.0, 1.5], [2.0, 2.5]]))
    assert belief.amid(np.empty((0, 2)), 0.2, 0.5) is belief


def test_ground_is_seen_or_unknown_and_hope_leads_onto_it(belief):
    places = out([[1.0, 1.0], [6.5, 0.5]])
    assert belief.are_unknown(places).tolist() == [False, True]
    # Without what the wall covers, to a column of cells.
    assert belief.seen_m2 == pytest.approx(3.4 * 5.0 - 0.2 * 3.0, abs=0.31)
    assert belief.cell_m == pytest.approx(0.1)
    assert belief.route(places[0], places[1]).reason == "no path"
    assert not belief.hopeful(places[1]).route(places[0], places[1]).reason
    samples = belief.unknown_samples()
    assert samples == pytest.approx(out(belief.navigation.unknown_samples()))
    borders = belief.unknown_ground(0.3)
    assert borders
    assert all(belief.are_unknown(border).all() for border in borders)


def test_views_look_at_unknown_ground_from_places_that_can_be_come_to(belief):
    pose = np.array([*out(START), math.pi / 2])
    border = belief.unknown_ground(0.3)[0]
    own_border = belief.navigation.unknown_ground(0.3)
    own_points = belief.navigation.ground.centres(own_border.of(0))
    view, own = (
        belief.best_view(pose, border, SIGHT),
        belief.navigation.best_view(np.array([*START, 0.0]), own_points, SIGHT),
    )
    assert view.place == pytest.approx(out(own.place))
    assert math.remainder(view.heading - own.heading - math.pi / 2, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert view.points == pytest.approx(out(own.points))
    assert view.cost == pytest.approx(own.cost)
    assert belief.best_view(pose, border[:0], SIGHT) is None
    nearest = belief.nearest_view(pose, out([[5.0, 3.5]]), SIGHT)
    aim = out([5.0, 3.5]) - nearest.place
    assert math.remainder(nearest.heading - math.atan2(aim[1], aim[0]), math.tau) == pytest.approx(0.0)


def test_the_nearest_place_to_stand_is_near(belief):
    place = out([1.0, 3.0])
    assert math.dist(belief.nearest_standing(place, 0.5), place) <= 0.2
    assert belief.nearest_standing(out([60.0, 3.0]), 0.5) is None
    pose = np.array([*out(START), 0.0])
    assert not belief.are_cut_off(pose, place[None]).any()


def test_a_robot_has_moved_when_it_left_more_than_one_place(belief):
    assert not belief.has_moved
    moved = known(WALL, floor_codes((0.0, 0.0), (3.0, 5.0)), [*TRAIL, [0.8, 0.5, 0.0]])
    assert SparseBelief(moved, FRAME, looking(), 0).has_moved
    assert belief.corrections == 3
