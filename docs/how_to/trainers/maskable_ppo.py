"""Train robots by MaskablePPO of sb3-contrib: decisions by frontiers.

Usage: python docs/how_to/trainers/maskable_ppo.py [DECISIONS]

It prints how many decisions a second it took, once all is compiled.
"""

import sys
import time
from typing import Any

import torch
from sb3_contrib import MaskablePPO
from stable_baselines3.common.vec_env import VecMonitor

import lidarium

ROBOT = {"level": "frontier", "observe": ["frontiers", "time_left"], "robots": 1, "horizon_s": 60.0}


def make(options: dict[str, Any], episodes: int = 64, rollout: int = 32) -> MaskablePPO:
    """Make a model that has not learned yet.

    Parameters
    ----------
    options : dict
        Of ``lidarium.sb3_vec_env``, such as ``floor``.
    episodes, rollout : int
        How many episodes at once, and decisions of each between updates.
    """
    env = VecMonitor(lidarium.sb3_vec_env(episodes, **{**ROBOT, **options}))
    size = min(512, episodes * rollout)
    return MaskablePPO("MultiInputPolicy", env, n_steps=rollout, batch_size=size, n_epochs=4, seed=0)


def train(model: MaskablePPO, decisions: int = 200_000) -> float:
    """Train for so many decisions; return how many a second, without the first rollout."""
    first = model.n_steps * model.n_envs
    model.learn(first)
    began = time.perf_counter()
    model.learn(max(decisions - first, first), reset_num_timesteps=False)
    return (model.num_timesteps - first) / (time.perf_counter() - began)


if __name__ == "__main__":
    torch.set_num_threads(1)  # the network is small: the kernels need the cores more
    learner = make({"floor": "set:train"})
    print(f"{train(learner, *map(int, sys.argv[1:2])):.0f} decisions a second")
    learner.save("explorer")
