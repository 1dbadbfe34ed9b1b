"""One engine steps single environments and batches, and a batch does everything that a single environment does."""

import numpy as np
import pytest
from compared_faces import compare_rows
from linked_rooms import TWO_ROOMS

import lidarium
from lidarium.envs.engine.engine import Engine
from lidarium.envs.onboard.radio.messages import OrderKind
from lidarium.envs.settings.making import make_settings

SMALL = {"robots": 2, "map_cells": 32, "lidar": "lidar_360_6m", "stop_coverage": None, "observe": ["scan", "pose"]}


def stepped(options, level, steps, before=None):
    """Compare a batch with single environments, and return how many robots have ended."""
    return compare_rows(level, 1, steps, [TWO_ROOMS] * 3, seed=3, before=before, **{**SMALL, **options})


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_a_batch_empties_batteries_as_single_environments_do(level):
    assert stepped({"battery": {"capacity_j": 20.0}}, level, 60 if level == "velocity" else 6) >= 3


@pytest.mark.parametrize("level", ["velocity", "waypoint"])
def test_a_batch_pauses_robots_as_single_environments_do(level):
    stepped({"pauses_when_blocked": True}, level, 60 if level == "velocity" else 10)
    if level == "velocity":
        batch = lidarium.vector_env(3, TWO_ROOMS, pauses_when_blocked=True, **SMALL, starts="fixed")
        batch.reset(seed=3)
        ahead = np.tile(np.array([1.0, 0.0], np.float32), (batch.num_envs, 1))
        assert any("paused" in batch.step(ahead)[4]["state"] for _ in range(200))


@pytest.mark.parametrize("radio", ["all", "line_of_sight"])
def test_a_batch_takes_orders_as_single_environments_do(radio):
    kinds = OrderKind
    orders = {
        1: lidarium.Order(kinds.GO_TO, lidarium.Target(0.5, 0.2), "test"),
        3: lidarium.Order(kinds.PAUSE, None, "test"),
        5: lidarium.Order(kinds.RESUME, None, "test"),
        7: lidarium.Order(kinds.STOP, None, "enough"),
    }

    def order(episode, step, team):
        if episode == 1 and step in orders:
            team.order("robot_1", orders[step])

    assert stepped({"radio": radio}, "waypoint", 10, order) == 1


def test_a_batch_reports_to_stations_as_single_environments_do():
    options = {**SMALL, "localization": "odometry", "odometry": "typical", "radio": "line_of_sight"}
    batch = lidarium.vector_env(3, TWO_ROOMS, level="waypoint", reports=True, **{"starts": "fixed", **options})
    batch.reset(seed=3)
    for _ in range(4):
        batch.step(np.full((6, 2), 0.3, np.float32))
    for k in range(3):
        env = lidarium.parallel_env(TWO_ROOMS, level="waypoint", **{"starts": "fixed", **options})
        env.reset(seed=3 + k)
        for _ in range(4):
            env.step(dict.fromkeys(env.agents, np.full(2, 0.3, np.float32)))
        for agent in env.possible_agents:
            ours, theirs = batch.team(k).report(agent), env.report(agent)
            assert ours.pose == theirs.pose
            assert ours.travelled_m == theirs.travelled_m
            assert np.array_equal(ours.map.levels, theirs.map.levels)
    with pytest.raises(ValueError, match="make it with reports=True"):
        lidarium.vector_env(1, TWO_ROOMS, **SMALL).team(0).report("robot_0")
    with pytest.raises(ValueError, match="episode is 7; want a number from 0 to 2"):
        batch.team(7)


def test_step_by_step_comes_to_what_the_kernel_does():
    for level in ("velocity", "waypoint"):
        engines = [Engine(2, TWO_ROOMS, make_settings(**SMALL, noise="datasheet"), level) for _ in range(2)]
        actions = np.tile([0.4, 0.2], (4, 1))
        for engine in engines:
            engine.run(None, np.arange(2), [1, 2])
        for _ in range(6):
            for engine, hook in zip(engines, (None, lambda commands: None), strict=True):
                engine.run(engine.level.read_rows(actions, engine.live), after_step=hook)
            assert np.array_equal(engines[0].world.steps, engines[1].world.steps)
            assert np.array_equal(engines[0].world.poses, engines[1].world.poses)
            for name, array in engines[0].observations.items():
                assert np.array_equal(array, engines[1].observations[name]), name


def test_waypoints_of_a_batch_may_be_targets_in_an_array_of_objects():
    batch = lidarium.vector_env(1, TWO_ROOMS, level="waypoint", **SMALL, starts="fixed")
    alone = lidarium.parallel_env(TWO_ROOMS, level="waypoint", **SMALL, starts="fixed")
    batch.reset(seed=0)
    alone.reset(seed=0)
    actions = np.array([lidarium.Target(0.6, 0.3), None], object)
    for _ in range(3):
        seen, *_ = batch.step(actions)
        wanted, *_ = alone.step({"robot_0": actions[0], "robot_1": None})
        assert np.array_equal(seen["pose"][0], wanted["robot_0"]["pose"])
    with pytest.raises(ValueError, match="waypoint of row 0 is"):
        batch.step(np.array(["there", None], object))
