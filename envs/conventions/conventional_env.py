"""The environment of a team in the forms that a trainer wants."""

from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.conventions.conventions import Conventions
from lidarium.envs.conventions.number_infos import ENDED, flat_infos
from lidarium.envs.conventions.observation_forms import MASK, ObservationForm, zeros_of
from lidarium.envs.conventions.talking_team import TalkingTeam
from lidarium.envs.conventions.team_rewards import TEAM, shared_among
from lidarium.envs.team_wrapper import TeamWrapper

ACTIVE = "active"
"""Info of environments whose ended agents stay: whether an agent has not ended."""


class ConventionalEnv(TeamWrapper):
    """Gives what the environment below returns the forms of conventions.

    Parameters
    ----------
    env : ParallelEnv
        The environment of a team, at any level of decision.
    conventions : Conventions
        The forms.

    Raises
    ------
    ValueError
        Where observations cannot take the form.
    """

    def __init__(self, env: Any, conventions: Conventions) -> None:  # noqa: ANN401
        super().__init__(env)
        self.conventions = conventions
        self._forms = {
            agent: ObservationForm(env.observation_space(agent), conventions) for agent in env.possible_agents
        }
        self._has_masks_apart = conventions.action_mask == "infos"
        self._keeps = conventions.ended_agents == "zeros"
        self._ended: dict[str, str] = {}
        self._numbers: dict[str, dict[str, Any]] = {}

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations, the same object at each call."""
        return self._forms[agent].space

    def columns(self, agent: str) -> tuple[tuple[str, int, int], ...]:
        """Return where each key of an agent's observation lies in the flat form; see `flat_columns`."""
        return self._forms[agent].columns

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start an episode; see ``ExplorationEnv.reset``."""
        observations, infos = super().reset(seed, options)
        self._ended, self._numbers = {}, {}
        return self._observations(observations), self._infos(infos, observations)

    def step(self, actions: Any) -> Any:  # noqa: ANN401
        """Take a step or a decision."""
        if not self.agents:
            return super().step(actions)
        if self._ended and isinstance(actions, dict):
            actions = {agent: action for agent, action in actions.items() if agent not in self._ended}
        observations, rewards, terminations, truncations, infos = super().step(actions)
        if self.conventions.team_reward:
            rewards = self._shared(rewards, infos)
        outcome = (
            self._observations(observations),
            rewards,
            terminations,
            truncations,
            self._infos(infos, observations),
        )
        return self._with_ended(*outcome, infos) if self._keeps else outcome

    def _observations(self, observations: dict[str, Any]) -> dict[str, Any]:
        return {agent: self._forms[agent].of(observation) for agent, observation in observations.items()}

    def _infos(
        self, infos: dict[str, dict[str, Any]], observations: dict[str, Any]
    ) -> dict[str, dict[str, Any]]:
        flat = self.conventions.infos == "flat"
        formed: dict[str, dict[str, Any]] = {agent: {} for agent in infos}
        if self.conventions.infos != "none":
            active: dict[str, Any] = {} if not self._keeps else {ACTIVE: 1.0 if flat else True}
            formed = {
                agent: {**(flat_infos(info) if flat else info), **active} for agent, info in infos.items()
            }
            self._numbers = {**self._numbers, **formed} if flat else {}
        if not self._has_masks_apart:
            return formed
        return {agent: {**info, MASK: observations[agent][MASK]} for agent, info in formed.items()}

    def _shared(self, rewards: dict[str, float], infos: dict[str, dict[str, Any]]) -> dict[str, float]:
        """Share rewards; the terms of the reward still add up to it."""
        shared = shared_among(rewards, self.conventions.team_reward)
        for agent, info in infos.items():
            info["reward_terms"] = {**info["reward_terms"], TEAM: shared[agent] - rewards[agent]}
        return shared

    def _with_ended(
        self,
        observations: dict[str, Any],
        rewards: dict[str, float],
        terminations: dict[str, bool],
        truncations: dict[str, bool],
        infos: dict[str, dict[str, Any]],
        full: dict[str, dict[str, Any]],
    ) -> Any:  # noqa: ANN401
        """Keep agents that have ended until the last one ends."""
        before = dict(self._ended)
        for agent in observations:
            if terminations[agent]:
                self._ended[agent] = full[agent]["ended_because"]
        is_over = not self.env.agents
        for agent in before:
            observations[agent], rewards[agent] = zeros_of(self._forms[agent].space), 0.0
            infos[agent] = self._info_of_ended(agent)
            terminations[agent], truncations[agent] = True, False
        if not is_over:
            terminations = dict.fromkeys(terminations, False)
        order = [agent for agent in self.possible_agents if agent in observations]
        self.agents = [] if is_over else order
        return tuple(
            {agent: part[agent] for agent in order}
            for part in (observations, rewards, terminations, truncations, infos)
        )

    def _info_of_ended(self, agent: str) -> dict[str, Any]:
        """Return what is said of an agent that has ended: its last numbers, and no reward."""
        mask = {MASK: self._only_stay(agent)} if self._has_masks_apart else {}
        if self.conventions.infos == "none":
            return mask
        if self.conventions.infos == "full":
            return {ACTIVE: False, "ended_because": self._ended[agent], **mask}
        last = self._numbers[agent]
        gone = {name: 0.0 for name in last if name.startswith("reward_terms.")}
        return {**last, **gone, ACTIVE: 0.0, ENDED: last[ENDED], **mask}

    def _only_stay(self, agent: str) -> NDArray[np.int8]:
        """Return the mask of an agent that has ended: it may stay."""
        mask = np.zeros(self.env.observation_space(agent)[MASK].shape, np.int8)
        mask[-1] = 1
        return mask


def conventional(env: Any, conventions: Conventions) -> Any:  # noqa: ANN401
    """Return an environment in the forms of conventions: itself where these are the defaults."""
    if conventions.comm:
        env = TalkingTeam(env, conventions.comm)
    return env if replace(conventions, comm=0) == Conventions() else ConventionalEnv(env, conventions)
