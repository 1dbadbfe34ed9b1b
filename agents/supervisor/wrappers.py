"""Environments under a supervisor: whatever decides for the robots, a station joins their maps and directs them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv, VectorWrapper
from numpy.typing import NDArray

from lidarium.agents.policy import Action, Policy
from lidarium.agents.supervisor.policy import Supervised
from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.envs.faces.conventions import MASK
from lidarium.envs.faces.parallel import Observation, Outcome
from lidarium.envs.faces.vector_env import ExplorationVectorEnv, Step
from lidarium.envs.faces.wrapper import TeamWrapper, exploration_below

DIRECTED = "directed"
"""Info: whether the station drives a robot now, so that an action for it is not carried out."""


class _Outside(Policy):
    """Takes the place of the policy whose decisions come from outside."""

    def __init__(self, level: str) -> None:
        self.level = level

    def reset(self, team: Any, seed: int = 0) -> None:  # noqa: ANN401
        """Begin an episode."""

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Decide nothing."""
        del observations
        return {}


class SupervisedTeam(TeamWrapper):
    """A supervisor around the environment of a team: a learner or policy decides for robots that have no order.

    Robots that the station directs do what it orders; an action for them is not carried out. In addition to those of
    the environment below, ``infos[agent]["directed"]`` says whether that is so now; ``infos[agent]["order"]`` is the
    last order as always. With ``masks_orders`` the action mask of such a robot leaves the action to stay alone. Starts
    may be unknown.

    Parameters
    ----------
    env : ParallelEnv
        The environment of a team, at any level of decision.
    settings : SupervisorSettings, optional
        Settings of the supervisor. Those of `SupervisorSettings` by default.
    masks_orders : bool, optional
        Whether action masks show orders. False by default.
    **options
        Any of the settings by name, instead.

    Attributes
    ----------
    supervisor : Supervised
        Decisions, events and joins of the episode.

    Raises
    ------
    ValueError
        If there is no team of one episode below, or ``masks_orders`` is set and there are no masks.
    """

    def __init__(
        self,
        env: Any,  # noqa: ANN401
        settings: SupervisorSettings | None = None,
        masks_orders: bool = False,
        **options: Any,  # noqa: ANN401
    ) -> None:
        self._base = exploration_below(getattr(env, "unwrapped", env), "Supervised")
        super().__init__(env)
        self.metadata = {**env.metadata, "name": str(env.metadata["name"]).replace("_v1", "_supervised_v1")}
        self.supervisor: Supervised = Supervised(_Outside(self._base.level), settings, **options)
        self._masks = masks_orders
        if masks_orders:
            _check_masks(self._base.engine.observation_space.spaces)
        self._free: list[str] = []

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode; see ``ExplorationEnv.reset``."""
        observations, infos = super().reset(seed, options)
        self.supervisor.reset(self._base)
        self._direct(observations, infos)
        return observations, infos

    def step(self, actions: Any) -> Outcome:  # noqa: ANN401
        """Take a step or a decision by the actions of robots without orders, and the orders of the others."""
        if not self.agents:
            return super().step(actions)
        live = self._base.agents
        own = {agent: actions[agent] for agent in self._free if agent in actions}
        outcome = super().step(self.supervisor.complete(live, own))
        self._direct(outcome[0], outcome[4])
        return outcome

    def _direct(self, observations: dict[str, Any], infos: dict[str, dict[str, Any]]) -> None:
        self._free = self.supervisor.direct(self._base.agents)
        for agent, info in infos.items():
            info[DIRECTED] = agent not in self._free
            if self._masks and info[DIRECTED]:
                observations[agent][MASK] = _only_stay(observations[agent][MASK])


class SupervisedBatch(VectorWrapper[Any, Any, Any]):
    """A supervisor around each episode of a batch; see `SupervisedTeam`.

    ``infos["directed"]`` (rows,) says which robots the station drives now.

    Parameters
    ----------
    env : ExplorationVectorEnv
        The episodes, made by ``lidarium.vector_env`` with ``reports=True``.
    settings, masks_orders, **options
        As for `SupervisedTeam`.

    Attributes
    ----------
    supervisors : list of Supervised
        Those of the episodes.
    """

    def __init__(
        self,
        env: ExplorationVectorEnv,
        settings: SupervisorSettings | None = None,
        masks_orders: bool = False,
        **options: Any,  # noqa: ANN401
    ) -> None:
        super().__init__(env)
        self._rows = env.batch
        level = self._rows.team(0).level
        self.supervisors: list[Supervised] = [
            Supervised(_Outside(level), settings, **options) for _ in range(self._rows.episodes)
        ]
        self._masks = masks_orders
        if masks_orders:
            _check_masks(env.single_observation_space)
        self._free: list[list[str]] = [[] for _ in self.supervisors]
        self._agents = env.settings.agents

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:  # noqa: ANN401
        """Begin episodes; see ``ExplorationVectorEnv.reset``."""
        observations, infos = self.env.reset(seed=seed, options=options)
        return self._direct(observations, infos)

    def step(self, actions: Any) -> Step:  # noqa: ANN401
        """Run all episodes by the actions of robots without orders, and the orders of the others."""
        robots = self._rows.robots
        teams = [
            supervisor.complete(
                self._rows.team(episode).agents,
                {agent: _of_row(actions, episode * robots + self._agents.index(agent)) for agent in free},
            )
            for episode, (supervisor, free) in enumerate(zip(self.supervisors, self._free, strict=True))
        ]
        observations, rewards, terminated, truncated, infos = self.env.step(teams)
        observations, infos = self._direct(observations, infos)
        return observations, rewards, terminated, truncated, infos

    def _direct(self, observations: Any, infos: dict[str, Any]) -> tuple[Any, dict[str, Any]]:  # noqa: ANN401
        robots = self._rows.robots
        directed: NDArray[np.bool_] = np.ones(self.num_envs, np.bool_)
        for episode, supervisor in enumerate(self.supervisors):
            team = self._rows.team(episode)
            if team.time_s == 0.0:
                supervisor.reset(team)
            self._free[episode] = supervisor.direct(team.agents)
            for agent in self._free[episode]:
                directed[episode * robots + self._agents.index(agent)] = False
        if self._masks:
            masks = observations[MASK].copy()
            masks[directed] = _only_stay(masks[directed])
            observations = {**observations, MASK: masks}
        return observations, {**infos, DIRECTED: directed, f"_{DIRECTED}": np.ones(self.num_envs, np.bool_)}


def supervise(env: Any, settings: SupervisorSettings | None = None, **options: Any) -> Any:  # noqa: ANN401
    """Return the wrapper of an environment of one team, or of a batch of them."""
    if isinstance(env, VectorEnv):
        if not isinstance(env, ExplorationVectorEnv):
            raise ValueError(f"Supervised is put around {type(env).__name__}; want a batch of lidarium.vector_env")
        return SupervisedBatch(env, settings, **options)
    return SupervisedTeam(env, settings, **options)


def _check_masks(spaces: Any) -> None:  # noqa: ANN401
    if MASK not in spaces:
        raise ValueError("masks_orders is set, but there are no masks; want level='frontier'")


def _only_stay(mask: NDArray[Any]) -> NDArray[Any]:
    """Return a mask, or some, that leaves the last action alone: to stay."""
    left = np.zeros_like(mask)
    left[..., -1] = 1
    return left


def _of_row(actions: Any, row: int) -> Any:  # noqa: ANN401
    if isinstance(actions, Mapping):
        return {name: _of_row(each, row) for name, each in actions.items()}
    return actions[row]
