"""Where a robot is in its neighbourhood: scans are matched with local maps, and local maps begin and end on the way."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.localization.branch_and_bound import place, pyramid
from lidarium.mapping.localization.scan_matching import Match, refine, search
from lidarium.mapping.localization.settings import MatchingSettings, SubmapSettings
from lidarium.mapping.localization.submaps import AgreementGrid, Submap
from lidarium.mapping.rigid import relative
from lidarium.mapping.scans import ScanGeometry


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
    path : float
        Way driven since [m].
    """

    submap: Submap
    node: int
    in_older: NDArray[np.float64]
    path: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Finished:
    """A local map that is finished.

    Attributes
    ----------
    grid : AgreementGrid
        What it holds.
    node : int
        Node of the graph in whose frame it is.
    """

    grid: AgreementGrid
    node: int


class LocalMapper:
    """Two growing local maps, of which the older one says where the robot is.

    Parameters
    ----------
    matching, submaps : MatchingSettings, SubmapSettings
        How.
    geometry : ScanGeometry
        Which way the beams look.
    """

    def __init__(self, matching: MatchingSettings, submaps: SubmapSettings, geometry: ScanGeometry) -> None:
        self._matching, self._submaps, self._geometry = matching, submaps, geometry
        self._active: list[_Active] = []

    @property
    def node(self) -> int:
        """Node in whose frame poses are now."""
        return self._active[0].node

    def begin(self, node: int, ranges: NDArray[np.float32]) -> list[Finished]:
        """Begin anew at a node, by the scan taken there; return the local maps that this ends."""
        ended = self._ended(self._active)
        self._active = []
        self._add(node, np.zeros(3), ranges)
        return ended

    def match(
        self, points: NDArray[np.float64], predicted: NDArray[np.float64], covariance: NDArray[np.float64] | None
    ) -> Match | None:
        """Return where a scan lies on the older local map; None where it does not match.

        Parameters
        ----------
        points : (n, 2) float64
            Points in the robot's frame [m].
        predicted : (3,) float64
            Where odometry says the robot is, in the local map's frame [m, rad].
        covariance : (3, 3) float64 or None
            How well it knows; None where there is no odometry.
        """
        settings = self._matching
        grid = self._active[0].submap.grid
        if covariance is not None:
            spread = np.sqrt(np.diag(covariance))
            reach_m = settings.search_m + settings.search_deviations * float(spread[:2].max())
            reach_angle = settings.search_angle + settings.search_deviations * float(spread[2])
            start = search(grid, points, predicted, reach_m, reach_angle)
            found = refine(grid, points, start, predicted, np.linalg.inv(covariance), self._weight)
            if self._is_good(found):
                return found
        start = self._search_widely(points, predicted)
        if start is None:
            return None
        found = refine(grid, points, start, start, np.zeros((3, 3)), self._weight)
        return found if self._is_good(found) else None

    @property
    def _weight(self) -> float:
        return self._matching.independent_points / self._matching.deviation**2

    def _is_good(self, match: Match) -> bool:
        return match.score >= self._matching.least_score and match.overlap >= self._matching.least_overlap

    def _search_widely(self, points: NDArray[np.float64], predicted: NDArray[np.float64]) -> NDArray[np.float64] | None:
        settings = self._matching
        coarse = pyramid(self._active[0].submap.finished())
        least = 0.5 * settings.least_score * settings.least_overlap
        found, _ = place(coarse, points, predicted, (settings.blind_m, settings.blind_angle), least, settings.evaluations)
        return None if found is None else found.pose

    def insert(self, pose: NDArray[np.float64], path: float, ranges: NDArray[np.float32]) -> bool:
        """Take in a scan at x, y, theta (3,) in the older local map's frame, so much way [m] after the last one.

        Returns
        -------
        bool
            Whether the robot has left what the local maps can hold; ``begin`` has to be called then.
        """
        for active in self._active:
            pose = pose if active is self._active[0] else relative(active.in_older, pose)
            active.path += path
            if not active.submap.insert(pose, ranges, self._geometry, self._matching.range_m):
                return False
        return True

    @property
    def wants_another(self) -> bool:
        """Whether it is time to begin another local map, at a new node."""
        newest = self._active[-1]
        is_full = newest.submap.scans >= max(self._submaps.least_scans // 2, 1) and newest.path >= 0.5 * self._submaps.path_m
        return len(self._active) == 1 and is_full

    def add(self, node: int, pose: NDArray[np.float64], ranges: NDArray[np.float32]) -> None:
        """Begin another local map at a node that lies at x, y, theta (3,) in the older one's frame, by the scan taken there."""
        self._add(node, pose, ranges)

    def hand_over(self, poses: NDArray[np.float64]) -> tuple[NDArray[np.float64], list[Finished]]:
        """End the older local map where it is full; return poses (n, 3) of its frame in that of the new older one, and what ended."""
        oldest = self._active[0]
        is_full = oldest.submap.scans >= self._submaps.least_scans and oldest.path >= self._submaps.path_m
        if len(self._active) < 2 or not is_full:
            return poses, []
        self._active = self._active[1:]
        return relative(self._active[0].in_older, poses), self._ended([oldest])

    def _add(self, node: int, in_older: NDArray[np.float64], ranges: NDArray[np.float32]) -> None:
        reach = min(self._matching.range_m, self._geometry.range_max) + 2.0 * self._submaps.path_m
        active = _Active(Submap(self._submaps.resolution, reach), node, in_older.copy())
        active.submap.insert(np.zeros(3), ranges, self._geometry, self._matching.range_m)
        self._active.append(active)

    def _ended(self, active: list[_Active]) -> list[Finished]:
        return [Finished(one.submap.finished(), one.node) for one in active if one.submap.scans >= self._submaps.least_scans // 2]


def way(motion: NDArray[np.float64]) -> float:
    """Return how much of a way a motion x, y, theta (3,) is, turns counted with a metre a radian [m]."""
    return math.hypot(float(motion[0]), float(motion[1])) + abs(float(motion[2]))
