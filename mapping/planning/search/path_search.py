"""Searches in kernels that plan for many bodies at once, and in the memory of one grid.

A kernel that plans uses memory of its own thread and clears the cells that it touched, so that the results
depend neither on the order of the searches nor on the number of threads.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at
from lidarium.mapping.planning.search.grid_search import spread
from lidarium.mapping.planning.search.search_state import (
    BUCKET_SHIFT,
    COLUMN_BITS,
    DIRECTIONS,
    LARGEST_BUDGET,
    LEAVING,
    NO_ENTRY,
    ROW_SHIFT,
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
"""Indices into a row of a search memory's table: addresses, and the shape of the buckets."""

BUCKET_WIDTH = 4096
"""Initial capacity of a bucket [cells]; a search that needs more allocates more for itself."""


SPARE_CELLS = 8
"""Capacity of a list of touched cells beyond the number of cells of the grid."""


class SearchMemory:
    """Scratch memory for searches in kernels, one piece per thread.

    The system provides it on first access.

    Attributes
    ----------
    table : (pieces, 6) int64
        Addresses and sizes of the pieces, for the kernels.
    """

    def __init__(self, pieces: int) -> None:
        self.table: NDArray[np.int64] = np.zeros((pieces, 6), np.int64)
        self._cells, self._slots = 0, 0
        self._arrays: list[tuple[NDArray[Any], ...]] = []

    def fit(self, cells: int, slots: int) -> None:
        """Provide memory for grids with a number of cells, and for a number of buckets."""
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
        """Pickle only the sizes: copies have memory of their own."""
        return _memory_of, (len(self.table), self._cells, self._slots)


def _memory_of(pieces: int, cells: int, slots: int) -> SearchMemory:
    memory = SearchMemory(pieces)
    if cells:
        memory.fit(cells, slots)
    return memory


@kernel
def budget_of(maximum_cost: float, resolution: float) -> int:
    """Return the budget [units of searches] for a cost of at most ``maximum_cost`` [m] (kernel)."""
    largest = maximum_cost * STRAIGHT / resolution
    return LARGEST_BUDGET if largest > LARGEST_BUDGET - 1 else max(int(largest), 0) + 1


@kernel
def _search_in(terrain: Terrain, memory: Array, task: Task, lookout: Lookout) -> tuple[Array, Array, int, int, int]:
    """Search in a piece of memory, see ``grid_search.spread`` (kernel).

    Parameters
    ----------
    memory : (6,) int64
        A row of ``SearchMemory.table``.

    Returns
    -------
    remaining, parent : (rows, columns) int32 and uint8
        Remaining budget of each cell, and the step by which it was reached.
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
    """Search a belief given by its address, so that read-only arrays need no kernels of their own (kernel).

    Returns count, hit_count and settled as ``_search_in``.
    """
    beliefs = grid_at(log_odds, closeness.shape[0], closeness.shape[1], np.int8)
    terrain = Terrain(beliefs, closeness, passage, discs)
    _, _, count, hit_count, settled = _search_in(terrain, memory, task, lookout)
    return count, hit_count, settled


@kernel
def _nothing() -> Lookout:
    no_mask = np.empty((0, 0), np.uint8)
    return Lookout(no_mask, no_mask, np.empty(0, np.int64), np.empty(0, np.int32))


@kernel
def search_all(
    log_odds: Array, closeness: Array, passage: Passage, memory: Array, start_row: int, start_column: int
) -> tuple[Array, Array, int, int]:
    """Spread costs over all cells that a body can reach, in a piece of memory (kernel).

    Returns
    -------
    remaining, parent : (rows, columns) int32 and uint8
        What remains of ``LARGEST_BUDGET`` in each cell, and the step by which it was reached; see
        ``search_state``.
    """
    terrain = Terrain(log_odds, closeness, passage, np.empty((0, 3)))
    task = Task(start_row, start_column, -1, -1, LARGEST_BUDGET, False, 0, 0)
    remaining, parent, count, _, settled = _search_in(terrain, memory, task, _nothing())
    return remaining, parent, count, LARGEST_BUDGET - settled


@kernel
def clear_memory(memory: Array, rows: int, columns: int, count: int) -> None:
    """Clear a thread's memory for the next search (kernel)."""
    clear(
        grid_at(memory[REMAINING_AT], rows, columns, np.int32),
        grid_at(memory[TOUCHED_AT], 1, rows * columns + SPARE_CELLS, np.int32)[0],
        count,
    )


