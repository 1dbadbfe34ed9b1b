"""Train a team by IPPO of AgileRL: one network for all robots.

Usage: python docs/how_to/trainers/with_agilerl.py
"""

from functools import partial
from typing import Any

from agilerl.algorithms import IPPO
from agilerl.training.train_multi_agent_on_policy import train_multi_agent_on_policy
from agilerl.vector import AsyncPettingZooVecEnv

import lidarium

TEAM = {"robots": 2, "lidar": "lidar_360_6m", "horizon_s": 60.0, "observe": ["scan", "velocity", "bumper"]}
FORMS = {"observation": "flat", "infos": "none", "ended_agents": "zeros"}


def train(options: dict[str, Any], steps: int = 100_000, rollout: int = 1024, copies: int = 2) -> list[float]:
    """Train; return the scores of the evaluations.

    Parameters
    ----------
    options : dict
        Of ``lidarium.parallel_env``, such as ``floor``.
    steps, rollout : int
        Steps in all, and of each rollout.
    copies : int
        Processes, each with a team.
    """
    make = partial(lidarium.parallel_env, **{**TEAM, **FORMS, **options})
    team = make()
    learner = IPPO(
        [team.observation_space(agent) for agent in team.possible_agents],
        [team.action_space(agent) for agent in team.possible_agents],
        agent_ids=team.possible_agents,
        learn_step=rollout,
    )
    env = AsyncPettingZooVecEnv([make] * copies)
    _, scores = train_multi_agent_on_policy(
        env, "lidarium", "IPPO", [learner], max_steps=steps, evo_steps=rollout, eval_steps=100, verbose=False
    )
    return [float(score) for score in scores]


if __name__ == "__main__":
    print(train({"floor": "set:train"}))
