"""The cheapest path between two cells.

It is found in kernels that plan for many bodies at once.

A kernel that plans works on memory of its own thread; what a search touched is cleared behind it, so that
neither the order of the searches nor the number of threads shows in what they find.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import int8_grid_at, int32_table_at, uint8_grid_at
from lidarium.mapping.planning.grid_search import (
    BUCKET_SHIFT,
    LARGEST_BUDGET,
    LEAVING,
    NO_ENTRY,
    STRAIGHT,
    clear,
    close_discs,
    spread,
    trace,
)

REMAINING, PARENT, TOUCHED, BUCKETS, SLOTS, WIDTH = range(6)
"""Indices into a row of a search memory's table.

Addresses, and the shape of the buckets.
"""

BUCKET_WIDTH = 4096
"""Cells for which a bucket has room at first.

A search that needs more takes more for itself.
"""


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


class Lookout(NamedTuple):
    """What a search looks for, and where it notes what it has found.

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
                np.empty(self._cells + 8, np.int32),
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
    log_odds: Array,
    closeness: Array,
    passage: Passage,
    memory: Array,
    discs: Array,
    task: Array,
    targets: Lookout,
) -> tuple[Array, Array, int, int, int]:
    """Search in a piece of memory, see ``grid_search.spread`` (kernel).

    Parameters
    ----------
    log_odds, closeness : (rows, columns) int8 and uint16
        The belief and its clearance.
    passage : Passage
        The body.
    memory : (6,) int64
        A row of ``SearchMemory.table``.
    discs : (K, 3) float64
        Discs (row, column, radius) [cells] that the body's centre may not enter.
    task : (8,) int64
        Row and column of the start and of the goal (-1 for none), the budget, 1 to be guided to the goal, how
        many targets are wanted, and how far to go on beyond them.
    targets : Lookout
        What to look for.

    Returns
    -------
    remaining, parent : (rows, columns) int32 and uint8
        What remains of the budget in each cell, and how it was reached.
    count, hit_count : int
        Number of touched cells, for ``clear_memory``, and of targets hit.
    settled : int
        Costs up to this one are final.
    """
    rows, columns = log_odds.shape
    remaining, parent = (
        int32_table_at(memory[REMAINING], rows, columns),
        uint8_grid_at(memory[PARENT], rows, columns),
    )
    touched = int32_table_at(memory[TOUCHED], 1, rows * columns + 8)[0]
    buckets = int32_table_at(memory[BUCKETS], memory[SLOTS], memory[WIDTH])
    count = close_discs(remaining, touched, discs)
    start_row, start_column, goal_row, goal_column = task[0], task[1], task[2], task[3]
    budget, guided, wanted, beyond = task[4], task[5], task[6], task[7]
    count, hit_count, band, _ = spread(
        log_odds,
        closeness,
        passage.limit,
        passage.half_costs,
        passage.roomy,
        passage.radius,
        discs,
        remaining,
        parent,
        touched,
        count,
        buckets,
        start_row,
        start_column,
        budget,
        goal_row,
        goal_column,
        guided != 0,
        targets.mask,
        targets.near,
        targets.spans,
        wanted,
        beyond,
        targets.hits,
    )
    return remaining, parent, count, hit_count, ((band + 1) << BUCKET_SHIFT) - 1


@kernel
def search_at(
    log_odds: int,
    closeness: Array,
    passage: Passage,
    memory: Array,
    discs: Array,
    task: Array,
    targets: Lookout,
) -> tuple[int, int, int]:
    """Search a belief given by its address (kernel).

    Read-only arrays then need no kernels of their own.

    Returns
    -------
    count, hit_count, settled : int
        As ``search_in``.
    """
    beliefs = int8_grid_at(log_odds, closeness.shape[0], closeness.shape[1])
    _, _, count, hit_count, settled = search_in(beliefs, closeness, passage, memory, discs, task, targets)
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
        What remains of ``LARGEST_BUDGET`` in each cell, and how it was reached; see ``grid_search``.
    count : int
        Number of touched cells, for ``clear_memory``.
    least : int
        What remains at least in cells whose costs are final.
    """
    task = np.array([start_row, start_column, -1, -1, LARGEST_BUDGET, 0, 0, 0])
    remaining, parent, count, _, settled = search_in(
        log_odds, closeness, passage, memory, np.empty((0, 3)), task, _nothing()
    )
    return remaining, parent, count, LARGEST_BUDGET - settled


@kernel
def clear_memory(memory: Array, rows: int, columns: int, count: int) -> None:
    """Leave a thread's memory as the next search wants it (kernel)."""
    clear(
        int32_table_at(memory[REMAINING], rows, columns),
        int32_table_at(memory[TOUCHED], 1, rows * columns + 8)[0],
        count,
    )


@kernel
def find_path(
    log_odds: Array,
    closeness: Array,
    passage: Passage,
    memory: Array,
    discs: Array,
    start_row: int,
    start_column: int,
    goal_row: int,
    goal_column: int,
    budget: int,
) -> tuple[int, Array]:
    """Return the cheapest path between two cells of a grid (kernel).

    By A* with the octile distance.

    Parameters
    ----------
    log_odds, closeness : (rows, columns) int8 and uint16
        The belief and its clearance.
    passage : Passage
        The body.
    memory : (6,) int64
        A row of ``SearchMemory.table``.
    discs : (K, 3) float64
        Discs (row, column, radius) [cells] that the body's centre may not enter.
    start_row, start_column, goal_row, goal_column : int
        From where to where; within the grid.
    budget : int
        What may be spent, see ``budget_of``.

    Returns
    -------
    cost : int
        In units of searches; negative where there is no way.
    cells : (N, 2) int64
        Cells (row, column) from the start to the goal.
    """
    rows, columns = log_odds.shape
    nothing = np.empty((0, 2), np.int64)
    is_there = start_row == goal_row and start_column == goal_column
    if not is_there and (
        log_odds[goal_row, goal_column] >= 0 or passage.half_costs[0, closeness[goal_row, goal_column]] == 0
    ):
        return -1, nothing  # no step leads into it
    for k in range(len(discs)):
        if (
            not is_there
            and (goal_row - discs[k, 0]) ** 2 + (goal_column - discs[k, 1]) ** 2 < discs[k, 2] ** 2
        ):
            return -1, nothing  # a body stands there
    task = np.array([start_row, start_column, goal_row, goal_column, budget, 1, 0, 0])
    remaining, parent, count, _, settled = search_in(
        log_odds, closeness, passage, memory, discs, task, _nothing()
    )
    left = remaining[goal_row, goal_column]
    cost = 0 if is_there else budget - left
    is_reached = (
        left != 0 and left != NO_ENTRY and parent[goal_row, goal_column] < LEAVING and cost <= settled
    )
    cells = (
        trace(parent, start_row, start_column, goal_row, goal_column) if is_there or is_reached else nothing
    )
    clear_memory(memory, rows, columns, count)
    return cost if is_there or is_reached else -1, cells
