"""Sphere tracing on a distance transform.

It follows the manner of f1tenth's scan simulator.

This is code of our own after its published method, a second yardstick besides the original: directions from a
table of 2000 angles, and along each beam steps of the distance that the transform of the cell tells, until
that is zero or the range is out. Like the original it passes through corners now and then.

References
----------
M. O'Kelly, H. Zheng, D. Karthik and R. Mangharam, F1TENTH: An Open-source Evaluation Environment for
Continuous Control and Reinforcement Learning, NeurIPS 2019 Competition and Demonstration Track.
"""

import math

import numba
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lidarium.benchmarks.speed.scenes.floors import BenchFloor
from lidarium.mapping.kernels.compilation import Array

ANGLES = 2000
CLOSE = 1e-4
"""Distance at which a beam has arrived [m]."""


@numba.njit
def _distance_at(
    x: float,
    y: float,
    origin_x: float,
    origin_y: float,
    cosine: float,
    sine: float,
    resolution: float,
    distances: Array,
) -> float:
    """Look up the distance of a point in the transform.

    The transform's grid may be shifted and turned.
    """
    rows, columns = distances.shape
    shifted_x, shifted_y = x - origin_x, y - origin_y
    grid_x = shifted_x * cosine + shifted_y * sine
    grid_y = shifted_y * cosine - shifted_x * sine
    if grid_x < 0.0 or grid_x >= columns * resolution or grid_y < 0.0 or grid_y >= rows * resolution:
        return distances[-1, -1]  # type: ignore[no-any-return]
    return distances[int(grid_y / resolution), int(grid_x / resolution)]  # type: ignore[no-any-return]


@numba.njit
def _scan(
    pose: Array,
    beams: int,
    field_of_view: float,
    directions: Array,
    reach: float,
    frame: Array,
    resolution: float,
    distances: Array,
) -> Array:
    """Return the ranges of one scan [m]."""
    ranges = np.empty(beams)
    angles = directions.shape[1]
    place = (angles * (pose[2] - 0.5 * field_of_view) / (2.0 * math.pi)) % angles
    step = angles * (field_of_view / (beams - 1)) / (2.0 * math.pi)
    for beam in range(beams):
        cosine, sine = directions[0, int(place)], directions[1, int(place)]
        x, y = pose[0], pose[1]
        nearest = _distance_at(x, y, frame[0], frame[1], frame[2], frame[3], resolution, distances)
        total = nearest
        while nearest > CLOSE and total <= reach:
            x += nearest * cosine
            y += nearest * sine
            nearest = _distance_at(x, y, frame[0], frame[1], frame[2], frame[3], resolution, distances)
            total += nearest
        ranges[beam] = total
        place += step
        if place >= angles:
            place -= angles
    return ranges


class SphereTracer:
    """Casts scans by sphere tracing."""

    def __init__(self, floor: BenchFloor, beams: int, field_of_view: float, reach: float) -> None:
        self._beams, self._field_of_view, self._reach, self._resolution = (
            beams,
            field_of_view,
            reach,
            floor.resolution,
        )
        self._distances = ndimage.distance_transform_edt(floor.solid == 0) * floor.resolution
        turns = np.linspace(0.0, 2.0 * math.pi, ANGLES)
        self._directions = np.stack([np.cos(turns), np.sin(turns)])
        self._frame = np.array([0.0, 0.0, 1.0, 0.0])

    def scan(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the ranges at a pose x, y, theta [m, rad], shape (beams,) [m]."""
        ranges: NDArray[np.float64] = _scan(
            pose,
            self._beams,
            self._field_of_view,
            self._directions,
            self._reach,
            self._frame,
            self._resolution,
            self._distances,
        )
        return ranges
