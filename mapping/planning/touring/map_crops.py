"""Pieces of a map as seen from a place in a direction, for networks."""

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
    """Return a square piece of a map around each of some cells, turned in a direction.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map: < 0 free, 0 unknown, > 0 occupied; all around it is unknown.
    resolution : float
        Side of its cells [m].
    cells : (n, 2) int64
        Cells (row, column) from which the pieces are seen.
    directions : (n,) float64
        Where each looks [rad].
    side : int
        Pieces have so many squares a side.
    step : float
        Side of a square [m].

    Returns
    -------
    (n, side, side) int8
        Rows go ahead, a quarter of them lie behind the cell; columns go to the left, half of them lie to its
        right. Squares are ``OCCUPIED`` where anything in them is, else ``FREE`` where anything is, else
        ``UNKNOWN``.
    """
    crops = np.empty((len(cells), side, side), np.int8)
    samples = max(round(step / resolution), 1)
    _crop(log_odds, cells, directions, (step / resolution, samples), crops)
    return crops


@kernel
def _crop(log_odds: Array, cells: Array, directions: Array, scale: tuple[float, int], crops: Array) -> None:
    rows, columns = log_odds.shape
    side = crops.shape[1]
    step, samples = scale
    for k in range(len(cells)):
        ahead_column, ahead_row = math.cos(directions[k]), math.sin(directions[k])
        for i in range(side):
            for j in range(side):
                level = UNKNOWN
                for sample in range(samples * samples):
                    ahead = (i - side // 4 + (sample // samples + 0.5) / samples) * step
                    left = (j - side // 2 + (sample % samples + 0.5) / samples) * step
                    row = int(math.floor(cells[k, 0] + 0.5 + ahead * ahead_row + left * ahead_column))
                    column = int(math.floor(cells[k, 1] + 0.5 + ahead * ahead_column - left * ahead_row))
                    if not (0 <= row < rows and 0 <= column < columns):
                        continue
                    value = log_odds[row, column]
                    if value > 0:
                        level = OCCUPIED
                        break
                    if value < 0:
                        level = FREE
                crops[k, i, j] = level
