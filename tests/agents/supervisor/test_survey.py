"""Goals on the merged map of a group for its robots."""

import math

import numpy as np
import pytest
from reported_halls import RADIUS, RESOLUTION, hall, report

from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.agents.supervisor.survey import NONE, Survey, _find_goals, _unknown_around
from lidarium.envs.onboard.driving.path_planner import footprint_of
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.fusion import fuse
from lidarium.mapping.planning.footprint import Footprint

WEST, EAST, NORTH = (0.0, 2.0), (7.95, 2.0), (4.0, 3.95)
TURNED = Transform(1.0, -2.0, math.pi / 2.0)
"""Of the second robot's map frame in the hall's."""


def survey_of(openings, given_up=(), wall_at=None, **robots):
    """A survey of the hall for robots at places, each with a target or none; the second's frame is turned."""
    levels = hall(openings=openings).levels.copy()
    if wall_at is not None:
        column = round(wall_at / RESOLUTION)
        levels[:, column : column + 3] = 0
    frames = {agent: Transform() if agent == "a" else TURNED for agent in robots}
    reports = {}
    for agent, (place, target) in robots.items():
        own = frames[agent].inverse()
        there = None if target is None else tuple(own.apply(target).tolist())
        reports[agent] = report(hall(), *own.apply(place).tolist(), there)
    fused = fuse([levels], [Transform()], RESOLUTION)
    blacklist = np.array(given_up, float).reshape(-1, 2)
    settings = SupervisorSettings()
    return Survey(fused, frames, reports, list(robots), blacklist, footprint_of(RADIUS), settings)


def test_openings_are_goals_and_robots_go_to_the_nearest_that_they_are_sent_to():
    survey = survey_of((WEST, EAST), a=((2.0, 2.0), (0.3, 2.0)), b=((6.0, 2.0), None))
    assert survey.goals.costs.shape == (2, 2)
    west = int(np.argmin(survey.goals.costs[0]))
    assert survey.going == {"a": west, "b": -1}
    assert survey.places["b"] is None
    assert survey.places["a"] == pytest.approx((0.3, 2.0))
    assert survey.has_frontier()
    assert survey.is_goal().all()


def test_stands_and_observed_cells_are_in_the_robots_own_frame():
    survey = survey_of((WEST, EAST), a=((2.0, 2.0), None), b=((6.0, 2.0), None))
    east = int(np.argmin(survey.goals.costs[1]))
    x, y, heading = survey.stand("b", east)
    place = TURNED.apply((x, y))
    observed = TURNED.apply(survey.observed_cell("b", east))
    assert abs(observed[0] - 7.95) < 0.15
    assert math.dist(place, observed) < RADIUS + 3.0 * RESOLUTION
    aim = observed - place
    assert math.cos(heading + TURNED.theta - math.atan2(aim[1], aim[0])) == pytest.approx(1.0, abs=1e-6)


def test_what_robots_have_given_up_is_no_goal():
    given_up = [(0.0, 1.5 + 0.1 * k) for k in range(11)]
    assert survey_of((WEST, EAST), given_up, a=((2.0, 2.0), None)).goals.costs.shape[1] == 1
    survey = survey_of((), a=((2.0, 2.0), None))
    assert not survey.has_frontier()


def test_robots_that_go_to_one_place_or_frontier_have_one_goal():
    survey = survey_of((WEST, EAST), a=((2.0, 2.0), (0.3, 2.2)), b=((3.0, 2.0), (0.3, 1.7)))
    assert survey.is_same_goal("a", "b", 0.1)
    apart = survey_of((WEST, EAST), a=((2.0, 2.0), (0.3, 2.0)), b=((6.0, 2.0), (7.7, 2.0)))
    assert not apart.is_same_goal("a", "b", 0.1)
    assert apart.is_same_goal("a", "b", 8.0)
    idle = survey_of((WEST, EAST), a=((2.0, 2.0), (0.3, 2.0)), b=((6.0, 2.0), None))
    assert not idle.is_same_goal("a", "b", 99.0)


def test_robots_meet_whose_goals_are_near_and_in_sight_and_bring_them_nearer():
    near = {"a": ((2.0, 2.0), (3.9, 2.0)), "b": ((6.0, 2.0), (4.2, 2.0))}
    assert survey_of((WEST,), **near).are_meeting("a", "b")
    assert not survey_of((WEST,), wall_at=4.0, **near).are_meeting("a", "b")
    assert not survey_of((WEST,), a=((4.0, 2.0), (3.9, 2.0)), b=((4.1, 2.0), (4.3, 2.0))).are_meeting("a", "b")


