"""Counts of how two maps agree under a motion."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, UNKNOWN
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.merging.description.described_map import FACING_DISTANCE_M, DescribedMap, faces_away

STRIDE = 3
"""Areas are counted on every so many-th cell."""


def disc_agreement(
    a: DescribedMap, b: DescribedMap, a_from_b: Transform, points: NDArray[np.float64], radius_cells: int
) -> float:
    """Return the share of map b's cells within discs whose state in map a agrees.

    The discs are around points [m of map b].

    Unknown is a state as others are; what lies outside of map a is unknown. A cell in several discs counts
    once.
    """
    if len(points) == 0:
        return 0.0
    is_inside = np.zeros(b.levels.shape, np.bool_)
    counts = np.zeros(2, np.int64)
    _count_discs(
        a.levels, b.levels, a.resolution, pose_numbers(a_from_b), points, radius_cells, is_inside, counts
    )
    return float(counts[0]) / float(counts[1]) if counts[1] else 0.0


def pose_numbers(transform: Transform) -> tuple[float, float, float]:
    """Return a transform as the numbers that kernels take: x, y [m], theta [rad]."""
    return transform.x, transform.y, transform.theta


class WallField(NamedTuple):
    """What walls of another map are compared with; see ``DescribedMap``.

    Attributes
    ----------
    levels, distance, is_open : (rows, columns) uint8, float32, uint8
        Cells of the map, distances to its walls [m], and where all around is free.
    scale : float
        Cells in a metre [1/m].
    hit, miss : float
        Distances up to which walls agree, and from which they contradict [m].
    """

    levels: Array
    distance: Array
    is_open: Array
    scale: float
    hit: float
    miss: float


@kernel
def count_walls(
    field: WallField,
    walls: Array,
    normals: Array,
    pose: tuple[float, float, float],
    counts: Array,
    facing: Array,
) -> None:
    """Count the walls that agree, that miss by little, and that contradict.

    Sum the squares of the normals of those that agree.
    """
    levels, distance, scale = field.levels, field.distance, field.scale
    rows, columns = levels.shape
    cosine, sine = math.cos(pose[2]) * scale, math.sin(pose[2]) * scale
    x0, y0 = pose[0] * scale, pose[1] * scale
    for i in range(walls.shape[0]):
        column = cosine * walls[i, 0] - sine * walls[i, 1] + x0
        row = sine * walls[i, 0] + cosine * walls[i, 1] + y0
        x, y = int(math.floor(column)), int(math.floor(row))
        if 0 <= x < columns and 0 <= y < rows:
            if distance[y, x] <= field.hit:
                ahead_x = FACING_DISTANCE_M * (cosine * normals[i, 0] - sine * normals[i, 1])
                ahead_y = FACING_DISTANCE_M * (sine * normals[i, 0] + cosine * normals[i, 1])
                if faces_away(levels, column, row, ahead_x, ahead_y):
                    counts[1] += 1
                    continue
                counts[0] += 1
                facing[0] += normals[i, 0] * normals[i, 0]
                facing[1] += normals[i, 0] * normals[i, 1]
                facing[2] += normals[i, 1] * normals[i, 1]
            elif levels[y, x] == FREE:
                counts[2 if field.is_open[y, x] != 0 and distance[y, x] > field.miss else 1] += 1


@kernel
def count_overlap(a: Array, b: Array, side: float, pose: tuple[float, float, float], found: Array) -> None:
    """Count the cells known in both maps, and find their centroid in b [m].

    Every so many-th cell of every so many-th row is examined.
    """
    rows, columns = a.shape
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    count, column_sum, row_sum = 0, 0, 0
    for row in range(STRIDE // 2, b.shape[0], STRIDE):
        x = (cosine * 0.5 - sine * (row + 0.5)) + pose[0] / side
        y = (sine * 0.5 + cosine * (row + 0.5)) + pose[1] / side
        for column in range(STRIDE // 2, b.shape[1], STRIDE):
            if b[row, column] != UNKNOWN:
                c, r = int(math.floor(x + cosine * column)), int(math.floor(y + sine * column))
                if 0 <= c < columns and 0 <= r < rows and a[r, c] != UNKNOWN:
                    count += 1
                    column_sum += column
                    row_sum += row
    found[0] = 1.0 * count * STRIDE**2
    found[1] = (column_sum + 0.5 * count) * side * STRIDE**2
    found[2] = (row_sum + 0.5 * count) * side * STRIDE**2


@kernel
def _count_discs(
    a: Array,
    b: Array,
    side: float,
    pose: tuple[float, float, float],
    points: Array,
    radius: int,
    is_inside: Array,
    counts: Array,
) -> None:
    """Count the cells of b in the discs that are the same in a, and all of them."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    for i in range(points.shape[0]):
        middle_column, middle_row = int(math.floor(points[i, 0] / side)), int(math.floor(points[i, 1] / side))
        for row in range(max(middle_row - radius, 0), min(middle_row + radius + 1, b.shape[0])):
            for column in range(max(middle_column - radius, 0), min(middle_column + radius + 1, b.shape[1])):
                if (
                    is_inside[row, column]
                    or (row - middle_row) ** 2 + (column - middle_column) ** 2 > radius * radius
                ):
                    continue
                is_inside[row, column] = True
                x = cosine * (column + 0.5) - sine * (row + 0.5) + pose[0] / side
                y = sine * (column + 0.5) + cosine * (row + 0.5) + pose[1] / side
                c, r = int(math.floor(x)), int(math.floor(y))
                state = a[r, c] if 0 <= c < a.shape[1] and 0 <= r < a.shape[0] else np.uint8(UNKNOWN)
                counts[0] += np.int64(state == b[row, column])
                counts[1] += 1
