"""The environment of a team whose robots send each other numbers with their actions."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces

from lidarium.envs.agent_actions import check_agents
from lidarium.envs.conventions.messages import MESSAGES, MessageBoard, split_action, talking_space
from lidarium.envs.team_wrapper import TeamWrapper


class TalkingTeam(TeamWrapper):
    """Lets robots send each other numbers over their radio.

    Actions have a message beside, see `talking_space`, and observations ``messages``, see `MessageBoard`.

    Parameters
    ----------
    env : ParallelEnv
        The environment of a team, at any level of decision.
    floats : int
        Numbers of a message, at least 1.
    """

    def __init__(self, env: Any, floats: int) -> None:  # noqa: ANN401
        super().__init__(env)
        base = self.unwrapped
        self._floats, self._base = floats, base
        self._board = MessageBoard(base.perception, base.settings, floats)
        self._rows = {agent: row for row, agent in enumerate(env.possible_agents)}
        self._has_vectors = isinstance(env.action_space(env.possible_agents[0]), spaces.Box)
        self._actions = {agent: talking_space(env.action_space(agent), floats) for agent in self._rows}
        self._observations = {
            agent: spaces.Dict({**env.observation_space(agent).spaces, MESSAGES: self._board.box})
            for agent in self._rows
        }

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations, the same object at each call."""
        return self._observations[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's actions with its message, the same object at each call."""
        return self._actions[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start an episode; see ``ExplorationEnv.reset``."""
        observations, infos = super().reset(seed, options)
        self._board.start(np.zeros(1, np.int64))
        return self._with_messages(observations), infos

    def step(self, actions: Any) -> Any:  # noqa: ANN401
        """Take a step or a decision, and let messages be heard."""
        check_agents(actions, self._rows)
        sent, acted = np.zeros((len(self._rows), self._floats)), np.zeros(len(self._rows), np.bool_)
        rest: dict[str, Any] = {}
        for agent, action in (actions if isinstance(actions, Mapping) else {}).items():
            rest[agent], message = split_action(action, self._floats, self._has_vectors, agent)
            sent[self._rows[agent]], acted[self._rows[agent]] = message, agent in self.agents
        observations, *others = super().step(rest)
        if observations:
            self._board.exchange(sent, acted)
        return (self._with_messages(observations), *others)

    def _with_messages(self, observations: dict[str, Any]) -> dict[str, Any]:
        table = self._board.table()
        for agent, observation in observations.items():
            observation[MESSAGES] = table[self._rows[agent]]
        return observations
