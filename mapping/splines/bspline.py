"""Cubic B-spline curves in the plane.

Points, derivatives, length, nearest points, and intersections with rays.

Knots here are four-fold at both ends, so that curves begin and end in control points, and run along the curve
in metres.

A curve has ``n`` control points and ``n + 4`` knots that do not decrease; it is defined from knot 3 to knot
n.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

ORDER = 4
"""Degree 3, and one."""


def _basis_matrix(knots: ArrayLike, parameters: ArrayLike) -> NDArray[np.float64]:
    """Return the values of all basis functions, shape (parameters, n).

    Each row sums to one within the domain.

    Parameters
    ----------
    knots : (n + 4,) float64
        Not decreasing.
    parameters : (m,) float64
        From knot 3 to knot n; the last span is closed.
    """
    all_knots, wanted = np.asarray(knots, np.float64), np.atleast_1d(np.asarray(parameters, np.float64))
    count = len(all_knots) - ORDER
    if count < ORDER or (
        wanted.size and not (all_knots[ORDER - 1] <= wanted.min() and wanted.max() <= all_knots[count])
    ):
        raise ValueError(
            f"{len(all_knots)} knots, or parameters outside of the domain; want 8 knots or more and parameters within"
        )
    matrix = np.zeros((len(wanted), count))
    _fill_basis(all_knots, wanted, matrix)
    return matrix


@kernel
def find_span(knots: Array, count: int, parameter: float) -> int:
    """Return i with knots[i] <= parameter < knots[i + 1].

    The last span that is not empty is closed.
    """
    low, high = ORDER - 1, count
    if parameter >= knots[high]:
        low = high - 1
        while low > ORDER - 1 and knots[low] >= knots[high]:
            low -= 1
        return low
    while high - low > 1:
        middle = (low + high) // 2
        if parameter < knots[middle]:
            high = middle
        else:
            low = middle
    return low


@kernel
def basis_of_span(knots: Array, span: int, parameter: float, order: int, values: Array) -> None:
    """Write the basis functions of a span, or their derivatives, to ``values`` (4,).

    Functions span - 3 .. span, which do not vanish; derivatives of order 1 or 2.

    Cox and de Boor's recursion; a derivative is a difference of functions of a lower degree.
    """
    values[0] = 1.0
    for degree in range(1, ORDER - order):
        saved = 0.0
        for r in range(degree):
            right, left = knots[span + r + 1], knots[span + r + 1 - degree]
            share = values[r] / (right - left)
            values[r] = saved + (right - parameter) * share
            saved = (parameter - left) * share
        values[degree] = saved
    for degree in range(ORDER - order, ORDER):
        previous = 0.0
        for r in range(degree + 1):
            # Function r of this degree lies between knots span - degree + r and degree further on.
            current = 0.0
            if r < degree:
                width = knots[span + r + 1] - knots[span + r + 1 - degree]
                current = degree * values[r] / width if width > 0.0 else 0.0
            values[r] = previous - current
            previous = current


@kernel
def point_at(knots: Array, control_points: Array, parameter: float, order: int, values: Array) -> tuple[float, float]:
    """Return the curve or a derivative at a parameter, clipped to the domain.

    ``values`` (4,) is scratch.
    """
    count = control_points.shape[0]
    within = min(max(parameter, knots[ORDER - 1]), knots[count])
    span = find_span(knots, count, within)
    basis_of_span(knots, span, within, order, values)
    x, y = 0.0, 0.0
    for r in range(ORDER):
        x += values[r] * control_points[span - ORDER + 1 + r, 0]
        y += values[r] * control_points[span - ORDER + 1 + r, 1]
    return x, y


@kernel
def _fill_basis(knots: Array, parameters: Array, matrix: Array) -> None:
    values = np.empty(ORDER)
    for k in range(parameters.shape[0]):
        span = find_span(knots, matrix.shape[1], parameters[k])
        basis_of_span(knots, span, parameters[k], 0, values)
        for r in range(ORDER):
            matrix[k, span - ORDER + 1 + r] = values[r]


NEWTON_STEPS = 20

PIECES = 8
"""Into so many pieces a span is cut where a curve is searched."""

FINE_PIECES = 32
"""Pieces per span in the search for the nearest point.

