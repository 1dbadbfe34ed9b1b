"""Of robots that block each other one drives round the other, or goes aside until it has passed."""

import math

import numpy as np
import pytest
from driven_teams import CORRIDOR, Teams

from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.onboard.driving.path_following import ARRIVED, BLOCKED, DRIVING
from lidarium.envs.onboard.driving.right_of_way import BACKING_S, REFUGE_STAY_S, RightOfWay, obstructing
from lidarium.envs.onboard.radio.messages import Orders, Target
from lidarium.envs.simulation.kernels.arrays import ENDED

OPEN = Floor("open", (0.0, 0.0, 6.0, 4.0), (), starts=np.array([[1.0, 2.0, 0.0], [1.7, 2.0, 0.0]]))
# The corridor is 0.6 m wide and has a niche between 3.6 m and 4.2 m.
MET = np.array([[3.0, 1.5, 0.0], [3.7, 1.5, math.pi]])
APART = 0.36


def met(floor=CORRIDOR, starts=MET, targets=((5.2, 1.5), (1.9, 1.5))):
    """Two robots that have paths and are blocked, and what settles their right of way."""
    met_floor = Floor(floor.name, floor.bounds, floor.solids, starts=np.array(starts))
    teams = Teams((met_floor,), (1,))
    orders = [None if place is None else Target(*(place - teams.offsets[row])) for row, place in enumerate(targets)]
    teams.driver.assign(teams.every, Orders.of(orders))
    teams.driver.prepare()
    drives = teams.driver.drives
    drives.states[drives.has_path] = BLOCKED
    return teams, drives, RightOfWay(teams.perception, teams.settings, drives, teams.driver.planner)


def test_what_blocks_a_robot_far_from_all_others_is_a_wall():
    teams, drives, right_of_way = met(OPEN, [[1.0, 2.0, 0.0], [4.0, 2.0, 0.0]], ((2.5, 2.0), None))
    right_of_way.settle_team(0)
    assert drives.backing.tolist() == [round(BACKING_S / teams.settings.time_step), 0]
    assert drives.states[0] == DRIVING
    assert drives.passing.tolist() == [-1, -1]


def test_where_there_is_room_the_blocked_robot_drives_round_the_other():
    teams, drives, right_of_way = met(OPEN, OPEN.starts, ((4.0, 2.0), None))
    drives.states[1] = DRIVING
    right_of_way.settle_team(0)
    assert drives.states[0] == DRIVING
    assert drives.passing.tolist() == [-1, -1]
    assert not obstructing(np.array([1.7, 2.0]), teams.driver.planner.remaining(0), APART)


def test_in_a_corridor_the_later_robot_goes_off_the_path_of_the_first():
    teams, drives, right_of_way = met()
    right_of_way.settle_team(0)
    assert drives.passing.tolist() == [-1, 0]
    assert drives.states.tolist() == [DRIVING, DRIVING]
    assert drives.stations[1] == pytest.approx(MET[1, :2])
    refuge = teams.driver.planner.remaining(1)[-1]
    assert not obstructing(refuge, teams.driver.planner.remaining(0), APART)


def test_who_has_nothing_to_do_gives_way_whatever_its_place():
    _, drives, right_of_way = met(targets=((5.2, 1.5), None))
    right_of_way.settle_team(0)
    assert drives.passing.tolist() == [-1, 0]
    _, drives, right_of_way = met(targets=(None, (1.9, 1.5)))
    right_of_way.settle_team(0)
    assert drives.passing.tolist() == [1, -1]
    _, drives, right_of_way = met()
    drives.states[0] = ARRIVED
    right_of_way.settle_team(0)
    assert drives.passing.tolist() == [1, -1]


def test_who_has_ended_or_is_held_gives_no_way():
    for hold in (False, True):
        teams, drives, right_of_way = met(targets=((5.2, 1.5), None))
        if hold:
            teams.driver.planner.held[1] = True
        else:
            teams.simulation.world.flags[1] |= ENDED
        right_of_way.settle_team(0)
        assert drives.passing[1] < 0


def test_who_gave_way_goes_on_when_the_other_has_passed_ended_or_takes_too_long():
    def pass_by(teams, drives):
        drives.counts[0] = 0

    def wait(teams, drives):
        teams.simulation.world.steps[0] += round(REFUGE_STAY_S / teams.settings.time_step) + 1

    def end(teams, drives):
        teams.simulation.world.flags[0] |= ENDED

    for happens in (pass_by, wait, end):
        teams, drives, right_of_way = met()
        right_of_way.settle_team(0)
        right_of_way.end_refuges(0)
        assert drives.passing.tolist() == [-1, 0]
        happens(teams, drives)
        right_of_way.end_refuges(0)
        assert drives.passing.tolist() == [-1, -1]
        # Who has ended stands in the corridor for good.
        assert drives.has_path[1] == (happens is not end)
        if drives.has_path[1]:
            assert teams.driver.planner.remaining(1)[-1] == pytest.approx([1.9, 1.5], abs=0.05)


def test_no_way_round_a_robot_that_has_ended_is_too_long():
    block = Solid(np.array([(1.5, 0.6), (6.5, 0.6), (6.5, 5.0), (1.5, 5.0)]))
    loop = Floor("loop", (0.0, 0.0, 8.0, 6.0), (block,))
    starts, targets = [[2.0, 0.3, 0.0], [2.6, 0.3, 0.0]], ((5.0, 0.3), None)
    teams, drives, right_of_way = met(loop, starts, targets)
    for row, log_odds in enumerate(teams.perception.beliefs.log_odds):
        y, x = (np.indices(log_odds.shape) + 0.5) * 0.05 + np.reshape(teams.driver.planner.origin(row)[::-1], (2, 1, 1))
        log_odds[:] = -40
        log_odds[(x < 0) | (x > 8) | (y < 0) | (y > 6) | (x > 1.5) & (x < 6.5) & (y > 0.6) & (y < 5.0)] = 70
        teams.perception.beliefs.windows[row] = 0, log_odds.shape[0], 0, log_odds.shape[1]
    teams.perception.world.steps += 1
    teams.perception.world.flags[1] |= ENDED
    right_of_way.settle_team(0)
    left = teams.driver.planner.remaining(0)
    assert drives.states[0] == DRIVING
    assert np.hypot(*np.diff(left, axis=0).T).sum() > 14.0
    assert not obstructing(np.array([2.6, 0.3]), left, APART)
