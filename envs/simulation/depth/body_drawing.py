"""Bodies drawn into inverse depths, exact at pixel centres: upright cylinders, and leaves of doors."""

import math

import numpy as np

from lidarium.envs.simulation.depth.face_drawing import (
    CENTRE_COLUMN,
    CENTRE_ROW,
    COLUMNS,
    DEPTH_MAX,
    FOCAL,
    NEAR,
    ROWS,
    sides_beyond,
)
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import scratch_vector


@kernel(nrt=False)
def _box_around(
    centre: Array, radius: float, height: float, axes: Array, eye: Array, view: Array
) -> tuple[int, int, int, int]:
    """Return the first and last row and column of a cylinder in the image; it is not in it if first > last."""
    low_row, high_row, low_column, high_column = math.inf, -math.inf, math.inf, -math.inf
    beyond, is_ahead = 63, True
    for corner in range(8):
        x = centre[0] - eye[0] + (radius if corner & 1 else -radius)
        y = centre[1] - eye[1] + (radius if corner & 2 else -radius)
        z = centre[2] - eye[2] + (height if corner & 4 else 0.0)
        across = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z
        down = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z
        ahead = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z
        beyond &= sides_beyond(across, down, ahead, view)
        is_ahead &= ahead >= NEAR
        low_row, high_row = min(low_row, down / ahead), max(high_row, down / ahead)
        low_column, high_column = min(low_column, across / ahead), max(high_column, across / ahead)
    if beyond:
        return 1, 0, 1, 0
    if not is_ahead:
        return 0, int(view[ROWS]) - 1, 0, int(view[COLUMNS]) - 1
    focal = view[FOCAL]
    return (
        max(int(math.ceil(max(view[CENTRE_ROW] + focal * low_row, 0.0))), 0),
        int(math.floor(min(view[CENTRE_ROW] + focal * high_row, view[ROWS] - 1.0))),
        max(int(math.ceil(max(view[CENTRE_COLUMN] + focal * low_column, 0.0))), 0),
        int(math.floor(min(view[CENTRE_COLUMN] + focal * high_column, view[COLUMNS] - 1.0))),
    )


@kernel(forceinline=True)
def _meets_cylinder(
    x: float, y: float, z: float, ray_x: float, ray_y: float, ray_z: float, radius: float, height: float
) -> float:
    """Return the inverse of how far along a ray an upright cylinder is met from the outside, or 0.

    The ray begins at x, y, z from the middle of the cylinder's base [m].
    """
    squared = ray_x * ray_x + ray_y * ray_y
    inward = x * ray_x + y * ray_y
    outside = x * x + y * y - radius * radius
    if outside > 0.0 and squared > 0.0:
        root = inward * inward - squared * outside
        if root >= 0.0 and inward < 0.0:
            along = outside / (math.sqrt(root) - inward)
            met = z + along * ray_z
            if 0.0 <= met <= height:
                return 1.0 / along
    if z > height and ray_z < 0.0:
        along = (height - z) / ray_z
        met_x, met_y = x + along * ray_x, y + along * ray_y
        if met_x * met_x + met_y * met_y <= radius * radius:
            return 1.0 / along
    return 0.0


@kernel(nrt=False)
def draw_leaf(
    ends: tuple[float, float, float, float], height: float, axes: Array, eye: Array, view: Array, inverse: Array
) -> None:
    """Draw an upright rectangle on the ground between two points x, y, x, y [m] into inverse depths."""
    from_x, from_y, to_x, to_y = ends
    along_x, along_y = to_x - from_x, to_y - from_y
    centre = scratch_vector(3, np.float64)
    centre[0], centre[1], centre[2] = 0.5 * (from_x + to_x), 0.5 * (from_y + to_y), 0.0
    half = 0.5 * math.hypot(along_x, along_y)
    if math.hypot(centre[0] - eye[0], centre[1] - eye[1]) > half + 2.0 * view[DEPTH_MAX]:
        return
    first, last, left, right = _box_around(centre, half, height, axes, eye, view)
    gap_x, gap_y, scale = from_x - eye[0], from_y - eye[1], 1.0 / view[FOCAL]
    for row in range(first, last + 1):
        down = (row - view[CENTRE_ROW]) * scale
        for column in range(left, right + 1):
            across = (column - view[CENTRE_COLUMN]) * scale
            ray_x = axes[0, 0] * across + axes[1, 0] * down + axes[2, 0]
            ray_y = axes[0, 1] * across + axes[1, 1] * down + axes[2, 1]
            ray_z = axes[0, 2] * across + axes[1, 2] * down + axes[2, 2]
            beside = ray_x * along_y - ray_y * along_x
            if beside == 0.0:
                continue
            depth = (gap_x * along_y - gap_y * along_x) / beside
            place = (gap_x * ray_y - gap_y * ray_x) / beside
            if depth > NEAR and 0.0 <= place <= 1.0 and 0.0 <= eye[2] + depth * ray_z <= height:
                inverse[row, column] = max(inverse[row, column], np.float32(1.0 / depth))


@kernel(nrt=False)
def draw_body(
    centre: Array, radius: float, height: float, axes: Array, eye: Array, view: Array, inverse: Array
) -> None:
    """Draw an upright cylinder into inverse depths.

    Parameters
    ----------
    centre : (3,) float64
        Middle of its base in the world [m].
    radius, height : float
        Its size [m].
    """
    x, y, z = eye[0] - centre[0], eye[1] - centre[1], eye[2] - centre[2]
    if math.hypot(x, y) > radius + view[DEPTH_MAX] / math.cos(math.atan(view[COLUMNS] / view[FOCAL])):
        return
    first, last, left, right = _box_around(centre, radius, height, axes, eye, view)
    scale = 1.0 / view[FOCAL]
    for row in range(first, last + 1):
        down = (row - view[CENTRE_ROW]) * scale
        for column in range(left, right + 1):
            across = (column - view[CENTRE_COLUMN]) * scale
            ray_x = axes[0, 0] * across + axes[1, 0] * down + axes[2, 0]
            ray_y = axes[0, 1] * across + axes[1, 1] * down + axes[2, 1]
            ray_z = axes[0, 2] * across + axes[1, 2] * down + axes[2, 2]
            met = np.float32(_meets_cylinder(x, y, z, ray_x, ray_y, ray_z, radius, height))
            inverse[row, column] = max(inverse[row, column], met)
