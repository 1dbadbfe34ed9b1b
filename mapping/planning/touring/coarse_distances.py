"""Lengths of paths over a grid of coarse cells.

An order of visits needs many lengths of paths, none of them to the centimetre. A coarse cell is open if a
body may stand anywhere in it; lengths are those over open cells, straight and diagonal.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

STRAIGHT, DIAGONAL = 5, 7
"""Lengths of the steps to the neighbours of a cell, in fifths of its side."""

_BUCKETS = DIAGONAL + 1

UNREACHED = np.iinfo(np.int32).max


class CoarseGrid(NamedTuple):
    """Coarse cells in which a body may stand.

    Attributes
    ----------
    is_open : (rows, columns) bool
        Whether it may stand anywhere in the cell.
    factor : int
        Side of a coarse cell [cells of the map].
    row, column : int
        The map's cell at which coarse cell (0, 0) begins.
    side : float
        Side of a coarse cell [m].
    """

    is_open: NDArray[np.bool_]
    factor: int
    row: int
    column: int
    side: float

    def cell_of(self, cell: tuple[int, int]) -> tuple[int, int]:
        """Return the coarse cell of a cell of the map, or the nearest one beyond the grid."""
        rows, columns = self.is_open.shape
        row, column = (int(cell[0]) - self.row) // self.factor, (int(cell[1]) - self.column) // self.factor
        return min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)


def distances_from(grid: CoarseGrid, starts: NDArray[np.int64], maximum: float = math.inf) -> NDArray[np.int32]:
    """Return the lengths of the shortest paths from each of some coarse cells to all.

    Parameters
    ----------
    starts : (n, 2) int64
        Coarse cells (row, column); they count as open.
    maximum : float
        Maximum length of a path [m].

    Returns
    -------
    (n, rows, columns) int32
        Lengths in fifths of the side of a coarse cell; ``UNREACHED`` if there is no path.
    """
    max_length = UNREACHED - _BUCKETS if math.isinf(maximum) else int(maximum / grid.side * STRAIGHT)
    lengths = np.empty((len(starts), *grid.is_open.shape), np.int32)
    _spread(grid.is_open, np.ascontiguousarray(starts, np.int64), max_length, lengths)
    return lengths


@kernel
def _spread(is_open: Array, starts: Array, max_length: int, lengths: Array) -> None:
    """Spread lengths from each start over open cells."""
    rows, columns = is_open.shape
    # The border and closed cells have length -1, so that no path is shorter.
    width = columns + 2
    fresh = np.full((rows + 2, width), -1, np.int32)
    for row in range(rows):
        for column in range(columns):
            if is_open[row, column]:
                fresh[row + 1, column + 1] = UNREACHED
    queues = np.empty((_BUCKETS, rows * columns), np.int32)
    for k in range(len(starts)):
        spread = fresh.copy().reshape(-1)
        _spread_from(
            (starts[k, 0] + 1) * width + starts[k, 1] + 1,
            width,
            max_length,
            queues,
            spread,
        )
        for row in range(rows):
            for column in range(columns):
                length = spread[(row + 1) * width + column + 1]
                lengths[k, row, column] = length if length >= 0 else UNREACHED


@kernel
def _spread_from(start: int, width: int, max_length: int, queues: Array, spread: Array) -> None:
    """Spread lengths from a cell, one length after the other."""
    steps = np.array([1, width, -1, -width, width + 1, width - 1, 1 - width, -1 - width])
    # A bucket holds cells of one length, and none of them twice.
    counts = np.zeros(_BUCKETS, np.int64)
    spread[start] = 0
    queues[0, 0] = start
    counts[0] = 1
    length, empty = 0, 0
    while empty < _BUCKETS and length <= max_length:
        bucket = length % _BUCKETS
        count = counts[bucket]
        counts[bucket] = 0
        empty = empty + 1 if count == 0 else 0
        straight, diagonal = (length + STRAIGHT) % _BUCKETS, (length + DIAGONAL) % _BUCKETS
        for i in range(count):
            cell = queues[bucket, i]
            if spread[cell] != length:
                continue
            for k in range(8):
                other = cell + steps[k]
                further = length + (STRAIGHT if k < 4 else DIAGONAL)
                if further < spread[other]:
                    spread[other] = further
                    target = straight if k < 4 else diagonal
                    queues[target, counts[target]] = other
                    counts[target] += 1
        length += 1
