"""A robot's local pose, by matching scans with local maps.

Local maps begin and end along the path.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import relative
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.matching.local_matching import LocalMatcher
from lidarium.mapping.localization.matching.scan_matching import Match
from lidarium.mapping.localization.matching.settings.slam import SlamSettings
from lidarium.mapping.localization.matching.submaps import AgreementGrid, Submap


@dataclass(slots=True, eq=False)
class _Active:
    """A local map that still grows.

    Attributes
    ----------
    submap : Submap
        What it holds.
    node : int
        Node of the graph in whose frame it is.
    in_older : (3,) float64
        That node in the frame of the local map before.
    nodes : list of int
        That node, and those that were set since.
    places : list of (3,) float64
        Where they lie in the local map's frame.
    path : float
        Way driven since [m].
    """

    submap: Submap
    node: int
    in_older: NDArray[np.float64]
    nodes: list[int]
    places: list[NDArray[np.float64]]
    path: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Finished:
    """A local map that is finished.

    Attributes
    ----------
    grid : AgreementGrid
        What it holds.
    nodes : (nodes,) int64
        Nodes of the graph that were set while it grew; in the frame of the first it is.
    places : (nodes, 3) float64
        Where they lay in its frame then: what it holds near them lies right to them, whatever is believed of
        the way between them later.
    """

    grid: AgreementGrid
    nodes: NDArray[np.int64]
    places: NDArray[np.float64]


class LocalMapper:
    """Two growing local maps, of which the older one says where the robot is.

    Parameters
    ----------
    settings : SlamSettings
        How.
    geometry : ScanGeometry
        Directions of the beams.
    """

    def __init__(self, settings: SlamSettings, geometry: ScanGeometry) -> None:
        self._matching, self._submaps = settings.matching, settings.submaps
        self._geometry = geometry
        self._active: list[_Active] = []
        self._matcher = LocalMatcher(settings, geometry)

    @property
    def node(self) -> int:
        """Node in whose frame poses are now."""
        return self._active[0].node

    def begin(self, node: int, ranges: NDArray[np.float32]) -> list[Finished]:
        """Begin again at a node, by the scan taken there.

        Return the local maps that this ends.
        """
        ended = self._ended(self._active)
        self._active = []
        self._add(node, np.zeros(3), ranges)
        return ended

    @property
    def usual_score(self) -> float:
        """Agreement of matches of late."""
        return self._matcher.usual_score

    @property
    def contradiction(self) -> float:
        """How much the last scan contradicted the local map, see ``LocalMatcher``."""
        return self._matcher.contradiction

    @property
    def recoveries(self) -> int:
        """How many scans were found elsewhere than odometry said, see ``LocalMatcher``."""
        return self._matcher.recoveries

    @property
    def explains(self) -> bool:
        """Whether the last match explains enough of its scan, see ``LocalMatcher``."""
        return self._matcher.explains

    def match(
        self,
        points: NDArray[np.float64],
        predicted: NDArray[np.float64],
        moved: NDArray[np.float64],
        uncertainty: NDArray[np.float64],
        failed: int,
    ) -> Match | None:
        """Return where a scan lies on the older local map, see ``LocalMatcher.match``."""
        return self._matcher.match(self._active[0].submap, points, predicted, moved, uncertainty, failed)

    def judge(self, points: NDArray[np.float64], pose: NDArray[np.float64]) -> None:
        """Note how well a scan agrees with the older local map at a pose found otherwise.

        Its points are (n, 2) [m]; the pose is x, y, theta (3,) in the map's frame [m, rad].
        """
        self._matcher.judge(self._active[0].submap, points, pose)

    def rendered_again(self, points: NDArray[np.float64]) -> Match | None:
        """Return where the older local map's first scan now lies on that map.

        Its points are (n, 2) [m]. None if they do not match.
        """
        return self._matcher.match_first(self._active[0].submap, points)

    def insert(self, pose: NDArray[np.float64], path: float, ranges: NDArray[np.float32]) -> bool:
        """Insert a scan at x, y, theta (3,) in the older local map's frame.

        The robot has driven a given distance [m] since the last scan.

        Returns
        -------
        bool
            False where the robot has left what the local maps can hold; ``begin`` has to be called then.
        """
        for active in self._active:
            pose = pose if active is self._active[0] else relative(active.in_older, pose)
            active.path += path
            if not active.submap.insert(pose, ranges, self._geometry, self._matching.range_m):
                return False
        return True

    def note_node(self, node: int, pose: NDArray[np.float64]) -> None:
        """Take in that a node was set at x, y, theta (3,) in the older local map's frame."""
        for active in self._active:
            pose = pose if active is self._active[0] else relative(active.in_older, pose)
            active.nodes.append(node)
            active.places.append(pose.copy())

    @property
    def wants_another(self) -> bool:
        """Whether it is time to begin another local map, at a new node."""
        newest = self._active[-1]
        is_full = (
            newest.submap.scans >= max(self._submaps.least_scans // 2, 1)
            and newest.path >= 0.5 * self._submaps.path_m
        )
        return len(self._active) == 1 and is_full

    def add(self, node: int, pose: NDArray[np.float64], ranges: NDArray[np.float32]) -> None:
        """Begin another local map at a node, by the scan taken there.

        The node lies at x, y, theta (3,) in the older local map's frame.
        """
        self._add(node, pose, ranges)

    def hand_over(self, poses: NDArray[np.float64]) -> tuple[NDArray[np.float64], list[Finished]]:
        """End the older local map where it is full.

        Return poses (n, 3) of its frame in that of the new older one, and what ended.
        """
        oldest = self._active[0]
        is_full = oldest.submap.scans >= self._submaps.least_scans and oldest.path >= self._submaps.path_m
        if len(self._active) < 2 or not is_full:
            return poses, []
        self._active = self._active[1:]
        return relative(self._active[0].in_older, poses), self._ended([oldest])

    def _add(self, node: int, in_older: NDArray[np.float64], ranges: NDArray[np.float32]) -> None:
        reach = min(self._matching.range_m, self._geometry.range_max) + 2.0 * self._submaps.path_m
        active = _Active(Submap(self._submaps, reach), node, in_older.copy(), [node], [np.zeros(3)])
        active.submap.insert(np.zeros(3), ranges, self._geometry, self._matching.range_m)
        self._active.append(active)

    def _ended(self, active: list[_Active]) -> list[Finished]:
        ended = [one for one in active if one.submap.scans >= self._submaps.least_scans // 2]
        return [Finished(one.submap.finished(), np.array(one.nodes), np.stack(one.places)) for one in ended]


def way(motion: NDArray[np.float64]) -> float:
    """Return the length of a motion x, y, theta (3,) [m].

    Turns count as a metre per radian.
    """
    return math.hypot(float(motion[0]), float(motion[1])) + abs(float(motion[2]))
