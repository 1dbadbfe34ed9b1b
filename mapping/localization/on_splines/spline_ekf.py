"""The extended Kalman filter on a map of curves.

One Gaussian over the pose, the scale errors of the wheels' paths and turns, and all
corners and peaks that it trusts.

A landmark enters when the map has seen it often enough, with the pose's uncertainty carried over; the cost of
a correction grows with the square of their number. Curves are measured too: how far the ends of rays lie
besides them. They hold the pose, and through it the landmarks.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import Distance, FromZero, Turn, check_settings
from lidarium.mapping.geometry.rigid import Transform, wrapped
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.on_splines.spline_matches import (
    TURNED,
    Matches,
    Measured,
    TrackingSettings,
    measured_lines,
    measured_rays,
    rotation_of,
)
from lidarium.mapping.localization.on_splines.spline_tracking import SplineTracker, steps_of
from lidarium.mapping.splines.features import Observation, match_points

POSE, SCALES = 3, 2
"""Numbers of the state that are the pose, and those that are scales of odometry after it."""

BODY = POSE + SCALES
"""Numbers of the state before the landmarks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SplineEkfSettings:
    """Settings of the extended Kalman filter.

    Attributes
    ----------
    tracking : TrackingSettings
        Settings of matching and of the map.
    gate_sigmas : float, default 3.0
        Measurements that differ from their expectation by more standard deviations are left out.
    start_distance, start_turn : float, default 0.0
        Standard deviations of the first pose [m, rad]; with ``start_map``
        0.0 means 0.05 m and 1 degree.
    distance_bias, turn_bias : float, default 0.05
        Constant scale errors of odometry's paths and turns, as a standard
        deviation.
    """

    tracking: TrackingSettings = field(default_factory=TrackingSettings)
    gate_sigmas: FromZero = 3.0
    start_distance: Distance = 0.0
    start_turn: Turn = 0.0
    distance_bias: FromZero = 0.05
    turn_bias: FromZero = 0.05

    def __post_init__(self) -> None:
        check_settings(self, "the filter")


