"""Curves of walls and features that are seen in a scan.

Features are corners, free ends of walls (peaks) and straight lines.

A corner is where two smooth pieces of one cluster meet. A peak is where a surface ends because it ends: the
scan goes on farther away. Where it goes on nearer, something stands in front; where it does not go on, the
laser's reach has ended; neither is a feature.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.breakpoints import clusters
from lidarium.mapping.splines.curves.bspline import Spline
from lidarium.mapping.splines.curves.fitting import fit_bspline
from lidarium.mapping.splines.curves.settings import SplineSettings
from lidarium.mapping.splines.scan_points import ScanPoints
from lidarium.mapping.splines.segmentation import Cut, split_merge

PEAK_JUMP = 0.3
"""What follows a peak lies at least so much farther away [m]."""

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

    points: ScanPoints
    pieces: tuple[tuple[int, int], ...]
    features: Features


def observe(points: ScanPoints, settings: SplineSettings | None = None) -> Observation:
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
        places = observation.points.points[first : last + 1]
        if float(np.ptp(places, axis=0).max()) > 1e-6:
            fitted.append((fit_bspline(places, settings.fit, sigmas).spline, sigmas))
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


def _is_peak(points: ScanPoints, end: int, step: int) -> bool:
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
    return bool(_incidence(points.points, end, -step) >= PEAK_INCIDENCE)


@kernel
def _incidence(points: Array, end: int, step: int) -> float:
    """Return the angle between the beam at an end and the wall behind it [rad].

    Estimated from the four points there.
    """
    x, y = points[end, 0], points[end, 1]
    dx, dy = points[end + 3 * step, 0] - x, points[end + 3 * step, 1] - y
    return abs(math.atan2(abs(x * dy - y * dx), abs(x * dx + y * dy)))
