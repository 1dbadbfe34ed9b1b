"""Observations, rewards, infos and ends in the forms that trainers want, alone and in batches."""

import re

import gymnasium
import numpy as np
import pytest
from conventional_teams import AHEAD, CLOSET, ENDING, make, step

import lidarium


def test_the_level_of_frontiers_alone_has_masks():
    for place in ("beside", "infos"):
        with pytest.raises(ValueError, match=f"action_mask is '{place}', but observations have none"):
            make(action_mask=place)
    solo = gymnasium.make("lidarium/FrontierExploration-v1", floor="scene_room", observation="flat").unwrapped
    observation, _ = solo.reset(seed=0)
    assert solo.action_masks().dtype == np.bool_
    assert np.array_equal(solo.action_masks(), observation[:33] == 1.0)
    with pytest.raises(AttributeError, match="level of frontiers only"):
        gymnasium.make("lidarium/Exploration-v1", floor="scene_room").unwrapped.action_masks()


@pytest.mark.parametrize(
    ("option", "value"),
    [("observation", "box"), ("infos", True), ("ended_agents", "stay"), ("action_mask", None)],
)
def test_unknown_forms_are_refused_with_the_known_ones(option, value):
    with pytest.raises(ValueError, match=re.escape(f"{option} is {value!r}")):
        make(**{option: value})


def test_a_share_beyond_the_whole_is_refused():
    with pytest.raises(ValueError, match=r"team_reward is 1\.5"):
        make(team_reward=1.5)


@pytest.mark.parametrize(("level", "mask"), [("velocity", None), ("frontier", "beside"), ("frontier", "infos")])
def test_rows_of_a_batch_take_the_forms_of_single_teams(level, mask):
    forms = {"observation": "flat", "infos": "flat", "team_reward": 0.5}
    if mask is not None:
        forms["action_mask"] = mask
    options = {**ENDING, "level": level, **forms}
    batch = lidarium.vector_env(2, CLOSET, **options)
    teams = [lidarium.parallel_env(CLOSET, **options) for _ in range(2)]
    observations, infos = batch.reset(seed=6)
    alone = [env.reset(seed=6 + k) for k, env in enumerate(teams)]
    assert batch.single_observation_space == teams[0].observation_space("robot_0")
    assert batch.observation_space.contains(observations)
    for _ in range(25):
        for episode, (own, *_, told) in enumerate(alone):
            for agent in own:
                row = 2 * episode + int(agent[-1])
                pairs = (
                    [(observations[name][row], own[agent][name]) for name in own[agent]]
                    if mask == "beside"
                    else [(observations[row], own[agent])]
                )
                assert all(np.array_equal(mine, theirs) for mine, theirs in pairs)
                for name, value in told[agent].items():
                    assert np.array_equal(infos[name][row], value), name
        action = 0 if level == "frontier" else AHEAD
        observations, rewards, *_, infos = batch.step(np.array([action] * 4))
        alone = [step(env, action) if env.agents else env.reset() for env in teams]
        for episode, outcome in enumerate(alone):
            for agent, reward in outcome[1].items() if len(outcome) == 5 else ():
                assert rewards[2 * episode + int(agent[-1])] == reward


def test_rows_for_stable_baselines_take_the_forms():
    pytest.importorskip("stable_baselines3")
    env = lidarium.sb3_vec_env(2, CLOSET, observation="flat", infos="flat", team_reward=1.0, **ENDING)
    env.seed(0)
    assert env.observation_space.contains(env.reset()[0])
    ends = 0
    for _ in range(40):
        observations, rewards, dones, infos = env.step(np.array([AHEAD] * 4))
        assert observations.shape == (4, *env.observation_space.shape)
        for row, info in enumerate(infos):
            assert "truth.coverage" in info
            if dones[row]:
                ends += 1
                assert env.observation_space.contains(info["terminal_observation"])
        assert rewards.dtype == np.float32
    assert ends
