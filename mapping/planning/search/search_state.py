"""The terrain, the task, the targets and the memory of a search over a belief.

A search keeps the *remaining* budget in each cell, 0 = not reached: only the memory of visited cells is
touched, and it is cleared from the list of touched cells.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

STRAIGHT = 4756
"""Cost of a straight step on open floor [units]."""

DIAGONAL = 6726
"""Cost of a diagonal step on open floor [units]."""

BUCKET_SHIFT = 12
"""A bucket holds the cells of a band of 2 to this power of costs [units]."""

NO_ENTRY = 2**31 - 1
"""Remaining budget of a cell that a disc blocks: no path improves on it."""

LARGEST_BUDGET = 2**31 - 2
"""Maximum budget of a search [units]."""

LEAVING = 8
"""Mark in ``parent``, added to the direction: the cell is passed only to leave a blocked zone."""

TILE_SHIFT = 4
"""Targets are counted in tiles of 2 to this power, 16 x 16 cells."""

ROW_SHIFT = 16
"""Bits of a packed cell below its row."""

COLUMN_BITS = 0xFFFF
"""Bits of a packed cell that hold its column."""

DIRECTIONS = 8
"""Steps from a cell to its neighbours, the straight ones first."""

FIRST_DIAGONAL = 4
"""Index of the first diagonal step."""

ROW_STEPS = np.array([0, 0, 1, -1, 1, 1, -1, -1])
COLUMN_STEPS = np.array([1, -1, 0, 0, 1, -1, 1, -1])

TOUCHED, HITS, PENDING, FULLEST = range(4)
"""Indices into ``SearchState.counts``."""

FLAT_STEPS, PACKED_STEPS = range(2)
"""Rows of ``SearchState.steps``."""


class Passage(NamedTuple):
    """How a body passes over a grid, in units of searches and cells.

    Attributes
    ----------
    limit : int
        Closeness of an occupied cell, see ``ClearanceField``.
    half_costs : (2, limit + 1) int32
        Half the cost of a step, straight and diagonal, by closeness; 0 if the body does not fit.
    roomy : int
        Maximum closeness of a cell whose neighbours are clear as well.
    radius, preferred : float
        Minimum clearance, and the one from which on a step costs no more than on open floor [cells].
    """

    limit: int
    half_costs: NDArray[np.int32]
    roomy: int
    radius: float
    preferred: float

    @property
    def slots(self) -> int:
        """Number of buckets that a search needs: a power of two."""
        bands = (2 * int(self.half_costs.max()) * 2 >> BUCKET_SHIFT) + 4
        return 1 << (bands - 1).bit_length()


class Terrain(NamedTuple):
    """A belief, its clearance and obstacles, for one body.

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
    """Start, goal and end conditions of a search.

    Attributes
    ----------
    start_row, start_column, goal_row, goal_column : int
        Cells within the grid; -1 for no goal.
    budget : int
        Budget, see ``budget_of``.
    is_guided : bool
        Whether the search prefers cells towards the goal (A*).
    wanted : int
        Number of targets that end the search; 0 for none.
    beyond : int
        Cost beyond those of the targets at which it ends [units].
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
    """The targets of a search, and memory for those that it finds.

    Attributes
    ----------
    mask, near, spans
        As of ``Targets``.
    hits : (N,) int32
        Cells from which a target is visible; one entry per cell of the grid, or empty without targets.
    """

    mask: NDArray[np.uint8]
    near: NDArray[np.uint8]
    spans: NDArray[np.int64]
    hits: NDArray[np.int32]


class SearchState(NamedTuple):
    """The memory that a search writes.

    Attributes
    ----------
    remaining, parent : (rows, columns) int32 and uint8
        Remaining budget of each cell, and the step by which it was reached.
    touched : (cells + 8,) int32
        The cells that were reached.
    buckets, sizes : (slots, width) int32, (slots,) int64
        Waiting cells, and their number in each bucket.
    counts : (4,) int64
        Numbers of touched cells, of hits, of waiting entries, and of entries in the fullest bucket.
    steps : (2, 8) int64
        The differences of indices into the flat grid, and of packed cells, by step.
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
    """Mark the cells whose centres lie inside discs (row, column, radius in cells) (kernel).

    Returns their number.
    """
    rows, columns = remaining.shape
    count = 0
    for k in range(len(discs)):
        centre_row, centre_column, radius = discs[k]
        for row in range(max(int(centre_row - radius), 0), min(int(centre_row + radius) + 2, rows)):
            for column in range(max(int(centre_column - radius), 0), min(int(centre_column + radius) + 2, columns)):
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
    """Follow the parents from a cell back to the start; return the cells from the start on (kernel)."""
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