A curve may turn back on itself within a piece, and then only one of its branches is found.
"""

GAUSS_PLACES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(5)


@kernel
def _is_sound(knots: Array, control_points: Array) -> bool:
    """Return whether all numbers are finite and the knots are valid.

    Knots must not decrease, and must span something.
    """
    for k in range(1, knots.shape[0]):
        if not knots[k] >= knots[k - 1]:
            return False
    for k in range(control_points.shape[0]):
        if not (math.isfinite(control_points[k, 0]) and math.isfinite(control_points[k, 1])):
            return False
    return bool(
        knots[ORDER - 1] < knots[control_points.shape[0]] and math.isfinite(knots[0]) and math.isfinite(knots[-1])
    )


@kernel
def _evaluate_curve(knots: Array, control_points: Array, parameters: Array, order: int, points: Array) -> None:
    """Write a derivative of a curve at some parameters, (parameters, 2)."""
    values = np.empty(ORDER)
    for k in range(parameters.shape[0]):
        points[k, 0], points[k, 1] = point_at(knots, control_points, parameters[k], order, values)


@kernel
def curve_length(knots: Array, control_points: Array) -> float:
    """Return the length of a curve [m]."""
    values = np.empty(ORDER)
    total = 0.0
    for span in range(ORDER - 1, control_points.shape[0]):
        half = (knots[span + 1] - knots[span]) / (2.0 * PIECES)
        if half > 0.0:
            for i in range(PIECES):
                for k in range(len(GAUSS_PLACES)):
                    x, y = point_at(
                        knots, control_points, knots[span] + half * (2 * i + 1 + GAUSS_PLACES[k]), 1, values
                    )
                    total += half * GAUSS_WEIGHTS[k] * math.sqrt(x * x + y * y)
    return total


@kernel
def _closest_point(knots: Array, control_points: Array, points: Array, parameters: Array, distances: Array) -> None:
    """Find nearest points by Newton's method in each piece that may hold one.

    The control points' differences bound the length of each piece.
    """
    count = control_points.shape[0]
    most = (count - ORDER + 1) * FINE_PIECES
    positions, widths, reaches, used = np.empty(most + 1), np.empty(most), np.empty(most), 0
    for span in range(ORDER - 1, count):
        width = (knots[span + 1] - knots[span]) / FINE_PIECES
        if width > 0.0:
            fastest = 0.0
            for k in range(span - ORDER + 2, span + 1):
                gap = math.hypot(
                    control_points[k, 0] - control_points[k - 1, 0],
                    control_points[k, 1] - control_points[k - 1, 1],
                )
                fastest = max(fastest, (ORDER - 1) * gap / (knots[k + ORDER - 1] - knots[k]))
            for i in range(FINE_PIECES):
                positions[used], widths[used], reaches[used] = (
                    knots[span] + width * i,
                    width,
                    0.5 * fastest * width,
                )
                used += 1
    positions[used] = knots[count]
    samples, values, apart = np.empty((used + 1, 2)), np.empty(ORDER), np.empty(used + 1)
    for i in range(used + 1):
        samples[i, 0], samples[i, 1] = point_at(knots, control_points, positions[i], 0, values)
    for k in range(points.shape[0]):
        px, py = points[k, 0], points[k, 1]
        for i in range(used + 1):
            apart[i] = math.hypot(samples[i, 0] - px, samples[i, 1] - py)
        nearest, chosen = apart.min(), positions[apart.argmin()]
        for i in range(used):
            if min(apart[i], apart[i + 1]) - reaches[i] <= nearest:
                middle = positions[i] + 0.5 * widths[i]
                parameter, squared = _descend(
                    knots, control_points, px, py, positions[i], middle, positions[i + 1], values
                )
                if math.sqrt(squared) < nearest:
                    nearest, chosen = math.sqrt(squared), parameter
        parameters[k], distances[k] = chosen, nearest


@kernel
def _descend(
    knots: Array,
    control_points: Array,
    px: float,
    py: float,
    low: float,
    begin: float,
    high: float,
    values: Array,
) -> tuple[float, float]:
    """Return the parameter nearest to a point, and the squared distance.

    Near a given parameter, between two others.

    Newton's method; if a step leads farther away, as it does near cusps, half of it is tried.
    """
    parameter = begin
    x, y = point_at(knots, control_points, parameter, 0, values)
    squared = (x - px) ** 2 + (y - py) ** 2
    for _ in range(NEWTON_STEPS):
        x, y = point_at(knots, control_points, parameter, 0, values)
        dx, dy = point_at(knots, control_points, parameter, 1, values)
        ddx, ddy = point_at(knots, control_points, parameter, 2, values)
        slope = (x - px) * dx + (y - py) * dy
        bend = dx * dx + dy * dy + (x - px) * ddx + (y - py) * ddy
        if bend <= 0.0:
            bend = dx * dx + dy * dy
        if bend == 0.0:
            break
        step = slope / bend
        moved, reached, is_nearer = parameter, squared, False
        while not is_nearer and abs(step) >= 1e-12:
            moved = min(max(parameter - step, low), high)
            x, y = point_at(knots, control_points, moved, 0, values)
            reached = (x - px) ** 2 + (y - py) ** 2
            is_nearer = reached < squared
            step *= 0.5
        if not is_nearer:
            break
        is_still = abs(moved - parameter) < 1e-10
        parameter, squared = moved, reached
        if is_still:
            break
    return parameter, squared


class _Ray(NamedTuple):
    """Origin of a ray [m], and its direction."""

    x: float
    y: float
    cosine: float
    sine: float


@kernel
def _ray_crossing(knots: Array, control_points: Array, x: float, y: float, cosine: float, sine: float) -> float:
    """Find where a ray meets the curve, skipping spans it cannot meet.

    Their control polygon lies on one side of its line, or behind it: a curve lies in its polygon's hull.
    """
    values = np.empty(ORDER)
    nearest = math.inf
    for span in range(ORDER - 1, control_points.shape[0]):
        if knots[span + 1] <= knots[span]:
            continue
        lowest, highest, farthest = math.inf, -math.inf, -math.inf
        for r in range(ORDER):
            offset_x = control_points[span - ORDER + 1 + r, 0] - x
            offset_y = control_points[span - ORDER + 1 + r, 1] - y
            aside = cosine * offset_y - sine * offset_x
            lowest, highest = min(lowest, aside), max(highest, aside)
            farthest = max(farthest, cosine * offset_x + sine * offset_y)
        if lowest > 0.0 or highest < 0.0 or farthest < 0.0:
            continue
        step = (knots[span + 1] - knots[span]) / PIECES
        ray = _Ray(x, y, cosine, sine)
        low, before = knots[span], _beside(knots, control_points, knots[span], ray, values)
        for i in range(1, PIECES + 1):
            high = knots[span] + i * step
            after = _beside(knots, control_points, high, ray, values)
            for ahead, aside, _ in (before, after):
                if aside == 0.0 and 0.0 <= ahead < nearest:
                    nearest = ahead
            if before[1] * after[1] < 0.0:
                nearest = _nearer(nearest, _crossing(knots, control_points, low, high, ray, values))
            elif before[1] * before[2] < 0.0 and after[1] * after[2] > 0.0:
                # The curve comes nearer and goes away again: it may cross twice.
                turn = _turn(knots, control_points, low, high, ray, values)
                if _beside(knots, control_points, turn, ray, values)[1] * before[1] <= 0.0:
                    nearest = _nearer(nearest, _crossing(knots, control_points, low, turn, ray, values))
                    nearest = _nearer(nearest, _crossing(knots, control_points, turn, high, ray, values))
            low, before = high, after
    return nearest


@kernel
def _nearer(nearest: float, met: float) -> float:
    return met if 0.0 <= met < nearest else nearest


@kernel
def _beside(
    knots: Array, control_points: Array, parameter: float, ray: _Ray, values: Array
) -> tuple[float, float, float]:
    """Return how far a point of the curve is ahead and aside of a ray, and the change of the latter."""
    px, py = point_at(knots, control_points, parameter, 0, values)
    dx, dy = point_at(knots, control_points, parameter, 1, values)
    px, py = px - ray.x, py - ray.y
    return (
        ray.cosine * px + ray.sine * py,
        ray.cosine * py - ray.sine * px,
        ray.cosine * dy - ray.sine * dx,
    )


@kernel
def _turn(knots: Array, control_points: Array, low: float, high: float, ray: _Ray, values: Array) -> float:
    """Return the parameter between two at which the curve is along the ray, by bisection."""
    first = _beside(knots, control_points, low, ray, values)[2]
    for _ in range(50):
        middle = 0.5 * (low + high)
        if _beside(knots, control_points, middle, ray, values)[2] * first > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@kernel
def _crossing(knots: Array, control_points: Array, low: float, high: float, ray: _Ray, values: Array) -> float:
    """Return how far ahead the curve crosses the ray's line.

    Between two parameters, by Newton's method, with bisection if it would leave them.
    """
    x, y, cosine, sine = ray
    px, py = point_at(knots, control_points, low, 0, values)
    aside_low = cosine * (py - y) - sine * (px - x)
    parameter = (low + high) / 2.0
    for _ in range(40):
        px, py = point_at(knots, control_points, parameter, 0, values)
        aside = cosine * (py - y) - sine * (px - x)
        if abs(aside) < 1e-12 or high - low < 1e-13:
            break
        if aside_low * aside <= 0.0:
            high = parameter
        else:
            low, aside_low = parameter, aside
        dx, dy = point_at(knots, control_points, parameter, 1, values)
        slope = cosine * dy - sine * dx
        moved = parameter - aside / slope if slope != 0.0 else low
        parameter = moved if low < moved < high else (low + high) / 2.0
    return float(cosine * (px - x) + sine * (py - y))


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
            raise ValueError(f"control points have shape {control_points.shape}; want (n, 2) with n >= {ORDER}")
        if knots.shape != (len(control_points) + ORDER,):
            raise ValueError(
                f"knots have shape {knots.shape}; want {len(control_points) + ORDER}, {ORDER} more than control points"
            )
        if not _is_sound(knots, control_points):
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

        Positive if the curve turns left.
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
        positions = np.ascontiguousarray(np.reshape(np.asarray(points, np.float64), (-1, 2)))
        parameters, distances = np.empty(len(positions)), np.empty(len(positions))
        _closest_point(self.knots, self.control_points, positions, parameters, distances)
        return parameters, distances

    def ray(self, origin: ArrayLike, direction: float) -> float:
        """Return the distance at which a ray first meets the curve [m].

        From a point (2,) along a direction [rad]; inf if it does not.
        """
        x, y = (float(value) for value in np.asarray(origin, np.float64))
        return float(_ray_crossing(self.knots, self.control_points, x, y, math.cos(direction), math.sin(direction)))

    def _values(self, parameters: ArrayLike, order: int) -> NDArray[np.float64]:
        wanted = np.atleast_1d(np.asarray(parameters, np.float64))
        values = np.empty((len(wanted), 2))
        _evaluate_curve(self.knots, self.control_points, wanted, order, values)
        return values
