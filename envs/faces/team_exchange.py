"""Exchanges of maps within teams: when, among whom, and with which result."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.engine.engine import Engine
from lidarium.envs.observing.spaces import FARTHEST
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.station.team_mapping import Frames, TeamMapping, crop_around
from lidarium.mapping.geometry.bounds import above, check_settings, shown
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.settings import MergeSettings

OLDEST_S = 3600.0
"""Maximum age of received data in observations [s]."""


CanTalk = Callable[[float, NDArray[np.float64]], NDArray[np.bool_]]
"""Takes the time [s] and the true poses (robots, 3).

Returns which robots reach each other, (robots, robots).
"""


def check_links(links: NDArray[Any], robots: int) -> NDArray[np.bool_]:
    """Return links as they count, in both directions, (robots, robots).

    Raises
    ------
    ValueError
        If they are of another shape.
    """
    if links.shape != (robots, robots):
        raise ValueError(f"can_talk has shape {links.shape}; want ({robots}, {robots}): which robots reach each other")
    found = np.asarray(links, np.bool_)
    return found | found.T


def clusters_of(agents: Sequence[str], links: NDArray[np.bool_]) -> list[list[str]]:
    """Return the robots that reach each other, some through others.

    Parameters
    ----------
    agents : sequence of str
        Names of all robots.
    links : (robots, robots) bool
        Which reach each other, see `check_links`.
    """
    robots = len(agents)
    reached = links.astype(np.int64) + np.eye(robots, dtype=np.int64)
    for _ in range(robots.bit_length()):
        reached = ((reached @ reached) > 0).astype(np.int64)
    rows = {tuple(row) for row in (reached > 0).tolist()}
    return [[agent for agent, is_in in zip(agents, row, strict=True) if is_in] for row in sorted(rows, reverse=True)]


@dataclass(frozen=True, slots=True, kw_only=True)
class MergingSettings:
    """Settings by which a team merges its maps.

    Attributes
    ----------
    period_s : float, default 1.0
        Simulated time between two exchanges [s].
    known_starts : bool, default False
        Whether the robots know how their frames lie, for comparison; nothing is searched for then.
    merge : MergeSettings
        Settings of map merging; by default those of `lidarium merge`.
    confirms : bool, default True
        Whether two robots are joined only when their maps were found twice to be of one place and convince,
        as a station joins them; otherwise by the first match.
    """

    period_s: Annotated[float, above(0.0, 1e7)] = 1.0
    known_starts: bool = False
    merge: MergeSettings = field(default_factory=MergeSettings)
    confirms: bool = True

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
        Transform of b's map frame to that of a [m, rad].
    at : (x, y)
        Position at which errors are measured, the middle of the area known to both maps, in b's frame [m].
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


class TeamExchange:
    """Lets the robots of an episode exchange their maps at a period.

    Parameters
    ----------
    perception : Perception
        Onboard software of all episodes.
    merging : MergingSettings
        Settings of merging.
    can_talk : (robots, robots) bool, callable or None
        Which robots reach each other, at all times or as a function (see `CanTalk`); if None, those that
        the radio joins.
    episode : int
        Which episode.

    Attributes
    ----------
    team : TeamMapping
        Maps that the robots hold of each other.
    events : list of MergeEvent
        All merges of this episode, in their order.

    Raises
    ------
    ValueError
        If there is but one robot, or ``can_talk`` is of another shape.
    """

    def __init__(
        self,
        perception: Perception,
        merging: MergingSettings,
        can_talk: NDArray[np.bool_] | CanTalk | None = None,
        episode: int = 0,
    ) -> None:
        settings = perception.settings
        if settings.robots < 2:
            raise ValueError(f"robots is {settings.robots}; merging maps wants two or more")
        if can_talk is not None and not callable(can_talk):
            check_links(np.asarray(can_talk), settings.robots)
        self._perception, self._merging, self._can_talk = perception, merging, can_talk
        self._episode, self._first = episode, episode * settings.robots
        self._agents = settings.agents
        self.team = TeamMapping(perception, merging.merge, episode=episode, confirms=merging.confirms)
        self.events: list[MergeEvent] = []
        self._joined: set[tuple[str, str]] = set()
        self._steps = max(round(merging.period_s / settings.time_step), 1)
        self._due = 0

    def start(self) -> None:
        """Begin an episode."""
        self.team.start()
        self.events, self._joined, self._due = [], set(), 0

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        return float(self._perception.world.steps[self._episode]) * self._perception.settings.time_step

    def exchange(self) -> list[MergeEvent]:
        """Exchange maps if it is time, and return the new merges."""
        steps = int(self._perception.world.steps[self._episode])
        if steps < self._due:
            return []
        self._due = steps - steps % self._steps + self._steps
        time_s, truth = self.time_s, frames_of(self._perception, self._episode)
        joined = self.team.exchange(self._clusters(time_s), time_s, truth if self._merging.known_starts else None)
        for (a, b), (a_from_b, *_) in joined.items():
            self._exchange_sparse(a, b, a_from_b)
            self._exchange_sparse(b, a, a_from_b.inverse())
        news = []
        for (a, b), (found, at, is_direct) in joined.items():
            if (a, b) in self._joined:
                continue
            true = truth[a, b]
            news.append(
                MergeEvent(time_s, a, b, (found.x, found.y, found.theta), (true.x, true.y, true.theta), at, is_direct)
            )
        self.events += news
        self._joined = set(joined)
        return news

    def _exchange_sparse(self, to: str, other: str, own_from_other: Transform) -> None:
        """Give a robot the sparse map of another, as it has come by radio, or at once if all hear each other."""
        perception = self._perception
        robot, source = self._agents.index(to), self._agents.index(other)
        if perception.exchanges:
            share = perception.exchanges[self._episode].sparse[robot][source]
        else:
            share = perception.sparse_maps.share(self._first + source)
        perception.sparse_maps.receive(self._first + robot, self._first + source, share, own_from_other)

    def _clusters(self, time_s: float) -> list[list[str]]:
        """Return the robots that reach each other, some through others."""
        robots, exchanges = len(self._agents), self._perception.exchanges
        if self._can_talk is None and not exchanges:
            return [list(self._agents)]
        if self._can_talk is None:
            links = exchanges[self._episode].links
            links = links | links.T
        elif callable(self._can_talk):
            poses = self._perception.world.poses[self._first : self._first + robots].copy()
            links = self._can_talk(time_s, poses)
        else:
            links = self._can_talk
        return clusters_of(self._agents, check_links(np.asarray(links), robots))

    def observed(self, robot: int) -> dict[str, NDArray[Any]]:
        """Return the observations that merging adds for a robot, by its number."""
        x, y, _ = self._perception.poses.pose_in_frame(self._first + robot, self._first + robot).tolist()
        agent, cells = self._agents[robot], self._perception.settings.map_cells
        return {
            "team_map": crop_around(self.team.fused[agent], x, y, cells)[None],
            "teammates": self._teammates(agent),
        }

    def _teammates(self, agent: str) -> NDArray[np.float32]:
        time_s = self.time_s
        others = [other for other in self._agents if other != agent]
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


def partners(events: Iterable[MergeEvent], agent: str) -> list[str]:
    """Return with whom a robot was joined, in order."""
    return [event.b if event.a == agent else event.a for event in events if agent in (event.a, event.b)]


def frames_of(perception: Perception, episode: int) -> Frames:
    """Return how the map frames of all robots of an episode truly lie."""
    settings = perception.settings
    rows = range(episode * settings.robots, (episode + 1) * settings.robots)
    if settings.known_starts:
        offsets = (perception.poses.offset(row) for row in rows)
        frames = [Transform(float(offset[0]), float(offset[1])) for offset in offsets]
    else:
        frames = [Transform(*start) for start in perception.world.starts[rows.start : rows.stop].tolist()]
    agents = settings.agents
    return {
        (a, b): frames[i].inverse() @ frames[j] for i, a in enumerate(agents) for j, b in enumerate(agents) if i != j
    }


def team_boxes(robots: int, cells: int) -> dict[str, spaces.Space[Any]]:
    """Return the spaces of the observations that merging adds."""
    turn = float(np.nextafter(np.float32(math.pi), np.float32(4.0)))
    high = np.tile(np.array([FARTHEST, FARTHEST, turn, OLDEST_S, 1.0], np.float32), (robots - 1, 1))
    low = np.tile(np.array([-FARTHEST, -FARTHEST, -turn, 0.0, 0.0], np.float32), (robots - 1, 1))
    return {
        "team_map": spaces.Box(0, 255, (1, cells, cells), np.uint8),
        "teammates": spaces.Box(low, high, dtype=np.float32),
    }


class MergedRows:
    """Lets the robots of each episode exchange their maps, as ``MergedMaps`` does for one.

    Parameters
    ----------
    engine : Engine
        The episodes.
    merging : MergingSettings
        Settings of merging.

    Attributes
    ----------
    boxes : dict
        Spaces of the observations that merging adds.
    arrays : dict of arrays
        The added observations of all rows, as of the last exchange; new arrays after each.
    teams : list of TeamExchange
        Exchange of each episode.

    Raises
    ------
    ValueError
        If a team is one robot, or ``merging`` is something else.
    """

    def __init__(
        self, engine: Engine, merging: MergingSettings, can_talk: NDArray[np.bool_] | CanTalk | None = None
    ) -> None:
        if not isinstance(merging, MergingSettings):
            raise ValueError(
                f"merging is {shown(merging)}; want True or MergingSettings, such as MergingSettings(period_s=2)"
            )
        self._engine = engine
        self._robots = engine.robots
        self.teams = [TeamExchange(engine.perception, merging, can_talk, episode) for episode in range(engine.episodes)]
        self.boxes = team_boxes(engine.robots, engine.settings.map_cells)
        self.arrays: dict[str, NDArray[Any]] = {
            name: np.zeros((engine.rows, *(box.shape or ())), box.dtype) for name, box in self.boxes.items()
        }
        self._events: list[list[MergeEvent]] = [[] for _ in self.teams]

    def exchange(self, seen: NDArray[np.bool_], began: NDArray[np.bool_]) -> None:
        """Exchange maps if it is time, after a run of the batch.

        Parameters
        ----------
        seen : (rows,) bool
            Rows with new observations; the others keep theirs.
        began : (episodes,) bool
            Which episodes have begun.
        """
        self.arrays = {name: array.copy() for name, array in self.arrays.items()}
        seen_robots = seen.reshape(len(self.teams), self._robots)
        for episode, team in enumerate(self.teams):
            if began[episode]:
                team.start()
            robots = np.flatnonzero(seen_robots[episode]).tolist()
            self._events[episode] = team.exchange() if robots else []
            for robot in robots:
                for name, value in team.observed(robot).items():
                    self.arrays[name][episode * self._robots + robot] = value

    def joined(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return with whom each robot was joined in this step, and the `MergeEvent` of each, (rows,) object."""
        agents = self._engine.settings.agents
        names, events = (np.full(self._engine.rows, None, object) for _ in range(2))
        for row in range(self._engine.rows):
            agent, own = agents[row % self._robots], self._events[row // self._robots]
            names[row] = partners(own, agent)
            events[row] = [event for event in own if agent in (event.a, event.b)]
        return names, events

    def infos(self, infos: dict[str, Any], seen: NDArray[np.bool_]) -> dict[str, Any]:
        """Return infos with the joins of this step, as ``MergedMaps`` has them."""
        names, events = self.joined()
        truth = {**infos["truth"], "merges": events}
        return {**infos, "truth": truth, "merges": names, "_merges": seen.copy()}
