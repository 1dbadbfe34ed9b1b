"""Robots get paths to their targets, keep those that are clear, and go round who stands."""

import itertools
import math

import numpy as np
import pytest
from driven_teams import HALL, Teams

from lidarium.envs.floors.floor import Floor
from lidarium.envs.onboard.driving.path_following import BLOCKED, DRIVING, IDLE
from lidarium.envs.onboard.driving.planning import (
    TEAMMATE_DISTANCE,
    prepare_robot,
    prepare_teams_parallel,
    prepare_teams_serial,
)
from lidarium.envs.onboard.navigation import CLEARANCE_LIMIT
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.mapping.kernels.work_queue import new_work

# A corridor in which two robots cannot pass each other, and an open floor.
PASSAGE = Floor("passage", (0.0, 0.0, 6.0, 0.7), (), starts=np.array([[0.6, 0.35, 0.0], [3.0, 0.35, 0.0]]))
OPEN = Floor("open", (0.0, 0.0, 6.0, 4.0), (), starts=np.array([[1.0, 2.0, 0.0], [3.0, 2.0, 0.0]]))
RADIUS = 0.18


def ordered(floor, x, y, heading=math.nan):
    """A team whose first robot is to drive to x, y of the floor."""
    teams = Teams((floor,), (1,))
    drives = teams.driver.drives
    drives.is_ordered[0], drives.target_headings[0] = True, heading
    drives.targets[0] = (x, y) - teams.offsets[0]
    return teams, drives


def prepare(teams, row=0):
    prepare_robot(teams.driver.planner.fresh_planning(row), teams.driver.drives, row, 0)
    return teams.driver.planner.remaining(row)


def nearest_to(path, place):
    shares = np.linspace(0.0, 1.0, 200)[:, None]
    points = np.concatenate([a + shares * (b - a) for a, b in itertools.pairwise(path)])
    return np.hypot(*(points - place).T).min()


def wall_off(teams, x):
    """Let a wall across the floor appear in the maps of all robots."""
    beliefs, resolution = teams.simulation.beliefs, teams.settings.occupancy.resolution
    for row in range(teams.rows):
        column = math.floor((x - beliefs.origins[row, 0]) / resolution)
        beliefs.log_odds[row][:, column] = 100
        beliefs.windows[row] = (0, len(beliefs.log_odds[row]), column, column + 1)
    teams.simulation.world.steps += 1


def test_a_path_ends_at_the_target_itself_with_its_heading():
    teams, drives = ordered(OPEN, 2.013, 1.027, heading=0.7)
    path = prepare(teams)
    assert path[0] == pytest.approx([1.0, 2.0])
    assert path[-1] == pytest.approx([2.013, 1.027])
    assert drives.states[0] == DRIVING
    assert drives.headings[0] == 0.7


def test_beside_a_wall_a_path_ends_in_the_middle_of_its_cell():
    x, y = 2.013, RADIUS + 0.083
    teams, drives = ordered(OPEN, x, y)
    path, resolution = prepare(teams), teams.settings.occupancy.resolution
    assert drives.has_path[0]
    cells = (path[-1] - teams.simulation.beliefs.origins[0]) / resolution
    assert cells % 1.0 == pytest.approx([0.5, 0.5])
    assert np.abs(path[-1] - (x, y)).max() <= resolution


def clearance_at(teams, cell):
    """Distance from the middle of a cell to the nearest occupied cell."""
    navigation = teams.perception.planning_map(0, True)
    gaps = np.abs(np.argwhere(navigation.log_odds > 0) - cell) - 0.5
    return np.hypot(*np.maximum(gaps, 0.0).T).min() * navigation.resolution


def test_the_room_of_a_path_is_that_beside_the_body():
    for floor, y, is_wide in ((PASSAGE, 0.35, False), (OPEN, 2.0, True)):
        teams, drives = ordered(floor, 2.0, y)
        prepare(teams)
        clearances = [clearance_at(teams, cell) for cell in drives.cells[0, : drives.counts[0]]]
        assert (min(clearances) > CLEARANCE_LIMIT) == is_wide
        wanted = np.minimum(clearances, CLEARANCE_LIMIT) - RADIUS
        assert drives.room[0, : drives.counts[0]] == pytest.approx(wanted, abs=1e-6)


def test_a_path_is_kept_while_it_is_clear_and_dropped_for_another_where_it_is_not():
    teams, drives = ordered(OPEN, 5.0, 2.0)
    drives.states[1] = DRIVING
    first = prepare(teams)
    drives.targets[0] += 0.2
    assert np.array_equal(prepare(teams), first)
    wall_off(teams, 4.0)
    prepare(teams)
    assert not drives.has_path[0]
    assert drives.states[0] == IDLE
    drives.targets[0] = (2.0, 1.0) - teams.offsets[0]
    prepare(teams)
    assert drives.has_path[0]


@pytest.mark.parametrize("target", [(50.0, 2.0), (5.0, -8.0)])
def test_there_is_no_path_to_a_target_off_the_map(target):
    teams, drives = ordered(OPEN, *target)
    prepare(teams)
    assert not drives.has_path[0]
    assert drives.states[0] == IDLE


def test_who_was_given_a_path_or_gives_way_is_left_alone():
    for name in ("is_given", "passing"):
        teams, drives = ordered(OPEN, 5.0, 2.0)
        getattr(drives, name)[0] = 1
        prepare(teams)
        assert not drives.has_path[0]


def test_paths_lead_round_teammates_that_stand_and_not_round_those_that_drive():
    gap = 2.0 * RADIUS + TEAMMATE_DISTANCE
    for state, is_avoided in ((IDLE, True), (DRIVING, False)):
        teams, drives = ordered(OPEN, 5.0, 2.0)
        drives.states[1] = state
        assert (nearest_to(prepare(teams), (3.0, 2.0)) >= gap - 0.03) == is_avoided


def test_where_a_teammate_takes_all_the_room_the_path_leads_through_it_unless_it_has_ended():
    teams, drives = ordered(PASSAGE, 5.0, 0.35)
    assert nearest_to(prepare(teams), (3.0, 0.35)) < 0.1
    teams, drives = ordered(PASSAGE, 5.0, 0.35)
    teams.simulation.world.flags[1] |= ENDED
    prepare(teams)
    assert not drives.has_path[0]


@pytest.mark.parametrize(("run", "threads"), [(prepare_teams_serial, 1), (prepare_teams_parallel, 2)])
def test_teams_are_prepared_but_for_who_has_ended_and_say_who_is_blocked(run, threads):
    teams = Teams((OPEN, HALL, PASSAGE), (1, 2, 3), threads=threads)
    drives = teams.driver.drives
    places = np.array([(5.0, 2.0), (1.0, 1.0), (5.0, 4.0), (5.0, 1.0), (2.0, 0.35), (5.0, 0.35)])
    drives.is_ordered[:], drives.targets[:] = True, places - teams.offsets
    drives.is_ordered[5], drives.states[5] = False, BLOCKED
    teams.simulation.world.flags[3] |= ENDED
    is_blocked = np.zeros(3, np.bool_)
    planning = teams.driver.planning(np.arange(teams.rows))
    work = new_work(np.arange(3), teams.perception.threads_for(3))
    run(planning, drives, teams.perception.maps, work, is_blocked)
    assert is_blocked.tolist() == [False, False, True]
    assert drives.has_path.tolist() == [True, True, True, False, True, False]
    for row in np.flatnonzero(drives.has_path):
        assert teams.driver.planner.remaining(row)[-1] == pytest.approx(places[row], abs=0.05)
