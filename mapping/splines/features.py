"""Curves of walls and features that are seen in a scan.

Features are corners, free ends of walls (peaks) and straight lines.

A corner is where two smooth pieces of one cluster meet. A peak is where a surface ends because it ends: the
scan goes on farther away. If it goes on nearer, something stands in front; if it does not go on, the
laser's reach has ended; neither is a feature.

The points of a scan are in the frame of the robot, each at the robot's pose at its own time.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.bspline import Spline
from lidarium.mapping.splines.fitting import fit_bspline
from lidarium.mapping.splines.segmentation import Cut, split_merge
from lidarium.mapping.splines.settings import BREAKPOINT_TESTS, PointSettings, SegmentationSettings, SplineSettings


@dataclass(frozen=True, slots=True, eq=False)
class _ScanPoints:
    """Ends of the beams of a scan, in the frame of the robot at the last beam.

    Attributes
    ----------
    points : (n, 2) float64
        Ends of the beams that returned, in their order [m].
    beams : (n,) int64
        Their numbers.
    ranges : (n,) float64
        Their ranges [m].
    sigmas : (n,) float64
        Standard deviations of these [m].
    scan : (beams,) float64
        The whole scan [m]; inf for no return, nan if invalid or out of the laser's reach.
    geometry : ScanGeometry
        Directions of the beams.
    laser_x : float
        How far the laser is before the robot's middle [m].
    """

    points: NDArray[np.float64]
    beams: NDArray[np.int64]
    ranges: NDArray[np.float64]
    sigmas: NDArray[np.float64]
    scan: NDArray[np.float64]
    geometry: ScanGeometry
    laser_x: float


def scan_points(
    ranges: NDArray[np.float32],
    geometry: ScanGeometry,
    settings: PointSettings | None = None,
    motion: Transform | None = None,
    motion_s: float = 0.0,
) -> _ScanPoints:
    """Turn a scan into points.

    Parameters
    ----------
    ranges : (beams,) float32
        The scan [m]; inf for no return, nan for an invalid beam. A range below the laser's minimum
        is invalid, one above its maximum is no return.
    geometry : ScanGeometry
        The laser.
    settings : PointSettings or None
        Time between beams, place and noise of the laser.
    motion : Transform or None
        How the robot has moved in the time before the last beam, ``before_from_now``; None for a robot at
        rest.
    motion_s : float
        That time [s]. Speeds are taken as constant in it.

    Raises
    ------
    ValueError
        If there are not as many ranges as beams.
    """
    settings = settings or PointSettings()
    measured = np.asarray(ranges, np.float64)
    if measured.shape != (geometry.beams,):
        raise ValueError(f"the scan has shape {measured.shape}; the laser has {geometry.beams} beams")
    scan = np.where(measured < geometry.range_min, np.nan, np.where(measured > geometry.range_max, np.inf, measured))
    beams = np.flatnonzero(np.isfinite(scan))
    hits = scan[beams]
    cosines, sines = geometry.unit_vectors[:, beams]
    points = np.stack([hits * cosines + settings.laser_x, hits * sines], axis=1)
    if motion is not None and motion_s > 0.0 and settings.beam_interval_s > 0.0:
        shares = (geometry.beams - 1 - beams) * (settings.beam_interval_s / motion_s)
        back = motion.inverse()
        _undo_motion(points, shares, back.x, back.y, back.theta)
    sigmas = np.maximum(settings.noise_floor, settings.noise_share * hits)
    return _ScanPoints(points, beams.astype(np.int64), hits, sigmas, scan, geometry, settings.laser_x)


@kernel
def _undo_motion(points: Array, shares: Array, x: float, y: float, theta: float) -> None:
    """Bring each point, seen a share of the motion ago, into the present frame.

    The frame is the robot's; ``x, y, theta`` is the former pose in it.
    """
    for k in range(points.shape[0]):
        cosine, sine = np.cos(shares[k] * theta), np.sin(shares[k] * theta)
        px, py = points[k, 0], points[k, 1]
        points[k, 0] = cosine * px - sine * py + shares[k] * x
        points[k, 1] = sine * px + cosine * py + shares[k] * y


def clusters(points: _ScanPoints, settings: SegmentationSettings | None = None) -> NDArray[np.int64]:
    """Cut the points of a scan at the ends of surfaces.

    A beam without a return, or an invalid one, always breaks. Dietmayer's test is printed with a difference
    of the ranges where their smaller one is meant, and with its sense turned round; it is used as meant.

    Parameters
    ----------
    points : ScanPoints
        The scan.
    settings : SegmentationSettings or None
        Which test; clusters with too few points are left out.

    Returns
    -------
    (k, 2) int64
        First point of each cluster and the one after its last.
    """
    settings = settings or SegmentationSettings()
    count = len(points.points)
    if count == 0:
        return np.empty((0, 2), np.int64)
    is_break = np.zeros(count, np.bool_)
    numbers = np.array(
        [
            points.geometry.angle_increment,
            settings.incidence,
            settings.noise_sigmas,
            settings.dietmayer_floor,
            settings.dietmayer_share,
            settings.step_ratio,
            settings.most_turn,
        ]
    )
    test = BREAKPOINT_TESTS.index(settings.test)
    _find_breaks(points.points, points.beams, points.ranges, points.sigmas, numbers, test, is_break)
    edges = np.flatnonzero(np.append(is_break, True))
    found = np.stack([np.append(0, edges[:-1]), edges], axis=1)
    return np.asarray(found[found[:, 1] - found[:, 0] >= settings.least_points], np.int64)


@kernel
def _find_breaks(
    points: Array, beams: Array, ranges: Array, sigmas: Array, numbers: Array, test: int, is_break: Array
) -> None:
    """Mark each point that does not belong to the one before it.

    ``test`` is an index into ``BREAKPOINT_TESTS``.
    """
    increment, incidence, noise_sigmas, floor, share, step_ratio, most_turn = numbers
    count = points.shape[0]
    grazing = math.sin(increment) / math.sin(max(incidence - increment, 1e-3))
    direct = 2.0 * math.sin(increment / 2.0)
    for k in range(1, count):
        if beams[k] != beams[k - 1] + 1:
            is_break[k] = True
            continue
        x, y = points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1]
        distance = math.sqrt(x * x + y * y)
        nearer = min(ranges[k], ranges[k - 1])
        if test == 0:
            is_break[k] = distance > nearer * grazing + noise_sigmas * max(sigmas[k], sigmas[k - 1])
        elif test == 1:
            is_break[k] = distance > nearer * direct + max(floor, share * max(ranges[k], ranges[k - 1]))
    if test != 2:
        return
    for k in range(1, count - 1):
        if is_break[k] or beams[k + 1] != beams[k] + 1:
            continue
        ax, ay = points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1]
        bx, by = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        before, after = math.sqrt(ax * ax + ay * ay), math.sqrt(bx * bx + by * by)
        # Steps and turns that noise alone can make show nothing.
        noise = noise_sigmas * sigmas[k]
        if max(before, after) > step_ratio * max(min(before, after), noise):
            is_break[k if before > after else k + 1] = True
        elif min(before, after) > noise and abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by)) > most_turn:
            is_break[k + 1] = True


PEAK_JUMP = 0.3
"""Minimum extra distance of the surface behind a peak [m]."""

PEAK_INCIDENCE = math.radians(15.0)
"""Least angle of incidence at which a surface ends where its scan does.

