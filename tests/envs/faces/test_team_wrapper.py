"""A wrapper passes everything on."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.wrapper import TeamWrapper
from lidarium.envs.onboard.radio.messages import Order

SMALL = {"robots": 2, "map_cells": 32, "lidar": "lidar_360_6m"}


def test_agents_are_those_that_are_left():
    wrapped = TeamWrapper(lidarium.parallel_env("apartment", **SMALL, starts="fixed"))
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
