"""Merged maps: robots exchange their maps at a period.

Each sees the team's map and its teammates in its own frame.
"""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.exploration import ExplorationEnv, Observation, Outcome
from lidarium.envs.levels.decisions import boxes_of, exploration_below
from lidarium.envs.levels.frontiers import FrontierExploration
from lidarium.envs.levels.waypoints import WaypointExploration
from lidarium.envs.station.team_mapping import Frames, TeamMapping
from lidarium.envs.team_wrapper import TeamWrapper
from lidarium.envs.wrappers.contacts import CanTalk
from lidarium.envs.wrappers.sparse_planning import SparsePlanning
from lidarium.envs.wrappers.team_exchange import (
    MergeEvent,
    MergingSettings,
    TeamExchange,
    frames_of,
    partners,
    team_boxes,
)


class MergedMaps(TeamWrapper):
    """Gives each robot the map made by all it is joined with, and their poses.

    The robot's own map is part of it.

    The observation has, beside that of the environment below, ``team_map`` uint8 (1, M, M) like ``map``, as
    of the last exchange, and ``teammates`` float32 (robots - 1, 5), one row for each of the others in their
    order: x, y [m], theta [rad] in the robot's own map frame, the age of what was received [s] and whether
    there is any; zeros where there is none. ``infos[agent]["merges"]`` lists with whom it was joined in this
    step, ``infos[agent]["truth"]["merges"]`` the `MergeEvent` of each.

    Parameters
    ----------
    env : ExplorationEnv, WaypointExploration, FrontierExploration or SparsePlanning
        The environment, at any level of decision, with two robots or more.
    settings : MergingSettings or None
        How; the defaults where None.
    can_talk : (robots, robots) bool, callable or None
        Which robots reach each other, at all times or as a function (see `CanTalk`); where None, those that
        the environment's radio joins. News are passed on.

    Attributes
    ----------
    events : list of MergeEvent
        All of this episode, in their order.

    Raises
    ------
    ValueError
        Where there is but one robot, or ``can_talk`` is of another shape.
    """

    def __init__(
        self,
        env: ExplorationEnv | WaypointExploration | FrontierExploration | SparsePlanning,
        settings: MergingSettings | None = None,
        can_talk: NDArray[np.bool_] | CanTalk | None = None,
    ) -> None:
        base = exploration_below(getattr(env, "unwrapped", env), "MergedMaps")
        super().__init__(env)
        self._base = base
        self.merging = settings or MergingSettings()
        self.metadata = {**env.metadata, "name": f"{str(env.metadata['name']).removesuffix('_v0')}_merged_v0"}
        self._team = TeamExchange(base.perception, self.merging, can_talk)
        robots = base.settings.robots
        self._observation_spaces: dict[str, spaces.Space[Any]] = {
            agent: spaces.Dict(
                {**boxes_of(env.observation_space(agent)), **team_boxes(robots, base.settings.map_cells)}
            )
            for agent in self.possible_agents
        }

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations, the same object at each call."""
        return self._observation_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode; see ``ExplorationEnv.reset``."""
        observations, infos = super().reset(seed, options)
        self._team.start()
        self._exchange(infos)
        return self._with_team(observations), infos

    def step(self, actions: Any) -> Outcome:  # noqa: ANN401
        """Take a step or a decision, and exchange maps where the period is over."""
        observations, rewards, terminations, truncations, infos = super().step(actions)
        self._exchange(infos)
        return self._with_team(observations), rewards, terminations, truncations, infos

    @property
    def team(self) -> TeamMapping:
        """What the robots hold of each other."""
        return self._team.team

    @property
    def events(self) -> list[MergeEvent]:
        """All merges of this episode, in their order."""
        return self._team.events

    def _exchange(self, infos: dict[str, dict[str, Any]]) -> None:
        """Let the robots exchange maps if it is time, and note who has come to know whom."""
        events = self._team.exchange() if infos else []
        for agent, info in infos.items():
            info["merges"] = partners(events, agent)
            info["truth"]["merges"] = [event for event in events if agent in (event.a, event.b)]

    def _with_team(self, observations: dict[str, Observation]) -> dict[str, Observation]:
        for agent, observation in observations.items():
            observation.update(self._team.observed(self.possible_agents.index(agent)))
        return observations


def true_frames(env: ExplorationEnv) -> Frames:
    """Return how the map frames of all robots of an environment truly lie."""
    return frames_of(env.perception, 0)
