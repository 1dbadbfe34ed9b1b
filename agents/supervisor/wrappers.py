"""Supervisors around environments and batches: learners and policies decide for robots that have no order."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.spaces import Dict, Space
from gymnasium.vector import VectorWrapper
from numpy.typing import NDArray

from lidarium.agents.policy import Action
from lidarium.envs.faces.conventions import MASK
from lidarium.envs.faces.parallel import Observation, Outcome
from lidarium.envs.faces.vector_env import BatchFace, ExplorationVectorEnv, Step
from lidarium.envs.faces.wrapper import TeamWrapper, exploration_below

if TYPE_CHECKING:
    from lidarium.agents.supervisor.policy import Supervised

    _BatchWrapper = VectorWrapper[Any, Any, Any]
else:
    _BatchWrapper = VectorWrapper  # Gymnasium 1.1 has no parameters there

Make = Callable[[str], "Supervised"]
"""Makes a supervisor of robots at a level, whose policy decides elsewhere."""

DIRECTED = "directed"
"""Info: whether the station drives a robot now, so that an action for it is not carried out."""


class SupervisedTeam(TeamWrapper):
    """A supervisor around the environment of a team: a learner or policy decides for robots that have no order.

    Robots under an order of the station ignore the actions given for them. In addition to the infos of
    the environment below, ``infos[agent]["directed"]`` is True for these robots; ``infos[agent]["order"]`` is the
    last order as always. With ``masks_orders`` the action mask of such a robot leaves the action to stay alone. Starts
    may be unknown.

    Parameters
    ----------
    env : ParallelEnv
        The environment of a team, at any action level.
    make : callable
        Takes the level and returns a supervisor.
    masks_orders : bool, optional
        Whether action masks show orders. False by default.

    Attributes
    ----------
    supervisor : Supervised
        Decisions, events and joins of the episode.

    Raises
    ------
    ValueError
        If the environment does not hold a single team, or ``masks_orders`` is set without action masks.
    """

    def __init__(
        self,
        env: Any,  # noqa: ANN401
        make: Make,
        masks_orders: bool = False,
    ) -> None:
        base = exploration_below(getattr(env, "unwrapped", env), "Supervised")
        if base.conventions.comm:
            raise ValueError(
                f"comm is {base.conventions.comm}; want 0 under a supervisor: robots under orders send no messages"
            )
        super().__init__(env)
        self.metadata = {**env.metadata, "name": str(env.metadata["name"]).replace("_v1", "_supervised_v1")}
        self.supervisor = make(base.level)
        self._masks = masks_orders
        if masks_orders:
            check_masks(env.observation_space(env.possible_agents[0]))
        self._free: list[str] = []

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode; see ``ExplorationEnv.reset``."""
        observations, infos = super().reset(seed, options)
        self.supervisor.reset(self.unwrapped)
        self._direct(observations, infos)
        return observations, infos

    def step(self, actions: Any) -> Outcome:  # noqa: ANN401
        """Take a step or a decision by the actions of robots without orders, and the orders of the others."""
        if not self.agents:
            return super().step(actions)
        live = self.unwrapped.agents
        own = {agent: actions[agent] for agent in self._free if agent in actions}
        outcome = super().step(self.supervisor.complete(live, own))
        self._direct(outcome[0], outcome[4])
        return outcome

    def _direct(self, observations: dict[str, Any], infos: dict[str, dict[str, Any]]) -> None:
        live = self.unwrapped.agents
        self._free = self.supervisor.direct(live)
        for agent, info in infos.items():
            info[DIRECTED] = agent in live and agent not in self._free
            if self._masks and info[DIRECTED]:
                observations[agent][MASK] = _only_stay(observations[agent][MASK])


