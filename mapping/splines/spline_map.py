"""The map of curves, corners and peaks, and how scans from known poses improve it."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.splines.association import Places, Way, are_near, common_places, join, mark_along
from lidarium.mapping.splines.bspline import ORDER, Spline
from lidarium.mapping.splines.curve import Curve, box_of, curves_in, fit_curve
from lidarium.mapping.splines.features import Observation, curves_of
from lidarium.mapping.splines.landmarks import no_landmarks
from lidarium.mapping.splines.segmentation import split_merge
from lidarium.mapping.splines.settings import SplineSettings


class SplineMap:
    """A map of walls as curves.

    Parameters
    ----------
    settings : SplineSettings or None
        How scans become curves, and curves one map.

    Attributes
    ----------
    curves : list of Curve
        The walls; their free side is the one from which they were seen.
    corners, peaks : Landmarks
        Corners of walls and their ends.
    updates : int
        How many scans were taken in.
    """

    def __init__(self, settings: SplineSettings | None = None) -> None:
        self.settings = settings or SplineSettings()
        self.curves: list[Curve] = []
        self.corners, self.peaks = no_landmarks(), no_landmarks()
        self.updates = 0

    def update(self, observation: Observation, pose: Transform) -> None:
        """Take in a scan that was seen from a pose of the robot."""
        self.updates += 1
        for spline, sigmas in curves_of(observation, self.settings):
            seen = Spline(spline.knots, pose.apply(spline.control_points))
            self._take_in(self._way_of(seen, sigmas), seen.control_points, 1)
        self._forget()
        limits = self.updates, self.settings.association.point_distance, self.settings.map
        features = observation.features.moved(pose)
        self.corners = self.corners.updated(features.corners, features.corner_sigmas, *limits)
        self.peaks = self.peaks.updated(features.peaks, features.peak_sigmas, *limits)

    def absorb(self, other: "SplineMap", pose: Transform) -> None:
        """Join another map to this one."""
        self.updates = max(self.updates, other.updates)
        for curve in other.curves:
            moved = curve.moved(pose)
            self._take_in(moved.way, moved.spline.control_points, curve.count)
        distance, most_weight = self.settings.association.point_distance, self.settings.map.most_weight
        self.corners = self.corners.joined(other.corners.moved(pose), distance, most_weight)
        self.peaks = self.peaks.joined(other.peaks.moved(pose), distance, most_weight)

    def around(self, frame: Transform, reach: float) -> "SplineMap":
        """Return the map near a frame, in that frame.

        Parameters
        ----------
        frame : Transform
            The frame, ``this_from_frame``.
        reach : float
            Half the side of the square around it that walls and points have to meet [m].
        """
        there = frame.inverse()
        found = SplineMap(self.settings)
        curves = [curve.moved(there) for curve in self.curves]
        found.curves = [curves[k] for k in curves_in(curves, (-reach, -reach, reach, reach))]
        found.corners, found.peaks = (marks.moved(there).within(reach) for marks in (self.corners, self.peaks))
        found.updates = self.updates
        return found

    @property
    def lines(self) -> NDArray[np.float64]:
        """Middle x, y, direction and half length of the curves that are lines.

        Shape (n, 4) [m, m, rad, m].
        """
        lines = [curve.line for curve in self.curves if curve.line is not None]
        return np.array(lines).reshape(-1, 4)

    @property
    def length(self) -> float:
        """Length of all curves [m]."""
        return math.fsum(curve.spline.length() for curve in self.curves)

    def sample(self, spacing: float = 0.02) -> NDArray[np.float64]:
        """Return points of all curves, at most about ``spacing`` apart, shape (n, 2) [m]."""
        return np.concatenate([np.empty((0, 2)), *(curve.spline.sample(spacing) for curve in self.curves)])

    def ray(self, origin: NDArray[np.float64], direction: float) -> float:
        """Return the range that a laser at a point (2,) would measure [m].

        Along a direction [rad]; inf if no curve is met.
        """
        return min((curve.spline.ray(origin, direction) for curve in self.curves), default=math.inf)

    def _forget(self) -> None:
        """Drop short curves that have not been seen again."""
        settings = self.settings.map
        since = self.updates - settings.trial_updates
        self.curves = [
            curve
            for curve in self.curves
            if curve.count >= settings.trusted_count
            or curve.last_seen > since
            or curve.way.length >= settings.trusted_length
        ]

    def _way_of(self, spline: Spline, sigmas: NDArray[np.float64]) -> Way:
        """Return points along a seen curve, with standard deviations (m,) of its points [m]."""
        parameters = spline.sample_parameters(self.settings.map.sample_spacing)
        positions = np.arange(len(parameters)) * ((len(sigmas) - 1) / (len(parameters) - 1))
        noise = np.interp(positions, np.arange(len(sigmas)), sigmas)
        return Way(spline.evaluate(parameters), (0.01 / noise) ** 2)

    def _take_in(self, way: Way, control_points: NDArray[np.float64], count: int) -> None:
        """Join a curve with those along it, or add it as a new one."""
        settings, seen = self.settings.map, count
        while (best := self._best_match(way, control_points)) is not None:
            known = self.curves.pop(best[0])
            way, extends = join(way, known.way, best[1], settings)
            # Pieces of a curve that was cut have the count of the whole, and may be joined again.
            most = max(self.updates, settings.trusted_count, count, known.count)
            count = min(count + known.count, most)
            pieces = self._cut_at_corners(way) if extends else [way]
            if len(pieces) > 1:
                longest = max(pieces, key=lambda piece: piece.length)
                self._add(longest, count)
                for piece in pieces:
                    if piece is not longest and self._is_new(piece):
                        self._add(piece, count)
                return
        if count > seen or self._is_new(way):
            self._add(way, count)

    def _add(self, way: Way, count: int) -> None:
        if len(way.points) >= ORDER and way.length >= self.settings.map.least_length:
            self.curves.append(fit_curve(way, count, self.updates, self.settings.fit, self.settings.map))

    def _is_new(self, way: Way) -> bool:
        """Return whether a polyline is long against its noise, and new to the map.

        New means that it is not one more view of a curve of the map.
        """
        settings = self.settings.map
        sigma = 0.01 / math.sqrt(float(way.weights.min()))
        if way.length < settings.least_sigmas * sigma:
            return False
        distance = max(settings.explained_distance, 3.0 * sigma)
        is_known = np.zeros(len(way.points), np.bool_)
        for index in self._near(way, distance):
            mark_along(way.points, self.curves[index].way.points, distance, is_known)
        return 2 * int(is_known.sum()) < len(is_known)

    def _near(self, way: Way, distance: float) -> list[int]:
        """Return the curves with boxes within a distance of that of a way [m]."""
        low_x, low_y, high_x, high_y = box_of(way.points)
        return curves_in(self.curves, (low_x - distance, low_y - distance, high_x + distance, high_y + distance))

    def _best_match(self, way: Way, control_points: NDArray[np.float64]) -> tuple[int, Places] | None:
        """Return which curve runs along a way the longest, and where."""
        settings = self.settings.association
        best: tuple[int, Places] | None = None
        for index in self._near(way, settings.control_distance):
            curve = self.curves[index]
            # Long curves have few control points: their ways stand in for them.
            if not (
                are_near(control_points, curve.spline.control_points, settings.control_distance)
                or are_near(way.points, curve.way.points, settings.control_distance)
            ):
                continue
            overlap = common_places(way, curve.way, settings)
            if overlap is not None and (best is None or overlap.length > best[1].length):
                best = (index, overlap)
        return best

    def _cut_at_corners(self, way: Way) -> list[Way]:
        """Cut a way if it turns sharply."""
        cut = split_merge(way.points, 0.01 / np.sqrt(way.weights), self.settings.segmentation)
        if len(cut.pieces) == 1:
            return [way]
        return [Way(way.points[first : last + 1], way.weights[first : last + 1]) for first, last in cut.pieces.tolist()]
