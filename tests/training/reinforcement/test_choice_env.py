"""Decisions one by one."""

from functools import partial

import numpy as np
import pytest

from lidarium.training.places import Place
from lidarium.training.reinforcement.choice_env import EPISODES_PER_FLOOR, ChoiceEnv
from lidarium.training.reinforcement.choices import AskedEpisode, classic_pace
from lidarium.training.settings import TrainingSettings


def place_at(robots, number):
    return Place(f"apartment:{7 + number}", TrainingSettings(settings={"resolution": 0.05}).team(robots), number)


@pytest.fixture
def env():
    made = ChoiceEnv(partial(place_at, 1))
    yield made
    made.close()


def classic(observation):
    scores = np.where(observation["mask"], observation["scores"], -np.inf)
    return np.int64(np.argmax(scores))


def test_classic_choices_gain_nothing_on_classic_tours(env):
    observation, _ = env.reset(seed=0)
    rewards, is_over = [], False
    while not is_over:
        assert env.observation_space.contains(observation)
        np.testing.assert_array_equal(env.action_masks(), observation["mask"])
        observation, reward, is_over, is_cut, info = env.step(classic(observation))
        rewards.append(reward)
        assert not is_cut
    # Before the first decision there is nothing to gain.
    assert sum(rewards) == pytest.approx(0.0, abs=0.05)
    assert info["ratio"] == 1.0
    assert info["coverage"] >= 0.99


def test_rewards_add_up_to_the_time_that_is_saved(env):
    generator = np.random.default_rng(0)
    env.reset()
    begin = env._asked
    left = env._pace.left(begin.coverage)
    total, is_over = 0.0, False
    while not is_over:
        action = np.int64(generator.choice(np.flatnonzero(env.action_masks())))
        _, reward, is_over, _, info = env.step(action)
        total += reward
    rest = (info["ratio"] * env._pace.time_s - begin.time_s) / env._pace.time_s
    assert total == pytest.approx(left - env._pace.left(info["coverage"]) - rest)


def test_an_episode_that_the_horizon_ends_is_truncated(env, monkeypatch):
    monkeypatch.setattr("lidarium.training.reinforcement.choice_env.SLOWEST", 0.5)
    monkeypatch.setattr("lidarium.training.reinforcement.choice_env.SLOWEST_S", 0.0)
    observation, _ = env.reset()
    is_over = is_cut = False
    while not (is_over or is_cut):
        observation, _, is_over, is_cut, info = env.step(classic(observation))
    assert (is_over, is_cut) == (False, True)
    assert info["coverage"] < 0.99


def test_several_episodes_follow_on_the_same_floor(env):
    places = []
    for _ in range(EPISODES_PER_FLOOR + 1):
        env.reset()
        places.append(env._place.floor)
    assert len(set(places[:-1])) == 1
    assert places[-1] != places[0]
    env.begin_at(3)
    env.reset()
    assert env._place.floor == "apartment:10"


def test_actions_that_are_not_on_offer_are_refused(env):
    with pytest.raises(ValueError, match="reset"):
        env.step(np.int64(0))
    env.reset()
    forbidden = int(np.flatnonzero(~env.action_masks())[0])
    with pytest.raises(ValueError, match=f"action {forbidden} is not on offer"):
        env.step(np.int64(forbidden))


def test_errors_of_an_episode_reach_who_asks(monkeypatch):
    def fail(*arguments):
        raise RuntimeError("the floor is gone")

    monkeypatch.setattr("lidarium.training.reinforcement.choices.run_episode", fail)
    with pytest.raises(RuntimeError, match="the floor is gone"):
        AskedEpisode(place_at(1, 0)).ask()


def test_an_abandoned_episode_ends_its_thread():
    episode = AskedEpisode(place_at(2, 0))
    assert episode.ask().decision is not None
    episode.abandon()
    assert not episode._thread.is_alive()


def test_a_pace_falls_from_1_to_0():
    pace = classic_pace(place_at(1, 0))
    left = [pace.left(coverage) for coverage in np.linspace(0.0, 1.0, 20)]
    assert (np.diff(left) <= 0.0).all()
    assert left[-1] == 0.0
    assert 0.8 < left[0] <= 1.0
    assert pace.time_s > 10.0
