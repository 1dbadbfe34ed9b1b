"""The agreement of a local map, smoothed by a cubic B-spline, with its slopes."""

import math

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.localization.matching.submaps import FREE_LEVEL, FULL_LEVEL, UNSEEN

LEVEL_RANGE = float(FULL_LEVEL - FREE_LEVEL)
"""Levels from no agreement to full agreement."""

NEAR_CELLS = 3
"""A cell is near another within so many rows and columns."""


@kernel(forceinline=True, nrt=False)
def _spline_weights(t: float) -> tuple[float, float, float, float]:
    """Return the weights of four neighbouring cells in a cubic B-spline.

    t runs from 0 to 1 between the middle two.
    """
    u, square, cube = 1.0 - t, t * t, t * t * t
    return (
        u * u * u / 6.0,
        (3.0 * cube - 6.0 * square + 4.0) / 6.0,
        (-3.0 * cube + 3.0 * square + 3.0 * t + 1.0) / 6.0,
        cube / 6.0,
    )


@kernel(forceinline=True, nrt=False)
def _spline_slopes(t: float) -> tuple[float, float, float, float]:
    """Return the slopes of the weights."""
    u, square = 1.0 - t, t * t
    return -0.5 * u * u, 1.5 * square - 2.0 * t, -1.5 * square + t + 0.5, 0.5 * square


@kernel(forceinline=True, nrt=False)
def agreement(levels: Array, x: float, y: float) -> tuple[float, float, float]:
    """Return the smoothed agreement at x, y [cells] and its slopes [1/cell] (kernel).

    Zero where the map ends.
    """
    u, v = x - 0.5, y - 0.5
    column, row = int(math.floor(u)), int(math.floor(v))
    if not (1 <= column < levels.shape[1] - 2 and 1 <= row < levels.shape[0] - 2):
        return 0.0, 0.0, 0.0
    across, across_slopes = _spline_weights(u - column), _spline_slopes(u - column)
    along, along_slopes = _spline_weights(v - row), _spline_slopes(v - row)
    value, slope_x, slope_y = 0.0, 0.0, 0.0
    for i in range(4):
        line, line_slope = 0.0, 0.0
        for j in range(4):
            level = max(float(levels[row + i - 1, column + j - 1]) - FREE_LEVEL, 0.0)
            line += across[j] * level
            line_slope += across_slopes[j] * level
        value += along[i] * line
        slope_x += along[i] * line_slope
        slope_y += along_slopes[i] * line
    return value / LEVEL_RANGE, slope_x / LEVEL_RANGE, slope_y / LEVEL_RANGE


@kernel(forceinline=True, nrt=False)
def is_unseen(levels: Array, x: float, y: float) -> bool:
    """Whether the map has not observed the cell at x, y [cells] (kernel)."""
    column, row = int(math.floor(x)), int(math.floor(y))
    return not (0 <= column < levels.shape[1] and 0 <= row < levels.shape[0]) or levels[row, column] == UNSEEN


@kernel(nrt=False)
def extremes_around(levels: Array, column: int, row: int) -> tuple[int, int]:
    """Return the lowest and the highest level within three cells (kernel).

    What lies outside of the map is not observed.
    """
    rows, columns = levels.shape
    lowest, highest = FULL_LEVEL, UNSEEN
    for i in range(row - NEAR_CELLS, row + NEAR_CELLS + 1):
        for j in range(column - NEAR_CELLS, column + NEAR_CELLS + 1):
            level = int(levels[i, j]) if 0 <= i < rows and 0 <= j < columns else UNSEEN
            lowest, highest = min(lowest, level), max(highest, level)
    return lowest, highest
