"""Merged maps: robots exchange their maps at a period.

Each sees the team's map and its teammates in its own frame.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.exploration import ExplorationEnv, Observation, Outcome
from lidarium.envs.levels.decisions import boxes_of, exploration_below
from lidarium.envs.levels.frontiers import FrontierExploration
from lidarium.envs.levels.waypoints import WaypointExploration
from lidarium.envs.observation_spaces import FARTHEST
from lidarium.envs.station.team_mapping import Frames, TeamMapping, crop_around
from lidarium.envs.team_wrapper import TeamWrapper
from lidarium.envs.wrappers.contacts import CanTalk, check_links, clusters_of
from lidarium.mapping.geometry.bounds import above, check_settings
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement.validation import ValidationSettings
from lidarium.mapping.merging.settings import MergeSettings

TEAM_VALIDATION = ValidationSettings(
    most_contradiction_m=1.0, plenty_of_overlap_m2=0.0, plenty_of_wall_m=10.0, contradiction_share=0.1
)
"""Validation of merges where robots map their teammates' bodies as walls.

They do not know where the others are, so more may contradict than in maps of robots alone.
"""

OLDEST_S = 3600.0
"""Bound of the age of what was received, in observations [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MergingSettings:
    """How a team merges its maps.

    Attributes
    ----------
    period_s : float
        Simulated time between two exchanges [s].
    known_starts : bool
        Whether the robots know how their frames lie, for comparison; nothing is searched for then.
    merge : MergeSettings
        How maps are merged; by default with `TEAM_VALIDATION`.
    """

    period_s: Annotated[float, above(0.0, 1e7)] = 1.0
    known_starts: bool = False
    merge: MergeSettings = field(default_factory=lambda: MergeSettings(validation=TEAM_VALIDATION))

    def __post_init__(self) -> None:
        check_settings(self, "merging")


@dataclass(frozen=True, slots=True)
class MergeEvent:
    """Two robots have been joined: how their frames lie as they found, and truly.

    Attributes
    ----------
    time_s : float
        When [s].
    a, b : str
        The robots.
    found, true : (x, y, theta)
        Of b's map frame in that of a [m, rad].
    at : (x, y)
        Where errors are taken, the middle of what both maps know, in b's frame [m].
    is_direct : bool
        Whether these two maps were laid on each other; otherwise those of others lie between them.
    """

    time_s: float
    a: str
    b: str
    found: tuple[float, float, float]
    true: tuple[float, float, float]
    at: tuple[float, float]
    is_direct: bool = True


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
    env : ExplorationEnv, WaypointExploration or FrontierExploration
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
        env: ExplorationEnv | WaypointExploration | FrontierExploration,
        settings: MergingSettings | None = None,
        can_talk: NDArray[np.bool_] | CanTalk | None = None,
    ) -> None:
        base = exploration_below(getattr(env, "unwrapped", env), "MergedMaps")
        robots = base.settings.robots
        if robots < 2:
            raise ValueError(f"robots is {robots}; merging maps wants two or more")
        if can_talk is not None and not callable(can_talk):
            check_links(np.asarray(can_talk), robots)
        super().__init__(env)
        self._base = base
        self.merging = settings or MergingSettings()
        self._can_talk = can_talk
        self.metadata = {**env.metadata, "name": f"{str(env.metadata['name']).removesuffix('_v0')}_merged_v0"}
        self.team = TeamMapping(base.perception, self.merging.merge)
        self.events: list[MergeEvent] = []
        self._joined: set[tuple[str, str]] = set()
        self._steps = max(round(self.merging.period_s / base.settings.time_step), 1)
        self._due = 0
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
        self.team.start()
        self.events, self._joined, self._due = [], set(), 0
        self._exchange(infos)
        return self._with_team(observations), infos

    def step(self, actions: Any) -> Outcome:  # noqa: ANN401
        """Take a step or a decision, and exchange maps where the period is over."""
        observations, rewards, terminations, truncations, infos = super().step(actions)
        self._exchange(infos)
        return self._with_team(observations), rewards, terminations, truncations, infos

    def _exchange(self, infos: dict[str, dict[str, Any]]) -> None:
        """Let the robots exchange maps if it is time, and note who has come to know whom."""
        for info in infos.values():
            info["merges"] = []
            info["truth"]["merges"] = []
        steps = int(self._base.world.steps[0])
        if steps < self._due or not infos:
            return
        self._due = steps - steps % self._steps + self._steps
        time_s = self._base.scorer.time
        truth = true_frames(self._base)
        joined = self.team.exchange(
            self._clusters(time_s), time_s, truth if self.merging.known_starts else None
        )
        for (a, b), (found, at, is_direct) in joined.items():
            if (a, b) in self._joined:
                continue
            true = truth[a, b]
            event = MergeEvent(
                time_s, a, b, (found.x, found.y, found.theta), (true.x, true.y, true.theta), at, is_direct
            )
            self.events.append(event)
            for agent, other in ((a, b), (b, a)):
                if agent in infos:
                    infos[agent]["merges"].append(other)
                    infos[agent]["truth"]["merges"].append(event)
        self._joined = set(joined)

    def _clusters(self, time_s: float) -> list[list[str]]:
        """Return the robots that reach each other, some through others."""
        robots = len(self.possible_agents)
        exchanges = self._base.perception.exchanges
        if self._can_talk is None and not exchanges:
            return [list(self.possible_agents)]
        if self._can_talk is None:
            links = exchanges[0].links | exchanges[0].links.T
        else:
            links = (
                self._can_talk(time_s, self._base.world.poses.copy())
                if callable(self._can_talk)
                else self._can_talk
            )
        return clusters_of(self.possible_agents, check_links(np.asarray(links), robots))

    def _with_team(self, observations: dict[str, Observation]) -> dict[str, Observation]:
        time_s, perception = self._base.scorer.time, self._base.perception
        for agent, observation in observations.items():
            row = self.possible_agents.index(agent)
            x, y, _ = perception.poses.pose_in_frame(row, row).tolist()
            observation["team_map"] = crop_around(self.team.fused[agent], x, y, self.settings.map_cells)[None]
            observation["teammates"] = self._teammates(agent, time_s)
        return observations

    def _teammates(self, agent: str, time_s: float) -> NDArray[np.float32]:
        others = [other for other in self.possible_agents if other != agent]
        table = np.zeros((len(others), 5), np.float32)
        for row, other in enumerate(others):
            received = self.team.received.get((agent, other))
            if received is not None:
                pose = received.own_from_other @ received.pose
                age = min(time_s - received.time_s, OLDEST_S)
                table[row] = (
                    np.clip(pose.x, -FARTHEST, FARTHEST),
                    np.clip(pose.y, -FARTHEST, FARTHEST),
                    pose.theta,
                    age,
                    1.0,
                )
        return table


