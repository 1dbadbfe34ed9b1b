"""The solids of a generated floor: upright boxes, and all of them turned."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.generation.plans import Rectangle


def solid_of(rectangle: Rectangle, z_high: float = math.inf) -> Solid:
    """Return what stands on a rectangle, from the ground up to a height [m]."""
    x_low, y_low, x_high, y_high = (round(value, 4) for value in rectangle)
    return Solid(np.array([(x_low, y_low), (x_high, y_low), (x_high, y_high), (x_low, y_high)]), 0.0, z_high)


def rotated(floor: Floor, angle: float) -> Floor:
    """Turn a floor about its corner and move it back to the first quadrant.

    The corners that open are filled.
    """
    if angle == 0.0:
        return floor
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    x_high, y_high = floor.bounds[2:]
    corners = np.array([(0.0, 0.0), (x_high, 0.0), (x_high, y_high), (0.0, y_high)]) @ turn.T
    shift = -corners.min(axis=0)
    corners = corners + shift
    extent = corners.max(axis=0)

    def moved(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.round(points @ turn.T + shift, 4) + 0.0)

    solids = [Solid(moved(solid.polygon), solid.z_low, solid.z_high) for solid in floor.solids]
    for k in range(4):
        a, b = corners[k], corners[(k + 1) % 4]
        apex = next(
            corner
            for corner in ((a[0], b[1]), (b[0], a[1]))
            if any(abs(corner[0] - x) < 1e-9 for x in (0.0, extent[0]))
            and any(abs(corner[1] - y) < 1e-9 for y in (0.0, extent[1]))
        )
        if np.abs(a - apex).max() > 1e-3 and np.abs(b - apex).max() > 1e-3:
            solids.append(Solid(np.asarray(np.round(np.array([a, b, apex]), 4) + 0.0, np.float64)))
    headings = np.arctan2(np.sin(floor.starts[:, 2] + angle), np.cos(floor.starts[:, 2] + angle))
    starts = np.asarray(np.column_stack([moved(floor.starts[:, :2]), np.round(headings, 4)]), np.float64)
    return Floor(
        floor.name,
        (0.0, 0.0, round(float(extent[0]), 4), round(float(extent[1]), 4)),
        tuple(solids),
        starts=starts,
    )
