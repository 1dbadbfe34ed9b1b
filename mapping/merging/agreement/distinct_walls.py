"""How many distinct walls agree: what a long straight wall shows once, it does not show again.

Two corners of one corridor agree over tens of metres of wall, and yet in four walls alone. Rooms that are one
agree in as many walls as they have.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.description.described_map import DescribedMap

DIRECTIONS = 16
"""Directions in which walls face."""

APART_M, LEAST_M = 0.12, 0.3
"""Gap between two walls that face one direction, and least length of a wall that agrees [m]."""


def distinct_walls(a: DescribedMap, b: DescribedMap, a_from_b: Transform, hit_distance_m: float) -> int:
    """Return the number of distinct walls of map b that agree with walls of map a.

    A wall is all that faces one direction at one distance.

    Parameters
    ----------
    a, b : DescribedMap
        Maps of one resolution.
    a_from_b : Transform
        Maps points of b into a.
    hit_distance_m : float
        Distance within which walls agree [m], or within a cell and a half.
    """
    is_agreeing = _agreeing(a, b, a_from_b, max(hit_distance_m, 1.5 * a.resolution))
    has_side = np.hypot(*b.normals.T) > 0.7
    walls, normals = b.walls[is_agreeing & has_side], b.normals[is_agreeing & has_side]
    angles, step = np.arctan2(normals[:, 1], normals[:, 0]), 2.0 * math.pi / DIRECTIONS
    # Most walls of a building are at right angles: directions are counted from theirs, in whatever frame.
    first = float(np.angle(np.exp(4j * angles).sum())) / 4.0
    facing = np.round((angles - first) / step).astype(np.int64) % DIRECTIONS
    count = 0
    for direction in range(DIRECTIONS):
        angle = first + direction * step
        chosen = walls[facing == direction]
        distances = np.sort(chosen @ np.array([math.cos(angle), math.sin(angle)]))
        lengths = np.diff(np.flatnonzero(np.diff(distances) > APART_M), prepend=-1, append=len(distances) - 1)
        count += int(np.count_nonzero(lengths * b.resolution >= LEAST_M - 1e-9))
    return count


def _agreeing(a: DescribedMap, b: DescribedMap, a_from_b: Transform, hit_m: float) -> NDArray[np.bool_]:
    """Return which walls of map b lie on walls of map a, (n,)."""
    cells = np.floor(a_from_b.apply(b.walls) / a.resolution).astype(np.int64)
    rows, columns = a.levels.shape
    is_inside = (cells >= 0).all(axis=1) & (cells[:, 0] < columns) & (cells[:, 1] < rows)
    agrees = np.zeros(len(cells), np.bool_)
    inside = cells[is_inside]
    agrees[is_inside] = a.distance[inside[:, 1], inside[:, 0]] <= hit_m
    return agrees
