"""Environments of teams at a level, in the forms of conventions."""

import numpy as np
import pytest

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.faces.teams import make_team
from lidarium.envs.settings.making import make_settings


def test_levels_are_of_one_environment_and_may_change_between_episodes():
    env = make_team("scene_room", {"robots": 2}, level="waypoint")
    assert type(env) is ExplorationEnv
    assert env.driver is not None
    assert env.metadata["name"] == "lidarium_waypoint_exploration_v1"
    env.use_level("velocity")
    assert env.driver is None
    observations, _ = env.reset(seed=0)
    assert env.observation_space("robot_0").contains(observations["robot_0"])
    env.use_level("frontier")
    observations, _ = env.reset(seed=0)
    assert env.observation_space("robot_0").contains(observations["robot_0"])
    assert env.action_masks("robot_0")[-1]


def test_unknown_levels_and_what_a_level_lacks_are_refused():
    with pytest.raises(ValueError, match=r"unknown level 'thought'.*velocity"):
        make_team("scene_room", {"robots": 1}, level="thought")
    with pytest.raises(ValueError, match="needs level='frontier'"):
        make_team("scene_room", {"robots": 1, "observe": ("scan", "frontier_gains")})


def test_the_curriculum_of_an_episode_is_asked_for_that_one_alone():
    asked = []

    def curriculum(number):
        asked.append(number)
        return {"starts": np.array([[1.0, 1.0, 0.0]])}

    drawn = {"randomize": {"time_step": (0.05, 0.1)}}
    env = make_team("scene_room", drawn, make_settings(robots=1), curriculum=curriculum)
    for _ in range(3):
        env.reset(seed=0, options={"starts": "fixed"})
    assert asked == [0, 1, 2]
