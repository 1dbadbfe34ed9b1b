"""Numbers that robots send each other: who hears them, when, and in which form."""

import numpy as np
import pytest
from talking_teams import OPTIONS, actions, drawn

import lidarium
from lidarium.envs.settings.radio import RadioSettings


@pytest.mark.parametrize("level", ["velocity", "waypoint"])
def test_everybody_hears_everybody_over_the_ideal_radio(level):
    env = lidarium.parallel_env("apartment", level=level, comm=2, **OPTIONS, starts="fixed")
    observations, _ = env.reset(seed=0)
    assert env.action_space("robot_0").shape == (4,)
    assert not any(observation["messages"].any() for observation in observations.values())
    draws = drawn(env)
    for _ in range(3):
        sent = actions(env, draws)
        observations = env.step(sent)[0]
        for agent, observation in observations.items():
            others = [other for other in env.possible_agents if other != agent]
            assert env.observation_space(agent).contains(observation)
            assert np.array_equal(observation["messages"][:, :2], [sent[other][2:] for other in others])
            assert observation["messages"][:, 2:].tolist() == [[0.0, 1.0]] * 2


def test_nobody_hears_anything_without_a_radio():
    env = lidarium.parallel_env("apartment", comm=2, radio="none", **OPTIONS, starts="fixed")
    env.reset(seed=0)
    draws = drawn(env)
    for _ in range(5):
        observations = env.step(actions(env, draws))[0]
        assert not any(observation["messages"].any() for observation in observations.values())


def test_what_was_heard_ages_where_the_radio_fails():
    radio = RadioSettings(kind="range", reach=50.0, loss=0.6)
    env = lidarium.parallel_env("apartment", comm=1, radio=radio, **OPTIONS, starts="fixed")
    env.reset(seed=0)
    draws, ages = drawn(env), set()
    for _ in range(30):
        sent = actions(env, draws)
        for agent, observation in env.step(sent)[0].items():
            others = [other for other in env.possible_agents if other != agent]
            for other, (number, age, known) in zip(others, observation["messages"], strict=True):
                ages.add(round(float(age), 1))
                if known and age == 0.0:
                    assert number == sent[other][2]
    assert len(ages) > 3


def test_messages_arrive_late_where_the_radio_has_latency():
    radio = RadioSettings(kind="range", reach=50.0, latency_s=0.3)
    env = lidarium.parallel_env("apartment", comm=1, radio=radio, **OPTIONS, starts="fixed")
    env.reset(seed=0)
    draws, log = drawn(env), []
    for step in range(10):
        log.append(actions(env, draws))
        heard = env.step(log[-1])[0]["robot_0"]["messages"][0]
        if step < 3:
            assert heard.tolist() == [0.0, 0.0, 0.0]
        else:
            assert heard[0] == log[step - 3]["robot_1"][2]
            assert heard[1:].tolist() == [np.float32(0.3), 1.0]


def test_a_robot_alone_has_nobody_to_talk_to():
    with pytest.raises(ValueError, match="comm is 2 and robots is 1; want two robots or more"):
        lidarium.parallel_env("apartment", comm=2, robots=1)
    with pytest.raises(ValueError, match="comm is -1"):
        lidarium.parallel_env("apartment", comm=-1)


def test_messages_on_the_way_outlast_the_beginning_of_other_episodes():
    radio = {"kind": "all", "latency_s": 0.5}
    env = lidarium.vector_env(2, "apartment", comm=1, radio=radio, **OPTIONS, starts="fixed")
    heard = []
    for resets in (False, True):
        env.reset(seed=[0, 0])
        rows = []
        for step in range(12):
            sent = np.zeros((env.num_envs, 3), np.float32)
            sent[:, 2] = 0.05 * step
            observations = env.step(sent)[0]
            rows.append(observations["messages"][0].copy())
            if resets:
                env.reset(options={"episodes": np.array([False, True])})
        heard.append(np.array(rows))
    assert heard[0][:, 0, 2].tolist() == [0.0] * 5 + [1.0] * 7
    np.testing.assert_array_equal(heard[1], heard[0])


def test_messages_that_were_sent_are_not_written_over():
    env = lidarium.vector_env(2, "apartment", robots=2, comm=2, observe=["velocity"], lidar={"beams": 40})
    env.reset(seed=0)
    actions = np.ones((4, 4))
    actions.flags.writeable = False
    env.step(actions)
    team = {f"robot_{k}": np.array([0.0, 0.0, 0.5, 0.5]) for k in range(2)}
    env.step([team, team])


def test_messages_of_rows_that_do_not_act_are_not_read():
    env = lidarium.vector_env(2, "apartment", robots=2, comm=2, observe=["velocity"], lidar={"beams": 40})
    env.reset(seed=0)
    env.team(0).stop("robot_0", "done")
    env.step(np.zeros((4, 4)))
    actions = np.zeros((4, 4))
    actions[0] = np.nan
    env.step(actions)
    actions[1, 3] = np.nan
    with pytest.raises(ValueError, match="want the action with 2 numbers behind it, all finite"):
        env.step(actions)


@pytest.mark.parametrize("action", [np.zeros(2), np.zeros(5), np.zeros((2, 4))])
def test_an_action_without_its_message_is_shown_as_it_was_given(action):
    env = lidarium.parallel_env("apartment", comm=2, **OPTIONS, starts="fixed")
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"of robot_0 is array\(\[.*; want the action with 2 numbers behind"):
        env.step(dict.fromkeys(env.agents, action))
