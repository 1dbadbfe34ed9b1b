"""Decisions by waypoints: where they lead, how long they hold, and what they refuse."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.onboard.radio.messages import DriveState, Target
from lidarium.envs.settings.making import make_settings

HALL = Floor("hall", (0.0, 0.0, 6.0, 4.0), starts=np.array([[1.0, 2.0, 0.0], [1.0, 3.0, 0.0]]), goal=None)


def make(floor=HALL, **options):
    return lidarium.parallel_env(
        floor, level="waypoint", **{"starts": "fixed", "robots": 1, "stop_coverage": None, "map_cells": 64, **options}
    )


def test_a_waypoint_is_a_share_of_half_the_maps_side_along_the_axes_of_the_frame():
    env = make()
    env.reset(seed=0)
    start = env.unwrapped.world.poses[0, :2].copy()
    for _ in range(10):
        info = env.step({"robot_0": np.array([0.5, 0.0], np.float32) if _ == 0 else Target(*(np.array([1.8, 0.0])))})[
            4
        ]["robot_0"]
        if info["drive"] is DriveState.ARRIVED:
            break
    assert env.unwrapped.world.poses[0, :2] == pytest.approx(start + np.array([1.8, 0.0]), abs=0.08)
    env = make()
    env.reset(seed=0)
    env.step({"robot_0": np.array([0.5, 0.25], np.float32)})
    # Half of 64 cells of 5 cm is 1.6 m.
    assert env.driver.path(0)[-1] == pytest.approx([0.8, 0.4], abs=0.06)


def test_a_decision_holds_for_the_period_and_sums_the_rewards_of_its_steps():
    env, base = make(), ExplorationEnv(HALL, make_settings(robots=1, stop_coverage=None, map_cells=64))
    env.reset(seed=0)
    base.reset(seed=0)
    rewards = env.step({"robot_0": None})[1]
    assert env.unwrapped.scorer.time == pytest.approx(2.0)
    assert rewards["robot_0"] == pytest.approx(
        sum(base.step({"robot_0": np.zeros(2)})[1]["robot_0"] for _ in range(20))
    )


def test_a_decision_ends_when_a_robot_arrives():
    env = make(robots=2)
    env.reset(seed=0)
    infos = env.step({"robot_0": Target(0.35, 0.0), "robot_1": Target(3.0, 0.0)})[4]
    assert infos["robot_0"]["drive"] is DriveState.ARRIVED
    assert infos["robot_1"]["drive"] is DriveState.DRIVING
    assert 0.5 < env.unwrapped.scorer.time < 2.0
    before = env.unwrapped.scorer.time
    # Who has arrived already does not cut the next decision short.
    env.step({"robot_0": Target(0.35, 0.0), "robot_1": Target(3.0, 0.0)})
    assert env.unwrapped.scorer.time - before == pytest.approx(2.0)


def test_a_heading_is_turned_to_at_the_end():
    env = make()
    env.reset(seed=0)
    for _ in range(8):
        info = env.step({"robot_0": Target(0.5, 0.2, 2.0)})[4]["robot_0"]
        if info["drive"] is DriveState.ARRIVED:
            break
    assert abs(math.remainder(env.unwrapped.world.poses[0, 2] - 2.0, 2.0 * math.pi)) < 0.15


@pytest.mark.parametrize("target", [Target(-0.95, 0.0), Target(500.0, 0.0), Target(4.9, 1.9)])
def test_where_there_is_no_path_the_robot_stays_and_says_so(target):
    env = make()
    env.reset(seed=0)
    place = env.unwrapped.world.poses.copy()
    info = env.step({"robot_0": target})[4]["robot_0"]
    assert info["drive"] is DriveState.NO_PATH
    assert np.array_equal(env.unwrapped.world.poses, place)


def test_none_stays_and_is_idle():
    env = make()
    env.reset(seed=0)
    place = env.unwrapped.world.poses.copy()
    assert env.step({"robot_0": None})[4]["robot_0"]["drive"] is DriveState.IDLE
    assert np.array_equal(env.unwrapped.world.poses, place)


def test_a_new_order_replaces_the_old_one_at_once():
    env = make()
    env.reset(seed=0)
    env.step({"robot_0": Target(3.0, 0.0)})
    env.step({"robot_0": None})
    place = env.unwrapped.world.poses[0, :2].copy()
    env.step({"robot_0": None})
    assert np.array_equal(env.unwrapped.world.poses[0, :2], place)
    assert place[0] - 1.0 < 0.75


def test_coverage_the_horizon_and_the_goal_cut_a_decision_short():
    env = make(horizon_s=1.0)
    env.reset(seed=0)
    outcome = env.step({"robot_0": None})
    assert outcome[3]["robot_0"]
    assert env.unwrapped.scorer.time == pytest.approx(1.0)
    goal = Floor("hall", HALL.bounds, starts=HALL.starts[:1], goal=(1.4, 2.0))
    env = make(goal, goal_radius=0.2)
    env.reset(seed=0)
    outcome = env.step({"robot_0": Target(3.0, 0.0)})
    assert outcome[4]["robot_0"]["ended_because"] == "reached"
    assert env.unwrapped.scorer.time < 2.0
    env = make(stop_coverage=0.3)
    env.reset(seed=0)
    assert env.step({"robot_0": None})[4]["robot_0"]["ended_because"] == "covered"
    assert env.unwrapped.scorer.time == pytest.approx(0.1)


def test_a_robot_that_is_stopped_ends_while_the_others_wait_one_step():
    env = make(robots=2)
    env.reset(seed=0)
    env.stop("robot_1", "unreachable")
    outcome = env.step({"robot_0": Target(3.0, 0.0)})
    assert outcome[4]["robot_1"]["ended_because"] == "unreachable"
    assert env.agents == ["robot_0"]
    assert env.unwrapped.scorer.time == pytest.approx(0.1)


@pytest.mark.parametrize("order", [np.array([math.nan, 0.0]), np.zeros(3), 0.5])
def test_an_order_that_is_no_waypoint_is_refused(order):
    env = make()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"waypoint of robot_\d is"):
        env.step({"robot_0": order})


def test_a_missing_order_is_refused_by_name():
    env = make(robots=2)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="no action for robot_1"):
        env.step({"robot_0": None})


@pytest.mark.parametrize("values", [(math.nan, 0.0), (0.0, math.inf), (0.0, 0.0, math.nan)])
def test_a_target_that_is_not_finite_is_refused(values):
    with pytest.raises(ValueError, match="finite"):
        Target(*values)


def test_after_the_end_steps_give_nothing_and_a_reset_begins_anew():
    env = make(horizon_s=0.5)
    env.reset(seed=0)
    env.step({"robot_0": Target(3.0, 0.0)})
    assert env.step({}) == ({}, {}, {}, {}, {})
    env.reset(seed=0)
    assert env.drive_state("robot_0") is DriveState.IDLE


def test_own_maps_and_the_teams_map_lead_to_different_plans():
    """Behind a wall that only the other robot has looked behind, the way is known to the team alone."""
    wall = Solid(np.array([[3.0, 0.0], [3.2, 0.0], [3.2, 3.0], [3.0, 3.0]]))
    floor = Floor("divided", (0.0, 0.0, 6.0, 4.0), (wall,), starts=np.array([[1.0, 1.0, -1.5], [3.1, 3.5, -1.0]]))
    states = []
    for shares_map in (True, False):
        settings = make_settings(robots=2, stop_coverage=None, map_cells=32, lidar="lidar_360_6m")
        env = ExplorationEnv(floor, settings)
        env.use_level("waypoint", shares_map)
        env.reset(seed=0)
        states.append(env.step({"robot_0": Target(4.0, 0.0), "robot_1": None})[4]["robot_0"]["drive"])
    assert states == [DriveState.DRIVING, DriveState.NO_PATH]