def test_robots_without_a_goal_or_with_goals_far_apart_do_not_meet():
    idle = survey_of((WEST,), a=((2.0, 2.0), None), b=((6.0, 2.0), (4.2, 2.0)))
    assert idle.are_meeting("a", "b") is False
    assert idle.are_meeting("b", "a") is False
    limit = SupervisorSettings().rendezvous_m
    # Each goes to the other's place: the goals are nearer to each other than the robots, and still far apart.
    far = survey_of((WEST,), a=((0.5, 2.0), (1.0, 2.0)), b=((7.5, 2.0), (1.2 + limit, 2.0)))
    assert far.are_meeting("a", "b") is False
    far.places.update(a=(1.0, 2.0), b=(1.0 + limit, 2.0))
    assert far.are_meeting("a", "b") is False
    far.places["b"] = (0.9 + limit, 2.0)
    assert far.are_meeting("a", "b") is True


def test_goals_see_each_other_less_the_farther_they_are_apart():
    survey = survey_of((WEST, EAST, NORTH), a=((2.0, 2.0), None))
    seen = survey.seen()
    np.testing.assert_allclose(np.diag(seen), 1.0)
    np.testing.assert_allclose(seen, seen.T, atol=1e-9)
    assert ((seen >= 0.0) & (seen <= 1.0)).all()
    here = survey.seen_at((0.5, 2.0))
    assert here.argmax() == survey.goals.costs[0].argmin()


def test_the_way_home_is_that_of_the_map_and_endless_where_there_is_none():
    survey = survey_of((WEST,), a=((2.0, 2.0), None), b=((6.0, 2.0), None))
    home = TURNED.inverse() @ Transform(3.0, 2.0, 0.0)
    assert survey.way_home_m("b", home) == pytest.approx(3.0, rel=0.1)
    parted = survey_of((WEST,), wall_at=4.0, b=((6.0, 2.0), None))
    assert math.isinf(parted.way_home_m("b", home))


GOAL_RESOLUTION, FOOTPRINT = 0.1, Footprint(0.2, 0.3)


def parted_hall(with_wall=False):
    """A hall of 8 m by 4 m whose left and right sides are open; a wall may part it."""
    log_odds = np.zeros((44, 84), np.int8)
    log_odds[2:42, 2:82] = -40
    log_odds[1, 1:83] = log_odds[42, 1:83] = 40
    if with_wall:
        log_odds[1:43, 41] = 40
    navigation = NavigationMap(log_odds, GOAL_RESOLUTION)
    navigation.changed((0, 44, 0, 84))
    return navigation


def goals_of(navigation, *cells):
    return _find_goals(navigation, (0.0, 0.0), cells, FOOTPRINT, 0.5, 3.0)


def test_each_open_side_is_a_goal_with_its_length_and_the_nearer_one_costs_less():
    found = goals_of(parted_hall(), (20, 12), (20, 72))
    assert found.costs.shape == (2, 2)
    np.testing.assert_allclose(found.sizes, 4.0, atol=0.21)
    left, right = np.argsort(found.seen_from[:, 1])
    assert found.costs[0, left] < 1.2 < 5.5 < found.costs[0, right]
    assert found.costs[1, right] < 1.2 < 5.5 < found.costs[1, left]


def test_robots_observe_a_cell_of_the_frontier_from_within_reach():
    found = goals_of(parted_hall(), (20, 12))
    for goal in range(2):
        cells = found.cells[found.starts[goal] : found.starts[goal + 1]].tolist()
        assert found.observed[0, goal].tolist() in cells
        assert math.dist(found.stands[0, goal], found.observed[0, goal]) * GOAL_RESOLUTION <= 0.5 + 1e-9


def test_what_lies_behind_a_wall_cannot_be_reached():
    found = goals_of(parted_hall(with_wall=True), (20, 12))
    right = int(np.argmax(found.seen_from[:, 1]))
    assert math.isinf(found.costs[0, right])
    assert found.stands[0, right].tolist() == [NONE, NONE]
    assert math.isfinite(found.costs[0, 1 - right])


def test_without_frontiers_there_are_no_goals():
    navigation = NavigationMap(np.full((20, 20), 40, np.int8), GOAL_RESOLUTION)
    navigation.changed((0, 20, 0, 20))
    found = goals_of(navigation, (10, 10))
    assert found.costs.shape == (1, 0)
    assert len(found.areas) == 0


@pytest.mark.parametrize("cell", [(10, 12), (0, 0), (29, 39), (3, 38)])
def test_the_unknown_area_is_that_of_the_square_around_beyond_the_map_too(cell):
    log_odds = np.random.default_rng(0).integers(-1, 2, (30, 40)).astype(np.int8)
    padded = np.pad(log_odds, 5)
    window = padded[cell[0] : cell[0] + 11, cell[1] : cell[1] + 11]
    found = _unknown_around(log_odds, np.array([cell]), 0.5, GOAL_RESOLUTION)
    assert found == pytest.approx([(window == 0).sum() * GOAL_RESOLUTION**2])
