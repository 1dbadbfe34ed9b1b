"""Train a team by PPO of RLlib: one shared network, decisions by frontiers.

Usage: python docs/how_to/trainers/with_rllib.py
"""

from typing import Any

import ray
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.rllib.core.rl_module.rl_module import RLModuleSpec
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune.registry import register_env

import lidarium

TEAM = {"robots": 2, "lidar": "lidar_360_6m", "horizon_s": 60.0, "observe": ["scan", "velocity", "bumper"]}


def make_env(options: dict[str, Any]) -> ParallelPettingZooEnv:
    """Make the environment in RLlib's form: flat observations, infos of numbers."""
    forms = {"observation": "flat", "infos": "none"}
    return ParallelPettingZooEnv(lidarium.parallel_env(**{**TEAM, **forms, **options}))


def train(options: dict[str, Any], iterations: int = 50, steps: int = 4000, runners: int = 0) -> list[dict[str, Any]]:
    """Train; return what RLlib reports of each iteration.

    Parameters
    ----------
    options : dict
        Of ``lidarium.parallel_env``, such as ``floor``.
    iterations, steps : int
        How many iterations, of how many steps of the environment.
    runners : int
        Processes that step environments; 0 for this one.
    """
    register_env("lidarium", make_env)
    config = (
        PPOConfig()
        .environment("lidarium", env_config=options)
        .env_runners(num_env_runners=runners)
        .multi_agent(policies={"shared"}, policy_mapping_fn=lambda *_, **__: "shared")
        .rl_module(rl_module_spec=RLModuleSpec(model_config=DefaultModelConfig(fcnet_hiddens=[64, 64])))
        .training(train_batch_size_per_learner=steps, minibatch_size=min(256, steps), num_epochs=4)
    )
    algorithm = config.build_algo()
    reports = [algorithm.train() for _ in range(iterations)]
    algorithm.stop()
    return reports


if __name__ == "__main__":
    for report in train({"floor": "set:train"}):
        print(report["env_runners"].get("episode_return_mean"))
    ray.shutdown()
