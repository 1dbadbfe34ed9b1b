"""Pieces of a map around a cell, rotated to a direction, for networks."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

FREE, UNKNOWN, OCCUPIED = -1, 0, 1


def map_crops(
    log_odds: NDArray[np.int8],
    resolution: float,
    cells: NDArray[np.int64],
    directions: NDArray[np.float64],
    side: int,
    step: float,
) -> NDArray[np.int8]:
    """Return a square piece of a map around each of some cells, rotated to a direction.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map: < 0 free, 0 unknown, > 0 occupied; cells beyond it are unknown.
    resolution : float
        Side of its cells [m].
    cells : (n, 2) int64
        Cells (row, column) of the pieces.
    directions : (n,) float64
        Direction of each piece [rad].
    step : float
        Side of a square [m].

    Returns
    -------
    (n, side, side) int8
        Rows go ahead, a quarter of them lie behind the cell; columns go to the left, half of them lie to its
        right. Squares are ``OCCUPIED`` if any of their cells is, else ``FREE`` if any is, else ``UNKNOWN``.
    """
    crops = np.empty((len(cells), side, side), np.int8)
    samples = max(round(step / resolution), 1)
    _crop(log_odds, cells, directions, (step / resolution, samples), crops)
    return crops


@kernel
def _crop(log_odds: Array, cells: Array, directions: Array, scale: tuple[float, int], crops: Array) -> None:
    side, (step, samples) = crops.shape[1], scale
    # Places of the samples along a side, ahead and to the left [cells].
    ahead, left = np.empty(side * samples), np.empty(side * samples)
    for i in range(side):
        for sample in range(samples):
            ahead[i * samples + sample] = (i - side // 4 + (sample + 0.5) / samples) * step
            left[i * samples + sample] = (i - side // 2 + (sample + 0.5) / samples) * step
    for k in range(len(cells)):
        ahead_column, ahead_row = math.cos(directions[k]), math.sin(directions[k])
        rows, columns = cells[k, 0] + 0.5 + ahead * ahead_row, cells[k, 1] + 0.5 + ahead * ahead_column
        rises, runs = left * ahead_column, left * ahead_row
        for i in range(side):
            for j in range(side):
                square = slice(i * samples, (i + 1) * samples), slice(j * samples, (j + 1) * samples)
                crops[k, i, j] = _level(
                    log_odds, rows[square[0]], columns[square[0]], rises[square[1]], runs[square[1]]
                )


@kernel
def _level(log_odds: Array, rows: Array, columns: Array, rises: Array, runs: Array) -> int:
    """Return the level of a square, by samples along its sides."""
    level = UNKNOWN
    for i in range(len(rows)):
        for j in range(len(rises)):
            row, column = int(math.floor(rows[i] + rises[j])), int(math.floor(columns[i] - runs[j]))
            if not (0 <= row < log_odds.shape[0] and 0 <= column < log_odds.shape[1]):
                continue
            value = log_odds[row, column]
            if value > 0:
                return OCCUPIED
            if value < 0:
                level = FREE
    return level
