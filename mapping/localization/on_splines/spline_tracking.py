"""Common base of both localizers on spline maps.

Odometry, the map that they build on the path, and what they match of a scan to it.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import (
    Angle,
    Count,
    Counted,
    FromZero,
    Positive,
    Turn,
    check_settings,
)
from lidarium.mapping.geometry.rigid import Transform, wrapped
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.dead_reckoning.localizer import KeyScans, Sensing
from lidarium.mapping.localization.on_splines.spline_matches import Matches, match
from lidarium.mapping.splines.curve_lookup import CurveLookup
from lidarium.mapping.splines.curves.settings import SplineSettings
from lidarium.mapping.splines.features import Observation, observe
from lidarium.mapping.splines.scan_points import scan_points
from lidarium.mapping.splines.spline_map import SplineMap


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingSettings:
    """How a pose is kept on a map of curves.

    Attributes
    ----------
    splines : SplineSettings
        How scans become curves, and curves a map.
    turn_per_turn, turn_per_metre, slip_per_metre, slip_per_turn : float
        Standard deviations of odometry: of a turn, for each radian and each metre [1, rad/m]; of a distance,
        for each metre and each radian [1, m/rad].
    feature_sigma, line_angle_sigma : float
        Least standard deviations of features: of points and of the distance of lines [m], of the direction of
        lines [rad].
    curve_sigma : float
        Standard deviation of the distance between a ray's end and its curve [m].
    curve_distance : float
        Rays that end farther from any curve see what is new, and say nothing of the pose [m].
    ray_stride : int
        Every so many-th beam that returned counts.
    ray_share : float
        What a ray counts, since neighbours are correlated.
    least_sightings : int
        Corners and peaks of the map count from so many scans on.
    least_features, least_rays : int
        With fewer matches of both kinds the pose is predicted only.
    still_distance, still_turn : float
        A robot that has moved less since its last correction is not corrected again: what it sees is not new
        [m, rad].
    map_distance, map_turn : float
        The map takes in a scan whenever the robot has moved as far since the last one [m, rad].
    """

    splines: SplineSettings = field(default_factory=SplineSettings)
    turn_per_turn: FromZero = 0.15
    turn_per_metre: FromZero = 0.06
    slip_per_metre: FromZero = 0.10
    slip_per_turn: FromZero = 0.03
    feature_sigma: Positive = 0.02
    line_angle_sigma: Angle = math.radians(1.0)
    curve_sigma: Positive = 0.03
    curve_distance: Positive = 0.3
    ray_stride: Count = 8
    ray_share: Positive = 0.5
    least_sightings: Count = 3
    least_features: Counted = 2
    least_rays: Counted = 20
    still_distance: FromZero = 0.001
    still_turn: Turn = math.radians(0.1)
    map_distance: Positive = 0.1
    map_turn: Angle = math.radians(5.0)

    def __post_init__(self) -> None:
        check_settings(self, "tracking")


class SplineTracker(ABC):
    """A localizer that makes a map of curves and keeps itself on it.

    How a pose is predicted and corrected, heirs say.

    Parameters
    ----------
    settings : TrackingSettings
        What both kinds of filter share.
    geometry : ScanGeometry
        The laser.

    Attributes
    ----------
    map : SplineMap
        The map so far.
    pose : (3,) float64
        The last pose, x, y, theta [m, rad].
    """

    def __init__(self, settings: TrackingSettings, geometry: ScanGeometry) -> None:
        self.tracking, self.geometry = settings, geometry
        self.reset(np.zeros(3), 0)

    def reset(self, pose: NDArray[np.float64], seed: int) -> None:
        """Begin again at x, y, theta (3,) [m, rad] with a blank map.

        Whatever is drawn comes from ``seed``.
        """
        begin = np.array(pose, np.float64)
        if begin.shape != (3,) or not np.isfinite(begin).all():
            raise ValueError(f"pose is {pose}; want x, y, theta, all finite")
        begin[2] = wrapped(float(begin[2]))
        self.pose = begin
        self.map = SplineMap(self.tracking.splines)
        self._lookup = CurveLookup(self.geometry.range_max, self.tracking.curve_distance)
        self._odometry: Transform | None = None
        self._time_s = -math.inf
        self._unmapped = self._uncorrected = Transform()
        self._is_mapped = False
        self._begin(begin, seed)

    def localize(self, sensing: Sensing) -> NDArray[np.float64]:
        """Take in what was sensed, later than all before.

        Return x, y, theta of the robot, shape (3,) [m, rad].

        Raises
        ------
        ValueError
            Where time runs backwards, the odometry is not finite, or the scan has not as many ranges as the
            laser beams.
        """
        if not sensing.time_s > self._time_s:
            raise ValueError(f"sensed at {sensing.time_s} s, not later than the last at {self._time_s} s")
        if not np.isfinite(sensing.odometry).all():
            raise ValueError(f"odometry is {sensing.odometry}; want x, y, theta, all finite")
        odometry = Transform(*(float(value) for value in sensing.odometry))
        motion = Transform() if self._odometry is None else self._odometry.inverse() @ odometry
        motion_s = sensing.time_s - self._time_s if self._odometry is not None else 0.0
        self._odometry, self._time_s = odometry, sensing.time_s
        self._unmapped, self._uncorrected = self._unmapped @ motion, self._uncorrected @ motion
        self.pose = self._predict(motion)
        observation = observe(
            scan_points(sensing.ranges, self.geometry, self.tracking.splines.points, motion, motion_s),
            self.tracking.splines,
        )
        tracking = self.tracking
        if self._is_mapped and _is_beyond(self._uncorrected, tracking.still_distance, tracking.still_turn):
            self._uncorrected = Transform()
            matches = self._match(observation)
            if matches.features >= tracking.least_features or len(matches.rays) >= tracking.least_rays:
                self.pose = self._correct(matches, observation)
        if not self._is_mapped or _is_beyond(self._unmapped, tracking.map_distance, tracking.map_turn):
            self._take_in(observation)
        return self.pose.copy()

    @property
    @abstractmethod
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the last pose, shape (3, 3) [m^2, m rad, rad^2]."""

    def take_correction(self) -> KeyScans | None:
        """Return None: the past is never corrected."""
        return None

    @abstractmethod
    def _begin(self, pose: NDArray[np.float64], seed: int) -> None:
        """Begin at a pose."""

    @abstractmethod
    def _predict(self, motion: Transform) -> NDArray[np.float64]:
        """Move as odometry says, ``before_from_now``; return the pose."""

    @abstractmethod
    def _correct(self, matches: Matches, observation: Observation) -> NDArray[np.float64]:
        """Weigh what was matched; return the pose."""

    def _match(self, observation: Observation) -> Matches:
        """Match a scan to the map from the pose as it is believed now."""
        if not self._lookup.covers(self.pose[:2]):
            self._lookup.renew(self.map.curves, self.pose[:2])
        here = Transform(*(float(value) for value in self.pose))
        return match(
            observation, self.map, self._lookup, here, self.tracking.ray_stride, self.tracking.least_sightings
        )

    def _take_in(self, observation: Observation) -> None:
        """Let the map learn from a scan at the pose."""
        if len(observation.pieces) == 0:
            return
        self.map.update(observation, Transform(*(float(value) for value in self.pose)))
        self._lookup.renew(self.map.curves, self.pose[:2])
        self._unmapped, self._is_mapped = Transform(), True


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


def _is_beyond(motion: Transform, distance: float, turn: float) -> bool:
    return math.hypot(motion.x, motion.y) >= distance or abs(motion.theta) >= turn
