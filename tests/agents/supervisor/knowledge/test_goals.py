"""The goals that a merged map offers to robots."""

import math

import numpy as np
import pytest

from lidarium.agents.supervisor.knowledge.goals import NONE, _unknown_around, find_goals
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.planning.footprint import Footprint

RESOLUTION, FOOTPRINT = 0.1, Footprint(0.2, 0.3)


def hall(with_wall=False):
    """A hall of 8 m by 4 m whose left and right sides are open; a wall may part it."""
    log_odds = np.zeros((44, 84), np.int8)
    log_odds[2:42, 2:82] = -40
    log_odds[1, 1:83] = log_odds[42, 1:83] = 40
    if with_wall:
        log_odds[1:43, 41] = 40
    navigation = NavigationMap(log_odds, RESOLUTION)
    navigation.changed((0, 44, 0, 84))
    return navigation


def goals_of(navigation, *cells):
    return find_goals(navigation, (0.0, 0.0), cells, FOOTPRINT, 0.5, 3.0)


def test_each_open_side_is_a_goal_with_its_length_and_the_nearer_one_costs_less():
    found = goals_of(hall(), (20, 12), (20, 72))
    assert found.costs.shape == (2, 2)
    np.testing.assert_allclose(found.sizes, 4.0, atol=0.21)
    left, right = np.argsort(found.seen_from[:, 1])
    assert found.costs[0, left] < 1.2 < 5.5 < found.costs[0, right]
    assert found.costs[1, right] < 1.2 < 5.5 < found.costs[1, left]


def test_robots_observe_a_cell_of_the_frontier_from_within_reach():
    found = goals_of(hall(), (20, 12))
    for goal in range(2):
        cells = found.cells[found.starts[goal] : found.starts[goal + 1]].tolist()
        assert found.observed[0, goal].tolist() in cells
        assert math.dist(found.stands[0, goal], found.observed[0, goal]) * RESOLUTION <= 0.5 + 1e-9


def test_what_lies_behind_a_wall_cannot_be_reached():
    found = goals_of(hall(with_wall=True), (20, 12))
    right = int(np.argmax(found.seen_from[:, 1]))
    assert math.isinf(found.costs[0, right])
    assert found.stands[0, right].tolist() == [NONE, NONE]
    assert math.isfinite(found.costs[0, 1 - right])


def test_without_frontiers_there_are_no_goals():
    navigation = NavigationMap(np.full((20, 20), 40, np.int8), RESOLUTION)
    navigation.changed((0, 20, 0, 20))
    found = goals_of(navigation, (10, 10))
    assert found.costs.shape == (1, 0)
    assert len(found.areas) == 0


@pytest.mark.parametrize("cell", [(10, 12), (0, 0), (29, 39), (3, 38)])
def test_the_unknown_area_is_that_of_the_square_around_beyond_the_map_too(cell):
    log_odds = np.random.default_rng(0).integers(-1, 2, (30, 40)).astype(np.int8)
    padded = np.pad(log_odds, 5)
    window = padded[cell[0] : cell[0] + 11, cell[1] : cell[1] + 11]
    found = _unknown_around(log_odds, np.array([cell]), 0.5, RESOLUTION)
    assert found == pytest.approx([(window == 0).sum() * RESOLUTION**2])
