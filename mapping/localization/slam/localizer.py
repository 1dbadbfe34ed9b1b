"""Simultaneous localization and mapping with a planar lidar.

Scans are matched with local maps; every half metre a node of a graph is set, and where a node's scan
recognises a local map of long ago, all poses are brought to agree. Between matches odometry carries the pose.

References
----------
The plan is that of Hess et al., Real-time loop closure in 2D LIDAR SLAM (ICRA 2016).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.covariance import turned
from lidarium.mapping.geometry.rigid import Transform, composed, relative
from lidarium.mapping.grids.occupancy import OccupancyGrid
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.dead_reckoning.localizer import KeyScans, Sensing
from lidarium.mapping.localization.dead_reckoning.odometry import compounded
from lidarium.mapping.localization.graph.node_graph import NodeGraph
from lidarium.mapping.localization.matching.local_mapping import LocalMapper, way
from lidarium.mapping.localization.matching.scan_matching import Match
from lidarium.mapping.localization.matching.scan_points import at_last_beam, scan_points
from lidarium.mapping.localization.matching.settings.slam import SlamSettings
from lidarium.mapping.localization.matching.wall_compass import WallCompass
from lidarium.mapping.localization.slam.doubts import ELSEWHERE, LITTLE, NO_MATCH, ODOMETRY_ALONE, Doubts
from lidarium.mapping.localization.slam.loop_closing import LoopClosing
from lidarium.mapping.localization.slam.odometry_motion import OdometryMotion
from lidarium.mapping.localization.slam.scan_history import ScanHistory


@dataclass(slots=True)
class SlamCounts:
    """What a localizer has done so far."""

    scans: int = 0
    matches: int = 0
    failures: int = 0
    closures: int = 0
    corrections: int = 0
    restarts: int = 0
    recoveries: int = 0


class Slam:
    """A localizer that makes a map to know where it is.

    Parameters
    ----------
    settings : SlamSettings
        How.
    geometry : ScanGeometry
        Directions of the beams.

    Attributes
    ----------
    counts : SlamCounts
        What was done so far.
    doubts : Doubts
        Stretches in which it is not sure where the robot went.
    """

    Settings = SlamSettings

    def __init__(self, settings: SlamSettings, geometry: ScanGeometry) -> None:
        self._settings, self._geometry = settings, geometry
        self._unit_vectors = geometry.unit_vectors
        self.reset(np.zeros(3), 0)

    def reset(self, pose: NDArray[np.float64], seed: int) -> None:
        """Begin again at x, y, theta (3,) [m, rad]; nothing is drawn."""
        settings = self._settings
        self._mapper = LocalMapper(settings, self._geometry)
        self._loops = LoopClosing(settings)
        self.counts, self.doubts = SlamCounts(), Doubts()
        self._compass = WallCompass(settings.compass) if settings.uses_walls else None
        self._graph = NodeGraph(settings.graph, self._compass, pose)
        self._history = ScanHistory(self._geometry, settings.submaps.resolution)
        self._has_begun = False
        # After so much of the path it is surveyed where walls run.
        self._orients_at = settings.graph.start_path_m
        # The first scan's points and pose, until the map shows how well they match.
        self._first: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
        self._motion = OdometryMotion(settings)
        # Poses in the frame of the older local map: now, at the last match, at the last node.
        self._local, self._matched, self._at_node = np.zeros(3), np.zeros(3), np.zeros(3)
        self._spread = np.zeros((3, 3))
        self._path, self._failed, self._time_s = 0.0, 0, 0.0
        self._is_corrected = False

    def localize(self, sensing: Sensing) -> NDArray[np.float64]:
        """Take in what was sensed, later than all before.

        Return x, y, theta of the robot, shape (3,) [m, rad].

        Raises
        ------
        ValueError
            Where the number of ranges is not that of the geometry.
        """
        if sensing.ranges.shape != (self._geometry.beams,):
            raise ValueError(
                f"ranges have shape {sensing.ranges.shape}; want ({self._geometry.beams},), one per beam"
            )
        self.counts.scans += 1
        self._time_s = sensing.time_s
        self._correct(sensing.time_s)
        motion, period = self._motion.take(sensing)
        self._local = composed(self._local, motion)
        matching = self._settings.matching
        moved = relative(self._matched, self._local)
        is_far = np.hypot(moved[0], moved[1]) >= matching.distance_m or abs(moved[2]) >= matching.angle
        if is_far or not self._has_begun or not self._settings.uses_odometry:
            ranges = at_last_beam(
                np.asarray(sensing.ranges, np.float32),
                self._geometry,
                motion,
                matching.beam_interval_s,
                period,
            )
            points = self._points(ranges, matching.spacing_m, matching.points)
            if len(points):
                self._take(ranges, points, moved, sensing.time_s)
        return self.pose

    @property
    def _last_node(self) -> int:
        return len(self._graph.nodes) - 1

    @property
    def pose(self) -> NDArray[np.float64]:
        """x, y, theta of the robot, shape (3,) [m, rad]."""
        node, pose = self.place
        return composed(self._graph.nodes[node], pose)

    @property
    def place(self) -> tuple[int, NDArray[np.float64]]:
        """The last node, and the robot's pose x, y, theta (3,) in its frame.

        Later corrections of the node apply to the robot as well.
        """
        return self._last_node, relative(self._at_node, self._local)

    @property
    def nodes(self) -> NDArray[np.float64]:
        """Poses of all nodes as they are now believed, shape (nodes, 3) [m, rad]."""
        return self._graph.nodes.copy()

    @property
    def pending(self) -> int:
        """How many closures were found that have not acted yet."""
        return self._loops.pending

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the last pose, shape (3, 3) [m^2, m rad, rad^2]."""
        moved = relative(self._matched, self._local)
        growth = self._turned_growth(moved)
        spread = compounded(np.zeros(3), self._spread, moved, growth)
        node, pose = self.place
        return compounded(self._graph.nodes[node], self._graph.covariance, pose, spread)

    def take_correction(self) -> KeyScans | None:
        """Return all scans at their poses, once after each time the past was corrected.

        Else None.
        """
        if not self._is_corrected:
            return None
        self._is_corrected = False
        return self.key_scans

    @property
    def key_scans(self) -> KeyScans:
        """All matched scans at the poses where they are now believed to have been taken."""
        return self._history.scans(self._graph.nodes)

    @property
    def map(self) -> OccupancyGrid:
        """The map of all matched scans, rendered again after corrections."""
        return self._history.map(self._graph.nodes)

    def finish(self) -> None:
        """Let all closures act that were found so far."""
        self._correct(np.inf)

    def _points(self, ranges: NDArray[np.float32], spacing_m: float, limit: int) -> NDArray[np.float64]:
        """Return representative points in which beams ended, (n, 2) [m].

        In the robot's frame, thinned to few.
        """
        longest = min(self._settings.matching.range_m, self._geometry.range_max)
        return scan_points(
            ranges, self._unit_vectors, self._geometry.angle_increment, longest, spacing_m, limit
        )

    def _all_points(self, ranges: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return nearly all points in which beams ended.

        They serve what is found once per run and gains from each point, such as the direction of
        walls.
        """
        return self._points(ranges, self._settings.compass.spacing_m, self._geometry.beams)

    def _take(
        self,
        ranges: NDArray[np.float32],
        points: NDArray[np.float64],
        moved: NDArray[np.float64],
        time_s: float,
    ) -> None:
        """Match a scan and take it into the maps."""
        if not self._has_begun:
            self._begin(ranges)
            return
        match = self._mapper.match(points, self._local, moved, self._motion.growth(), self._failed)
        self.doubts.note(time_s, self._doubt(match, len(points)))
        self.counts.recoveries = self._mapper.recoveries
        if match is None:
            self._fail(ranges)
            return
        if match.prior.any():
            heading = float(self._local[2])
            measured, prior = turned(match.information, -heading), turned(match.prior, -heading)
            self._motion.learn(relative(self._local, match.pose), measured, prior)
        self._motion.begin_interval()
        self.counts.matches += 1
        self._failed = 0
        driven = relative(self._matched, match.pose)
        self._motion.velocity = driven
        self._path += way(driven)
        self._local, self._matched, self._spread = match.pose, match.pose.copy(), match.covariance
        if not self._mapper.insert(match.pose, way(driven), ranges):
            self._restart(
                ranges, self._motion_covariance(match.covariance, relative(self._at_node, self._local))
            )
            return
        self._measure_walls(ranges)
        graph = self._settings.graph
        if self._first is not None and self._path >= graph.start_path_m:
            self._find_start(*self._first)
        if self._compass is not None and not self._compass.is_surveyed and self._path >= self._orients_at:
            self._orient(self._compass)
        since = relative(self._at_node, self._local)
        wants_another = self._mapper.wants_another
        if wants_another or np.hypot(since[0], since[1]) >= graph.distance_m or abs(since[2]) >= graph.angle:
            self._add_node(since, self._motion_covariance(match.covariance, since))
            self._mapper.note_node(self._last_node, self._local)
            if wants_another:
                self._mapper.add(self._last_node, self._local, ranges)
            self._loops.find(self._graph, points, self._path, self._mapper.usual_score, time_s)
        self._note_key(ranges)
        poses, ended = self._mapper.hand_over(np.stack([self._local, self._matched, self._at_node]))
        self._local, self._matched, self._at_node = poses[0], poses[1], poses[2]
        self._loops.remember(ended, self._path)

    def _doubt(self, match: Match | None, points: int) -> str | None:
        """Return why a scan of so many points is not sure to be where it was placed; None where it is."""
        if match is None:
            return NO_MATCH
        if self._mapper.recoveries > self.counts.recoveries:
            return ELSEWHERE
        is_sparse = points < self._settings.matching.wide_share * self._geometry.beams
        if not match.information.any():
            return None if is_sparse else ODOMETRY_ALONE
        return None if self._mapper.explains else LITTLE

    def _begin(self, ranges: NDArray[np.float32]) -> None:
        """Begin the first map, at a node of its own.

        The start's pose in the map is known as well as one scan allows.
        """
        self._has_begun = True
        self._note_key(ranges)
        self._first = self._all_points(ranges), self._local.copy()
        growth = self._turned_growth(self._local)
        self._motion.begin_interval()
        self._begin_maps(ranges, self._motion_covariance(growth, self._local))

    def _turned_growth(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the covariance of the motion since the last match, turned by a pose (3,)."""
        if not self._motion.has_moved:
            return np.zeros((3, 3))
        return turned(self._motion.growth(), float(pose[2]))

    def _find_start(self, points: NDArray[np.float64], pose: NDArray[np.float64]) -> None:
        """Match the first scan with the map to correct the start.

        The map was begun by few scans, whose errors displace the scan from the robot's start.
        """
        self._first = None
        match = self._mapper.rendered_again(points) if self._mapper.node == 1 else None
        if match is not None:
            self._graph.begin_at(composed(pose, relative(match.pose, np.zeros(3))))
            self._note_correction()

    def _orient(self, compass: WallCompass) -> None:
        """Survey where walls run in the local map.

        Where none do, survey again after as much of the path.
        """
        self._orients_at = self._path + self._settings.graph.start_path_m
        node, scans = self._mapper.node, self.key_scans
        since = self._history.since(node)
        poses = relative(self._graph.nodes[node], scans.poses[since])
        points = [
            Transform(*pose).apply(self._all_points(ranges))
            for pose, ranges in zip(poses, scans.ranges[since], strict=True)
        ]
        if points:  # none of the scans since may have been kept
            compass.survey(np.concatenate(points), node, float(self._graph.nodes[node, 2]))

    def _motion_covariance(
        self, matched: NDArray[np.float64], since: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return how well the motion between two nodes is known, both by matches."""
        graph = self._settings.graph
        along = (graph.deviation_m + graph.deviation_per_metre * float(np.hypot(since[0], since[1]))) ** 2
        turned = np.eye(3)
        cosine, sine = np.cos(self._at_node[2]), np.sin(self._at_node[2])
        turned[:2, :2] = [[cosine, sine], [-sine, cosine]]
        return np.asarray(np.diag([along, along, graph.deviation_angle**2]) + turned @ matched @ turned.T)

    def _fail(self, ranges: NDArray[np.float32]) -> None:
        """Go on by odometry; after too many failures begin again."""
        self.counts.failures += 1
        self._failed += 1
        self._motion.velocity = np.zeros(3)
        settings = self._settings.matching
        if self._failed >= settings.lost_after:
            self.counts.restarts += 1
            covariance = np.diag([settings.lost_m**2, settings.lost_m**2, settings.lost_angle**2])
            if self._mapper.contradiction <= settings.most_contradiction:
                # The map does not know the place well, but nothing says that odometry has led elsewhere.
                growth = self._spread + turned(self._motion.growth(), float(self._local[2]))
                covariance = self._motion_covariance(growth, relative(self._at_node, self._local))
            self._motion.begin_interval()
            self._restart(ranges, covariance)

    def _restart(self, ranges: NDArray[np.float32], covariance: NDArray[np.float64]) -> None:
        """Begin new local maps at a new node here."""
        self._failed, self._first = 0, None
        if self._compass is not None:
            self._compass.forget()
            self._orients_at = self._path + self._settings.graph.start_path_m
        self._begin_maps(ranges, covariance)
        self._note_key(ranges)

    def _begin_maps(self, ranges: NDArray[np.float32], covariance: NDArray[np.float64]) -> None:
        """Begin new local maps by a scan, at a new node at the robot's pose.

        The covariance of its motion since the last node is given.
        """
        self._add_node(relative(self._at_node, self._local), covariance)
        self._loops.remember(self._mapper.begin(self._last_node, ranges), self._path)
        self._local, self._matched, self._at_node = np.zeros(3), np.zeros(3), np.zeros(3)

    def _add_node(self, since: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
        """Set a node where the robot is, so far from the last one."""
        self._graph.add(since, covariance)
        self._at_node = self._local.copy()
        self._spread = np.zeros((3, 3))

    def _measure_walls(self, ranges: NDArray[np.float32]) -> None:
        if self._compass is not None and self._compass.is_surveyed:
            self._compass.observe(
                Transform(*relative(self._at_node, self._local)).apply(self._all_points(ranges))
            )

    def _note_key(self, ranges: NDArray[np.float32]) -> None:
        node, pose = self.place
        self._history.append(node, pose, ranges, self._time_s)

    def _correct(self, time_s: float) -> None:
        """Let closures act whose time has come."""
        acting = self._loops.take_due(time_s)
        if not acting and not (time_s == np.inf and self._graph.has_waiting):
            return
        self.counts.closures += len(acting)
        is_due = self._graph.close(acting) if acting else True
        if is_due or time_s == np.inf:
            self._graph.settle(len(acting))
            self._note_correction()

    def _note_correction(self) -> None:
        self.counts.corrections += 1
        self._history.discard_map()
        self._is_corrected = True
