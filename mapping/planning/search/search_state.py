"""The terrain, the task and the memory of a search over a belief.

A search keeps what *remains* of its budget in each cell, 0 = not reached: memory is touched only where the
search goes, and cleared from the list of touched cells.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

STRAIGHT = 4756
"""Cost of a straight step on open floor [units]."""

DIAGONAL = 6726
"""Cost of a diagonal step on open floor [units]."""

BUCKET_SHIFT = 12
"""A bucket holds the cells of a band of costs of 2 to the power of this [units]."""

NO_ENTRY = 2**31 - 1
"""What remains in a cell that a disc blocks: no path improves on it."""

LARGEST_BUDGET = 2**31 - 2
"""Most that a search can spend [units]."""

LEAVING = 8
"""Mark beside the direction in ``parent``.

The cell is passed only to leave a blocked zone.
"""

TILE_SHIFT = 4
"""Targets are counted in tiles of 2 to the power of this, 16 x 16 cells."""

ROW_SHIFT = 16
"""Bits of a packed cell below its row."""

COLUMN_BITS = 0xFFFF
"""Bits of a packed cell that hold its column."""

DIRECTIONS = 8
"""Steps from a cell to its neighbours, the straight ones first."""

FIRST_DIAGONAL = 4
"""Number of the first diagonal step."""

ROW_STEPS = np.array([0, 0, 1, -1, 1, 1, -1, -1])
COLUMN_STEPS = np.array([1, -1, 0, 0, 1, -1, 1, -1])

TOUCHED, HITS, PENDING, FULLEST = range(4)
"""Places in ``SearchState.counts``."""

FLAT_STEPS, PACKED_STEPS = range(2)
"""Rows of ``SearchState.steps``."""


class Passage(NamedTuple):
    """How a body passes over a grid, in the units of searches and cells.

    Attributes
    ----------
    limit : int
        Closeness of an occupied cell, see ``ClearanceField``.
    half_costs : (2, limit + 1) int32
        Half the cost of a step, straight and diagonal, by closeness; 0 where the body does not fit.
    roomy : int
        Closeness up to which steps have room beside them.
    radius, preferred : float
        Least clearance, and the one from which on a step costs no more than on open floor [cells].
    """

    limit: int
    half_costs: NDArray[np.int32]
    roomy: int
    radius: float
    preferred: float

    @property
    def slots(self) -> int:
        """Buckets that a search needs: a power of two."""
        bands = (2 * int(self.half_costs.max()) * 2 >> BUCKET_SHIFT) + 4
        return 1 << (bands - 1).bit_length()


class Terrain(NamedTuple):
    """What a body moves over.

    Attributes
    ----------
    log_odds, closeness : (rows, columns) int8 and uint16
        The belief and its clearance.
    passage : Passage
        The body.
    discs : (K, 3) float64
        Discs (row, column, radius) [cells] that the body's centre may not enter.
    """

    log_odds: NDArray[np.int8]
    closeness: NDArray[np.uint16]
    passage: Passage
    discs: NDArray[np.float64]


class Task(NamedTuple):
    """From where to where a search goes, and how far.

    Attributes
    ----------
    start_row, start_column, goal_row, goal_column : int
        Cells within the grid; -1 for no goal.
    budget : int
        What may be spent, see ``budget_of``.
    is_guided : bool
        Whether the search prefers cells towards the goal (A*).
    wanted : int
        How many targets end the search; 0 for none.
    beyond : int
        How far to go on beyond their costs [units].
    """

    start_row: int
    start_column: int
    goal_row: int
    goal_column: int
    budget: int
    is_guided: bool
    wanted: int
    beyond: int


class Lookout(NamedTuple):
    """The targets of a search, and where it notes what it has found.

    Attributes
    ----------
    mask, near, spans
        As of ``Targets``.
    hits : (N,) int32
        Cells from which a target is seen; room for as many as there are cells, or none where no target is
        wanted.
    """

    mask: NDArray[np.uint8]
    near: NDArray[np.uint8]
    spans: NDArray[np.int64]
    hits: NDArray[np.int32]


class SearchState(NamedTuple):
    """What a search writes.

    Attributes
    ----------
    remaining, parent : (rows, columns) int32 and uint8
        What remains of the budget in each cell, and how it was reached.
    touched : (cells + 8,) int32
        The cells that were reached.
    buckets, sizes : (slots, width) int32, (slots,) int64
        Cells that wait, and how many there are in each bucket.
    counts : (4,) int64
        Numbers of touched cells, of hits, of waiting entries, and of entries in the fullest bucket.
    steps : (2, 8) int64
        What the steps add to a place in the flat grid, and to a packed cell.
    """

    remaining: NDArray[np.int32]
    parent: NDArray[np.uint8]
    touched: NDArray[np.int32]
    buckets: NDArray[np.int32]
    sizes: NDArray[np.int64]
    counts: NDArray[np.int64]
    steps: NDArray[np.int64]


@kernel
def close_discs(remaining: NDArray[np.int32], touched: NDArray[np.int32], discs: NDArray[np.float64]) -> int:
    """Mark the cells whose centres lie inside discs (row, column, radius in cells).

    Return how many (kernel).
    """
    rows, columns = remaining.shape
    count = 0
    for k in range(len(discs)):
        centre_row, centre_column, radius = discs[k]
        for row in range(max(int(centre_row - radius), 0), min(int(centre_row + radius) + 2, rows)):
            for column in range(
                max(int(centre_column - radius), 0), min(int(centre_column + radius) + 2, columns)
            ):
                if (row - centre_row) ** 2 + (column - centre_column) ** 2 < radius * radius and remaining[
                    row, column
                ] == 0:
                    remaining[row, column] = NO_ENTRY
                    touched[count] = (row << ROW_SHIFT) | column
                    count += 1
    return count


@kernel
def clear(remaining: NDArray[np.int32], touched: NDArray[np.int32], count: int) -> None:
    """Forget a search (kernel)."""
    for i in range(count):
        remaining[touched[i] >> ROW_SHIFT, touched[i] & COLUMN_BITS] = 0


@kernel
def trace(parent: Array, start_row: int, start_column: int, row: int, column: int) -> NDArray[np.int64]:
    """Follow the parents from a cell back to the start.

    Return the cells from the start on (kernel).
    """
    end_row, end_column = row, column
    count = 1
    while row != start_row or column != start_column:
        direction: int = parent[row, column] % LEAVING
        row -= ROW_STEPS[direction]
        column -= COLUMN_STEPS[direction]
        count += 1
    cells = np.empty((count, 2), np.int64)
    row, column = end_row, end_column
    for i in range(count - 1, -1, -1):
        cells[i, 0] = row
        cells[i, 1] = column
        direction = parent[row, column] % LEAVING
        if i > 0:
            row -= ROW_STEPS[direction]
            column -= COLUMN_STEPS[direction]
    return cells