@kernel
def touched_in(memory: Array, rows: int, columns: int) -> Array:
    """Return the list of the cells that a search has touched, row and column packed (kernel)."""
    touched: Array = grid_at(memory[TOUCHED_AT], 1, rows * columns + SPARE_CELLS, np.int32)[0]
    return touched


@kernel
def find_path(
    terrain: Terrain, memory: Array, start: tuple[int, int], goal: tuple[int, int], budget: int
) -> tuple[int, Array]:
    """Return the cheapest path between two cells of a grid, by A* with the octile distance (kernel).

    Parameters
    ----------
    memory : (6,) int64
        A row of ``SearchMemory.table``.
    start, goal : (int, int)
        Cells (row, column) within the grid.

    Returns
    -------
    cells : (N, 2) int64
        Cells (row, column) from the start to the goal.
    """
    nothing = np.empty((0, 2), np.int64)
    is_there = start[0] == goal[0] and start[1] == goal[1]
    if not is_there and not _can_enter(terrain, goal[0], goal[1]):
        return -1, nothing
    task = Task(start[0], start[1], goal[0], goal[1], budget, True, 0, 0)
    remaining, parent, count, _, settled = _search_in(terrain, memory, task, _nothing())
    left = remaining[goal[0], goal[1]]
    cost = 0 if is_there else budget - left
    is_reached = left != 0 and left != NO_ENTRY and parent[goal[0], goal[1]] < LEAVING and cost <= settled
    cells = trace(parent, start[0], start[1], goal[0], goal[1]) if is_there or is_reached else nothing
    clear_memory(memory, terrain.log_odds.shape[0], terrain.log_odds.shape[1], count)
    return cost if is_there or is_reached else -1, cells


@kernel(nrt=False)
def _can_enter(terrain: Terrain, row: int, column: int) -> bool:
    """Whether the body fits into a cell outside of all discs."""
    discs = terrain.discs
    if terrain.log_odds[row, column] >= 0:
        return False
    if terrain.passage.half_costs[0, terrain.closeness[row, column]] == 0:
        return False
    for k in range(len(discs)):
        if (row - discs[k, 0]) ** 2 + (column - discs[k, 1]) ** 2 < discs[k, 2] ** 2:
            return False
    return True


MAX_CELLS_A_SIDE = 2**15 - 1
"""Maximum number of cells per side of a grid: a row and a column fit into 32 bits."""


def check_shape(shape: tuple[int, ...]) -> None:
    """Raise ValueError if a map of ``shape`` (rows, columns) cannot be searched."""
    if not all(0 < side <= MAX_CELLS_A_SIDE for side in shape):
        rows, columns = shape
        raise ValueError(
            f"a map of {rows} rows and {columns} columns cannot be searched; want 1 to {MAX_CELLS_A_SIDE} cells a "
            "side; with a larger resolution there are fewer"
        )


class SearchSpace:
    """Scratch memory of the searches over one grid; each search forgets the previous one.

    Parameters
    ----------
    shape : (rows, columns)
        Of the belief; at most 32,767 cells per side.
    resolution : float
        Side of a cell [m].
    """

    def __init__(self, shape: tuple[int, int], resolution: float) -> None:
        check_shape(shape)
        if not resolution > 0.0:
            raise ValueError(f"resolution is {resolution} m; want a positive side of a cell")
        cells = shape[0] * shape[1]
        self.resolution = float(resolution)
        self.shape = (int(shape[0]), int(shape[1]))
        self.remaining: NDArray[np.int32] = np.zeros(shape, dtype=np.int32)
        self.parent: NDArray[np.uint8] = np.empty(shape, dtype=np.uint8)
        self.touched: NDArray[np.int32] = np.empty(cells + SPARE_CELLS, dtype=np.int32)
        self.hits: NDArray[np.int32] = np.empty(cells + SPARE_CELLS, dtype=np.int32)
        self.buckets: NDArray[np.int32] = np.empty((16, BUCKET_WIDTH), dtype=np.int32)
        self.touched_count = 0
        self.generation = 0

    def forget(self) -> None:
        """Clear the results of the last search; its :class:`Search` can no longer be read."""
        clear(self.remaining, self.touched, self.touched_count)
        self.touched_count = 0
        self.generation += 1

    def provide(self, slots: int) -> None:
        """Provide at least this number of buckets, a power of two."""
        if slots > self.buckets.shape[0]:
            self.buckets = np.empty((slots, self.buckets.shape[1]), dtype=np.int32)

    @property
    def memory(self) -> NDArray[np.int64]:
        """Addresses and sizes of the memory, as a row of ``SearchMemory.table``."""
        arrays = (self.remaining, self.parent, self.touched, self.buckets)
        return np.array([*(array.ctypes.data for array in arrays), *self.buckets.shape], np.int64)


