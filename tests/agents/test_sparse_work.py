"""What a robot that explores by its camera is at, and whether it gets on with it."""

import math

import numpy as np
import pytest

from lidarium.agents.sparse_work import BLOCKED_S, CLAIMED_M, OBSTACLE_S, PATIENCE_S, STUCK_S, Work
from lidarium.envs.onboard.radio.messages import DriveState
from lidarium.mapping.sparse.exploring.views import View

HERE = np.array([1.0, 2.0, 3.0])
VIEW = View(np.array([4.0, 2.0]), 0.0, 3.0, np.array([[5.0, 2.0], [5.0, 3.0]]))


def begun():
    work = Work()
    work.begin(VIEW, 10.0, HERE)
    return work


def test_what_a_robot_is_about_to_see_is_left_to_it_until_it_drops_it():
    work = begun()
    np.testing.assert_allclose(work.claimed[:, :2], VIEW.points)
    np.testing.assert_allclose(work.claimed[:, 2], CLAIMED_M)
    work.drop()
    assert work.claimed.shape == (0, 3)


def test_a_robot_that_does_not_move_is_stuck_and_then_in_vain():
    work = begun()
    work.watch(11.0, HERE + np.array([0.05, 0.0, 0.1]), DriveState.DRIVING)
    assert (work.is_stuck(10.0 + STUCK_S), work.is_stuck(10.1 + STUCK_S)) == (False, True)
    assert (work.is_in_vain(10.0 + PATIENCE_S), work.is_in_vain(10.1 + PATIENCE_S)) == (False, True)


@pytest.mark.parametrize("motion", [(0.2, 0.0, 0.0), (0.0, 0.0, 0.3), (0.0, 0.0, 0.25 + math.tau)])
def test_a_motion_or_a_turn_begins_the_time_anew(motion):
    work = begun()
    work.watch(20.0, HERE + np.array(motion), DriveState.DRIVING)
    assert not work.is_stuck(19.9 + STUCK_S)


def test_giving_way_is_no_standing_still_and_a_blocked_path_is():
    work = begun()
    work.watch(20.0, HERE, DriveState.GIVING_WAY)
    assert work.moved_s == 20.0
    for now in (21.0, 22.0):
        work.watch(now, HERE, DriveState.BLOCKED)
    assert (work.is_stuck(21.0 + BLOCKED_S), work.is_stuck(21.1 + BLOCKED_S)) == (False, True)
    work.watch(22.5, HERE, DriveState.DRIVING)
    assert work.blocked_s == math.inf


def test_what_is_taken_to_stand_there_does_so_for_a_while():
    work = begun()
    work.watch(11.0, HERE, DriveState.BLOCKED)
    work.take_to_stand(np.array([2.0, 2.0]), 12.0)
    work.take_to_stand(np.array([3.0, 2.0]), 20.0)
    assert work.blocked_s == math.inf
    assert work.obstacles_at(12.0 + OBSTACLE_S - 0.1).tolist() == [[2.0, 2.0], [3.0, 2.0]]
    assert work.obstacles_at(12.0 + OBSTACLE_S).tolist() == [[3.0, 2.0]]
    assert work.obstacles_at(99.0).shape == (0, 2)
