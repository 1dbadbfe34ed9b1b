"""Paths are planned in the frames of the believed poses, round who stands there."""

import itertools
import math

import numpy as np
import pytest
from driven_teams import Teams

from lidarium.envs.floors.floor import Floor
from lidarium.envs.onboard.driving.path_following import DRIVING
from lidarium.envs.onboard.driving.path_planner import footprint_of
from lidarium.envs.onboard.driving.planning import TEAMMATE_DISTANCE
from lidarium.envs.simulation.kernels.arrays import ENDED

OPEN = Floor("open", (0.0, 0.0, 6.0, 4.0), (), starts=np.array([[1.0, 2.0, 0.0], [3.0, 2.0, 0.0]]))


@pytest.fixture
def teams():
    return Teams((OPEN,), (1,))


def cell_at(teams, x, y, row=0):
    low_x, low_y = teams.driver.planner.origin(row)
    resolution = teams.settings.occupancy.resolution
    return math.floor((y - low_y) / resolution), math.floor((x - low_x) / resolution)


def sampled(path):
    shares = np.linspace(0.0, 1.0, 200)[:, None]
    return np.concatenate([a + shares * (b - a) for a, b in itertools.pairwise(path)])


def test_a_robot_just_fits_where_it_must_and_keeps_off_walls_where_it_can():
    footprint = footprint_of(0.2)
    assert footprint.radius == pytest.approx(0.202)
    assert footprint.preferred == pytest.approx(0.35)


def test_the_cell_of_a_robot_holds_its_believed_place(teams):
    planner, believed = teams.driver.planner, teams.simulation.beliefs.believed
    assert planner.cell(1) == cell_at(teams, 3.0, 2.0, row=1)
    believed[1, :2] += (0.5, -0.25)
    assert planner.cell(1) == cell_at(teams, 3.5, 1.75, row=1)


def test_a_path_leads_from_the_robot_to_the_middle_of_the_goal(teams):
    planner, drives = teams.driver.planner, teams.driver.drives
    assert np.array_equal(planner.remaining(0), teams.simulation.beliefs.believed[:1, :2])
    assert planner.drive_to(0, cell_at(teams, 5.0, 2.0), [], heading=1.5)
    assert drives.states[0] == DRIVING
    assert drives.headings[0] == 1.5
    path = planner.remaining(0)
    assert path[0] == pytest.approx([1.0, 2.0])
    assert np.abs(path[-1] - [5.0, 2.0]).max() <= teams.settings.occupancy.resolution
    assert not drives.has_path[1]


def test_paths_lead_round_those_that_are_to_be_avoided(teams):
    planner = teams.driver.planner
    goal, gap = cell_at(teams, 5.0, 2.0), 2.0 * teams.settings.robot.radius + TEAMMATE_DISTANCE
    assert planner.drive_to(0, goal, [])
    assert np.hypot(*(sampled(planner.remaining(0)) - [3.0, 2.0]).T).min() < 0.1
    assert planner.drive_to(0, goal, [1])
    assert np.hypot(*(sampled(planner.remaining(0)) - [3.0, 2.0]).T).min() >= gap - 0.03


def test_where_no_path_is_cheap_enough_or_the_goal_is_off_the_map_nothing_changes(teams):
    planner, drives = teams.driver.planner, teams.driver.drives
    assert planner.drive_to(0, cell_at(teams, 2.0, 2.0), [])
    before = planner.remaining(0)
    assert not planner.drive_to(0, cell_at(teams, 5.0, 2.0), [], maximum_cost=3.5)
    assert not planner.drive_to(0, (-1, 5), [])
    assert np.array_equal(planner.remaining(0), before)
    assert drives.has_path[0]
    assert planner.drive_to(0, cell_at(teams, 5.0, 2.0), [], maximum_cost=4.5)


def test_robots_that_are_held_count_as_ended(teams):
    planner = teams.driver.planner
    assert planner.planning(np.array([0])).has_ended.tolist() == [False, False]
    planner.held[1] = True
    assert planner.planning(np.array([0])).has_ended.tolist() == [False, True]
    teams.simulation.world.flags[0] |= ENDED
    assert planner.fresh_planning(1).has_ended.tolist() == [True, True]
