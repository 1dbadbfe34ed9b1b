"""Which way the walls of a scan run.

In most buildings walls run in two directions, at right angles. A scan's walls then tell its heading, up to quarter turns, and this
measurement does not drift.

References
----------
Coughlan and Yuille, Manhattan world: compass direction from a single image by Bayesian inference (ICCV 1999), here for range scans.
"""

import math

import numpy as np

from lidarium.mapping.kernels import Array, kernel
from lidarium.mapping.localization.scan_matching import SURFACE_GAP

QUARTER = 0.5 * math.pi
"""Turns by so much change nothing about the directions of walls [rad]."""

BASELINE_M = 0.5
"""Two points of a surface so far apart tell its direction [m]: with nearer ones noise does."""

ALONG = math.radians(15.0)
"""A surface belongs to a wall that runs less than this from its direction [rad]."""

LEAST_POINTS = 6
"""Of fewer points in a row nothing is told."""

LEAST_AGREEMENT = 0.3
"""Surfaces that agree on two directions at right angles less than this tell nothing; it is 1 where all run along them."""

MOST_ROUGHNESS_M = 0.08
"""Points that lie farther than this from their line, in the root of the mean square, are no wall [m]."""

OUTLIER = math.radians(1.0)
"""A wall that deviates so much from the others counts half [rad]."""


@kernel
def within_quarter(angle: float) -> float:
    """Return an angle less quarter turns, in [-pi/4, pi/4)."""
    return float((angle + 0.5 * QUARTER) % QUARTER - 0.5 * QUARTER)


@kernel
def wall_direction(points: Array, deviation: float) -> tuple[float, float]:
    """Return in which direction the walls of a scan run, up to quarter turns.

    Parameters
    ----------
    points : (points, 2) float64
        Points in which beams ended, in their order, as seen by the robot [m].
    deviation : float
        Standard deviation of a range [m].

    Returns
    -------
    float
        The direction, in [-pi/4, pi/4), as seen by the robot [rad].
    float
        Its information, 0 where there are no walls, or hardly any that agree on two directions at right angles [1/rad^2].
    """
    count = len(points)
    surfaces = np.full(count, np.nan)
    cosines, sines, told, last = 0.0, 0.0, 0, 0
    for k in range(count):
        last = max(last, k)
        while last + 1 < count and _is_one_surface(points, last) and _distance(points, k, last) < BASELINE_M:
            last += 1
        if _distance(points, k, last) >= BASELINE_M:
            surface = math.atan2(points[last, 1] - points[k, 1], points[last, 0] - points[k, 0])
            surfaces[(k + last) // 2] = surface
            cosines += math.cos(4.0 * surface)
            sines += math.sin(4.0 * surface)
            told += 1
    if told < LEAST_POINTS or math.hypot(cosines, sines) < LEAST_AGREEMENT * told:
        return 0.0, 0.0
    coarse = 0.25 * math.atan2(sines, cosines)
    offsets, weights = np.empty(count), np.empty(count)
    walls, first = 0, 0
    while first < count:
        axis = _axis(surfaces[first], coarse)
        end = first + 1
        while end < count and _is_one_surface(points, end - 1) and _axis(surfaces[end], coarse) == axis:
            end += 1
        if axis >= 0 and end - first >= LEAST_POINTS:
            offset, length, roughness = _line(points[first:end], coarse + axis * QUARTER)
            if roughness <= MOST_ROUGHNESS_M:
                offsets[walls], weights[walls] = offset, length / (deviation * deviation)
                walls += 1
        first = end
    fine, information = _agreed(offsets[:walls], weights[:walls])
    return within_quarter(coarse + fine), information


@kernel(inline=True)
def _distance(points: Array, k: int, m: int) -> float:
    return math.hypot(points[m, 0] - points[k, 0], points[m, 1] - points[k, 1])


@kernel(inline=True)
def _is_one_surface(points: Array, k: int) -> bool:
    """Whether a point and the next one lie on one surface."""
    return bool(_distance(points, k, k + 1) <= SURFACE_GAP * max(1.0, math.hypot(points[k, 0], points[k, 1])))


@kernel(inline=True)
def _axis(surface: float, coarse: float) -> int:
    """Return 0 or 1 for a surface along a direction or across it, -1 for any other."""
    if not abs(within_quarter(surface - coarse)) <= ALONG:
        return -1
    return int(math.floor((surface - coarse) / QUARTER + 0.5)) % 2


@kernel
def _line(points: Array, direction: float) -> tuple[float, float, float]:
    """Return how far a line through points turns from a direction [rad], the squares along it [m^2], and the rms beside it [m]."""
    cosine, sine = math.cos(direction), math.sin(direction)
    x, y = points[:, 0].mean(), points[:, 1].mean()
    along2, product, across2 = 0.0, 0.0, 0.0
    for k in range(len(points)):
        along = cosine * (points[k, 0] - x) + sine * (points[k, 1] - y)
        across = cosine * (points[k, 1] - y) - sine * (points[k, 0] - x)
        along2 += along * along
        product += along * across
        across2 += across * across
    slope = product / along2
    return math.atan(slope), along2, math.sqrt(max(across2 - slope * product, 0.0) / len(points))


@kernel
def _agreed(offsets: Array, weights: Array) -> tuple[float, float]:
    """Return the mean of walls' offsets, those that deviate counting less, and its information."""
    mean, total = 0.0, 0.0
    for step in range(4):
        mean_before, mean, total = mean, 0.0, 0.0
        for k in range(len(offsets)):
            deviation = (offsets[k] - mean_before) / OUTLIER if step > 0 else 0.0
            weight = weights[k] / (1.0 + deviation * deviation)
            mean += weight * offsets[k]
            total += weight
        if total == 0.0:
            return 0.0, 0.0
        mean /= total
    return mean, total
