"""Directions of the surfaces that the points of a scan lie on."""

import math

from lidarium.mapping.kernels.compilation import Array, kernel

SURFACE_GAP = 0.3
"""Largest gap between neighbouring points on one surface.

As a share of their distance, or in metres.
"""

MOST_BEND = 0.15
"""Largest ratio of the points' variance across the surface to that along it.

Above this there is a corner.
"""

LEAST_POINTS = 3
"""Fewer points have no axis of their own."""


@kernel(forceinline=True)
def _is_one_surface(points: Array, k: int) -> bool:
    """Whether a point and the next one lie on one surface."""
    gap = SURFACE_GAP * max(math.hypot(points[k, 0], points[k, 1]), 1.0)
    return bool(math.hypot(points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]) <= gap)


@kernel
def find_normals(points: Array, reach: float, normals: Array) -> None:
    """Fill ``normals`` (n, 2) with unit normals of the surfaces (kernel).

    The surface at each point is that of the point and its neighbours; zero for a point alone.

    Two neighbours give it where the surface bends; elsewhere all within reach do, since noise turns what lies
    between two near points.
    """
    count = points.shape[0]
    for k in range(count):
        before, after = k, k
        while before > 0 and _is_one_surface(points, before - 1) and _is_near(points, before - 1, k, reach):
            before -= 1
        while after + 1 < count and _is_one_surface(points, after) and _is_near(points, after + 1, k, reach):
            after += 1
        along_x, along_y, is_bent = _axis(points[before : after + 1])
        if is_bent:
            before = k - 1 if k > 0 and _is_one_surface(points, k - 1) else k
            after = k + 1 if k + 1 < count and _is_one_surface(points, k) else k
            along_x, along_y = points[after, 0] - points[before, 0], points[after, 1] - points[before, 1]
        length = math.hypot(along_x, along_y)
        if length > 0.0:
            normals[k, 0], normals[k, 1] = -along_y / length, along_x / length


@kernel(forceinline=True)
def _is_near(points: Array, k: int, m: int, reach: float) -> bool:
    return bool(math.hypot(points[k, 0] - points[m, 0], points[k, 1] - points[m, 1]) <= reach)


@kernel
def _axis(points: Array) -> tuple[float, float, bool]:
    """Return the axis of largest variance of points, and whether it is unclear.

    The axis is of unit length, zero for fewer than three points. Unclear where points do not lie along
    it, or are too few.
    """
    count = points.shape[0]
    if count < LEAST_POINTS:
        return 0.0, 0.0, True
    x, y = 0.0, 0.0
    for k in range(count):
        x += points[k, 0] / count
        y += points[k, 1] / count
    xx, xy, yy = 0.0, 0.0, 0.0
    for k in range(count):
        xx += (points[k, 0] - x) * (points[k, 0] - x)
        xy += (points[k, 0] - x) * (points[k, 1] - y)
        yy += (points[k, 1] - y) * (points[k, 1] - y)
    half, middle = math.hypot(0.5 * (xx - yy), xy), 0.5 * (xx + yy)
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    return math.cos(angle), math.sin(angle), middle - half > MOST_BEND * (middle + half)