Below it may be a round post, or a wall too slanted to be one cluster.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Corners, peaks and lines.

    Attributes
    ----------
    corners, peaks : (n, 2) float64
        Points [m].
    lines : (n, 4) float64
        Middle x, y, direction [rad], half length [m].
    corner_sigmas, peak_sigmas, line_sigmas : (n,) float64
        Standard deviations of the ranges there [m].
    """

    corners: NDArray[np.float64]
    peaks: NDArray[np.float64]
    lines: NDArray[np.float64]
    corner_sigmas: NDArray[np.float64]
    peak_sigmas: NDArray[np.float64]
    line_sigmas: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.corners) + len(self.peaks) + len(self.lines)

    def moved(self, pose: Transform) -> "Features":
        """Return the features in the frame in which the robot has a pose."""
        lines = self.lines.copy()
        lines[:, :2] = pose.apply(self.lines[:, :2])
        lines[:, 2] += pose.theta
        return Features(
            pose.apply(self.corners),
            pose.apply(self.peaks),
            lines,
            self.corner_sigmas,
            self.peak_sigmas,
            self.line_sigmas,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """A scan, understood: in the frame of the robot.

    Attributes
    ----------
    points : ScanPoints
        Its points.
    pieces : tuple of (first, last)
        Smooth pieces, both points inclusive.
    features : Features
        Corners, peaks and lines.
    """

    points: _ScanPoints
    pieces: tuple[tuple[int, int], ...]
    features: Features


def observe(points: _ScanPoints, settings: SplineSettings | None = None) -> Observation:
    """Cut a scan into smooth pieces and find its features."""
    settings = settings or SplineSettings()
    pieces: list[tuple[int, int]] = []
    corners, corner_points, peaks, lines, line_points = [], [], [], [], []
    for first, last in clusters(points, settings.segmentation).tolist():
        cut = split_merge(points.points[first:last], points.sigmas[first:last], settings.segmentation)
        pieces += [(first + a, first + b) for a, b in cut.pieces.tolist()]
        corners.append(cut.corners)
        corner_points += (first + cut.corner_points).tolist()
        is_line = _are_lines(cut, points.sigmas[first:last], settings)
        lines.append(cut.lines[is_line, :4])
        line_points += (first + cut.leaves[is_line].mean(axis=1).astype(np.int64)).tolist()
        peaks += [end for end, step in ((first, -1), (last - 1, 1)) if _is_peak(points, end, step)]
    features = Features(
        np.concatenate([np.empty((0, 2)), *corners]),
        points.points[peaks].reshape(-1, 2),
        np.concatenate([np.empty((0, 4)), *lines]),
        points.sigmas[corner_points],
        points.sigmas[peaks],
        points.sigmas[line_points],
    )
    return Observation(points, tuple(pieces), features)


def curves_of(
    observation: Observation, settings: SplineSettings | None = None
) -> list[tuple[Spline, NDArray[np.float64]]]:
    """Fit a curve to each smooth piece.

    Returns curves in the robot's frame and the standard deviations of their points (m,) [m].
    """
    settings = settings or SplineSettings()
    fitted = []
    for first, last in observation.pieces:
        if last - first + 1 < settings.segmentation.least_points:
            continue
        sigmas = observation.points.sigmas[first : last + 1]
        positions = observation.points.points[first : last + 1]
        if float(np.ptp(positions, axis=0).max()) > 1e-6:
            fitted.append((fit_bspline(positions, settings.fit, sigmas).spline, sigmas))
    return fitted


def match_points(
    seen: NDArray[np.float64], known: NDArray[np.float64], most_distance: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Match each seen point (n, 2) to the nearest known one (m, 2).

    Only within a distance [m]. Returns indices of both.

    A known point is matched once, by the seen point that is nearest to it.
    """
    if len(seen) == 0 or len(known) == 0:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    distances = np.linalg.norm(seen[:, None] - known[None], axis=2)
    nearest = distances.argmin(axis=1)
    is_match = (distances[np.arange(len(seen)), nearest] < most_distance) & (
        distances.argmin(axis=0)[nearest] == np.arange(len(seen))
    )
    indices = np.flatnonzero(is_match)
    return indices.astype(np.int64), nearest[indices].astype(np.int64)


