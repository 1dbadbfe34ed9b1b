"""Train a team by stable-baselines3 through SuperSuit: every robot is a row of a vector environment.

``lidarium.sb3_vec_env`` does the same in one kernel call, and is faster.

Usage: python docs/how_to/trainers/with_supersuit.py
"""

from typing import Any

import supersuit
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

import lidarium

TEAM = {"robots": 2, "lidar": "lidar_360_6m", "horizon_s": 60.0, "observe": ["scan", "velocity", "bumper"]}
FORMS = {"observation": "flat", "ended_agents": "zeros"}


def train(options: dict[str, Any], steps: int = 200_000, copies: int = 4, rollout: int = 256) -> PPO:
    """Train; return the model.

    Parameters
    ----------
    options : dict
        Of ``lidarium.parallel_env``, such as ``floor``.
    steps : int
        How many steps of robots.
    copies : int
        How many teams.
    rollout : int
        Steps of each robot between updates.
    """
    team = lidarium.parallel_env(**{**TEAM, **FORMS, **options})
    rows = supersuit.pettingzoo_env_to_vec_env_v1(team)
    env = supersuit.concat_vec_envs_v1(rows, copies, num_cpus=1, base_class="stable_baselines3")
    model = PPO("MlpPolicy", VecMonitor(env), n_steps=rollout, batch_size=rollout)
    return model.learn(steps)


if __name__ == "__main__":
    train({"floor": "set:train"}).save("team")
