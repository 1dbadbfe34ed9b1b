"""Kernels of one B-spline curve: values, length, closest point, intersection."""

import math
from typing import NamedTuple

import numpy as np

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.curves.basis import ORDER, point_at

NEWTON_STEPS = 20

PIECES = 8
"""Into so many pieces a span is cut where a curve is searched."""

FINE_PIECES = 32
"""Pieces per span in the search for the nearest point.

A curve may turn back on itself within a piece, and then only one of its branches is found.
"""

GAUSS_PLACES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(5)


@kernel
def is_sound(knots: Array, control_points: Array) -> bool:
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
        knots[ORDER - 1] < knots[control_points.shape[0]]
        and math.isfinite(knots[0])
        and math.isfinite(knots[-1])
    )


@kernel
def evaluate_curve(knots: Array, control_points: Array, parameters: Array, order: int, points: Array) -> None:
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
def closest_point(
    knots: Array, control_points: Array, points: Array, parameters: Array, distances: Array
) -> None:
    """Find nearest points by Newton's method in each piece that may hold one.

    The control points' differences bound the length of each piece.
    """
    count = control_points.shape[0]
    most = (count - ORDER + 1) * FINE_PIECES
    places, widths, reaches, used = np.empty(most + 1), np.empty(most), np.empty(most), 0
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
                places[used], widths[used], reaches[used] = (
                    knots[span] + width * i,
                    width,
                    0.5 * fastest * width,
                )
                used += 1
    places[used] = knots[count]
    samples, values, apart = np.empty((used + 1, 2)), np.empty(ORDER), np.empty(used + 1)
    for i in range(used + 1):
        samples[i, 0], samples[i, 1] = point_at(knots, control_points, places[i], 0, values)
    for k in range(points.shape[0]):
        px, py = points[k, 0], points[k, 1]
        for i in range(used + 1):
            apart[i] = math.hypot(samples[i, 0] - px, samples[i, 1] - py)
        nearest, chosen = apart.min(), places[apart.argmin()]
        for i in range(used):
            if min(apart[i], apart[i + 1]) - reaches[i] <= nearest:
                middle = places[i] + 0.5 * widths[i]
                parameter, squared = _descend(
                    knots, control_points, px, py, places[i], middle, places[i + 1], values
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

    Newton's method; where a step leads farther away, as it does beside cusps, half of it is tried.
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
    """Where a ray begins [m], and its direction."""

    x: float
    y: float
    cosine: float
    sine: float


@kernel
def ray_crossing(
    knots: Array, control_points: Array, x: float, y: float, cosine: float, sine: float
) -> float:
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
        ahead_before, aside_before = 0.0, 0.0
        for i in range(PIECES + 1):
            px, py = point_at(knots, control_points, knots[span] + i * step, 0, values)
            ahead, aside = cosine * (px - x) + sine * (py - y), cosine * (py - y) - sine * (px - x)
            if i > 0 and aside_before * aside <= 0.0 and max(ahead_before, ahead) >= 0.0:
                low, high = knots[span] + (i - 1) * step, knots[span] + i * step
                ray = _Ray(x, y, cosine, sine)
                met = _crossing(knots, control_points, low, high, ray, values)
                if 0.0 <= met < nearest:
                    nearest = met
            ahead_before, aside_before = ahead, aside
    return nearest


@kernel
def _crossing(
    knots: Array, control_points: Array, low: float, high: float, ray: _Ray, values: Array
) -> float:
    """Return how far ahead the curve crosses the ray's line.

    Between two parameters, by Newton's method, with bisection where it would leave them.
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