def _are_lines(cut: Cut, sigmas: NDArray[np.float64], settings: SplineSettings) -> NDArray[np.bool_]:
    """Return which leaves are straight enough and have points enough."""
    limits = settings.segmentation
    is_long = cut.leaves[:, 1] - cut.leaves[:, 0] + 1 >= limits.line_points
    noise = sigmas[cut.leaves].mean(axis=1)
    return np.asarray(is_long & (cut.lines[:, 4] < np.maximum(limits.split_distance / 2.0, 1.25 * noise)))


def _is_peak(points: _ScanPoints, end: int, step: int) -> bool:
    """Return whether a cluster ends at a point because its surface does.

    Points are followed in steps of 1 or -1.
    """
    beam = int(points.beams[end]) + step
    geometry = points.geometry
    if geometry.is_full_circle:
        beam %= geometry.beams
    elif not 0 <= beam < geometry.beams:
        return False
    beyond, distance = float(points.scan[beam]), float(points.ranges[end])
    if math.isnan(beyond) or beyond < distance + PEAK_JUMP or distance > geometry.range_max - PEAK_JUMP:
        return False
    return bool(_incidence(points.points, end, -step, points.laser_x) >= PEAK_INCIDENCE)


@kernel
def _incidence(points: Array, end: int, step: int, laser_x: float) -> float:
    """Return the angle between the beam at an end and the wall behind it [rad].

    Estimated from the four points there.
    """
    x, y = points[end, 0], points[end, 1]
    dx, dy = points[end + 3 * step, 0] - x, points[end + 3 * step, 1] - y
    x -= laser_x  # from the laser on
    return abs(math.atan2(abs(x * dy - y * dx), abs(x * dx + y * dy)))