class Supervisors:
    """The supervisors of all episodes of a batch.

    Parameters
    ----------
    env : ExplorationVectorEnv or ExplorationVecEnv
        The episodes, made with ``reports=True``.
    make : callable
        Takes the level and returns a supervisor.

    Attributes
    ----------
    each : list of Supervised
        That of each episode.
    """

    def __init__(self, env: BatchFace, make: Make) -> None:
        self._rows, self._agents = env.batch, env.settings.agents
        level = env.team(0).level
        self.each = [make(level) for _ in range(env.batch.episodes)]
        self._free: list[list[str]] = [[] for _ in self.each]
        self._directed: NDArray[np.bool_] = np.zeros(env.batch.rows, np.bool_)

    def actions(self, actions: Any) -> list[dict[str, Action]]:  # noqa: ANN401
        """Return the actions of each team by agent: those of rows without orders, and orders for the others."""
        robots = self._rows.robots
        return [
            supervisor.complete(
                self._rows.team(episode).agents,
                {agent: _of_row(actions, episode * robots + self._agents.index(agent)) for agent in free},
            )
            for episode, (supervisor, free) in enumerate(zip(self.each, self._free, strict=True))
        ]

    def direct(self, *, is_step: bool = True) -> NDArray[np.bool_]:
        """Let the stations decide after a step; return which rows are under an order, (rows,).

        After a reset only those of episodes that begin decide: orders of the others still wait to be sent.
        """
        directed = self._directed.reshape(len(self.each), -1)
        for episode, supervisor in enumerate(self.each):
            team = self._rows.team(episode)
            if team.time_s == 0.0:
                supervisor.reset(team)
            elif not is_step:
                continue
            self._free[episode] = supervisor.direct(team.agents)
            under_order = set(team.agents).difference(self._free[episode])
            directed[episode] = [agent in under_order for agent in self._agents]
        return self._directed.copy()


class SupervisedBatch(_BatchWrapper):
    """A supervisor around each episode of a batch; see `SupervisedTeam`.

    ``infos["directed"]`` (rows,) bool is True for robots under an order of the station.

    Parameters
    ----------
    env : ExplorationVectorEnv
        The episodes, made by ``lidarium.vector_env`` with ``reports=True``.
    make, masks_orders
        As for `SupervisedTeam`.

    Attributes
    ----------
    supervisors : list of Supervised
        Those of the episodes.
    """

    def __init__(
        self,
        env: ExplorationVectorEnv,
        make: Make,
        masks_orders: bool = False,
    ) -> None:
        super().__init__(env)
        self._stations = Supervisors(env, make)
        self.supervisors = self._stations.each
        self._masks = masks_orders
        if masks_orders:
            check_masks(env.single_observation_space)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:  # noqa: ANN401
        """Begin episodes; see ``ExplorationVectorEnv.reset``."""
        return self._direct(*self.env.reset(seed=seed, options=options), is_step=False)

    def step(self, actions: Any) -> Step:  # noqa: ANN401
        """Run all episodes by the actions of robots without orders, and the orders of the others."""
        observations, rewards, terminated, truncated, infos = self.env.step(self._stations.actions(actions))
        observations, infos = self._direct(observations, infos, is_step=True)
        return observations, rewards, terminated, truncated, infos

    def _direct(self, observations: Any, infos: dict[str, Any], *, is_step: bool) -> tuple[Any, dict[str, Any]]:  # noqa: ANN401
        directed = self._stations.direct(is_step=is_step)
        if self._masks:
            observations = {**observations, MASK: with_orders(observations[MASK], directed)}
        return observations, {**infos, DIRECTED: directed, f"_{DIRECTED}": np.ones(self.num_envs, np.bool_)}


def check_masks(space: Space[Any]) -> None:
    """Raise ValueError if observations have no action mask."""
    if not isinstance(space, Dict) or MASK not in space.spaces:
        raise ValueError("masks_orders is set, but there are no masks; want level='frontier'")


def with_orders(masks: NDArray[Any], directed: NDArray[np.bool_]) -> NDArray[Any]:
    """Return masks of rows in which rows under an order can only stay."""
    masks = masks.copy()
    masks[directed] = _only_stay(masks[directed])
    return masks


def _only_stay(mask: NDArray[Any]) -> NDArray[Any]:
    """Return a mask, or some, that leaves the last action alone: to stay."""
    left = np.zeros_like(mask)
    left[..., -1] = 1
    return left


def _of_row(actions: Any, row: int) -> Any:  # noqa: ANN401
    if isinstance(actions, Mapping):
        return {name: _of_row(each, row) for name, each in actions.items()}
    return actions[row]
