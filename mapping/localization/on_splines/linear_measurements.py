"""What a scan's matches measure of a pose, linearised about where it is believed to be."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.localization.on_splines.spline_matches import Matches
from lidarium.mapping.localization.on_splines.tracking_settings import TrackingSettings

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
        """Return those that miss by at most so many standard deviations."""
        is_kept = self.misses**2 <= sigmas**2 * self.variances
        return Measured(self.misses[is_kept], self.jacobian[is_kept], self.variances[is_kept])

    def information(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the information (n, n) of the state, and its product (n,) with the change that fits."""
        weighted = self.jacobian / self.variances[:, None]
        return weighted.T @ self.jacobian, weighted.T @ self.misses


def measured_points(matches: Matches, pose: NDArray[np.float64], tracking: TrackingSettings) -> Measured:
    """Measure where corners and peaks lie beside those of the map, along both axes."""
    lever = matches.points @ rotation_of(float(pose[2])).T
    jacobian = np.zeros((len(lever), 2, 3))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
    jacobian[:, :, 2] = lever @ TURNED.T
    misses = matches.known_points - lever - pose[:2]
    variances = np.repeat(np.maximum(matches.point_sigmas, tracking.feature_sigma) ** 2, 2)
    return Measured(misses.reshape(-1), jacobian.reshape(-1, 3), variances)


def measured_lines(matches: Matches, pose: NDArray[np.float64], tracking: TrackingSettings) -> Measured:
    """Measure how lines lie beside lines of the map and against their directions."""
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
    """Measure how the ends of rays lie beside the curves."""
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
