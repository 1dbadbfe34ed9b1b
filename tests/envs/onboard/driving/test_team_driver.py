"""Orders become paths, and paths are kept until orders change."""

import numpy as np
import pytest
from driven_teams import FLOORS, HALL, ROBOTS, SEEDS, Teams

import lidarium
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.onboard.driving.drives import (
    any_newly_done,
    is_done,
    mark_waiting,
)
from lidarium.envs.onboard.navigation import FLAGS
from lidarium.envs.onboard.radio.messages import DriveState, Orders, Target
from lidarium.envs.simulation.kernels.arrays import ENDED


def test_driving_by_waypoints_keeps_no_frontiers():
    teams = Teams(FLOORS[:2], SEEDS[:2])
    teams.driven_to_targets(2)
    assert not teams.driver.planning(np.arange(teams.rows)).records[:, FLAGS].any()
    assert teams.driver.planning(np.arange(teams.rows), with_frontiers=True).records[:, FLAGS].all()


def test_the_same_order_again_changes_nothing_and_a_new_one_drops_the_path():
    teams = Teams((HALL,), (1,))
    drives, target = teams.driver.drives, Target(2.0, 0.5, 1.0)
    teams.drive(Orders.of([target, None]), steps=3)
    assert drives.has_path.tolist() == [True, False]
    teams.driver.assign(teams.every, Orders.of([target, None]))
    assert drives.has_path[0]
    teams.driver.assign(np.array([False, True]), Orders.of([None, None]))
    assert drives.is_ordered[0]
    for changed in (Target(2.0, 0.5), Target(2.0, 0.6, 1.0), None):
        teams.drive(Orders.of([target, None]), steps=1)
        assert drives.has_path[0]
        teams.driver.assign(teams.every, Orders.of([changed, None]))
        assert not drives.has_path[0]
        assert drives.is_ordered[0] == (changed is not None)


def test_a_robot_is_newly_done_when_it_waits_and_did_not_before():
    teams = Teams((HALL,), (1,))
    drives, waiting, live = teams.driver.drives, np.zeros(ROBOTS, np.bool_), np.ones(ROBOTS, np.bool_)
    teams.driver.assign(teams.every, Orders.of([Target(0.1, 0.0), Target(-100.0, 0.0)]))
    teams.driver.prepare()
    mark_waiting(drives, 0, ROBOTS, waiting)
    assert waiting.tolist() == [False, True]
    assert not any_newly_done(drives, 0, ROBOTS, live, waiting)
    teams.drive(Orders.of([Target(0.1, 0.0), Target(-100.0, 0.0)]))
    assert is_done(drives, 0)
    assert any_newly_done(drives, 0, ROBOTS, live, waiting)
    assert not any_newly_done(drives, 0, ROBOTS, np.array([False, True]), waiting)


def test_robots_that_have_ended_are_not_planned_for():
    teams = Teams((HALL,), (1,))
    teams.simulation.world.flags[0] |= ENDED
    teams.driver.assign(teams.every, Orders.of([Target(1.0, 0.0)] * ROBOTS))
    teams.driver.prepare()
    assert teams.driver.drives.has_path.tolist() == [False, True]


def test_a_robot_that_pushes_against_what_its_laser_does_not_see_backs_out():
    low = Solid(np.array([(3.0, 1.0), (3.4, 1.0), (3.4, 2.0), (3.0, 2.0)]), 0.0, 0.2)
    floor, options = Floor("low", (0.0, 0.0, 6.0, 3.0), (low,)), {"stop_coverage": None, "horizon_s": 30.0}
    env = lidarium.parallel_env(floor, robots=1, level="waypoint", decision_period_s=0.5, **options)
    env.reset(seed=0, options={"starts": [(1.0, 1.5, 0.0)]})
    target = Target(*(np.array([5.0, 1.5]) - env.belief("robot_0").frame))
    places, states = [], []
    while env.agents:
        states.append(env.step({"robot_0": target})[4]["robot_0"]["drive"])
        places.append(env.world.poses[0, 0])
    assert DriveState.BLOCKED in states
    assert max(places) == pytest.approx(3.0 - env.settings.robot.radius, abs=0.01)
    assert np.diff(places).min() < -0.02
