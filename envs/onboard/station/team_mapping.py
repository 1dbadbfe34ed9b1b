"""Common maps for robots that do not know each other's starts.

They exchange maps, merge them, and remember what they received.
"""

from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.station.joining import GROWTH_M2, team_confirmation
from lidarium.envs.onboard.station.reports import known_map
from lidarium.envs.onboard.station.trails import without_own_trail
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.agreement import Confirmation
from lidarium.mapping.merging.fusion import FusedMap, fuse
from lidarium.mapping.merging.incremental import GrowingMap, IncrementalMerger
from lidarium.mapping.merging.joining import placed
from lidarium.mapping.merging.settings import MergeSettings

Frames = dict[tuple[str, str], Transform]
"""Transforms by pairs of robots: from the second one's map frame to the first one's."""


class _Joined(NamedTuple):
    """Relation between the frames of two robots.

    Attributes
    ----------
    a_from_b : Transform
        Maps points of the second robot's map frame into the first's.
    at : (x, y)
        Middle of the area known to both maps, or the position of the second robot if their maps do not overlap, in
        its frame [m].
    is_direct : bool
        Whether these two maps were laid on each other; otherwise those of others lie between them.
    """

    a_from_b: Transform
    at: tuple[float, float]
    is_direct: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class _TeammateMap:
    """The latest map that a robot has received from another.

    Attributes
    ----------
    map : GrowingMap
        Its map.
    pose : Transform
        Believed pose in that map's frame.
    own_from_other : Transform
        Its map frame in that of the robot that received it.
    time_s : float
        When [s].
    """

    map: GrowingMap
    pose: Transform
    own_from_other: Transform
    time_s: float


@dataclass(slots=True)
class TeamMapping:
    """The maps that the robots of a team hold of each other.

    Parameters
    ----------
    perception : Perception
        The onboard software with the robots' own maps and poses.
    settings : MergeSettings
        Settings of map merging.
    episode : int
        Number of the episode.
    confirms : bool
        Whether maps are joined only by the criteria of `joining`; otherwise by the first match.

    Attributes
    ----------
    received : dict of (str, str) to _TeammateMap
        By a robot and another: the latest map that the first received from the second while their frames were
        aligned.
    fused : dict of str to FusedMap
        Each robot's own map and all that it has got, in its own frame.
    """

    perception: Perception
    settings: MergeSettings = field(default_factory=MergeSettings)
    received: dict[tuple[str, str], _TeammateMap] = field(default_factory=dict)
    fused: dict[str, FusedMap] = field(default_factory=dict)
    episode: int = 0
    confirms: bool = True
    _trails: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    _merger: IncrementalMerger = field(init=False)

    def __post_init__(self) -> None:
        self.start()

    def start(self) -> None:
        """Forget the last episode."""
        self.received, self.fused, self._trails = {}, {}, {}
        self._merger = IncrementalMerger(
            self.perception.settings.occupancy.resolution,
            self.settings,
            confirmation_growth_m2=GROWTH_M2 if self.confirms else None,
            confirmation=team_confirmation() if self.confirms else Confirmation(),
        )

    def exchange(
        self, clusters: list[list[str]], time_s: float, frames: Frames | None = None
    ) -> dict[tuple[str, str], _Joined]:
        """Let robots that can talk to each other exchange and merge their maps.

        Parameters
        ----------
        time_s : float
            Now [s].
        """
        agents = self.perception.settings.agents
        first = self.episode * len(agents)
        maps = {agent: known_map(self.perception, row) for row, agent in enumerate(agents, first)}
        poses = {
            agent: Transform(*self.perception.poses.pose_in_frame(row, row).tolist())
            for row, agent in enumerate(agents, first)
        }
        pairs = [
            (a, b) for a, b in combinations(agents, 2) if any(a in cluster and b in cluster for cluster in clusters)
        ]
        places = {agent: (pose.x, pose.y) for agent, pose in poses.items()}
        for agent, place in places.items():
            self._trails.setdefault(agent, []).append(place)
        if frames is None:
            joined = self._merged(maps, places, pairs)
        else:
            joined = {(a, b): _Joined(frames[a, b], places[b]) for a, b in pairs}
        for (a, b), (a_from_b, *_) in joined.items():
            self.received[a, b] = _TeammateMap(maps[b], poses[b], a_from_b, time_s)
            self.received[b, a] = _TeammateMap(maps[a], poses[a], a_from_b.inverse(), time_s)
        self.fused = {agent: self._fused(agent, maps[agent]) for agent in agents}
        return joined

    def _merged(
        self,
        maps: dict[str, GrowingMap],
        places: dict[str, tuple[float, float]],
        pairs: list[tuple[str, str]],
    ) -> dict[tuple[str, str], _Joined]:
        merged = self._merger.update(
            {agent: self._compared(agent, one) for agent, one in maps.items()}, frozenset(pairs)
        )
        joined = {}
        for a, b in pairs:
            transform = merged.tree.lookup(a, b)
            if transform is not None:
                result = merged.pairs.get((a, b))
                overlaps = result is not None and result.is_accepted
                centre = (
                    placed(maps[b].origin).apply(result.agreement.centre).tolist()
                    if overlaps and result is not None
                    else places[b]
                )
                joined[a, b] = _Joined(transform, (float(centre[0]), float(centre[1])), merged.tree.has_edge(a, b))
        return joined

    def _compared(self, agent: str, one: GrowingMap) -> GrowingMap:
        """Return a robot's map in the form that is compared with others.

        Cells at the robot's positions are left open: others may have drawn its body there.
        """
        settings = self.perception.settings
        trail = np.array(self._trails[agent], np.float64)
        return without_own_trail(one, trail, settings.robot.radius, settings.occupancy.resolution)

    def _fused(self, agent: str, own: GrowingMap) -> FusedMap:
        got = [received for (to, _), received in self.received.items() if to == agent]
        levels = [own.levels, *(received.map.levels for received in got)]
        places = [
            placed(own.origin),
            *(received.own_from_other @ placed(received.map.origin) for received in got),
        ]
        return fuse(levels, places, self.perception.settings.occupancy.resolution)


def crop_around(fused: FusedMap, x: float, y: float, cells: int) -> NDArray[np.uint8]:
    """Return the cells of a map around a place [m], (cells, cells).

    Unknown outside of the map.
    """
    column, row = (
        int(np.floor((value - low) / fused.resolution + 1e-9)) - cells // 2
        for value, low in zip((x, y), fused.origin, strict=True)
    )
    crop = np.full((cells, cells), UNKNOWN, np.uint8)
    rows, columns = fused.levels.shape
    top, left = max(row, 0), max(column, 0)
    part = fused.levels[top : max(min(row + cells, rows), top), left : max(min(column + cells, columns), left)]
    crop[top - row : top - row + part.shape[0], left - column : left - column + part.shape[1]] = part
    return crop
