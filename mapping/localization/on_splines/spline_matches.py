"""Matches of a scan's points, lines and rays with a map of curves.

They are arrays that filters weigh.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import Angle, Count, Counted, FromZero, Positive, Turn, check_settings
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.localization.settings import GraphSettings, SlamSettings
from lidarium.mapping.splines.curve import CurveLookup
from lidarium.mapping.splines.features import Observation, match_points
from lidarium.mapping.splines.landmarks import Landmarks
from lidarium.mapping.splines.settings import AssociationSettings, SplineSettings
from lidarium.mapping.splines.spline_map import SplineMap


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Features in the robot's frame, and their matches on the map.

    Attributes
    ----------
    points, known_points : (n, 2) float64
        Corners and peaks [m].
    point_sigmas : (n,) float64
        Standard deviations of their ranges [m].
    lines, known_lines : (m, 3) float64
        A point x, y of the line, and its direction [m, rad].
    line_sigmas : (m,) float64
        Standard deviations of their ranges [m].
    rays : (k, 2) float64
        Ends of some beams that lie near curves of the map [m].
    pieces : (k, 5) float64
        The straight piece of a curve that is nearest to each: middle x, y, unit vector along, half length
        [m].
    """

    points: NDArray[np.float64]
    known_points: NDArray[np.float64]
    point_sigmas: NDArray[np.float64]
    lines: NDArray[np.float64]
    known_lines: NDArray[np.float64]
    line_sigmas: NDArray[np.float64]
    rays: NDArray[np.float64]
    pieces: NDArray[np.float64]

    @property
    def features(self) -> int:
        """How many features are matched."""
        return len(self.points) + len(self.lines)


def match(
    observation: Observation,
    spline_map: SplineMap,
    lookup: CurveLookup,
    pose: Transform,
    stride: int,
    least_sightings: int,
) -> Matches:
    """Match a scan to the map from about its pose."""
    settings = spline_map.settings.association
    features, seen = observation.features, observation.features.moved(pose)
    matched = [
        _matched_points(own, placed, known, settings.point_distance, least_sightings)
        for own, placed, known in (
            (features.corners, seen.corners, spline_map.corners),
            (features.peaks, seen.peaks, spline_map.peaks),
        )
    ]
    sigmas = (features.corner_sigmas, features.peak_sigmas)
    which_lines, references, known_lines = _matched_lines(seen.lines, spline_map.lines, pose, settings)
    rays = observation.points.points[::stride]
    pieces, _ = lookup.look_up(pose.apply(rays))
    is_known = pieces >= 0
    own_references = pose.inverse().apply(references)
    return Matches(
        np.concatenate([part[0] for part in matched]),
        np.concatenate([part[1] for part in matched]),
        np.concatenate([sigma[part[2]] for sigma, part in zip(sigmas, matched, strict=True)]),
        np.column_stack([own_references, features.lines[which_lines, 2]]),
        known_lines,
        features.line_sigmas[which_lines],
        rays[is_known],
        lookup.pieces[pieces[is_known]],
    )


