"""Train robots by MaskablePPO of sb3-contrib: decisions by frontiers.

Usage: python docs/how_to/trainers/maskable_ppo.py
"""

from typing import Any

import torch
from sb3_contrib import MaskablePPO
from stable_baselines3.common.vec_env import VecMonitor

import lidarium

ROBOT = {"level": "frontier", "observe": ["frontiers", "time_left"], "robots": 1, "horizon_s": 60.0}


def train(
    options: dict[str, Any], steps: int = 100_000, episodes: int = 32, rollout: int = 32
) -> MaskablePPO:
    """Train; return the model.

    Parameters
    ----------
    options : dict
        Of ``lidarium.sb3_vec_env``, such as ``floor``.
    steps : int
        How many decisions in all.
    episodes, rollout : int
        How many episodes at once, and decisions of each between updates.
    """
    env = VecMonitor(lidarium.sb3_vec_env(episodes, **{**ROBOT, **options}))
    size = min(512, episodes * rollout)
    model = MaskablePPO("MultiInputPolicy", env, n_steps=rollout, batch_size=size, n_epochs=4, seed=0)
    return model.learn(steps)


if __name__ == "__main__":
    torch.set_num_threads(1)
    train({"floor": "set:train"}).save("explorer")
