"""Merged maps: robots exchange their maps at a period, each sees the team's map and teammates in its own frame."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.engine.engine import Engine
from lidarium.envs.faces.parallel import ExplorationEnv, Observation, Outcome
from lidarium.envs.faces.randomized import padded
from lidarium.envs.faces.team_exchange import (
    CanTalk,
    MergedRows,
    MergeEvent,
    MergingSettings,
    frames_of,
    team_boxes,
)
from lidarium.envs.faces.wrapper import TeamWrapper, exploration_below
from lidarium.envs.onboard.station.team_mapping import Frames, TeamMapping


class MergedMaps(TeamWrapper):
    """Adds to each robot's observation the map merged from all robots joined with it, and their poses.

    In addition to those of the environment below, observations have ``team_map`` uint8 (1, M, M) like ``map``, as of
    the last exchange; it includes the robot's own map. ``teammates`` float32 (robots - 1, 5) has one row for each of
    the others in their order: x, y [m], theta [rad] in the robot's own map frame, the age of the received data [s]
    and 1 if data have been received; zeros otherwise. ``infos[agent]["merges"]`` lists the robots with which it was
    joined in this step, ``infos[agent]["truth"]["merges"]`` the `MergeEvent` of each. In a batch:
    ``vector_env(merging=...)``.

    Parameters
    ----------
    env : ParallelEnv
        The environment of a team of two robots or more, at any action level.
    settings : MergingSettings, optional
        Settings of map merging. The defaults of `MergingSettings` by default.
    can_talk : (robots, robots) bool or callable, optional
        Which robots reach each other, at all times or as a function (see `CanTalk`). By default those that the
        environment's radio connects. Data received from others are passed on.

    Attributes
    ----------
    events : list of MergeEvent
        All merges of this episode, in their order.

    Raises
    ------
    ValueError
        If there is only one robot, or ``can_talk`` is of another shape.
    """

    def __init__(
        self,
        env: Any,  # noqa: ANN401
        settings: MergingSettings | None = None,
        can_talk: NDArray[np.bool_] | CanTalk | None = None,
    ) -> None:
        base = exploration_below(getattr(env, "unwrapped", env), "MergedMaps")
        super().__init__(env)
        self.merging = settings or MergingSettings()
        self.metadata = {**env.metadata, "name": str(env.metadata["name"]).replace("_v1", "_merged_v1")}
        self._can_talk = can_talk
        self._use(base.engine)
        self._index = {agent: row for row, agent in enumerate(self.possible_agents)}
        if len(self.possible_agents) > 1 and getattr(env, "minimum_robots", 2) < 2:
            raise ValueError("teams of one robot are drawn; want two robots or more, as they merge their maps")
        wanted = {"observation": "dict", "infos": "full", "ended_agents": "leave"}
        for name, form in wanted.items():
            if getattr(base.conventions, name) != form:
                raise ValueError(
                    f"{name} is {getattr(base.conventions, name)!r}; MergedMaps wants {form!r}, "
                    "vector_env(merging=...) takes any"
                )
        self._note_spaces()

    def _note_spaces(self) -> None:
        boxes = team_boxes(len(self.possible_agents), self.settings.map_cells)
        self._observation_spaces: dict[str, spaces.Space[Any]] = {
            agent: spaces.Dict({**self.env.observation_space(agent).spaces, **boxes}) for agent in self.possible_agents
        }

    def use_level(self, name: str, shares_map: bool = True, decision_period_s: float | None = None) -> None:
        """Let actions be those of another action level; see ``ExplorationEnv.use_level``."""
        super().use_level(name, shares_map, decision_period_s)
        self._note_spaces()

    def _use(self, engine: Engine) -> None:
        self._engine, self._merged = engine, MergedRows(engine, self.merging, self._can_talk)

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations, the same object at each call."""
        return self._observation_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode; see ``ExplorationEnv.reset``."""
        observations, infos = super().reset(seed, options)
        if self.unwrapped.engine is not self._engine:  # of settings newly drawn
            self._use(self.unwrapped.engine)
        self._exchange(observations, infos)
        return observations, infos

    def step(self, actions: Any) -> Outcome:  # noqa: ANN401
        """Take a step or a decision, and exchange maps if the period is over."""
        outcome = super().step(actions)
        self._exchange(outcome[0], outcome[4])
        return outcome

    @property
    def team(self) -> TeamMapping:
        """The maps and poses that the robots have received of each other."""
        return self._merged.teams[0].team

    @property
    def events(self) -> list[MergeEvent]:
        """All merges of this episode, in their order."""
        return self._merged.teams[0].events

    def _exchange(self, observations: dict[str, Observation], infos: dict[str, dict[str, Any]]) -> None:
        """Let the robots exchange maps if it is time, and add the results to observations and infos."""
        seen = np.zeros(self._engine.rows, np.bool_)
        seen[[self._index[agent] for agent in infos]] = True
        self._merged.exchange(seen, np.asarray(self._engine.world.steps <= 0))
        arrays, names, events = self._merged.arrays, *self._merged.joined()
        for agent, info in infos.items():
            row = self._index[agent]
            info["merges"] = names[row]
            info["truth"]["merges"] = events[row]
            seen_by = {**observations[agent], **{name: array[row] for name, array in arrays.items()}}
            observations[agent] = padded(seen_by, self._observation_spaces[agent])


def true_frames(env: ExplorationEnv) -> Frames:
    """Return the true transforms between the map frames of all robots of an environment."""
    return frames_of(env.perception, 0)