@dataclass(frozen=True, slots=True)
class Targets:
    """Target cells of a search, which ends once one of them is visible within reach.

    Attributes
    ----------
    mask : (rows, columns) uint8
        1 in target cells; other values are ignored.
    near : (ceil(rows / 16), ceil(columns / 16)) uint8
        Not 0 in tiles from which a target may be within reach.
    spans : (2 k + 1,) int64
        The disc of ``reach`` around a cell: in row i - k from the cell the columns up to ``spans[i]`` on
        either side.
    """

    mask: NDArray[np.uint8]
    near: NDArray[np.uint8]
    spans: NDArray[np.int64]

    @classmethod
    def of(cls, mask: NDArray[np.bool_] | NDArray[np.uint8], reach: float = 0.0) -> "Targets":
        """Return the cells of a mask (rows, columns) as targets, from up to ``reach`` cells away."""
        cells = np.ascontiguousarray(mask, dtype=np.uint8)
        size = 1 << TILE_SHIFT
        rows, columns = (np.arange(0, side, size) for side in cells.shape)
        counts = np.add.reduceat(np.add.reduceat((cells == 1).astype(np.int32), rows, axis=0), columns, axis=1)
        return cls(cells, near_tiles(counts, reach), disc_spans(reach))

    @classmethod
    def at(cls, cells: Iterable[tuple[int, int]], shape: tuple[int, ...]) -> "Targets":
        """Return some cells (row, column) of a grid as targets, from these cells themselves."""
        size = 1 << TILE_SHIFT
        mask, near = np.zeros(shape, np.uint8), np.zeros([-(-side // size) for side in shape], np.uint8)
        for row, column in cells:
            mask[row, column] = near[row >> TILE_SHIFT, column >> TILE_SHIFT] = 1
        return cls(mask, near, disc_spans(0.0))


@lru_cache(maxsize=64)
def disc_spans(reach: float) -> NDArray[np.int64]:
    """Return half widths of the rows of a disc of ``reach`` cells around the centre of a cell."""
    squared = reach * reach + 1e-9
    steps = np.arange(-math.floor(math.sqrt(squared)), math.floor(math.sqrt(squared)) + 1)
    spans: NDArray[np.int64] = np.floor(np.sqrt(squared - steps * steps)).astype(np.int64)
    spans.flags.writeable = False
    return spans


def near_tiles(counts: NDArray[np.int32], reach: float) -> NDArray[np.uint8]:
    """Return the tiles of which some cell may be within ``reach`` cells of a target.

    ``counts`` has the number of targets of each tile.
    """
    return np.asarray(_grown(counts, math.ceil(reach / (1 << TILE_SHIFT))))


@kernel
def _grown(counts: NDArray[np.int32], margin: int) -> NDArray[np.uint8]:
    rows, columns = counts.shape
    near = np.zeros((rows, columns), np.uint8)
    for row in range(rows):
        for column in range(columns):
            if counts[row, column] > 0:
                near[max(row - margin, 0) : row + margin + 1, max(column - margin, 0) : column + margin + 1] = 1
    return near
