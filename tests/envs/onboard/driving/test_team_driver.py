"""Orders become paths, and paths are kept until orders change."""

import numpy as np
from driven_teams import FLOORS, HALL, ROBOTS, SEEDS, Teams

from lidarium.envs.onboard.driving.drives import (
    any_newly_done,
    is_done,
    mark_waiting,
)
from lidarium.envs.onboard.navigation import FLAGS
from lidarium.envs.onboard.radio.messages import Orders, Target
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
