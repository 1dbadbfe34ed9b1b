"""Faces of meshes: polygons as triangles, and points on them."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

SPACING_M = 0.02
"""Largest distance between neighbouring points on a face [m]."""

MAX_SAMPLES = 4_000_000
"""Most points on faces; those of larger meshes are farther apart."""

Triangles = NDArray[np.int64]
"""Numbers of the points at the corners, (M, 3)."""


def triangles_of(polygons: Sequence[NDArray[np.int64]], points: int) -> Triangles:
    """Return polygons, grouped by their number of corners as (m, corners), as fans of triangles.

    Parameters
    ----------
    points : int
        Number of points that corners may name.
    """
    fans = [np.zeros((0, 3), np.int64)]
    for group in polygons:
        if group.size and not (group.min() >= 0 and group.max() < points):
            raise ValueError(f"its faces name the points {group.min():,} to {group.max():,}; there are {points:,}")
        fans += [group[:, [0, k, k + 1]] for k in range(1, group.shape[1] - 1)]
    return np.concatenate(fans)


def sampled(points: NDArray[np.float64], triangles: Triangles) -> tuple[NDArray[np.float64], float]:
    """Return points on triangles whose corners (N, 3) are far apart, and the largest distance between them [m].

    Small triangles get none: their corners are near enough.
    """
    corners = points[triangles]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    longest = np.argmax(sides, axis=1) if len(sides) else np.zeros(0, np.int64)
    is_large = sides.max(axis=1, initial=0.0) > SPACING_M
    corners, sides, longest = corners[is_large], sides[is_large], longest[is_large]
    order = (longest[:, None] + np.arange(3)) % 3
    # The longest side is the base, so that the third corner is above it.
    start, end, top = np.moveaxis(np.take_along_axis(corners, order[:, :, None], axis=1), 1, 0)
    base = np.linalg.norm(end - start, axis=1)
    areas = 0.5 * np.linalg.norm(np.cross(end - start, top - start), axis=1)
    height = 2.0 * areas / np.where(base > 0.0, base, 1.0)
    spacing = SPACING_M
    while _number(base, height, spacing) > MAX_SAMPLES:
        spacing *= 1.25
    return _rows_of_points(start, end, top, base, height, spacing), spacing


def _number(base: NDArray[np.float64], height: NDArray[np.float64], spacing: float) -> float:
    """Return about how many points there are."""
    return float(((0.5 * base / spacing + 1.5) * (height / spacing + 1.5)).sum())


@kernel
def _rows_of_points(
    start: Array, end: Array, top: Array, base: Array, height: Array, spacing: float
) -> NDArray[np.float64]:
    """Return points in rows parallel to the bases of triangles, shorter and shorter up to the top."""
    count = 0
    for k in range(len(base)):
        rows = math.ceil(height[k] / spacing) + 1
        for row in range(rows):
            count += math.ceil(base[k] * (1.0 - row / max(rows - 1, 1)) / spacing) + 1
    found, place = np.empty((count, 3)), 0
    for k in range(len(base)):
        rows = math.ceil(height[k] / spacing) + 1
        for row in range(rows):
            up = row / max(rows - 1, 1)
            across = math.ceil(base[k] * (1.0 - up) / spacing) + 1
            for column in range(across):
                along = column / max(across - 1, 1)
                for axis in range(3):
                    left = start[k, axis] + up * (top[k, axis] - start[k, axis])
                    right = end[k, axis] + up * (top[k, axis] - end[k, axis])
                    found[place, axis] = left + along * (right - left)
                place += 1
    return found
