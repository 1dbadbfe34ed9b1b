"""The cheapest path between two cells.

It is found in kernels that plan for many bodies at once.

A kernel that plans works on memory of its own thread; what a search touched is cleared behind it, so that
neither the order of the searches nor the number of threads shows in what they find.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at
from lidarium.mapping.planning.search.grid_search import spread
from lidarium.mapping.planning.search.search_state import (
    BUCKET_SHIFT,
    DIRECTIONS,
    LARGEST_BUDGET,
    LEAVING,
    NO_ENTRY,
    STRAIGHT,
    TOUCHED,
    Lookout,
    Passage,
    SearchState,
    Task,
    Terrain,
    clear,
    close_discs,
    trace,
)

REMAINING_AT, PARENT_AT, TOUCHED_AT, BUCKETS_AT, SLOTS, WIDTH = range(6)
"""Indices into a row of a search memory's table.

Addresses, and the shape of the buckets.
"""

BUCKET_WIDTH = 4096
"""Cells for which a bucket has room at first.

A search that needs more takes more for itself.
"""


SPARE_CELLS = 8
"""Cells for which a list of touched cells has room beyond those of the grid."""


class SearchMemory:
    """Scratch memory for searches in kernels, one piece for each thread.

    Memory is provided where it is touched.

    Attributes
    ----------
    table : (pieces, 6) int64
        Where each piece lies, for the kernels.
    """

    def __init__(self, pieces: int) -> None:
        self.table: NDArray[np.int64] = np.zeros((pieces, 6), np.int64)
        self._cells, self._slots = 0, 0
        self._arrays: list[tuple[NDArray[Any], ...]] = []

    def fit(self, cells: int, slots: int) -> None:
        """Make room for searches over grids of so many cells with so many buckets."""
        if cells <= self._cells and slots <= self._slots:
            return
        self._cells, self._slots = max(cells, self._cells), max(slots, self._slots)
        self._arrays = []
        for piece in range(len(self.table)):
            arrays = (
                np.zeros(self._cells, np.int32),
                np.empty(self._cells, np.uint8),
                np.empty(self._cells + SPARE_CELLS, np.int32),
                np.empty((self._slots, BUCKET_WIDTH), np.int32),
            )
            self._arrays.append(arrays)
            self.table[piece] = (*(array.ctypes.data for array in arrays), self._slots, BUCKET_WIDTH)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the sizes alone: copies have memory of their own."""
        return _memory_of, (len(self.table), self._cells, self._slots)


def _memory_of(pieces: int, cells: int, slots: int) -> SearchMemory:
    memory = SearchMemory(pieces)
    if cells:
        memory.fit(cells, slots)
    return memory


@kernel
def budget_of(maximum_cost: float, resolution: float) -> int:
    """Return the budget for a cost of at most ``maximum_cost`` [m] (kernel).

    In units of searches.
    """
    largest = maximum_cost * STRAIGHT / resolution
    return LARGEST_BUDGET if largest > LARGEST_BUDGET - 1 else max(int(largest), 0) + 1


@kernel
def search_in(
    terrain: Terrain, memory: Array, task: Task, lookout: Lookout
) -> tuple[Array, Array, int, int, int]:
    """Search in a piece of memory, see ``grid_search.spread`` (kernel).

    Parameters
    ----------
    terrain : Terrain
        What to move over.
    memory : (6,) int64
        A row of ``SearchMemory.table``.
    task : Task
        From where to where.
    lookout : Lookout
        What to search.

    Returns
    -------
    remaining, parent : (rows, columns) int32 and uint8
        What remains of the budget in each cell, and how it was reached.
    count, hit_count : int
        Number of touched cells, for ``clear_memory``, and of targets hit.
    settled : int
        Costs up to this one are final.
    """
    state = _state_in(memory, terrain.log_odds.shape[0], terrain.log_odds.shape[1])
    state.counts[TOUCHED] = close_discs(state.remaining, state.touched, terrain.discs)
    count, hit_count, band = spread(terrain, state, task, lookout)
    return state.remaining, state.parent, count, hit_count, ((band + 1) << BUCKET_SHIFT) - 1


@kernel
def _state_in(memory: Array, rows: int, columns: int) -> SearchState:
    """View a piece of memory as that of a search over a grid."""
    return SearchState(
        grid_at(memory[REMAINING_AT], rows, columns, np.int32),
        grid_at(memory[PARENT_AT], rows, columns, np.uint8),
        grid_at(memory[TOUCHED_AT], 1, rows * columns + SPARE_CELLS, np.int32)[0],
        grid_at(memory[BUCKETS_AT], memory[SLOTS], memory[WIDTH], np.int32),
        np.zeros(memory[SLOTS], np.int64),
        np.zeros(4, np.int64),
        np.empty((2, DIRECTIONS), np.int64),
    )


