"""Common base of both localizers on spline maps.

Odometry, the local maps that they build on the path, and the matches of a scan with them.

A filter estimates the robot's pose in the frame of a local map. The laser's path is a graph of nodes, as SLAM
has it: local maps begin anew along it with the walls around the robot, places are recognised, and all nodes
are brought to agree. How far a local map itself may be off grows with the path, and is added to what the
filter knows.
"""

import math
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.spline_files import read_spline_map
from lidarium.mapping.geometry.rigid import Transform, composed, relative, turned, wrapped
from lidarium.mapping.grids.occupancy import OccupancyGrid
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.localizer import KeyScans, Sensing
from lidarium.mapping.localization.matching.scan_points import at_last_beam
from lidarium.mapping.localization.odometry import compounded
from lidarium.mapping.localization.on_splines.spline_matches import Matches, TrackingSettings, match
from lidarium.mapping.localization.slam.mapped_path import MappedPath
from lidarium.mapping.splines.curve import CurveLookup
from lidarium.mapping.splines.features import Observation, observe, scan_points
from lidarium.mapping.splines.spline_map import SplineMap

START_SPREAD = 0.05, math.radians(1.0)
"""Standard deviations of the first pose on a map of an earlier run [m, rad]."""


class SplineTracker(ABC):
    """A localizer that makes a map of curves and keeps itself on it.

    How a pose is predicted and corrected, heirs say.

    Attributes
    ----------
    settings : dataclass
        How; the heir's own.
    local_map : SplineMap
        The local map that grows, in a frame of its own.
    local : (3,) float64
        The last pose in that frame, x, y, theta [m, rad].
    updates : int
        How many scans the local maps have taken in.
    """

    settings: Any

    def __init__(self, settings: TrackingSettings, geometry: ScanGeometry) -> None:
        self.tracking, self.geometry = settings, geometry
        # The walls that are known from the start, in the frame of the poses.
        self._known = read_spline_map(Path(settings.start_map), settings.splines) if settings.start_map else None
        self.reset(np.zeros(3), 0)

    def reset(self, pose: NDArray[np.float64], seed: int) -> None:
        """Begin again at x, y, theta (3,) [m, rad] with a blank map, or the one of ``start_map``.

        Whatever is drawn comes from ``seed``.
        """
        begin = np.array(pose, np.float64)
        if begin.shape != (3,) or not np.isfinite(begin).all():
            raise ValueError(f"pose is {pose}; want x, y, theta, all finite")
        begin[2] = wrapped(float(begin[2]))
        self.local, self.updates = np.zeros(3), 0
        self.local_map = self._known_around(begin, self.geometry.range_max + 1.0)
        self._mount = np.array([self.tracking.splines.points.laser_x, 0.0, 0.0])
        self._path = MappedPath(
            self.tracking.path, self.geometry, composed(begin, self._mount), finds_start=self._known is None
        )
        self._path.local = self._path.at_node = self._mount.copy()
        # Local maps that are finished, each with the node in whose frame it is.
        self._finished: list[tuple[int, SplineMap]] = []
        self._lookup = CurveLookup(self.geometry.range_max, self.tracking.curve_distance)
        self._odometry: Transform | None = None
        self._time_s = -math.inf
        self._unmapped = self._uncorrected = Transform()
        self._is_mapped = False
        self._spread_at_node = np.zeros((3, 3))
        self._begin(np.zeros(3), seed)

    def localize(self, sensing: Sensing) -> NDArray[np.float64]:
        """Take in sensor readings, none earlier than those before.

        Return x, y, theta of the robot, shape (3,) [m, rad].
        """
        if not sensing.time_s >= self._time_s:
            raise ValueError(f"sensed at {sensing.time_s} s, earlier than the last at {self._time_s} s")
        if not np.isfinite(sensing.odometry).all():
            raise ValueError(f"odometry is {sensing.odometry}; want x, y, theta, all finite")
        odometry = Transform(*(float(value) for value in sensing.odometry))
        motion = Transform() if self._odometry is None else self._odometry.inverse() @ odometry
        motion_s = sensing.time_s - self._time_s if self._odometry is not None else 0.0
        self._odometry, self._time_s = odometry, sensing.time_s
        self._path.correct(sensing.time_s)
        self._unmapped, self._uncorrected = self._unmapped @ motion, self._uncorrected @ motion
        self.local = self._predict(motion)
        observation = observe(
            scan_points(sensing.ranges, self.geometry, self.tracking.splines.points, motion, motion_s),
            self.tracking.splines,
        )
        tracking = self.tracking
        is_on_known = not self._is_mapped and self._known is not None
        has_moved = _is_beyond(self._uncorrected, tracking.still_distance, tracking.still_turn)
        if is_on_known or (self._is_mapped and has_moved):
            self._uncorrected = Transform()
            matches = self._match(observation)
            if matches.features >= tracking.least_features or len(matches.rays) >= tracking.least_rays:
                self.local = self._correct(matches, observation)
        if not self._is_mapped or _is_beyond(self._unmapped, tracking.map_distance, tracking.map_turn):
            self._take_in(observation, self._at_last_beam(sensing, motion, motion_s))
        self._path.local = composed(self.local, self._mount)
        return self.pose

    def _start_spread(self, distance: float, turn: float) -> NDArray[np.float64]:
        """Return the standard deviations of the first pose, (3,) [m, rad].

        With a start map, ``START_SPREAD`` replaces zeros, as the start on that map is not known exactly.
        """
        if self._known is not None and distance == turn == 0.0:
            distance, turn = START_SPREAD
        return np.array([distance, distance, turn])

    @property
    def pose(self) -> NDArray[np.float64]:
        """The last pose, x, y, theta (3,) [m, rad]."""
        return composed(self._path.pose, -self._mount)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the last pose, shape (3, 3) [m^2, m rad, rad^2]."""
        path = self._path
        of_laser = path.covariance(path.motion_covariance(self._growth(), path.place[1]))
        return compounded(path.pose, of_laser, -self._mount, np.zeros((3, 3)))

    @property
    @abstractmethod
    def local_covariance(self) -> NDArray[np.float64]:
        """Covariance of the last pose in the local map, shape (3, 3) [m^2, m rad, rad^2]."""

    @property
    def map(self) -> SplineMap:
        """The map of all local maps, at the poses that are now believed."""
        nodes, whole = self._path.nodes, SplineMap(self.tracking.splines)
        if self._known is not None:
            whole.absorb(self._known, Transform())
        for node, part in [*self._finished, (self._path.mapper_node, self.local_map)]:
            whole.absorb(part, Transform(*nodes[node].tolist()))
        return whole

    @property
    def grid(self) -> OccupancyGrid:
        """The same scans as a grid, rendered again after corrections."""
        return self._path.map

    @property
    def place(self) -> tuple[int, NDArray[np.float64]]:
        """The last node, and the laser's pose x, y, theta (3,) in its frame."""
        return self._path.place

    @property
    def nodes(self) -> NDArray[np.float64]:
        """Poses of all nodes as they are now believed, shape (nodes, 3) [m, rad]."""
        return self._path.nodes

    @property
    def closures(self) -> int:
        """Number of places that were recognised."""
        return self._path.closures

    @property
    def corrections(self) -> int:
        """How often the past was corrected."""
        return self._path.corrections

    @property
    def key_scans(self) -> KeyScans:
        """All scans that local maps have taken in, at their poses as believed now."""
        return self._path.key_scans

    def take_correction(self) -> KeyScans | None:
        """Return all scans at their poses, once after each time the past was corrected; else None."""
        return self._path.take_correction()

    def finish(self) -> None:
        """Let all closures act that were found so far."""
        self._path.correct(math.inf)

    @abstractmethod
    def _begin(self, pose: NDArray[np.float64], seed: int) -> None:
        """Begin at a pose."""

    @abstractmethod
    def _change_frame(self, change: Transform, reach: float) -> None:
        """Bring the map to the frame of another local map, ``new_from_old``.

        Everything beyond a square of half the side ``reach`` around it is dropped [m].
        """

    @abstractmethod
    def _predict(self, motion: Transform) -> NDArray[np.float64]:
        """Move by odometry, ``before_from_now``; return the pose."""

    @abstractmethod
    def _correct(self, matches: Matches, observation: Observation) -> NDArray[np.float64]:
        """Weigh the matches; return the pose."""

    def _match(self, observation: Observation) -> Matches:
        """Match a scan to the local map from the pose as it is believed now."""
        if not self._lookup.covers(self.local[:2]):
            self._lookup.renew(self.local_map.curves, self.local[:2])
        here = Transform(*(float(value) for value in self.local))
        return match(
            observation,
            self.local_map,
            self._lookup,
            here,
            self.tracking.ray_stride,
            self.tracking.least_sightings,
        )

    def _take_in(self, observation: Observation, ranges: NDArray[np.float32]) -> None:
        """Let the local map and the path learn from a scan at the pose."""
        if len(observation.pieces) == 0:
            return
        self.local_map.update(observation, Transform(*(float(value) for value in self.local)))
        self.updates += 1
        self._unmapped = Transform()
        self._extend(ranges)
        self._is_mapped = True
        self._lookup.renew(self.local_map.curves, self.local[:2])

    def _extend(self, ranges: NDArray[np.float32]) -> None:
        """Take a scan into the path; begin another local map if it is time to."""
        path, matching = self._path, self.tracking.path.matching
        path.local = composed(self.local, self._mount)
        node, last_node = path.mapper_node, path.last_node
        if not self._is_mapped:
            frame: NDArray[np.float64] | None = path.begin(ranges, self._growth(), self._time_s)
        else:
            points = path.sampling.points(ranges, matching.spacing_m, matching.points)
            path.mapper.judge(points, path.local)
            frame = path.take(path.local, self._growth(), ranges, points, self._time_s)
        if path.last_node > last_node:
            self._spread_at_node = self.local_covariance
        if frame is None:
            return
        if self._is_mapped:
            self._finished.append((node, self.local_map))
        self._begin_local_map(Transform(*frame.tolist()))

    def _begin_local_map(self, frame: Transform) -> None:
        """Go on in a new frame, ``old_from_new``, with the map around the robot."""
        self.local = relative(np.array([frame.x, frame.y, frame.theta]), self.local)
        reach = self.geometry.range_max + 1.0 + float(np.hypot(*self.local[:2]))
        self.local_map = self.local_map.around(frame, reach)
        if self._known is not None:
            # What was cut off before may be around again.
            self.local_map.absorb(self._known_around(self._path.nodes[self._path.mapper_node], reach), Transform())
        self._spread_at_node = turned(self._spread_at_node, -frame.theta)
        self._change_frame(frame.inverse(), reach)

    def _known_around(self, frame: NDArray[np.float64], reach: float) -> SplineMap:
        """Return the known walls around a frame x, y, theta (3,), in that frame."""
        known = SplineMap(self.tracking.splines) if self._known is None else self._known
        return known.around(Transform(*frame.tolist()), reach)

    def _growth(self) -> NDArray[np.float64]:
        """Return how much less well the pose in the local map is known than at the last node, (3, 3).

        If it is known better since, nothing is added: the space between the nodes is no better known.
        """
        moved = composed(self.local, self._mount)[:2] - self._path.at_node[:2]
        lever = np.array([[1.0, 0.0, -moved[1]], [0.0, 1.0, moved[0]], [0.0, 0.0, 1.0]])
        now = self.local_covariance + np.diag([1e-10, 1e-10, 1e-10])
        root = np.linalg.cholesky(now)
        back = np.linalg.inv(root)
        shares, directions = np.linalg.eigh(np.eye(3) - back @ lever @ self._spread_at_node @ lever.T @ back.T)
        grown = root @ directions
        return np.asarray((grown * np.maximum(shares, 0.0)) @ grown.T)

    def _at_last_beam(self, sensing: Sensing, motion: Transform, motion_s: float) -> NDArray[np.float32]:
        """Return the scan as if all beams had been taken with the last one."""
        ranges = np.asarray(sensing.ranges, np.float32)
        interval = self.tracking.splines.points.beam_interval_s
        step = np.array([motion.x, motion.y, motion.theta])
        return at_last_beam(ranges, self.geometry, step, interval, motion_s)


def _is_beyond(motion: Transform, distance: float, turn: float) -> bool:
    return math.hypot(motion.x, motion.y) >= distance or abs(motion.theta) >= turn


def steps_of(motion: Transform) -> tuple[float, float, float]:
    """Split a motion into a turn, a straight segment and a turn [rad, m, rad].

    The segment leads ahead or back.
    """
    distance = math.hypot(motion.x, motion.y)
    if distance < 0.001:
        return 0.0, distance, motion.theta
    first = math.atan2(motion.y, motion.x)
    # A robot that backs up has not turned round twice.
    if abs(first) > math.pi / 2.0:
        first, distance = wrapped(first + math.pi), -distance
    return first, distance, wrapped(motion.theta - first)


def driven(poses: NDArray[np.float64], steps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses (n, 3) after a turn, a straight segment and a turn each, (n, 3) [rad, m, rad]."""
    headings = poses[:, 2] + steps[:, 0]
    return np.stack(
        [
            poses[:, 0] + steps[:, 1] * np.cos(headings),
            poses[:, 1] + steps[:, 1] * np.sin(headings),
            headings + steps[:, 2],
        ],
        axis=1,
    )
