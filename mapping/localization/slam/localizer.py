"""Simultaneous localization and mapping with a planar lidar.

Scans are matched with local maps; every half metre a node of a graph is set, and where a node's scan
recognises a local map of long ago, all poses are brought to agree. Between matches odometry carries the pose.

References
----------
The plan is that of Hess et al., Real-time loop closure in 2D LIDAR SLAM (ICRA 2016).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import composed, relative, turned
from lidarium.mapping.grids.occupancy import OccupancyGrid
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.localizer import KeyScans, Sensing
from lidarium.mapping.localization.matching.scan_matching import Match
from lidarium.mapping.localization.matching.scan_points import at_last_beam
from lidarium.mapping.localization.odometry import compounded
from lidarium.mapping.localization.settings import SlamSettings
from lidarium.mapping.localization.slam.mapped_path import MappedPath
from lidarium.mapping.localization.slam.odometry_motion import OdometryMotion

ODOMETRY_ALONE = "odometry alone: the scans show what the map does not hold"
NO_MATCH = "no match: the scans contradict the map where odometry leads, and no other place is sure"

ELSEWHERE = "odometry contradicted: the scans agree with the map in another direction or place alone"

LITTLE = "little explained: hardly any of the scans agrees with the map, and no other place is sure"


@dataclass(frozen=True, slots=True)
class _Doubt:
    """A stretch that is doubtful.

    Attributes
    ----------
    start_s, end_s : float
        Times of the last scan before it that was matched, and of the last scan in it [s].
    scans : int
        Scans in it.
    reason : str
        Why.
    """

    start_s: float
    end_s: float
    scans: int
    reason: str


class _Doubts:
    """Doubtful stretches so far, in the order of time."""

    def __init__(self) -> None:
        self.stretches: list[_Doubt] = []
        self._sure_s: float | None = None
        self._is_open = False

    def note(self, time_s: float, reason: str | None) -> None:
        """Take in that a scan was matched (None), or why its pose is uncertain."""
        if reason is None:
            self._sure_s, self._is_open = time_s, False
            return
        if self._is_open and self.stretches[-1].reason == reason:
            last = self.stretches[-1]
            self.stretches[-1] = replace(last, end_s=time_s, scans=last.scans + 1)
        else:
            start_s = time_s if self._sure_s is None else self._sure_s
            self.stretches.append(_Doubt(start_s, time_s, 1, reason))
        self._is_open = True


@dataclass(slots=True)
class _SlamCounts:
    """Counts of a localizer so far."""

    scans: int = 0
    matches: int = 0
    failures: int = 0
    closures: int = 0
    corrections: int = 0
    restarts: int = 0
    recoveries: int = 0


class Slam:
    """A localizer that makes a map to localize on it.

    Parameters
    ----------
    settings : SlamSettings
        How.
    geometry : ScanGeometry
        Directions of the beams.

    Attributes
    ----------
    settings : SlamSettings
        How.
    counts : SlamCounts
        Counts so far.
    doubts : Doubts
        Stretches of uncertain motion of the robot.
    """

    Settings = SlamSettings

    def __init__(self, settings: SlamSettings, geometry: ScanGeometry) -> None:
        self.settings, self._geometry = settings, geometry
        self.reset(np.zeros(3), 0)

    def reset(self, pose: NDArray[np.float64], seed: int) -> None:
        """Begin again at x, y, theta (3,) [m, rad]; nothing is drawn."""
        self._path = MappedPath(self.settings, self._geometry, pose)
        self.counts, self.doubts = _SlamCounts(), _Doubts()
        self._has_begun = False
        self._motion = OdometryMotion(self.settings)
        self._failed, self._time_s = 0, 0.0

    def localize(self, sensing: Sensing) -> NDArray[np.float64]:
        """Take in sensor readings, later than all before.

        Return x, y, theta of the robot, shape (3,) [m, rad].
        """
        if sensing.ranges.shape != (self._geometry.beams,):
            raise ValueError(f"ranges have shape {sensing.ranges.shape}; want ({self._geometry.beams},), one per beam")
        self.counts.scans += 1
        self._time_s = sensing.time_s
        self._correct(sensing.time_s)
        motion, period = self._motion.take(sensing)
        path = self._path
        path.local = composed(path.local, motion)
        matching = self.settings.matching
        moved = relative(path.matched, path.local)
        is_far = np.hypot(moved[0], moved[1]) >= matching.distance_m or abs(moved[2]) >= matching.angle
        if is_far or not self._has_begun or not self._motion.is_measured:
            ranges = at_last_beam(
                np.asarray(sensing.ranges, np.float32),
                self._geometry,
                motion,
                matching.beam_interval_s,
                period,
            )
            points = path.sampling.points(ranges, matching.spacing_m, matching.points)
            if len(points):
                self._take(ranges, points, moved, sensing.time_s)
        return self.pose

    @property
    def pose(self) -> NDArray[np.float64]:
        """x, y, theta of the robot, shape (3,) [m, rad]."""
        return self._path.pose

    @property
    def place(self) -> tuple[int, NDArray[np.float64]]:
        """The last node, and the robot's pose x, y, theta (3,) in its frame.

        Later corrections of the node apply to the robot as well.
        """
        return self._path.place

    @property
    def nodes(self) -> NDArray[np.float64]:
        """Poses of all nodes as they are now believed, shape (nodes, 3) [m, rad]."""
        return self._path.nodes

    @property
    def pending(self) -> int:
        """How many closures were found that have not acted yet."""
        return self._path.pending

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the last pose, shape (3, 3) [m^2, m rad, rad^2]."""
        path = self._path
        moved = relative(path.matched, path.local)
        return path.covariance(compounded(np.zeros(3), path.spread, moved, self._turned_growth(moved)))

    def take_correction(self) -> KeyScans | None:
        """Return all scans at their poses, once after each time the past was corrected.

        Else None.
        """
        return self._path.take_correction()

    @property
    def key_scans(self) -> KeyScans:
        """All matched scans at their poses as believed now."""
        return self._path.key_scans

    @property
    def map(self) -> OccupancyGrid:
        """The map of all matched scans, rendered again after corrections."""
        return self._path.map

    def finish(self) -> None:
        """Let all closures act that were found so far."""
        self._correct(np.inf)

    def _take(
        self,
        ranges: NDArray[np.float32],
        points: NDArray[np.float64],
        moved: NDArray[np.float64],
        time_s: float,
    ) -> None:
        """Match a scan and take it into the maps."""
        path = self._path
        if not self._has_begun:
            self._begin(ranges)
            return
        growth = self._motion.growth() if self._motion.is_measured else None
        match = path.mapper.match(points, path.local, moved, growth, self._failed)
        self.doubts.note(time_s, self._doubt(match, len(points)))
        self.counts.recoveries = path.mapper.recoveries
        if match is None:
            self._fail(ranges)
            return
        if match.prior.any():
            heading = float(path.local[2])
            measured, prior = turned(match.information, -heading), turned(match.prior, -heading)
            self._motion.learn(relative(path.local, match.pose), measured, prior)
        if growth is None:
            self._motion.velocity = relative(path.matched, match.pose)
        self._motion.begin_interval()
        self.counts.matches += 1
        self._failed = 0
        path.take(match.pose, match.covariance, ranges, points, time_s)
        self.counts.corrections = path.corrections

    def _doubt(self, match: Match | None, points: int) -> str | None:
        """Return why a scan of a number of points has an uncertain pose; None if it has none."""
        if match is None:
            return NO_MATCH
        if self._path.mapper.recoveries > self.counts.recoveries:
            return ELSEWHERE
        is_sparse = points < self.settings.matching.wide_share * self._geometry.beams
        if not match.information.any():
            return None if is_sparse else ODOMETRY_ALONE
        return None if self._path.mapper.explains else LITTLE

    def _begin(self, ranges: NDArray[np.float32]) -> None:
        """Begin the first map, at a node of its own.

        The start's pose in the map is known as well as one scan allows.
        """
        self._has_begun = True
        growth = self._turned_growth(self._path.local)
        self._motion.begin_interval()
        self._path.begin(ranges, growth, self._time_s)

    def _turned_growth(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the covariance of the motion since the last match, turned by a pose (3,)."""
        if not self._motion.has_moved:
            return np.zeros((3, 3))
        return turned(self._motion.growth(), float(pose[2]))

    def _fail(self, ranges: NDArray[np.float32]) -> None:
        """Go on by odometry; after too many failures begin again."""
        self.counts.failures += 1
        self._failed += 1
        self._motion.velocity = np.zeros(3)
        settings, path = self.settings.matching, self._path
        if self._failed >= settings.lost_after:
            self.counts.restarts += 1
            covariance = np.diag([settings.lost_m**2, settings.lost_m**2, settings.lost_angle**2])
            if path.mapper.contradiction <= settings.most_contradiction:
                # The map does not know the place well, but nothing says that odometry has led elsewhere.
                growth = path.spread + turned(self._motion.growth(), float(path.local[2]))
                covariance = path.motion_covariance(growth, relative(path.at_node, path.local))
            self._motion.begin_interval()
            self._failed = 0
            path.restart(ranges, covariance, self._time_s)

    def _correct(self, time_s: float) -> None:
        """Let closures act that are due."""
        self._path.correct(time_s)
        self.counts.closures, self.counts.corrections = self._path.closures, self._path.corrections
