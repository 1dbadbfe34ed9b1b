"""Running a policy through an episode, at every action level."""

import numpy as np
import pytest

import lidarium
from lidarium.agents import Policy, Stop
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode


class FirstFrontier(Policy):
    """Takes the cheapest frontier on offer."""

    level, shares_map = "frontier", True

    def reset(self, team, seed):
        self.team = team

    def act(self, observations):
        return {agent: 0 if observation["action_mask"][0] else 16 for agent, observation in observations.items()}


class StopsAfter(Policy):
    """Stands for some steps and stops, each robot with a reason of its own."""

    level, shares_map = "velocity", True

    def reset(self, team, seed):
        self.team, self.steps = team, 0

    def act(self, observations):
        self.steps += 1
        return {
            agent: Stop(f"tired of {agent}") if self.steps > 3 else np.zeros(2, np.float32) for agent in observations
        }


def test_a_policy_that_chooses_among_frontiers_explores_the_apartment():
    env = ExplorationEnv("apartment", make_settings(robots=2, horizon_s=900.0))
    episode = run_episode(FirstFrontier(), env, seed=0)
    assert env.scorer.coverage >= 0.98
    assert set(env.scorer.ended_because) == {"robot_0", "robot_1"}
    assert env.world.collisions.sum() == 0
    assert len(episode.decision_seconds) > 5


def test_a_policys_stop_ends_its_robot_with_its_reason():
    env = ExplorationEnv("apartment", make_settings(robots=2))
    run_episode(StopsAfter(), env, seed=0)
    assert env.scorer.ended_because == {"robot_0": "tired of robot_0", "robot_1": "tired of robot_1"}
    assert env.scorer.time == pytest.approx(0.4)


def test_an_unknown_level_is_refused_before_anything_runs():
    policy = FirstFrontier()
    policy.level = "thought"
    with pytest.raises(ValueError, match="thought"):
        run_episode(policy, ExplorationEnv("apartment", make_settings(robots=1)), seed=0)


def test_an_environment_of_drawn_settings_is_refused():
    env = lidarium.parallel_env("scene_room", robots=2, resolution=0.1, randomize={"lidar.noise_floor": (0.0, 0.001)})
    with pytest.raises(ValueError, match="env is a RandomizedTeam; want an environment of `parallel_env` without rand"):
        run_episode(lidarium.policy("nearest_frontier"), env, seed=0)
