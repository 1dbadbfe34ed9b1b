"""Cubic B-spline curves in the plane.

Points, derivatives, length, nearest points, and intersections with rays.

Knots here are four-fold at both ends, so that curves begin and end in control points, and run along the curve
in metres.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.splines.curves.basis import ORDER
from lidarium.mapping.splines.curves.curve_kernels import (
    closest_point,
    curve_length,
    evaluate_curve,
    is_sound,
    ray_crossing,
)


@dataclass(frozen=True, slots=True, eq=False)
class Spline:
    """A cubic B-spline curve.

    Attributes
    ----------
    knots : (n + 4,) float64
        Not decreasing [m].
    control_points : (n, 2) float64
        At least 4 [m].
    """

    knots: NDArray[np.float64]
    control_points: NDArray[np.float64]

    def __post_init__(self) -> None:
        knots = np.ascontiguousarray(self.knots, np.float64)
        control_points = np.ascontiguousarray(self.control_points, np.float64)
        if control_points.ndim != 2 or control_points.shape[1] != 2 or len(control_points) < ORDER:
            raise ValueError(
                f"control points have shape {control_points.shape}; want (n, 2) with n >= {ORDER}"
            )
        if knots.shape != (len(control_points) + ORDER,):
            raise ValueError(
                f"knots have shape {knots.shape}; want {len(control_points) + ORDER}, {ORDER} more than "
                "control points"
            )
        if not is_sound(knots, control_points):
            raise ValueError("knots decrease or span nothing, or knots or control points are not finite")
        object.__setattr__(self, "knots", knots)
        object.__setattr__(self, "control_points", control_points)

    @property
    def domain(self) -> tuple[float, float]:
        """First and last parameter [m]."""
        return float(self.knots[ORDER - 1]), float(self.knots[len(self.control_points)])

    def evaluate(self, parameters: ArrayLike) -> NDArray[np.float64]:
        """Return the points at parameters (m,), shape (m, 2) [m].

        Parameters beyond the ends give the ends.
        """
        return self._values(parameters, 0)

    def derivative(self, parameters: ArrayLike, order: int = 1) -> NDArray[np.float64]:
        """Return the first or second derivative at parameters (m,), shape (m, 2) [1, 1/m]."""
        if order not in (1, 2):
            raise ValueError(f"order of the derivative is {order}; want 1 or 2")
        return self._values(parameters, order)

    def tangents(self, parameters: ArrayLike) -> NDArray[np.float64]:
        """Return unit vectors along the curve at parameters (m,), shape (m, 2)."""
        along = self.derivative(parameters)
        return np.asarray(along / np.maximum(np.linalg.norm(along, axis=1), 1e-12)[:, None], np.float64)

    def curvature(self, parameters: ArrayLike) -> NDArray[np.float64]:
        """Return the signed curvature at parameters (m,) [1/m].

        Positive where the curve turns left.
        """
        first, second = self.derivative(parameters), self.derivative(parameters, 2)
        speed = np.maximum(np.linalg.norm(first, axis=1), 1e-12)
        return np.asarray((first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3, np.float64)

    def length(self) -> float:
        """Return the length of the curve [m], by Gauss-Legendre quadrature of each span."""
        return float(curve_length(self.knots, self.control_points))

    def sample(self, spacing: float) -> NDArray[np.float64]:
        """Return points evenly spaced in the parameter, shape (m, 2) [m].

        Both ends are included; points are at most about ``spacing`` apart.
        """
        return self.evaluate(self.sample_parameters(spacing))

    def sample_parameters(self, spacing: float) -> NDArray[np.float64]:
        """Return the parameters of `sample`, shape (m,) [m]."""
        first, last = self.domain
        gaps = max(math.ceil((last - first) / spacing), 2)
        return np.asarray(first + np.arange(gaps + 1) * ((last - first) / gaps), np.float64)

    def closest(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return parameters (m,) of the nearest points, and the distances (m,) [m].

        The nearest points of the curve to points (m, 2).
        """
        places = np.ascontiguousarray(np.reshape(np.asarray(points, np.float64), (-1, 2)))
        parameters, distances = np.empty(len(places)), np.empty(len(places))
        closest_point(self.knots, self.control_points, places, parameters, distances)
        return parameters, distances

    def ray(self, origin: ArrayLike, direction: float) -> float:
        """Return the distance at which a ray first meets the curve [m].

        From a point (2,) along a direction [rad]; inf where it does not.
        """
        x, y = (float(value) for value in np.asarray(origin, np.float64))
        return float(
            ray_crossing(self.knots, self.control_points, x, y, math.cos(direction), math.sin(direction))
        )

    def _values(self, parameters: ArrayLike, order: int) -> NDArray[np.float64]:
        wanted = np.atleast_1d(np.asarray(parameters, np.float64))
        values = np.empty((len(wanted), 2))
        evaluate_curve(self.knots, self.control_points, wanted, order, values)
        return values