def true_frames(env: ExplorationEnv) -> Frames:
    """Return how the map frames of all robots of an environment truly lie."""
    if env.settings.known_starts:
        offsets = (env.perception.poses.offset(row) for row in range(env.settings.robots))
        frames = [Transform(float(offset[0]), float(offset[1])) for offset in offsets]
    else:
        frames = [Transform(*start) for start in env.world.starts.tolist()]
    agents = env.possible_agents
    return {
        (a, b): frames[i].inverse() @ frames[j]
        for i, a in enumerate(agents)
        for j, b in enumerate(agents)
        if i != j
    }


def team_boxes(robots: int, cells: int) -> dict[str, spaces.Space[Any]]:
    """Return the spaces of what merging adds to an observation."""
    turn = float(np.nextafter(np.float32(math.pi), np.float32(4.0)))
    high = np.tile(np.array([FARTHEST, FARTHEST, turn, OLDEST_S, 1.0], np.float32), (robots - 1, 1))
    low = np.tile(np.array([-FARTHEST, -FARTHEST, -turn, 0.0, 0.0], np.float32), (robots - 1, 1))
    return {
        "team_map": spaces.Box(0, 255, (1, cells, cells), np.uint8),
        "teammates": spaces.Box(low, high, dtype=np.float32),
    }
