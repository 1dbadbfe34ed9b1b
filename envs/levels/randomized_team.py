"""A team whose settings are drawn for each episode (domain randomisation)."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.levels.team_sizes import fits_into, largest_team, padded
from lidarium.envs.outcome.team_state import ROBOT_NUMBERS
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import set_values
from lidarium.envs.settings.reset_options import checked_seed
from lidarium.envs.team_wrapper import TeamWrapper
from lidarium.mapping.geometry.bounds import shown

Distribution = Callable[[np.random.Generator], Any] | tuple[float, float] | list[Any]
"""Of a setting: a callable of a generator; (low, high) for all between; a list of which each is as likely."""

Distributions = Mapping[str, Distribution]
"""By the names of settings, such as ``lidar.noise_floor``."""

ROBOTS = "robots"
"""The setting by which teams differ in size."""

SETTINGS_STREAM = 77
"""Separates the draws of settings from those of floors, starts and noise."""


class RandomizedTeam(TeamWrapper):
    """Draws settings at each reset, and makes an environment of them.

    Parameters
    ----------
    make : callable
        Takes settings and the number of the episode and returns the environment.
    settings : ExplorationSettings
        What is not drawn.
    distributions : mapping
        From names of settings to `Distribution`.

    Notes
    -----
    Where ``robots`` is drawn, ``possible_agents`` are those of the largest team, and ``agents`` those of the
    episode. Observations of teammates have rows for the largest team, zeros behind those of the episode, and
    so has the state.

    Attributes
    ----------
    drawn : dict
        What was drawn for this episode, by name.

    Raises
    ------
    ValueError
        Where a name or a distribution is none, a draw is no value of its setting, or draws change the spaces
        of observations or actions.
    """

    def __init__(
        self,
        make: Callable[[ExplorationSettings, int], Any],
        settings: ExplorationSettings,
        distributions: Distributions,
    ) -> None:
        check_distributions(distributions)
        self._make, self._fixed, self._distributions = make, settings, dict(distributions)
        self._generator = np.random.default_rng(0)
        self._episode, self.drawn = 0, dict[str, Any]()
        most = largest_team(distributions[ROBOTS]) if ROBOTS in distributions else None
        first = self._next(0)
        super().__init__(first)
        largest = first
        if most is not None:
            self.drawn[ROBOTS] = most
            largest = self._made(0)
            self.possible_agents = largest.possible_agents
        agent = self.possible_agents[0]
        self._spaces: tuple[spaces.Space[Any], spaces.Space[Any]] = (
            largest.observation_space(agent),
            largest.action_space(agent),
        )
        self._state_space = largest.state_space
        self._has_begun = False

    def _next(self, episode: int) -> Any:  # noqa: ANN401
        self.drawn = {name: draw(each, self._generator) for name, each in self._distributions.items()}
        return self._made(episode)

    def _made(self, episode: int) -> Any:  # noqa: ANN401
        return self._make(set_values(self._fixed, self.drawn), episode)

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations, that of the largest team."""
        self._check_agent(agent)
        return self._spaces[0]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's actions."""
        self._check_agent(agent)
        return self._spaces[1]

    def _check_agent(self, agent: str) -> None:
        if agent not in self.possible_agents:
            raise ValueError(f"{agent!r} is not among the agents {self.possible_agents}")

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start an episode of newly drawn settings; see ``ExplorationEnv.reset``."""
        seed = checked_seed(seed)
        if seed is not None:
            self._generator = np.random.default_rng((seed, SETTINGS_STREAM))
        elif not self._has_begun:
            self._generator = np.random.default_rng()
        made = self._next(self._episode)
        agent = self.possible_agents[0]
        fits = fits_into(made.observation_space(agent), self._spaces[0])
        if not fits or made.action_space(agent) != self._spaces[1]:
            raise ValueError(
                f"settings drawn are {self.drawn}; want some that leave the spaces of observations and "
                "actions as they are: learners have one for all episodes"
            )
        self.env.close()
        self.env, self.settings, self._has_begun = made, made.settings, True
        own = int(self._generator.integers(2**31)) if seed is None else seed
        observations, infos = super().reset(own, options)
        self._episode += 1
        return self._padded(observations), infos

    def step(self, actions: Any) -> Any:  # noqa: ANN401
        """Take a step or a decision."""
        observations, *others = super().step(actions)
        return (self._padded(observations), *others)

    def _padded(self, observations: dict[str, Any]) -> dict[str, Any]:
        if ROBOTS not in self._distributions:
            return observations
        return {agent: padded(each, self._spaces[0]) for agent, each in observations.items()}

    @property
    def state_space(self) -> spaces.Box:
        """The space of ``state``, that of the largest team."""
        space: spaces.Box = self._state_space
        return space

    def state(self) -> NDArray[np.float32]:
        """Return the true state of the team, zeros for robots that it lacks."""
        state = super().state()
        own = self.settings.robots * len(ROBOT_NUMBERS)
        lacking = np.zeros(len(self._state_space.low) - len(state), np.float32)
        return np.concatenate([state[:own], lacking, state[own:]])


def check_distributions(distributions: Any) -> None:  # noqa: ANN401
    """Check that there are distributions by name.

    Raises
    ------
    ValueError
        Where there are none, or one is of no kind of `Distribution`.
    """
    if not isinstance(distributions, Mapping) or not distributions:
        raise ValueError(
            f"randomize is {shown(distributions)}; want a dict from names of settings to distributions, such "
            'as {"lidar.noise_floor": (0.0, 0.05)}'
        )
    for name, each in distributions.items():
        is_range = isinstance(each, tuple) and len(each) == 2 and _are_numbers(each) and each[0] <= each[1]
        if not (callable(each) or is_range or (isinstance(each, list) and each)):
            raise ValueError(
                f"the distribution of {name} is {shown(each)}; want (low, high), a list to choose from, or a "
                "callable of a generator"
            )


def _are_numbers(values: Sequence[Any]) -> bool:
    return all(
        isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value)
        for value in values
    )


def draw(distribution: Distribution, generator: np.random.Generator) -> Any:  # noqa: ANN401
    """Return a value; between whole numbers it is one, both ends included."""
    if isinstance(distribution, list):
        return distribution[int(generator.integers(len(distribution)))]
    if isinstance(distribution, tuple):
        low, high = distribution
        is_whole = isinstance(low, int) and isinstance(high, int)
        return (
            int(generator.integers(int(low), int(high) + 1))
            if is_whole
            else float(generator.uniform(low, high))
        )
    return distribution(generator)
