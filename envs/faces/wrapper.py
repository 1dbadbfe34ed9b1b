"""A wrapper around the environment of a team that passes everything on."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from lidarium.envs.faces.parallel import ExplorationEnv, Observation, Outcome
from lidarium.envs.onboard.belief import Belief
from lidarium.envs.onboard.radio.messages import Order


class TeamWrapper(ParallelEnv[str, Any, Any]):
    """Passes everything on to the environment below; subclasses override the methods that they change.

    Parameters
    ----------
    env : ParallelEnv
        The environment of a team, at any action level.

    Notes
    -----
    If settings are drawn, each reset replaces ``unwrapped`` and its engine: subclasses must not keep parts of them.
    """

    def __init__(self, env: Any) -> None:  # noqa: ANN401
        self.env = env
        self.metadata = env.metadata
        self.possible_agents, self.agents = env.possible_agents, env.agents
        self.render_mode, self.settings = env.render_mode, env.settings

    @property
    def unwrapped(self) -> ExplorationEnv:
        """The environment that keeps the episode."""
        base: ExplorationEnv = self.env.unwrapped
        return base

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations, the same object at each call."""
        space: spaces.Space[Any] = self.env.observation_space(agent)
        return space

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's actions, the same object at each call."""
        space: spaces.Space[Any] = self.env.action_space(agent)
        return space

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode; see ``ExplorationEnv.reset``."""
        outcome: tuple[dict[str, Observation], dict[str, dict[str, Any]]] = self.env.reset(seed, options)
        self.agents, self.settings = self.env.agents, self.env.settings
        return outcome

    def step(self, actions: Any) -> Outcome:  # noqa: ANN401
        """Take a step or a decision."""
        outcome: Outcome = self.env.step(actions)
        self.agents = self.env.agents
        return outcome

    def use_level(self, name: str, shares_map: bool = True, decision_period_s: float | None = None) -> None:
        """Let actions be those of another action level; see ``ExplorationEnv.use_level``."""
        self.env.use_level(name, shares_map, decision_period_s)
        self.agents = self.env.agents

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        time: float = self.env.time_s
        return time

    def columns(self, agent: str) -> tuple[tuple[str, int, int], ...]:
        """Return the columns of each key of an agent's observation in the flat form; see `flat_columns`."""
        columns: tuple[tuple[str, int, int], ...] = self.env.columns(agent)
        return columns

    def action_masks(self, agent: str) -> NDArray[np.bool_]:
        """Return which actions an agent may choose now, (actions,)."""
        masks: NDArray[np.bool_] = self.env.action_masks(agent)
        return masks

    def belief(self, agent: str) -> Belief:
        """Return the handle on the belief of an agent's onboard software."""
        belief: Belief = self.env.belief(agent)
        return belief

    def stop(self, agent: str, reason: str) -> None:
        """End an agent at its next step, with a reason."""
        self.env.stop(agent, reason)

    def order(self, agent: str, order: Order) -> None:
        """Send an agent an order, as ``ExplorationEnv.order``."""
        self.env.order(agent, order)

    @property
    def state_space(self) -> spaces.Box:
        """The space of ``state``."""
        space: spaces.Box = self.env.state_space
        return space

    def state(self) -> NDArray[np.float32]:
        """Return the true state of the team."""
        state: NDArray[np.float32] = self.env.state()
        return state

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the environment."""
        frame: NDArray[np.uint8] | None = self.env.render()
        return frame

    def close(self) -> None:
        """Close the window, if there is one."""
        self.env.close()


def exploration_below(env: Any, wrapper: str) -> ExplorationEnv:  # noqa: ANN401
    """Return the environment below a wrapper.

    Raises
    ------
    ValueError
        If it is not one of a single team.
    """
    if not isinstance(env, ExplorationEnv):
        kind = "a batch of many episodes" if hasattr(env, "num_envs") else "no team's environment"
        raise ValueError(
            f"{wrapper} is put around {type(env).__name__}, {kind}; want an environment of lidarium.parallel_env"
        )
    return env
