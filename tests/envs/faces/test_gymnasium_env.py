"""One robot alone, as Gymnasium has it."""

import numpy as np
import pytest
from linked_rooms import TWO_ROOMS

import lidarium
from lidarium.envs.faces.gymnasium_env import AGENT, SoloExploration
from lidarium.envs.onboard.radio.messages import Order, OrderKind

SMALL = {"map_cells": 32, "lidar": "lidar_360_6m", "stop_coverage": None}


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_it_is_the_team_of_one_robot(level):
    env = SoloExploration(TWO_ROOMS, level, **SMALL)
    team = lidarium.parallel_env(TWO_ROOMS, level=level, robots=1, **SMALL)
    assert env.observation_space == team.observation_space(AGENT)
    assert env.action_space == team.action_space(AGENT)
    observation, info = env.reset(seed=4)
    observations, infos = team.reset(seed=4)
    for _ in range(3):
        assert env.observation_space.contains(observation)
        for name, value in observations[AGENT].items():
            assert np.array_equal(observation[name], value), name
        assert info["truth"]["coverage"] == infos[AGENT]["truth"]["coverage"]
        action = 0 if level == "frontier" else np.array([0.4, 0.1], np.float32)
        observation, reward, *_, info = env.step(action)
        observations, rewards, _, _, infos = team.step({AGENT: action})
        assert reward == rewards[AGENT]


def test_an_episode_ends_once_and_has_to_be_reset():
    env = SoloExploration(TWO_ROOMS, horizon_s=0.2, **SMALL)
    with pytest.raises(RuntimeError, match=r"over or was not started; call reset\(\) before step\(\)"):
        env.step([0.0, 0.0])
    env.reset(seed=0)
    assert env.step([0.0, 0.0])[2:4] == (False, False)
    assert env.step([0.0, 0.0])[2:4] == (False, True)
    with pytest.raises(RuntimeError, match="call reset"):
        env.step([0.0, 0.0])
    env.reset()
    env.stop("bored")
    *_, terminated, truncated, info = env.step([0.0, 0.0])
    assert (terminated, truncated) == (True, False)
    assert info["ended_because"] == "bored"


def test_actions_of_frontiers_have_masks_and_others_have_none():
    env = SoloExploration(TWO_ROOMS, "frontier", observation="flat", **SMALL)
    env.reset(seed=0)
    masks = env.action_masks()
    assert masks.dtype == np.bool_
    assert masks.shape == (env.action_space.n,)
    assert masks[-1]
    assert masks[0]
    with pytest.raises(AttributeError, match="use level='frontier'"):
        SoloExploration(TWO_ROOMS, "waypoint", **SMALL).action_masks()


def test_the_robot_takes_orders_and_is_drawn():
    env = SoloExploration(TWO_ROOMS, render_mode="rgb_array", time_step=0.05, **SMALL)
    env.reset(seed=0)
    env.order(Order(OrderKind.PAUSE))
    assert env.step([1.0, 0.0])[4]["state"] == "paused"
    assert env.parallel.world.travelled[0] == 0.0
    assert env.render().shape[2] == 3
    assert env.metadata["render_fps"] == env.parallel.metadata["render_fps"] == pytest.approx(20)
    env.close()


def test_a_team_is_refused():
    with pytest.raises(ValueError, match="robots is 2; the Gymnasium form has one robot"):
        SoloExploration(TWO_ROOMS, robots=2)