@dataclass(frozen=True, slots=True)
class Search:
    """Results of a search; readable until the next search in the same space.

    Attributes
    ----------
    space : SearchSpace
        Memory with costs and parents.
    start : (row, column)
        Start of the search.
    budget : int
        Budget in units of cost.
    settled : int
        Costs up to this one [units] are final; a cell beyond counts as not reached.
    hits : (M, 2) int64
        The first targets (row, column), by cost and then by row and column; empty if none was searched or
        reached.
    """

    space: SearchSpace
    start: tuple[int, int]
    budget: int
    settled: int
    hits: NDArray[np.int64]
    generation: int

    @property
    def unit(self) -> float:
        """Metres of open floor per unit of cost."""
        return self.space.resolution / STRAIGHT

    def cost(self, cell: tuple[int, int]) -> float:
        """Return the cost [m] of the cheapest path to a cell, ``inf`` if it was not reached."""
        self._check()
        row, column = int(cell[0]), int(cell[1])
        if (row, column) == self.start:
            return 0.0
        left = int(self.space.remaining[row, column])
        if left in (0, NO_ENTRY) or self.space.parent[row, column] >= LEAVING or self.budget - left > self.settled:
            return math.inf
        return (self.budget - left) * self.unit

    def costs(self) -> NDArray[np.float64]:
        """Return the costs (rows, columns) [m] of all cells, ``inf`` if not reached.

        It passes over the whole grid: for tests and pictures.
        """
        self._check()
        left = self.space.remaining
        spent = self.budget - left.astype(np.int64)
        reached = (left > 0) & (left != NO_ENTRY) & (spent <= self.settled)
        reached[reached] = self.space.parent[reached] < LEAVING
        costs = np.where(reached, spent * self.unit, math.inf)
        costs[self.start] = 0.0
        return costs

    def reached(self) -> NDArray[np.int64]:
        """Return the cells (N, 2) that were reached, in the order in which they were first seen."""
        self._check()
        packed = self.space.touched[: self.space.touched_count].astype(np.int64)
        cells = np.stack((packed >> ROW_SHIFT, packed & COLUMN_BITS), axis=1)
        left = self.space.remaining[cells[:, 0], cells[:, 1]]
        passable = self.space.parent[cells[:, 0], cells[:, 1]] < LEAVING
        reached: NDArray[np.int64] = cells[(left != NO_ENTRY) & (self.budget - left <= self.settled) & passable]
        return reached

    def path(self, cell: tuple[int, int]) -> NDArray[np.int64]:
        """Cheapest path to a cell.

        Returns
        -------
        (N, 2) int64
            Cells (row, column) from the start to ``cell``, both included; neighbours differ by at most one in
            each.
        """
        if math.isinf(self.cost(cell)):
            raise ValueError(
                f"cell {(int(cell[0]), int(cell[1]))} was not reached from {self.start}; ask for its cost first"
            )
        return np.asarray(trace(self.space.parent, self.start[0], self.start[1], int(cell[0]), int(cell[1])))

    def _check(self) -> None:
        if self.generation != self.space.generation:
            raise ValueError(
                "another search has used this space since; read a search before the next one, or give it a "
                "space of its own"
            )
