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

from lidarium.mapping.geometry.rigid import Transform, composed, relative
from lidarium.mapping.grids.growing_array import GrowingArray
from lidarium.mapping.grids.occupancy import OccupancyGrid, OccupancySettings
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.dead_reckoning.localizer import KeyScans, Sensing
from lidarium.mapping.localization.dead_reckoning.odometry import compounded
from lidarium.mapping.localization.graph.closures import Closure, ClosureFinder
from lidarium.mapping.localization.graph.node_graph import NodeGraph
from lidarium.mapping.localization.matching.local_mapping import Finished, LocalMapper, turned, way
from lidarium.mapping.localization.matching.scan_points import at_last_beam, scan_points
from lidarium.mapping.localization.matching.settings.slam import SlamSettings
from lidarium.mapping.localization.matching.wall_compass import WallCompass
from lidarium.mapping.localization.slam.calibration import OdometryCalibration


@dataclass(slots=True)
class SlamCounts:
    """What a localizer has done so far."""

    scans: int = 0
    matches: int = 0
    failures: int = 0
    closures: int = 0
    corrections: int = 0
    restarts: int = 0


class Slam:
    """A localizer that makes a map to know where it is.

    Parameters
    ----------
    settings : SlamSettings
        How.
    geometry : ScanGeometry
        Which way the beams look.

    Attributes
    ----------
    counts : SlamCounts
        What was done so far.
    """

    Settings = SlamSettings

    def __init__(self, settings: SlamSettings, geometry: ScanGeometry) -> None:
        self._settings, self._geometry = settings, geometry
        self._unit_vectors = geometry.unit_vectors
        self.reset(np.zeros(3), 0)

    def reset(self, pose: NDArray[np.float64], seed: int) -> None:
        """Begin anew at x, y, theta (3,) [m, rad]; nothing is drawn."""
        settings = self._settings
        self._mapper = LocalMapper(settings, self._geometry)
        self._finder = ClosureFinder(settings.closures, settings.matching)
        self.counts = SlamCounts()
        self._compass = WallCompass(settings.compass) if settings.uses_walls else None
        self._graph = NodeGraph(settings.graph, self._compass, pose)
        self._due: list[tuple[float, Closure]] = []
        # Of each scan that was matched: the node before, the pose in its frame, and the ranges.
        self._key_nodes, self._key_poses = GrowingArray((), np.int64), GrowingArray((3,), np.float64)
        self._key_ranges = GrowingArray((self._geometry.beams,), np.float32)
        self._has_begun = False
        # After so much way it is surveyed where walls run.
        self._orients_at = settings.graph.start_path_m
        # The first scan's points and pose, until the map tells how well it lies on them.
        self._first: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
        self._last: Sensing | None = None
        # Poses in the frame of the older local map: now, at the last match, at the last node.
        self._local, self._matched, self._at_node = np.zeros(3), np.zeros(3), np.zeros(3)
        self._spread = np.zeros((3, 3))
        self._velocity = np.zeros(3)
        # What odometry has told since the last match: distance, negative backwards, and turn [m, rad].
        self._calibration, self._told = OdometryCalibration(settings.odometry), np.zeros(2)
        self._path, self._failed = 0.0, 0
        self._is_corrected = False
        self._map, self._mapped = OccupancyGrid(), 0

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
        self._correct(sensing.time_s)
        motion = self._motion(sensing)
        self._local = composed(self._local, motion)
        period = sensing.time_s - self._last.time_s if self._last is not None else 0.0
        self._last = sensing
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
        return len(self._due)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the last pose, shape (3, 3) [m^2, m rad, rad^2]."""
        moved = relative(self._matched, self._local)
        growth = turned(self._growth(), float(moved[2])) if self._told.any() else np.zeros((3, 3))
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
        return KeyScans(
            composed(self._graph.nodes[self._key_nodes.rows], self._key_poses.rows), self._key_ranges.rows
        )

    @property
    def map(self) -> OccupancyGrid:
        """The map of all matched scans, rendered anew after corrections."""
        settings = OccupancySettings(resolution=self._settings.submaps.resolution)
        if self._mapped == 0:
            self._map = OccupancyGrid(settings)
        scans = self.key_scans
        for pose, ranges in zip(scans.poses[self._mapped :], scans.ranges[self._mapped :], strict=True):
            self._map.integrate(pose, ranges, self._geometry)
        self._mapped = len(self._key_ranges)
        return self._map

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

    def _motion(self, sensing: Sensing) -> NDArray[np.float64]:
        """Return the motion since the last sensing, by odometry or the last motion.

        The last motion is used where odometry is not.
        """
        if self._last is None:
            return np.zeros(3)
        if not self._settings.uses_odometry:
            return self._velocity
        ends = np.stack([self._last.odometry, sensing.odometry])
        if not np.isfinite(ends).all():
            return np.zeros(3)
        motion = relative(ends[0], ends[1])
        self._told += motion[[0, 2]]
        return self._calibration.corrected(motion)

    def _growth(self) -> NDArray[np.float64]:
        """Return the covariance of the motion by odometry since the last match.

        It is in the robot's present frame.
        """
        return self._calibration.uncertainty(float(self._told[0]), float(self._told[1]))

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
        match = self._mapper.match(points, self._local, moved, self._growth(), self._failed)
        if match is None:
            self._fail(ranges)
            return
        if match.prior.any():
            heading = float(self._local[2])
            told, prior = turned(match.told, -heading), turned(match.prior, -heading)
            self._calibration.learn(
                float(self._told[0]), float(self._told[1]), relative(self._local, match.pose), told, prior
            )
        self._told[:] = 0.0
        self.counts.matches += 1
        self._failed = 0
        driven = relative(self._matched, match.pose)
        self._velocity = driven
        self._path += way(driven)
        self._local, self._matched, self._spread = match.pose, match.pose.copy(), match.covariance
        if not self._mapper.insert(match.pose, way(driven), ranges):
            self._begin_anew(
                ranges, self._motion_covariance(match.covariance, relative(self._at_node, self._local))
            )
            return
        self._look_at_walls(ranges)
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
            self._look_for_closures(points, time_s)
        self._note_key(ranges)
        poses, ended = self._mapper.hand_over(np.stack([self._local, self._matched, self._at_node]))
        self._local, self._matched, self._at_node = poses[0], poses[1], poses[2]
        self._finder_takes(ended)

    def _begin(self, ranges: NDArray[np.float32]) -> None:
        """Begin the first map, at a node of its own.

        The start's pose in the map is known as well as one scan allows.
        """
        self._has_begun = True
        self._note_key(ranges)
        self._first = self._all_points(ranges), self._local.copy()
        growth = turned(self._growth(), float(self._local[2])) if self._told.any() else np.zeros((3, 3))
        self._told[:] = 0.0
        self._begin_maps(ranges, self._motion_covariance(growth, self._local))

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

        Where none do, look again after as much way.
        """
        self._orients_at = self._path + self._settings.graph.start_path_m
        node, scans = self._mapper.node, self.key_scans
        since = np.flatnonzero(self._key_nodes.rows >= node)
        poses = relative(self._graph.nodes[node], scans.poses[since])
        points = [
            Transform(*pose).apply(self._all_points(ranges))
            for pose, ranges in zip(poses, scans.ranges[since], strict=True)
        ]
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
        """Go on by odometry; after too many failures begin anew."""
        self.counts.failures += 1
        self._failed += 1
        self._velocity = np.zeros(3)
        settings = self._settings.matching
        if self._failed >= settings.lost_after:
            self.counts.restarts += 1
            covariance = np.diag([settings.lost_m**2, settings.lost_m**2, settings.lost_angle**2])
            if self._mapper.contradiction <= settings.most_contradiction:
                # The map does not know the place well, but nothing says that odometry has led elsewhere.
                growth = self._spread + turned(self._growth(), float(self._local[2]))
                covariance = self._motion_covariance(growth, relative(self._at_node, self._local))
            self._told[:] = 0.0
            self._begin_anew(ranges, covariance)

    def _begin_anew(self, ranges: NDArray[np.float32], covariance: NDArray[np.float64]) -> None:
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
        self._finder_takes(self._mapper.begin(self._last_node, ranges))
        self._local, self._matched, self._at_node = np.zeros(3), np.zeros(3), np.zeros(3)

    def _add_node(self, since: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
        """Set a node where the robot is, so far from the last one."""
        self._graph.add(since, covariance)
        self._at_node = self._local.copy()
        self._spread = np.zeros((3, 3))

    def _look_at_walls(self, ranges: NDArray[np.float32]) -> None:
        if self._compass is not None and self._compass.is_surveyed:
            self._compass.look(
                Transform(*relative(self._at_node, self._local)).apply(self._all_points(ranges))
            )

    def _note_key(self, ranges: NDArray[np.float32]) -> None:
        node, pose = self.place
        self._key_nodes.append(node)
        self._key_poses.append(pose)
        self._key_ranges.append(ranges)

    def _finder_takes(self, ended: list[Finished]) -> None:
        for finished in ended:
            self._finder.remember(finished, self._path)

    def _look_for_closures(self, points: NDArray[np.float64], time_s: float) -> None:
        graph, usual_score = self._graph, self._mapper.usual_score
        for closure in self._finder.find(
            graph.nodes, points, graph.covariance, graph.covariance_since, self._path, usual_score
        ):
            self._due.append((time_s + self._settings.closures.delay_s, closure))

    def _correct(self, time_s: float) -> None:
        """Let closures act whose time has come."""
        acting = [closure for due, closure in self._due if due <= time_s]
        if not acting and not (time_s == np.inf and self._graph.has_waiting):
            return
        self._due = [(due, closure) for due, closure in self._due if due > time_s]
        self.counts.closures += len(acting)
        is_due = self._graph.close(acting) if acting else True
        if is_due or time_s == np.inf:
            self._graph.settle(len(acting))
            self._note_correction()

    def _note_correction(self) -> None:
        self.counts.corrections += 1
        self._mapped, self._is_corrected = 0, True
