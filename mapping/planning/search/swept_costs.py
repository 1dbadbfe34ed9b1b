"""Costs of the paths from one cell to all others, by sweeps over the rows of a map.

The costs are those of a search over all reachable cells (``search_all``), to the unit: those of the cheapest
paths, whatever the order in which cells are visited. Rows are swept down and up in turn. A sweep lowers the
costs of 16 cells at once by those of the row before and of the cells before them in their row; only changed
areas are computed again. Indoors a cell is visited some three times, at a tenth of the time that a queue of
single cells takes (a chamfer distance, Borgefors, Computer Vision, Graphics, and Image Processing 1986,
repeated until no wall is left to go round).
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.costs import (
    FAR,
    FITS,
    LANES,
    look_up_costs,
    relax_backwards,
    relax_forwards,
)
from lidarium.mapping.kernels.simd.words import first_bit, last_bit
from lidarium.mapping.kernels.views import grid_at, scratch_vector
from lidarium.mapping.planning.clearance import Window
from lidarium.mapping.planning.search.search_state import (
    COLUMN_BITS,
    LARGEST_BUDGET,
    LEAVING,
    ROW_SHIFT,
    Passage,
)

COSTS_AT, STRAIGHT_AT, DIAGONAL_AT, KINDS_AT, WAITING_AT = range(5)
"""Indices into a row of a memory's table."""

DOWN, UP = range(2)
"""Directions of a sweep."""

ALL_THREE = 0b111
"""A block and both its neighbours."""


@kernel(forceinline=True)
def _words_of(blocks: int) -> int:
    """Return the number of words that hold a bit for each block and for one beyond either end."""
    return (blocks + 2 + 63) // 64


class SweepMemory:
    """Scratch memory for sweeps in kernels, one piece per thread.

    Attributes
    ----------
    table : (pieces, 5) int64
        Addresses of the pieces, for the kernels.
    """

    def __init__(self, pieces: int) -> None:
        self.table: NDArray[np.int64] = np.zeros((pieces, 5), np.int64)
        self._cells, self._words = 0, 0
        self._arrays: list[tuple[NDArray[Any], ...]] = []

    def fit(self, rows: int, columns: int) -> None:
        """Provide memory for maps of this size; raise ValueError if the columns are no multiple of 16."""
        if columns % LANES:
            raise ValueError(f"the map has {columns} columns; want a multiple of {LANES}")
        blocks = columns // LANES
        cells, words = (rows + 2) * (blocks + 2) * LANES, 2 * (rows + 2) * _words_of(blocks)
        if cells > self._cells or words > self._words:
            self._provide(max(cells, self._cells), max(words, self._words))

    def _provide(self, cells: int, words: int) -> None:
        self._cells, self._words, self._arrays = cells, words, []
        for piece in range(len(self.table)):
            arrays: tuple[NDArray[Any], ...] = (
                np.zeros(cells, np.int32),
                np.zeros(cells, np.int32),
                np.zeros(cells, np.int32),
                np.zeros(cells, np.uint8),
                np.zeros(words, np.uint64),
            )
            self._arrays.append(arrays)
            self.table[piece] = [array.ctypes.data for array in arrays]

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle only the sizes: copies have memory of their own."""
        return _memory_of, (len(self.table), self._cells, self._words)


def _memory_of(pieces: int, cells: int, words: int) -> SweepMemory:
    memory = SweepMemory(pieces)
    if cells:
        memory._provide(cells, words)
    return memory


class SweptCosts(NamedTuple):
    """Costs over a window of a map, with a border of a row and of 16 columns.

    Attributes
    ----------
    costs : (rows + 2, 16 (blocks + 2)) int32
        Of the cheapest path to each cell [units], ``FAR`` if there is none.
    straight, diagonal : like costs, int32
        Half the cost of a step into or out of a cell [units]; any cost if the body does not fit.
    kinds : like costs, uint8
        Bits ``FREE``, ``FITS`` and ``ROOMY``.
    waiting : (2 (rows + 2), words) uint64
        Scratch: bits of the blocks that wait for the next sweep down, and up; bit 1 is the first block's.
    row_low, column_low : int
        First row and column of the window.
    """

    costs: NDArray[np.int32]
    straight: NDArray[np.int32]
    diagonal: NDArray[np.int32]
    kinds: NDArray[np.uint8]
    waiting: NDArray[np.uint64]
    row_low: int
    column_low: int


@kernel
def costs_in(memory: Array, window: Window) -> SweptCosts:
    """View a piece of memory as that of sweeps over a window (kernel).

    The window is extended to multiples of 16 columns.
    """
    rows, first = window[1] - window[0], window[2] // LANES
    blocks = (window[3] + LANES - 1) // LANES - first
    width = (blocks + 2) * LANES
    return SweptCosts(
        grid_at(memory[COSTS_AT], rows + 2, width, np.int32),
        grid_at(memory[STRAIGHT_AT], rows + 2, width, np.int32),
        grid_at(memory[DIAGONAL_AT], rows + 2, width, np.int32),
        grid_at(memory[KINDS_AT], rows + 2, width, np.uint8),
        grid_at(memory[WAITING_AT], 2 * (rows + 2), _words_of(blocks), np.uint64),
        window[0],
        first * LANES,
    )


@kernel(nrt=False)
def prepare_costs(swept: SweptCosts, log_odds: Array, closeness: Array, passage: Passage) -> None:
    """Look up the costs of a body's steps over the window of a map (kernel)."""
    body = scratch_vector(5, np.int64)
    _describe(passage, body)
    grids = swept.kinds.ctypes.data, swept.straight.ctypes.data, swept.diagonal.ctypes.data
    width = swept.kinds.shape[1]
    swept.kinds[0], swept.kinds[-1] = 0, 0
    for i in range(1, swept.kinds.shape[0] - 1):
        row = swept.row_low + i - 1
        # Blocks read one cell of the border on either side of the row.
        swept.kinds[i, LANES - 1], swept.kinds[i, width - LANES] = 0, 0
        for block in range(LANES, width - LANES, LANES):
            at, index = i * width + block, row * log_odds.shape[1] + swept.column_low + block - LANES
            look_up_costs(
                log_odds.ctypes.data + index,
                closeness.ctypes.data + 2 * index,
                body.ctypes.data,
                grids[0] + at,
                grids[1] + 4 * at,
                grids[2] + 4 * at,
            )