class SplineEkf(SplineTracker):
    """Localizes by an extended Kalman filter on the map of curves that it makes.

    Parameters
    ----------
    settings : SplineEkfSettings or None
        The defaults if None.
    geometry : ScanGeometry or None
        The laser; the URG-04LX of the theses if None.

    Attributes
    ----------
    scales : (2,) float64
        Scale factors of paths and turns against odometry.
    landmarks : (k, 2) float64
        Corners and peaks in the state, in the frame of the local map [m].
    state_covariance : (5 + 2 k, 5 + 2 k) float64
        Covariance of the pose, the scales and the landmarks [m, rad, 1].
    """

    Settings = SplineEkfSettings

    def __init__(self, settings: SplineEkfSettings | None = None, geometry: ScanGeometry | None = None) -> None:
        self.settings = settings or SplineEkfSettings()
        super().__init__(self.settings.tracking, geometry or ScanGeometry())

    @property
    def local_covariance(self) -> NDArray[np.float64]:
        """Covariance of the last pose in the local map, shape (3, 3) [m^2, m rad, rad^2]."""
        return self.state_covariance[:3, :3].copy()

    def _begin(self, pose: NDArray[np.float64], seed: int) -> None:
        settings = self.settings
        self.landmarks = np.empty((0, 2))
        self.scales = np.ones(SCALES)
        start = self._start_spread(settings.start_distance, settings.start_turn)
        self.state_covariance = np.diag([*start, settings.distance_bias, settings.turn_bias]) ** 2

    def _change_frame(self, change: Transform, reach: float) -> None:
        points = change.apply(self.landmarks)
        is_kept = np.abs(points).max(axis=1, initial=0.0) <= reach
        kept = np.concatenate([np.ones(BODY, np.bool_), np.repeat(is_kept, 2)])
        rotation = np.eye(len(self.state_covariance))
        for k in [0, *range(BODY, len(rotation), 2)]:
            rotation[k : k + 2, k : k + 2] = rotation_of(change.theta)
        covariance = rotation @ self.state_covariance @ rotation.T
        self.landmarks, self.state_covariance = points[is_kept], covariance[np.ix_(kept, kept)]

    def _predict(self, motion: Transform) -> NDArray[np.float64]:
        measured = steps_of(motion)
        of_way, of_turn = self.scales.tolist()
        first, distance, second = measured[0] * of_turn, measured[1] * of_way, measured[2] * of_turn
        x, y, theta = (float(value) for value in self.local)
        heading = theta + first
        cosine, sine = math.cos(heading), math.sin(heading)
        tracking = self.tracking
        sway = tracking.turn_per_metre * abs(distance)
        spread = np.array(
            [
                tracking.turn_per_turn * abs(first) + sway,
                tracking.slip_per_metre * abs(distance) + tracking.slip_per_turn * (abs(first) + abs(second)),
                tracking.turn_per_turn * abs(second) + sway,
            ]
        )
        by_pose = np.array([[1.0, 0.0, -distance * sine], [0.0, 1.0, distance * cosine], [0.0, 0.0, 1.0]])
        by_steps = np.array([[-distance * sine, cosine, 0.0], [distance * cosine, sine, 0.0], [1.0, 0.0, 1.0]])
        by_body = np.eye(BODY)
        by_body[:POSE, :POSE] = by_pose
        by_body[:POSE, POSE] = by_steps[:, 1] * measured[1]
        by_body[:POSE, POSE + 1] = by_steps[:, 0] * measured[0] + by_steps[:, 2] * measured[2]
        covariance = self.state_covariance
        covariance[:BODY] = by_body @ covariance[:BODY]
        covariance[:, :BODY] = covariance[:, :BODY] @ by_body.T
        covariance[:3, :3] += (by_steps * spread**2) @ by_steps.T
        return np.array([x + distance * cosine, y + distance * sine, wrapped(heading + second)])

    def _correct(self, matches: Matches, observation: Observation) -> NDArray[np.float64]:
        seen = np.concatenate([observation.features.corners, observation.features.peaks])
        sigmas = np.concatenate([observation.features.corner_sigmas, observation.features.peak_sigmas])
        here = Transform(*(float(value) for value in self.local))
        which, known = match_points(here.apply(seen), self.landmarks, self.tracking.splines.association.point_distance)
        of_walls = [
            self._gated(part)
            for part in (
                measured_lines(matches, self.local, self.tracking),
                measured_rays(matches, self.local, self.tracking),
            )
        ]
        measured = [
            self._gated(self._landmarks_measured(seen[which], known, sigmas[which])),
            _condensed(_stacked(of_walls)),
        ]
        self._update(_stacked(measured))
        self._add_landmarks(matches)
        return self.local

    def _gated(self, measured: Measured) -> Measured:
        """Return the measurements without those that exceed their expected deviation.

        Expected from the measurement's own variance and that of the state.
        """
        columns = measured.jacobian.shape[1]
        spread = measured.jacobian @ self.state_covariance[:columns, :columns]
        expected = (spread * measured.jacobian).sum(axis=1) + measured.variances
        is_kept = measured.misses**2 <= self.settings.gate_sigmas**2 * expected
        return Measured(measured.misses[is_kept], measured.jacobian[is_kept], measured.variances[is_kept])

    def _update(self, measured: Measured) -> None:
        """Correct the state by measurements."""
        if len(measured.misses) == 0:
            return
        covariance, jacobian = self.state_covariance, measured.jacobian
        spread = jacobian @ covariance[: jacobian.shape[1]]
        innovation = spread[:, : jacobian.shape[1]] @ jacobian.T + np.diag(measured.variances)
        gain = np.linalg.solve(innovation, spread).T
        change = gain @ measured.misses
        covariance = covariance - gain @ spread
        self.state_covariance = (covariance + covariance.T) / 2.0
        self.local = self.local + change[:POSE]
        self.local[2] = wrapped(float(self.local[2]))
        self.scales = self.scales + change[POSE:BODY]
        self.landmarks = self.landmarks + change[BODY:].reshape(-1, 2)

    def _landmarks_measured(
        self, seen: NDArray[np.float64], known: NDArray[np.int64], sigmas: NDArray[np.float64]
    ) -> Measured:
        """Return seen points (m, 2) that are landmarks, as measurements.

        Both coordinates of each are measured in the robot's frame.
        """
        count = len(seen)
        back = rotation_of(float(self.local[2])).T
        offsets = self.landmarks[known] - self.local[:2]
        jacobian = np.zeros((count, 2, len(self.state_covariance)))
        jacobian[:, :, :2] = -back
        jacobian[:, :, 2] = offsets @ (back @ TURNED.T).T
        columns = BODY + 2 * known
        for row, column in enumerate(columns.tolist()):
            jacobian[row, :, column : column + 2] = back
        misses = (seen - offsets @ back.T).reshape(-1)
        variances = np.repeat(np.maximum(sigmas, self.tracking.feature_sigma) ** 2, 2)
        return Measured(misses, jacobian.reshape(2 * count, len(self.state_covariance)), variances)

    def _add_landmarks(self, matches: Matches) -> None:
        """Append landmarks that the map knows well and the state lacks.

        Their covariance follows from the pose and the measurement.
        """
        distance = self.tracking.splines.association.point_distance
        for seen, sigma in zip(matches.points, matches.point_sigmas, strict=True):
            rotation = rotation_of(float(self.local[2]))
            lever = rotation @ seen
            position = self.local[:2] + lever
            if len(self.landmarks) and float(np.linalg.norm(self.landmarks - position, axis=1).min()) < distance:
                continue
            by_pose = np.column_stack([np.eye(2), TURNED @ lever])
            old = self.state_covariance
            size = len(old)
            grown = np.empty((size + 2, size + 2))
            grown[:size, :size] = old
            grown[size:, :size] = by_pose @ old[:3]
            grown[:size, size:] = grown[size:, :size].T
            variance = max(float(sigma), self.tracking.feature_sigma) ** 2
            grown[size:, size:] = by_pose @ old[:3, :3] @ by_pose.T + variance * np.eye(2)
            self.state_covariance = grown
            self.landmarks = np.concatenate([self.landmarks, position[None]])


def _stacked(parts: list[Measured]) -> Measured:
    """Return several measurements as one.

    Each part ignores the rest.
    """
    columns = max(part.jacobian.shape[1] for part in parts)
    jacobians = [np.pad(part.jacobian, ((0, 0), (0, columns - part.jacobian.shape[1]))) for part in parts]
    return Measured(
        np.concatenate([part.misses for part in parts]),
        np.concatenate(jacobians),
        np.concatenate([part.variances for part in parts]),
    )


def _condensed(measured: Measured) -> Measured:
    """Return at most three measurements equivalent to many for the pose.

    They are the triangle of the QR decomposition.
    """
    if len(measured.misses) <= 3:
        return measured
    scales = 1.0 / np.sqrt(measured.variances)
    basis, triangle = np.linalg.qr(measured.jacobian * scales[:, None])
    return Measured(basis.T @ (measured.misses * scales), triangle, np.ones(len(triangle)))
