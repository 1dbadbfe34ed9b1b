"""Numbers that robots send each other: who hears them, when, and in which form."""

import numpy as np
import pytest
from talking_teams import OPTIONS, actions, drawn

import lidarium
from lidarium.envs.settings.radio import RadioSettings


@pytest.mark.parametrize("level", ["velocity", "waypoint"])
def test_everybody_hears_everybody_over_the_ideal_radio(level):
    env = lidarium.parallel_env("apartment", level=level, comm=2, **OPTIONS)
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
    env = lidarium.parallel_env("apartment", comm=2, radio="none", **OPTIONS)
    env.reset(seed=0)
    draws = drawn(env)
    for _ in range(5):
        observations = env.step(actions(env, draws))[0]
        assert not any(observation["messages"].any() for observation in observations.values())


def test_what_was_heard_ages_where_the_radio_fails():
    radio = RadioSettings(kind="range", reach=50.0, loss=0.6)
    env = lidarium.parallel_env("apartment", comm=1, radio=radio, **OPTIONS)
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
    env = lidarium.parallel_env("apartment", comm=1, radio=radio, **OPTIONS)
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


@pytest.mark.parametrize("level", ["velocity", "frontier"])
def test_rows_of_a_batch_hear_the_same(level):
    radio = RadioSettings(kind="range", reach=6.0, loss=0.3, latency_s=0.2)
    options = {**OPTIONS, "level": level, "comm": 2, "radio": radio, "horizon_s": 4.0}
    batch = lidarium.vector_env(2, "apartment", **options)
    teams = [lidarium.parallel_env("apartment", **options) for _ in range(2)]
    assert batch.single_observation_space == teams[0].observation_space("robot_0")
    assert batch.single_action_space == teams[0].action_space("robot_0")
    observations, _ = batch.reset(seed=3)
    alone = [env.reset(seed=3 + k)[0] for k, env in enumerate(teams)]
    generator = np.random.default_rng(1)
    for _ in range(60 if level == "velocity" else 8):
        for episode, own in enumerate(alone):
            for agent, observation in own.items():
                row = 3 * episode + int(agent[-1])
                assert np.array_equal(observations["messages"][row], observation["messages"])
        numbers = generator.uniform(-1.0, 1.0, (6, 4)).astype(np.float32)
        rows = {"action": np.zeros(6, np.int64), "message": numbers[:, 2:]} if level == "frontier" else numbers
        observations = batch.step(rows)[0]
        for episode, env in enumerate(teams):
            own = {
                agent: {"action": 0, "message": numbers[3 * episode + k, 2:]}
                if level == "frontier"
                else numbers[3 * episode + k]
                for k, agent in enumerate(env.possible_agents)
            }
            alone[episode] = env.step(own)[0] if env.agents else env.reset()[0]


def test_rows_for_stable_baselines_talk():
    pytest.importorskip("stable_baselines3")
    env = lidarium.sb3_vec_env(2, "apartment", comm=2, horizon_s=1.0, **OPTIONS)
    env.seed(0)
    env.reset()
    dones = 0
    for _ in range(15):
        observations, _, done, infos = env.step(np.full((6, 4), 0.25, np.float32))
        dones += int(done.any())
        heard = infos[0]["terminal_observation"]["messages"] if done[0] else observations["messages"][0]
        assert heard[:, :2].tolist() == [[0.25, 0.25]] * 2
        if done[0]:
            assert not observations["messages"].any()
    assert dones
