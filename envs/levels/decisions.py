"""Shared parts of the wrappers of the levels of decision.

Everything but the decisions belongs to the environment.
"""

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from lidarium.envs.exploration import ExplorationEnv, Observation
from lidarium.envs.radio.messages import Order


class DecisionWrapper(ParallelEnv[str, Observation, Any]):
    """Lets another level of decision drive an environment.

    The environment remains the one that keeps the episode.

    Parameters
    ----------
    env : ExplorationEnv
        The environment to drive in.
    name : str
        Name of the wrapped environment.

    Raises
    ------
    ValueError
        Where ``env`` is another environment.
    """

    def __init__(self, env: ExplorationEnv, name: str) -> None:
        self.env = exploration_below(env, type(self).__name__)
        self.metadata = {**env.metadata, "name": name, "render_fps": 1.0 / env.settings.decision_period_s}
        self.possible_agents = env.possible_agents
        self.agents: list[str] = env.agents
        self.render_mode = env.render_mode
        self.settings = env.settings

    @property
    def unwrapped(self) -> ExplorationEnv:
        """The environment below."""
        return self.env

    def stop(self, agent: str, reason: str) -> None:
        """End an agent at its next step, with a reason."""
        self.env.stop(agent, reason)

    def order(self, agent: str, order: Order) -> None:
        """Send an agent an order, as ``ExplorationEnv.order``."""
        self.env.order(agent, order)

    def state(self) -> NDArray[np.float64]:
        """Return the true state of the team."""
        return self.env.state()

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the environment."""
        return self.env.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self.env.close()


def exploration_below(env: Any, wrapper: str) -> ExplorationEnv:  # noqa: ANN401
    """Return the environment below a wrapper.

    Raises
    ------
    ValueError
        Where it is not one of a single team.
    """
    if not isinstance(env, ExplorationEnv):
        what = "a batch of many episodes" if isinstance(env, VectorEnv) else "no team's environment"
        raise ValueError(
            f"{wrapper} is put around {type(env).__name__}, {what}; want an environment of "
            "lidarium.parallel_env"
        )
    return env


def boxes_of(space: spaces.Space[Any]) -> dict[str, spaces.Space[Any]]:
    """Return the parts of a space of observations, by key."""
    assert isinstance(space, spaces.Dict)
    return dict(space.spaces)
