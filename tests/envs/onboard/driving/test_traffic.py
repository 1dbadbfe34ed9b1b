"""Places aside: off the other's path, within reach, and the nearest of them."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.envs.onboard.driving.path_planner import footprint_of
from lidarium.envs.onboard.driving.right_of_way import find_refuge, obstructing
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.planning.grid_planning import Until, centres_of, search

RESOLUTION = 0.05
ORIGIN = (0.0, 0.0)


def known(rows, columns, walls=()):
    """A map that is free inside and occupied at its border and in the walls (row, column, height, width)."""
    log_odds = np.full((rows, columns), -20, np.int8)
    log_odds[0], log_odds[-1], log_odds[:, 0], log_odds[:, -1] = 20, 20, 20, 20
    for row, column, height, width in walls:
        log_odds[row : row + height, column : column + width] = 20
    navigation = NavigationMap(log_odds, RESOLUTION)
    navigation.changed((0, rows, 0, columns))
    return navigation


def refuge(navigation, start, path, distance=0.45, discs=()):
    return find_refuge(
        navigation, ORIGIN, start, footprint_of(0.18), list(discs), np.asarray(path, np.float64), distance
    )


def gap_to(cell, path):
    place = centres_of(np.array(cell), ORIGIN, RESOLUTION)
    path = np.asarray(path, np.float64)
    dense = np.concatenate([a + (b - a) * np.linspace(0, 1, 200)[:, None] for a, b in itertools.pairwise(path)])
    return float(np.hypot(*(dense - place).T).min())


@given(x=st.floats(0.0, 4.0), y=st.floats(0.0, 4.0), distance=st.floats(0.1, 1.0))
@settings(max_examples=100)
def test_a_body_obstructs_a_path_within_the_distance(x, y, distance):
    path = np.array([[0.5, 0.5], [3.0, 0.5], [3.0, 3.5]])
    dense = np.concatenate([np.linspace(path[k], path[k + 1], 2000) for k in range(2)])
    gap = float(np.hypot(*(dense - [x, y]).T).min())
    if abs(gap - distance) > 0.004:
        assert obstructing(np.array([x, y]), path, distance) == (gap < distance)


def test_a_path_of_one_point_obstructs_only_where_it_is():
    path = np.array([[1.0, 1.0]])
    assert obstructing(np.array([1.1, 1.0]), path, 0.2)
    assert not obstructing(np.array([1.3, 1.0]), path, 0.2)


@pytest.mark.parametrize(
    ("size", "path", "start"),
    [((40, 100), [(0.5, 1.0), (4.5, 1.0)], (20, 50)), ((160, 160), [(0.3, 4.0), (7.7, 4.0)], (84, 80))],
)
def test_the_refuge_is_off_the_path_and_the_one_that_costs_least(size, path, start):
    navigation = known(*size)
    cell = refuge(navigation, start, path)
    assert cell is not None
    assert gap_to(cell, path) >= 0.44
    found = search(
        navigation.space,
        navigation.log_odds,
        navigation.clearance,
        start,
        footprint_of(0.18),
        until=Until(maximum_cost=3.0),
    )
    cells = found.reached()
    off = [tuple(int(value) for value in each) for each in cells if gap_to(each, path) >= 0.45]
    assert found.cost(cell) <= min(found.cost(each) for each in off) + 1e-9


def test_in_a_corridor_the_refuge_is_the_niche():
    walls = [(0, 20, 14, 80), (26, 20, 30, 30), (26, 66, 30, 34)]
    navigation = known(56, 120, walls)
    path = [(0.5, 1.0), (5.5, 1.0)]
    cell = refuge(navigation, (20, 56), path)
    assert cell is not None
    assert 50 <= cell[1] < 66
    assert cell[0] > 26


def test_there_is_none_where_the_path_takes_all_the_room():
    navigation = known(14, 60)
    assert refuge(navigation, (7, 30), [(0.3, 0.35), (2.7, 0.35)]) is None


def test_bodies_of_others_are_kept_clear_of():
    navigation = known(40, 100)
    path = [(0.5, 1.0), (4.5, 1.0)]
    free = refuge(navigation, (20, 50), path)
    assert free is not None
    blocked = refuge(navigation, (20, 50), path, discs=[(float(free[0]), float(free[1]), 0.5 / RESOLUTION)])
    assert blocked is not None
    assert np.hypot(blocked[0] - free[0], blocked[1] - free[1]) * RESOLUTION >= 0.45