@kernel(nrt=False)
def _describe(passage: Passage, body: Array) -> None:
    """Write the numbers of a body, (5,), that ``look_up_costs`` takes."""
    costs = passage.half_costs
    length, plain, tight = costs.shape[1], 0, costs.shape[1] - 1
    while plain + 1 < length and costs[0, plain + 1] == costs[0, 0] and costs[1, plain + 1] == costs[1, 0]:
        plain += 1
    while tight >= 0 and costs[0, tight] == 0:
        tight -= 1
    body[0], body[1], body[2], body[3], body[4] = costs.ctypes.data, length, plain, tight, passage.roomy


@kernel(nrt=False)
def spread_costs(swept: SweptCosts, row: int, column: int) -> bool:
    """Find the costs of the cheapest paths from a cell, see the module (kernel).

    Returns whether the body fits in that cell and the cell lies in the window; if not, nothing is reached.
    """
    swept.costs[:], swept.waiting[:] = FAR, 0
    i, k = row - swept.row_low + 1, column - swept.column_low + LANES
    if not (0 < i < swept.costs.shape[0] - 1 and LANES <= k < swept.costs.shape[1] - LANES):
        return False
    if swept.kinds[i, k] & FITS == 0:
        return False
    swept.costs[i, k] = 0
    block = k // LANES - 1
    for way in (DOWN, UP):
        _let_wait(swept.waiting, way, i, block, ALL_THREE)
        _let_wait(swept.waiting, way, i + 1 - 2 * way, block, ALL_THREE)
    while _sweep(swept, DOWN) + _sweep(swept, UP) > 0:
        pass
    return True


@kernel(forceinline=True, nrt=False)
def _let_wait(waiting: Array, way: int, row: int, block: int, which: int) -> None:
    """Mark some of three neighbouring blocks of a row as waiting for the next sweep.

    ``which`` has a bit for the block before, for the block and for the one after it.
    """
    at, bit = way * (waiting.shape[0] // 2) + row, block & 63
    waiting[at, block >> 6] |= np.uint64(which) << np.uint64(bit)
    if bit > 61:
        waiting[at, (block >> 6) + 1] |= np.uint64(which) >> np.uint64(64 - bit)


@kernel(nrt=False)
def _sweep(swept: SweptCosts, way: int) -> int:
    """Visit the blocks that wait, row by row; return their number."""
    rows, waiting, visited = swept.costs.shape[0] - 2, swept.waiting, 0
    for r in range(1, rows + 1):
        row = r if way == DOWN else rows + 1 - r
        at = way * (rows + 2) + row
        for w in range(waiting.shape[1]):
            word = w if way == DOWN else waiting.shape[1] - 1 - w
            while waiting[at, word] != 0:
                bit = first_bit(waiting[at, word]) if way == DOWN else last_bit(waiting[at, word])
                waiting[at, word] &= ~(np.uint64(1) << np.uint64(bit))
                visited += _visit(swept, way, row, 64 * word + bit - 1)
    return visited


@kernel(forceinline=True, nrt=False)
def _visit(swept: SweptCosts, way: int, row: int, block: int) -> int:
    """Lower the costs of a block, if it exists, and mark affected blocks as waiting.

    Returns the number of visited blocks.
    """
    width = swept.costs.shape[1]
    if not 0 <= block < width // LANES - 2:
        return 0
    at = row * width + (block + 1) * LANES
    costs, straight = swept.costs.ctypes.data, swept.straight.ctypes.data
    diagonal, kinds = swept.diagonal.ctypes.data, swept.kinds.ctypes.data
    if way == DOWN:
        changed = relax_forwards(costs, straight, diagonal, kinds, at, at - width)
    else:
        changed = relax_backwards(costs, straight, diagonal, kinds, at, at + width)
    if changed == 0:
        return 1
    before, behind = changed & 1, changed >> (LANES - 1) << 2
    _let_wait(swept.waiting, DOWN, row + 1, block, before | 2 | behind)
    _let_wait(swept.waiting, UP, row - 1, block, before | 2 | behind)
    # In its own row the block itself waits for the sweep against this one.
    _let_wait(swept.waiting, DOWN, row, block, behind | (2 if way == UP else 0))
    _let_wait(swept.waiting, UP, row, block, before | (2 if way == DOWN else 0))
    return 1


@kernel
def take_costs(swept: SweptCosts, remaining: Array, parent: Array, touched: Array, minimum: int) -> None:
    """Copy the costs of a search by ``search_all`` (kernel)."""
    swept.costs[:] = FAR
    for i in range(len(touched)):
        row, column = touched[i] >> ROW_SHIFT, touched[i] & COLUMN_BITS
        left = remaining[row, column]
        if left >= minimum and parent[row, column] < LEAVING:
            swept.costs[row - swept.row_low + 1, column - swept.column_low + LANES] = LARGEST_BUDGET - left
