"""A wrapper passes everything on."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.wrapper import TeamWrapper
from lidarium.envs.onboard.radio.messages import Order

SMALL = {"robots": 2, "map_cells": 32, "lidar": "lidar_360_6m"}


def test_a_wrapped_environment_does_what_the_one_below_does():
    plain, below = (lidarium.parallel_env("apartment", **SMALL) for _ in range(2))
    wrapped = TeamWrapper(below)
    assert wrapped.unwrapped is below
    assert wrapped.observation_space("robot_0") is below.observation_space("robot_0")
    assert wrapped.action_space("robot_1") is below.action_space("robot_1")
    assert wrapped.state_space == plain.state_space
    seen, same = plain.reset(seed=3)[0], wrapped.reset(seed=3)[0]
    for _ in range(5):
        actions = {agent: np.array([0.5, 0.2], np.float32) for agent in plain.agents}
        seen, rewards, *_ = plain.step(actions)
        same, others, *_ = wrapped.step(actions)
        assert rewards == others
    assert all(np.array_equal(seen[agent][name], same[agent][name]) for agent in seen for name in seen[agent])
    assert np.array_equal(plain.state(), wrapped.state())


def test_agents_are_those_that_are_left():
    wrapped = TeamWrapper(lidarium.parallel_env("apartment", **SMALL))
    wrapped.reset(seed=0)
    wrapped.stop("robot_0", "enough")
    wrapped.order("robot_1", Order("pause"))
    actions = dict.fromkeys(wrapped.agents, np.zeros(2, np.float32))
    _, _, terminations, _, infos = wrapped.step(actions)
    assert wrapped.agents == ["robot_1"]
    assert terminations["robot_0"]
    assert infos["robot_0"]["ended_because"] == "enough"
    assert infos["robot_1"]["state"] == "paused"
    with pytest.raises(ValueError, match="robot_0 is not among the live agents"):
        wrapped.stop("robot_0", "again")