@kernel
def search_at(
    log_odds: int,
    closeness: Array,
    passage: Passage,
    memory: Array,
    discs: Array,
    task: Task,
    lookout: Lookout,
) -> tuple[int, int, int]:
    """Search a belief given by its address (kernel).

    Read-only arrays then need no kernels of their own.

    Returns
    -------
    count, hit_count, settled : int
        As ``search_in``.
    """
    beliefs = grid_at(log_odds, closeness.shape[0], closeness.shape[1], np.int8)
    terrain = Terrain(beliefs, closeness, passage, discs)
    _, _, count, hit_count, settled = search_in(terrain, memory, task, lookout)
    return count, hit_count, settled


@kernel
def _nothing() -> Lookout:
    no_mask = np.empty((0, 0), np.uint8)
    return Lookout(no_mask, no_mask, np.empty(0, np.int64), np.empty(0, np.int32))


@kernel
def search_all(
    log_odds: Array, closeness: Array, passage: Passage, memory: Array, start_row: int, start_column: int
) -> tuple[Array, Array, int, int]:
    """Spread costs over all that a body can reach, in a piece of memory (kernel).

    Returns
    -------
    remaining, parent : (rows, columns) int32 and uint8
        What remains of ``LARGEST_BUDGET`` in each cell, and how it was reached; see ``search_state``.
    count : int
        Number of touched cells, for ``clear_memory``.
    least : int
        What remains at least in cells whose costs are final.
    """
    terrain = Terrain(log_odds, closeness, passage, np.empty((0, 3)))
    task = Task(start_row, start_column, -1, -1, LARGEST_BUDGET, False, 0, 0)
    remaining, parent, count, _, settled = search_in(terrain, memory, task, _nothing())
    return remaining, parent, count, LARGEST_BUDGET - settled


@kernel
def clear_memory(memory: Array, rows: int, columns: int, count: int) -> None:
    """Leave a thread's memory as the next search wants it (kernel)."""
    clear(
        grid_at(memory[REMAINING_AT], rows, columns, np.int32),
        grid_at(memory[TOUCHED_AT], 1, rows * columns + SPARE_CELLS, np.int32)[0],
        count,
    )


@kernel
def touched_in(memory: Array, rows: int, columns: int) -> Array:
    """Return the room for the cells that a search has touched, row and column packed (kernel)."""
    touched: Array = grid_at(memory[TOUCHED_AT], 1, rows * columns + SPARE_CELLS, np.int32)[0]
    return touched


@kernel
def find_path(
    terrain: Terrain, memory: Array, start: tuple[int, int], goal: tuple[int, int], budget: int
) -> tuple[int, Array]:
    """Return the cheapest path between two cells of a grid (kernel).

    By A* with the octile distance.

    Parameters
    ----------
    terrain : Terrain
        What to move over.
    memory : (6,) int64
        A row of ``SearchMemory.table``.
    start, goal : (int, int)
        From where to where (row, column); within the grid.
    budget : int
        What may be spent, see ``budget_of``.

    Returns
    -------
    cost : int
        In units of searches; negative where there is no way.
    cells : (N, 2) int64
        Cells (row, column) from the start to the goal.
    """
    nothing = np.empty((0, 2), np.int64)
    is_there = start[0] == goal[0] and start[1] == goal[1]
    if not is_there and not _can_enter(terrain, goal[0], goal[1]):
        return -1, nothing
    task = Task(start[0], start[1], goal[0], goal[1], budget, True, 0, 0)
    remaining, parent, count, _, settled = search_in(terrain, memory, task, _nothing())
    left = remaining[goal[0], goal[1]]
    cost = 0 if is_there else budget - left
    is_reached = left != 0 and left != NO_ENTRY and parent[goal[0], goal[1]] < LEAVING and cost <= settled
    cells = trace(parent, start[0], start[1], goal[0], goal[1]) if is_there or is_reached else nothing
    clear_memory(memory, terrain.log_odds.shape[0], terrain.log_odds.shape[1], count)
    return cost if is_there or is_reached else -1, cells


@kernel
def _can_enter(terrain: Terrain, row: int, column: int) -> bool:
    """Whether a step may lead into a cell, and no body stands there."""
    discs = terrain.discs
    if terrain.log_odds[row, column] >= 0:
        return False
    if terrain.passage.half_costs[0, terrain.closeness[row, column]] == 0:
        return False
    for k in range(len(discs)):
        if (row - discs[k, 0]) ** 2 + (column - discs[k, 1]) ** 2 < discs[k, 2] ** 2:
            return False
    return True
