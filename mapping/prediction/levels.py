"""Partial maps at the resolution of predictions: free, unknown or occupied squares of many cells."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

FREE, UNKNOWN, OCCUPIED = -1, 0, 1
"""Levels of squares."""

SIDE = 0.2
"""Side of a square of predictions [m]."""


def factor_of(resolution: float) -> int:
    """Return the number of cells along a square of predictions, 1 at least."""
    return max(round(SIDE / resolution), 1)


def levels_of(log_odds: NDArray[np.int8], factor: int) -> NDArray[np.int8]:
    """Return the squares of a map, (ceil(rows / factor), ceil(columns / factor)) int8.

    A square is ``OCCUPIED`` if any of its cells is, ``FREE`` if at least half of them are, else ``UNKNOWN``: walls
    keep their thickness at least, and the border of the known area stays unknown.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map: < 0 free, 0 unknown, > 0 occupied.
    factor : int
        Number of cells along a square.
    """
    rows, columns = log_odds.shape
    levels = np.empty((-(-rows // factor), -(-columns // factor)), np.int8)
    _pool(log_odds, factor, levels)
    return levels


@kernel
def _pool(log_odds: Array, factor: int, levels: Array) -> None:
    rows, columns = log_odds.shape
    counts = np.empty((2, levels.shape[1]), np.int32)
    for i in range(levels.shape[0]):
        counts[:] = 0
        for row in range(i * factor, min((i + 1) * factor, rows)):
            for column in range(columns):
                value = log_odds[row, column]
                if value < 0:
                    counts[0, column // factor] += 1
                elif value > 0:
                    counts[1, column // factor] += 1
        for j in range(levels.shape[1]):
            is_free = 2 * counts[0, j] >= factor * factor
            levels[i, j] = OCCUPIED if counts[1, j] > 0 else FREE if is_free else UNKNOWN


def shares_unknown(log_odds: NDArray[np.int8], factor: int) -> NDArray[np.float32]:
    """Return which share of the cells of each square is unknown; parameters as in ``levels_of``."""
    return (_counts(log_odds == 0, factor) / factor**2).astype(np.float32)


def free_squares(free: NDArray[np.bool_], solid: NDArray[np.bool_], factor: int) -> NDArray[np.bool_]:
    """Return the free squares of a whole floor: none of their cells is solid, and at least half are free.

    Parameters
    ----------
    free, solid : (rows, columns) bool
        Cells that can be explored, and those that lasers hit.
    factor : int
        Number of cells along a square.
    """
    return np.asarray((2 * _counts(free, factor) >= factor * factor) & (_counts(solid, factor) == 0))


def _counts(cells: NDArray[np.bool_], factor: int) -> NDArray[np.int64]:
    """Return the number of cells set in each square."""
    rows, columns = (-(-size // factor) for size in cells.shape)
    padded = np.zeros((rows * factor, columns * factor), np.uint8)
    padded[: cells.shape[0], : cells.shape[1]] = cells
    # Strided sums: numpy sums short axes, as those of a reshape, slowly.
    by_row = np.asarray(np.sum([padded[offset::factor] for offset in range(factor)], axis=0, dtype=np.int32))
    return np.asarray(np.sum([by_row[:, offset::factor] for offset in range(factor)], axis=0, dtype=np.int64))