def _matched_points(
    own: NDArray[np.float64],
    placed: NDArray[np.float64],
    known: Landmarks,
    most_distance: float,
    least_sightings: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return seen points, their matched map points, and the indices of the seen.

    The seen points are in the robot's frame.
    """
    trusted = known.points[known.counts >= least_sightings]
    which, of_map = match_points(placed, trusted, most_distance)
    return own[which], trusted[of_map], which


def _matched_lines(
    seen: NDArray[np.float64], known: NDArray[np.float64], pose: Transform, settings: AssociationSettings
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return indices of matched lines, reference points, and the map's lines.

    Seen lines are (n, 4). The matched are compared about points (m, 2); the map's lines are (m, 3).
    """
    if len(seen) == 0 or len(known) == 0:
        return np.empty(0, np.int64), np.empty((0, 2)), np.empty((0, 3))
    if settings.line_origin == "segment":
        references = seen[:, :2]
    else:
        along = np.stack([np.cos(seen[:, 2]), np.sin(seen[:, 2])], axis=1)
        offsets = np.array([pose.x, pose.y]) - seen[:, :2]
        references = seen[:, :2] + (offsets * along).sum(axis=1)[:, None] * along
    cosines, sines = np.cos(known[:, 2]), np.sin(known[:, 2])
    to_middle = seen[:, None, :2] - known[None, :, :2]
    to_reference = references[:, None] - known[None, :, :2]
    along_known = to_middle[..., 0] * cosines + to_middle[..., 1] * sines
    aside = to_reference[..., 1] * cosines - to_reference[..., 0] * sines
    turns = seen[:, None, 2] - known[None, :, 2]
    turns = np.abs(np.arctan2(np.sin(turns), np.cos(turns)))
    fits = (
        (np.abs(aside) <= settings.line_distance)
        & (turns <= settings.line_angle)
        & (np.abs(along_known) <= known[None, :, 3])
    )
    gaps = np.where(fits, np.abs(aside) + turns, np.inf)
    best = gaps.argmin(axis=1)
    which = np.flatnonzero(np.isfinite(gaps[np.arange(len(seen)), best]))
    return which.astype(np.int64), references[which], known[best[which], :3]


_GRAPH = GraphSettings(deviation_m=0.003, deviation_per_metre=0.006, deviation_angle=math.radians(0.03))
"""Curves follow walls a little closer than cells: chosen where true poses lie within the spread."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingSettings:
    """How a pose is kept on a map of curves.

    Attributes
    ----------
    splines : SplineSettings
        How scans become curves, and curves a map.
    turn_per_turn, turn_per_metre, slip_per_metre, slip_per_turn : float, default 0.15, 0.06, 0.1, 0.03
        Standard deviations of odometry: of a turn, for each radian and each metre [1, rad/m]; of a distance,
        for each metre and each radian [1, m/rad].
    feature_sigma, line_angle_sigma : float
        Least standard deviations of features: of points and of the distance of lines [m], of the direction of
        lines [rad].
    curve_sigma : float, default 0.03
        Standard deviation of the distance between a ray's end and its curve [m].
    curve_distance : float, default 0.3
        Rays that end farther from any curve see new walls, and do not measure the pose [m].
    ray_stride : int, default 8
        Step between the returned beams that count.
    ray_share : float, default 0.5
        Weight of a ray, since neighbours are correlated.
    least_sightings : int, default 3
        Minimum number of scans of corners and peaks that count.
    least_features, least_rays : int, default 2, 20
        With fewer matches of both kinds the pose is predicted only.
    still_distance, still_turn : float
        A robot that has moved less since its last correction is not corrected again: what it sees is not new
        [m, rad].
    map_distance, map_turn : float
        The map takes in a scan whenever the robot has moved as far since the last one [m, rad].
    path : SlamSettings
        How local maps follow each other, places are recognised and poses brought to agree; its matching
        serves to recognise places only.
    start_map : str
        File of a spline map that the robot begins with, in the frame of its poses; empty for none.
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
    path: SlamSettings = field(default_factory=lambda: SlamSettings(graph=_GRAPH))
    start_map: str = ""

    def __post_init__(self) -> None:
        check_settings(self, "tracking")


TURNED = np.array([[0.0, -1.0], [1.0, 0.0]])
"""A quarter turn."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Linearised measurements: residuals (m,), Jacobian (m, n), variances (m,).

    The Jacobian is by the first n numbers of the state.
    """

    misses: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    variances: NDArray[np.float64]

    def within(self, sigmas: float) -> "Measured":
        """Return those that miss by at most a number of standard deviations."""
        is_kept = self.misses**2 <= sigmas**2 * self.variances
        return Measured(self.misses[is_kept], self.jacobian[is_kept], self.variances[is_kept])

    def information(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the information (n, n) of the state, and its product (n,) with the change that fits."""
        weighted = self.jacobian / self.variances[:, None]
        return weighted.T @ self.jacobian, weighted.T @ self.misses


def measured_points(matches: Matches, pose: NDArray[np.float64], tracking: TrackingSettings) -> Measured:
    """Measure the offsets of corners and peaks from those of the map, along both axes."""
    lever = matches.points @ rotation_of(float(pose[2])).T
    jacobian = np.zeros((len(lever), 2, 3))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
    jacobian[:, :, 2] = lever @ TURNED.T
    misses = matches.known_points - lever - pose[:2]
    variances = np.repeat(np.maximum(matches.point_sigmas, tracking.feature_sigma) ** 2, 2)
    return Measured(misses.reshape(-1), jacobian.reshape(-1, 3), variances)


def measured_lines(matches: Matches, pose: NDArray[np.float64], tracking: TrackingSettings) -> Measured:
    """Measure the offsets of lines from lines of the map, and the angles between them."""
    count = len(matches.lines)
    lever = matches.lines[:, :2] @ rotation_of(float(pose[2])).T
    known = matches.known_lines
    normals = np.stack([-np.sin(known[:, 2]), np.cos(known[:, 2])], axis=1)
    asides = ((lever + pose[:2] - known[:, :2]) * normals).sum(axis=1)
    turns = pose[2] + matches.lines[:, 2] - known[:, 2]
    jacobian = np.zeros((2 * count, 3))
    jacobian[:count, :2] = normals
    jacobian[:count, 2] = ((lever @ TURNED.T) * normals).sum(axis=1)
    jacobian[count:, 2] = 1.0
    sigmas = np.maximum(matches.line_sigmas, tracking.feature_sigma)
    angles = np.full(count, tracking.line_angle_sigma)
    misses = -np.concatenate([asides, np.arctan2(np.sin(turns), np.cos(turns))])
    return Measured(misses, jacobian, np.concatenate([sigmas, angles]) ** 2)


def measured_rays(matches: Matches, pose: NDArray[np.float64], tracking: TrackingSettings) -> Measured:
    """Measure the offsets of the ends of rays from the curves."""
    lever, found = matches.rays @ rotation_of(float(pose[2])).T, matches.pieces
    normals = np.stack([-found[:, 3], found[:, 2]], axis=1)
    jacobian = np.empty((len(found), 3))
    jacobian[:, :2] = normals
    jacobian[:, 2] = ((lever @ TURNED.T) * normals).sum(axis=1)
    misses = -((lever + pose[:2] - found[:, :2]) * normals).sum(axis=1)
    variance = tracking.curve_sigma**2 / tracking.ray_share
    return Measured(misses, jacobian, np.full(len(found), variance))


def joined(parts: list[Measured]) -> Measured:
    """Return several measurements of the same numbers of the state as one."""
    return Measured(
        np.concatenate([part.misses for part in parts]),
        np.concatenate([part.jacobian for part in parts]),
        np.concatenate([part.variances for part in parts]),
    )


def rotation_of(theta: float) -> NDArray[np.float64]:
    """Return the matrix (2, 2) of a rotation."""
    cosine, sine = math.cos(theta), math.sin(theta)
    return np.array([[cosine, -sine], [sine, cosine]])
