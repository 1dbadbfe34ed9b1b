"""Rigid motions of the plane."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.geometry.small_matrices import product


@dataclass(frozen=True, slots=True)
class Transform:
    """A rotation and then a translation; as ``a_from_b`` it maps points of b into a.

    Attributes
    ----------
    x, y : float
        Translation [m].
    theta : float
        Rotation, counter-clockwise [rad].
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0

    def apply(self, points: ArrayLike) -> NDArray[np.float64]:
        """Map points, shape (..., 2) [m]."""
        places = np.asarray(points, np.float64)
        cosine, sine = math.cos(self.theta), math.sin(self.theta)
        x, y = places[..., 0], places[..., 1]
        moved = np.empty(places.shape)
        moved[..., 0] = cosine * x - sine * y + self.x
        moved[..., 1] = sine * x + cosine * y + self.y
        return moved

    def __matmul__(self, other: "Transform") -> "Transform":
        """Return the motion that does ``other`` first and then this one."""
        cosine, sine = math.cos(self.theta), math.sin(self.theta)
        x, y = cosine * other.x - sine * other.y + self.x, sine * other.x + cosine * other.y + self.y
        return Transform(x, y, wrapped(self.theta + other.theta))

    def inverse(self) -> "Transform":
        """Return the motion that undoes this one."""
        cosine, sine = math.cos(self.theta), math.sin(self.theta)
        return Transform(-cosine * self.x - sine * self.y, sine * self.x - cosine * self.y, wrapped(-self.theta))

    def difference(self, other: "Transform", at: ArrayLike = (0.0, 0.0)) -> tuple[float, float]:
        """Return by how much two transforms differ at a point [m, rad]: between its images, and in angle."""
        x, y = (self.apply(at) - other.apply(at)).tolist()
        return math.hypot(x, y), abs(wrapped(self.theta - other.theta))


def wrapped(angle: float) -> float:
    """Return an angle in (-pi, pi]."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


def halfway(first: Transform, second: Transform, at: ArrayLike) -> Transform:
    """Return the motion midway between two motions: it maps a point to the middle between its images."""
    turn = Transform(0.0, 0.0, wrapped(first.theta + 0.5 * wrapped(second.theta - first.theta)))
    x, y = (0.5 * (first.apply(at) + second.apply(at)) - turn.apply(at)).tolist()
    return Transform(x, y, turn.theta)


def fit(source: NDArray[np.float64], target: NDArray[np.float64]) -> Transform:
    """Return the rigid motion that best aligns points with others by least squares.

    It maps source to target, (n, 2) each [m]; it is a translation if all source points are equal. Raises ValueError
    if there are no pairs, or the numbers of points differ.
    """
    if len(source) == 0 or source.shape != target.shape:
        raise ValueError(
            f"source and target have shapes {source.shape} and {target.shape}; want (n, 2) each with n >= 1"
        )
    source_centre, target_centre = source.mean(axis=0), target.mean(axis=0)
    p, q = source - source_centre, target - target_centre
    theta = math.atan2(float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum()), float((p * q).sum()))
    x, y = (target_centre - Transform(0.0, 0.0, theta).apply(source_centre)).tolist()
    return Transform(x, y, theta)


def composed(outer: NDArray[np.float64], inner: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses (..., 3) transformed out of the frames ``outer`` [m, rad].

    Poses are x, y, theta, given in the frames ``outer`` (..., 3), and returned in the frame of these.
    """
    (left, low, turn), (x, y, theta) = _parts(outer), _parts(inner)
    cosine, sine = np.cos(turn), np.sin(turn)
    return _poses(cosine * x - sine * y + left, sine * x + cosine * y + low, math.pi - turn - theta)


def relative(frame: NDArray[np.float64], pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses (..., 3) relative to frames (..., 3) [m, rad].

    Poses are x, y, theta: ``composed(frame, relative(frame, pose)) = pose``.
    """
    (left, low, turn), (x, y, theta) = _parts(frame), _parts(pose)
    cosine, sine, x, y = np.cos(turn), np.sin(turn), x - left, y - low
    return _poses(cosine * x + sine * y, cosine * y - sine * x, math.pi - theta + turn)


def _parts(poses: NDArray[np.float64]) -> Iterable[Any]:
    """Return x, y and theta: arrays or, of a single pose, numbers, which take a seventh of the time."""
    return poses.tolist() if poses.ndim == 1 else (poses[..., 0], poses[..., 1], poses[..., 2])


def _poses(x: Any, y: Any, supplement: Any) -> NDArray[np.float64]:  # noqa: ANN401
    """Return poses with theta = pi - supplement, in (-pi, pi]."""
    parts = [x, y, math.pi - supplement % (2.0 * math.pi)]
    return np.array(parts) if isinstance(supplement, float) else np.stack(parts, axis=-1)


def turned(matrix: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Return a (3, 3) covariance or information of x, y, theta in another frame.

    Its own frame is rotated by the angle [rad] in that frame.
    """
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return product(turn, matrix, turn.T)
