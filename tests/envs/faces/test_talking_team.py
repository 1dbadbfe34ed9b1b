"""A team whose robots send each other numbers with their actions."""

import numpy as np
import pytest
from talking_teams import OPTIONS, actions, drawn

import lidarium


def test_messages_do_not_change_how_robots_drive():
    env, mute = (lidarium.parallel_env("apartment", comm=floats, **OPTIONS, starts="fixed") for floats in (3, 0))
    env.reset(seed=0)
    mute.reset(seed=0)
    draws = drawn(env)
    for _ in range(5):
        sent = actions(env, draws)
        env.step(sent)
        mute.step({agent: action[:2] for agent, action in sent.items()})
        assert np.array_equal(env.unwrapped.world.poses, mute.world.poses)


def test_choices_of_frontiers_have_messages_beside():
    env = lidarium.parallel_env("apartment", level="frontier", comm=1, **OPTIONS, starts="fixed")
    env.reset(seed=0)
    action = {"action": 0, "message": [0.5]}
    observations = env.step(dict.fromkeys(env.agents, action))[0]
    assert (observations["robot_1"]["messages"][:, 0] == 0.5).all()
    with pytest.raises(ValueError, match=r"the action of robot_0 is 3; want \{'action'"):
        env.step(dict.fromkeys(env.agents, 3))


@pytest.mark.parametrize("action", [None, [0.1, 0.2], "hello", [0.1, 0.2, float("nan")]])
def test_actions_without_a_message_are_refused_by_name(action):
    env = lidarium.parallel_env("apartment", comm=1, **{**OPTIONS, "robots": 2}, starts="fixed")
    env.reset(seed=0)
    good = np.zeros(3, np.float32)
    with pytest.raises(ValueError, match="robot_1"):
        env.step({"robot_0": good, "robot_1": action})
