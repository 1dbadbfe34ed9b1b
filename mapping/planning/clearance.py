"""Clearance: the distance of each cell from the nearest occupied one, exact and updated window by window.

Clearance is the distance from the centre of a cell to the nearest occupied cell's square, so that a disc of
radius r centred there touches nothing exactly if the clearance is at least r. In half cells the squared
distance to the cell ``(i, j)`` steps away is the integer ``max(2|i| - 1, 0)^2 + max(2|j| - 1, 0)^2``:
comparisons need no tolerance.

The stored number is *closeness*, ``limit - squared distance``, and 0 at and beyond the maximum distance:
memory is touched only near occupied cells, and an occupied cell is the one with closeness ``limit``.

An update places stamps around cells that became occupied, and recomputes blocks around cells that became
free. The distance transform is separable (Felzenszwalb and Huttenlocher, Distance transforms of sampled
functions, Theory of Computing 8, 2012); with a small maximum distance the plain minimum along rows, of many
cells at once, beats the lower envelope.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.llvm import BLOCK
from lidarium.mapping.kernels.simd.clearance import (
    cells_that_differ,
    count_rows,
    raise_block,
    same_cells,
    write_min_sums,
    write_squares,
)


@kernel(forceinline=True)
def _is_within(column: int, columns: int) -> int:
    """Return the first of 64 grid columns that hold all columns from ``column`` on; -1 for none."""
    return min(max(column, 0), columns - BLOCK) if columns >= BLOCK and -BLOCK < column < columns else -1


class _Sweep(NamedTuple):
    """Rows that are visited one after the other.

    Attributes
    ----------
    row, step, rows : int
        The first row, 1 or -1, and the number of rows.
    largest : int
        Maximum number of steps that is counted.
    """

    row: int
    step: int
    rows: int
    largest: int


@kernel(nrt=False)
def _count_rows(log_odds: Array, sweep: _Sweep, column: int, steps: Array, fewest: Array, lane: int) -> None:
    """Apply ``count_rows`` to the columns from ``column`` on; beyond the grid nothing is occupied.

    ``steps`` is (64,); ``fewest`` (rows, width), in which the columns begin at ``lane``, may have one row for all.
    """
    row, step, rows, largest = sweep
    columns, width = log_odds.shape[1], fewest.shape[1]
    index = lane if step > 0 else (fewest.shape[0] - 1) * width + lane
    stride = step * width if fewest.shape[0] > 1 else 0
    if column >= 0 and column + BLOCK <= columns:
        beliefs, target = log_odds.ctypes.data + row * columns + column, fewest.ctypes.data + 2 * index
        count_rows(beliefs, step * columns, rows, steps.ctypes.data, largest, target, 2 * stride)
        return
    lanes = fewest.reshape(-1)
    for k in range(max(-column, 0), min(BLOCK, columns - column)):
        for i in range(rows):
            steps[k] = 0 if log_odds[row + i * step, column + k] > 0 else min(steps[k] + 1, largest)
            lanes[index + i * stride + k] = min(lanes[index + i * stride + k], steps[k])


@kernel
def _nearest_rows(log_odds: Array, reach: int, row_low: int, row_high: int, column: int, width: int) -> Array:
    """Return the number of rows to the nearest occupied cell of the same column, (rows, width) uint16.

    It is ``reach`` + 1 for farther cells.
    """
    far, low, high = reach + 1, max(row_low - reach, 0), min(row_high + reach, log_odds.shape[0])
    steps, beyond = np.empty(BLOCK, np.uint16), np.empty((1, width), np.uint16)
    fewest = np.full((row_high - row_low, width), far, np.uint16)
    for chunk in range(0, width, BLOCK):
        # At the border 64 columns within the grid, of which some are counted twice, serve as well.
        within = _is_within(column + chunk, log_odds.shape[1])
        first = within if within >= 0 and 0 <= within - column <= width - BLOCK else column + chunk
        for step, outside, inside in ((1, low, row_low), (-1, high - 1, row_high - 1)):
            steps[:] = far
            before = _Sweep(outside, step, abs(inside - outside), far)
            _count_rows(log_odds, before, first, steps, beyond, first - column)
            within_rows = _Sweep(inside, step, row_high - row_low, far)
            _count_rows(log_odds, within_rows, first, steps, fewest, first - column)
    return fewest


@kernel
def _recompute(
    log_odds: Array, closeness: Array, limit: int, reach: int, row_low: int, stale: Array, column: int
) -> None:
    """Compute the closeness of a block of columns in its stale rows, from all occupied cells.

    The columns begin at ``column``, the rows at ``row_low``.
    """
    columns, far = log_odds.shape[1], reach + 1
    width = (BLOCK + 2 * reach + BLOCK - 1) // BLOCK * BLOCK
    costs, sides = np.empty(2 * reach + 1, np.uint16), np.empty(far, np.int64)
    for k in range(2 * reach + 1):
        costs[k] = max(2 * abs(k - reach) - 1, 0) ** 2
    side = reach
    for nearest in range(far):
        # Steps to the side that cost more than the rest of the limit have no effect.
        while side > 0 and np.int64(costs[reach + side]) + max(2 * nearest - 1, 0) ** 2 >= limit:
            side -= 1
        sides[nearest] = side
    distances = _nearest_rows(log_odds, reach, row_low, row_low + stale.size, column - reach, width)
    result = np.empty(BLOCK, np.uint16)
    used = min(BLOCK, columns - column)
    for k in range(stale.size):
        if not stale[k]:
            continue
        row, squares, nearest = row_low + k, distances[k], far
        for chunk in range(0, width, BLOCK):
            index = squares.ctypes.data + 2 * chunk
            nearest = min(nearest, write_squares(index, far, limit, index))
        if nearest == far:
            closeness[row, column : column + used] = 0
            continue
        side = sides[nearest]
        target = closeness.ctypes.data + 2 * (row * columns + column) if used == BLOCK else result.ctypes.data
        write_min_sums(squares.ctypes.data, costs.ctypes.data, reach - side, reach + side + 1, limit, target)
        if used < BLOCK:
            closeness[row, column : column + used] = result[:used]


Window = tuple[int, int, int, int]


STAMPS_PER_CELL = 1.0 / 200.0
"""Stamping one disc costs about as much as computing 200 cells again."""


@kernel(nrt=False)
def grown_window(window: Window, margin: int, shape: tuple[int, int]) -> Window:
    """Grow a window by ``margin`` cells on each side, clipped to the grid (kernel)."""
    row_low, row_high, column_low, column_high = window
    return (
        max(row_low - margin, 0),
        min(row_high + margin, shape[0]),
        max(column_low - margin, 0),
        min(column_high + margin, shape[1]),
    )


@kernel
def _update_closeness(log_odds: Array, closeness: Array, limit: int, stamp: Array, window: Window) -> bool:
    """Update closeness around a window of the belief; return whether a cell changed occupancy (kernel).

    Parameters are those of :class:`ClearanceField` and its ``update``.
    """
    return update_around(log_odds, closeness, limit, stamp, changed_cells(log_odds, closeness, limit, window))  # type: ignore[no-any-return]


@kernel
def update_around(log_odds: Array, closeness: Array, limit: int, stamp: Array, changed: Array) -> bool:
    """Update closeness around all cells (N, 2) that changed occupancy (kernel).

    Returns whether there are any.
    """
    if len(changed) == 0:
        return False
    reach, added = stamp.shape[0] // 2, 0
    for k in range(len(changed)):
        added += log_odds[changed[k, 0], changed[k, 1]] > 0
    target = grown_window(_box_of(log_odds, changed), reach, log_odds.shape)
    first_block, last_block = target[2] // BLOCK, (target[3] - 1) // BLOCK + 1
    is_stale = np.zeros((last_block - first_block, target[1] - target[0]), np.bool_)
    is_all = added > STAMPS_PER_CELL * (target[1] - target[0]) * (target[3] - target[2])
    is_stale[:] = is_all
    if not is_all and added < len(changed):
        for k in range(len(changed)):
            if log_odds[changed[k, 0], changed[k, 1]] <= 0:
                _mark_stale(closeness, stamp, changed[k, 0], changed[k, 1], target[0], first_block, is_stale)
    for block in range(first_block, last_block):
        stale = is_stale[block - first_block]
        row = _next_stale(stale, 0)
        while row < stale.size:
            # Rows that share neighbours are computed together.
            first, last, row = row, row, _next_stale(stale, row + 1)
            while row < stale.size and row - last <= 2 * reach:
                last, row = row, _next_stale(stale, row + 1)
            _recompute(log_odds, closeness, limit, reach, target[0] + first, stale[first : last + 1], block * BLOCK)
    if not is_all:
        for k in range(len(changed)):
            if log_odds[changed[k, 0], changed[k, 1]] > 0:
                _stamp_at(closeness, stamp, changed[k, 0], changed[k, 1])
    return True


@kernel(forceinline=True)
def _next_stale(stale: Array, row: int) -> int:
    """Return the first stale row from ``row`` on, or the number of rows if there is none."""
    while row < stale.size and not stale[row]:
        row += 1
    return row


@kernel
def _mark_stale(
    closeness: Array, stamp: Array, row: int, column: int, first_row: int, first_block: int, is_stale: Array
) -> None:
    """Mark the rows of blocks whose closeness may come from a cell that became free.

    If it comes from another cell, it was greater, and that cell is still occupied or marks it itself.
    """
    (rows, columns), reach = closeness.shape, stamp.shape[0] // 2
    low, high = max(row - reach, 0), min(row + reach + 1, rows)
    if columns < BLOCK:
        is_stale[:, low - first_row : high - first_row] = True
        return
    for lane in range(BLOCK, stamp.shape[1] - BLOCK, BLOCK):
        first = column - reach + lane - BLOCK
        within = _is_within(first, columns)
        if within < 0:
            continue
        # The lanes lie in one block of columns, or in two.
        index, border = within // BLOCK - first_block, BLOCK - within % BLOCK
        for other in range(low, high):
            source = stamp.ctypes.data + 2 * ((other - row + reach) * stamp.shape[1] + lane + within - first)
            same = same_cells(closeness.ctypes.data + 2 * (other * columns + within), source)
            if same == np.uint64(0):
                continue
            near = same if border == BLOCK else same & ((np.uint64(1) << np.uint64(border)) - np.uint64(1))
            if near != np.uint64(0):
                is_stale[index, other - first_row] = True
            if near != same:
                is_stale[index + 1, other - first_row] = True


@kernel
def changed_cells(log_odds: Array, closeness: Array, limit: int, window: Window) -> Array:
    """List the cells (row, column) of a window that changed occupancy since the last update (kernel)."""
    row_low, row_high, column_low, column_high = grown_window(window, 0, log_odds.shape)
    columns = log_odds.shape[1]
    changed, count = room_for_cells(), 0
    for row in range(row_low, row_high):
        index = row * columns + column_low
        for column in range(column_low, column_high, BLOCK):
            differing = _that_differ(log_odds, closeness, limit, index, min(BLOCK, column_high - column))
            index += BLOCK
            if differing != np.uint64(0):
                changed, count = list_cells(changed, count, differing, row, column)
    cells: Array = changed[:count]
    return cells


@kernel(forceinline=True)
def room_for_cells() -> Array:
    """Return an empty list for ``list_cells`` (kernel)."""
    return np.empty((256, 2), np.int64)


@kernel
def list_cells(listed: Array, count: int, word: np.uint64, row: int, column: int) -> tuple[Array, int]:
    """Add the cells of a block whose bits are set to a list with ``count`` entries (kernel).

    The block is the part of a row from ``column`` on. Returns the list (N, 2), which is a new one if it was full,
    and its number of entries.
    """
    if count + BLOCK > len(listed):
        longer = np.empty((2 * len(listed), 2), np.int64)
        longer[:count] = listed[:count]
        listed = longer
    while word != np.uint64(0):
        if word & np.uint64(1):
            listed[count, 0], listed[count, 1] = row, column
            count += 1
        word >>= np.uint64(1)
        column += 1
    return listed, count


@kernel(nrt=False)
def _that_differ(log_odds: Array, closeness: Array, limit: int, index: int, cells: int) -> np.uint64:
    """Return which of up to 64 cells, from an index of the grid on, became occupied or free."""
    if index + BLOCK <= log_odds.size:
        found: np.uint64 = cells_that_differ(log_odds.ctypes.data + index, closeness.ctypes.data + 2 * index, limit)
        return found & (np.uint64(0xFFFFFFFFFFFFFFFF) >> np.uint64(BLOCK - cells))
    differing, beliefs, known = np.uint64(0), log_odds.reshape(-1), closeness.reshape(-1)
    for k in range(cells):
        differing |= np.uint64((beliefs[index + k] > 0) != (known[index + k] == limit)) << np.uint64(k)
    return differing


@kernel(nrt=False)
def _box_of(log_odds: Array, cells: Array) -> Window:
    """Bound cells by a window."""
    row_low, row_high, column_low, column_high = log_odds.shape[0], 0, log_odds.shape[1], 0
    for k in range(len(cells)):
        row_low, row_high = min(row_low, cells[k, 0]), max(row_high, cells[k, 0] + 1)
        column_low, column_high = min(column_low, cells[k, 1]), max(column_high, cells[k, 1] + 1)
    return row_low, row_high, column_low, column_high


@kernel(nrt=False)
def _stamp_at(closeness: Array, stamp: Array, row: int, column: int) -> None:
    """Raise the closeness around an occupied cell."""
    (rows, columns), reach = closeness.shape, stamp.shape[0] // 2
    low, high = max(row - reach, 0), min(row + reach + 1, rows)
    if columns < BLOCK:
        for other in range(low, high):
            for index in range(max(column - reach, 0), min(column + reach + 1, columns)):
                closeness[other, index] = max(
                    closeness[other, index], stamp[other - row + reach, BLOCK + index - column + reach]
                )
        return
    for lane in range(BLOCK, stamp.shape[1] - BLOCK, BLOCK):
        first = column - reach + lane - BLOCK
        within = _is_within(first, columns)
        if within < 0:
            continue
        for other in range(low, high):
            source = stamp.ctypes.data + 2 * ((other - row + reach) * stamp.shape[1] + lane + within - first)
            raise_block(closeness.ctypes.data + 2 * (other * columns + within), source)


LARGEST_LIMIT = 32_767  # twice the limit must fit into 16 bits


def limit_of(distance: float, resolution: float) -> int:
    """Return the smallest squared distance [half cells] that is at least ``distance`` [m].

    ``resolution`` is the side of a cell [m].
    """
    return math.ceil((2.0 * distance / resolution) ** 2 - 1e-6)


def full_window(shape: tuple[int, ...]) -> Window:
    """Return the window of a whole grid: row_low, row_high, column_low, column_high, high ends excluded."""
    return 0, int(shape[0]), 0, int(shape[1])


def clearance(occupied: NDArray[np.bool_], resolution: float, maximum: float = 0.6) -> NDArray[np.float32]:
    """Return the clearance of a whole grid, (rows, columns) float32 [m]; 0 in occupied cells.

    Parameters
    ----------
    occupied : (rows, columns) bool
        Cells that a body must not touch.
    resolution : float
        Side of a cell [m].
    maximum : float
        Maximum distance [m], half a cell to 90 cells; clearance is capped there.
    """
    occupied = np.asarray(occupied)
    if occupied.ndim != 2:
        raise ValueError(f"occupied has shape {occupied.shape}; want a grid (rows, columns)")
    field = ClearanceField((occupied.shape[0], occupied.shape[1]), resolution, maximum)
    field.update(np.ascontiguousarray(occupied, dtype=np.int8))
    return field.metres()


class ClearanceField:
    """Clearance kept next to a belief.

    Raises ValueError if ``resolution`` is not positive, or ``maximum`` is below half a cell or above 90
    cells.

    Attributes
    ----------
    closeness : (rows, columns) uint16
        ``limit`` minus the squared distance in half cells to the nearest occupied square; 0 at ``maximum``
        or beyond.
    limit : int
        Squared ``maximum`` in half cells, rounded up.
    resolution, maximum : float
        Side of a cell and the maximum distance [m].
    """

    def __init__(self, shape: tuple[int, int], resolution: float, maximum: float = 0.6) -> None:
        if not resolution > 0.0:
            raise ValueError(f"resolution is {resolution} m; want a positive side of a cell")
        limit = limit_of(maximum, resolution) if math.isfinite(maximum) and maximum > 0.0 else 0
        if not 1 <= limit <= LARGEST_LIMIT:
            raise ValueError(
                f"maximum is {maximum} m; want {0.5 * resolution} to {90 * resolution} m at cells of {resolution} m"
            )
        self.resolution = float(resolution)
        self.maximum = float(maximum)
        self.limit = limit
        self.closeness: NDArray[np.uint16] = np.zeros(shape, dtype=np.uint16)

    @property
    def stamp(self) -> NDArray[np.uint16]:
        """Closeness around one occupied cell, see ``stamp_of``; read-only and shared."""
        return stamp_of(self.limit)

    @property
    def reach(self) -> int:
        """Cells, along a row or a column, over which an occupied cell has an effect."""
        return int(self.stamp.shape[0]) // 2

    def update(self, log_odds: NDArray[np.int8], window: Window | None = None) -> bool:
        """Update clearance around cells of a window that became occupied or free; return whether any changed.

        Raises ValueError if the belief's shape is not that of the field.

        Parameters
        ----------
        log_odds : (rows, columns) int8
            The belief; > 0 is occupied. C-contiguous.
        window : (row_low, row_high, column_low, column_high), optional
            Cells that may have changed since the last call, high ends excluded; all cells by default.
        """
        if log_odds.shape != self.closeness.shape:
            raise ValueError(f"log_odds has shape {log_odds.shape}; this field was made for {self.closeness.shape}")
        row_low, row_high, column_low, column_high = full_window(log_odds.shape) if window is None else window
        inside = (int(row_low), int(row_high), int(column_low), int(column_high))
        return bool(_update_closeness(log_odds, self.closeness, self.limit, self.stamp, inside))

    def metres(self, window: Window | None = None) -> NDArray[np.float32]:
        """Return the clearance [m] of the cells of a window (all by default), capped at ``maximum``.

        A new float32 array.
        """
        row_low, row_high, column_low, column_high = full_window(self.closeness.shape) if window is None else window
        squared = self.limit - self.closeness[row_low:row_high, column_low:column_high].astype(np.float64)
        return np.minimum(np.sqrt(squared) * (0.5 * self.resolution), self.maximum).astype(np.float32)

    def at(self, cell: tuple[int, int]) -> float:
        """Return the clearance [m] of one cell (row, column), capped at ``maximum``."""
        return min(math.sqrt(self.limit - int(self.closeness[cell])) * 0.5 * self.resolution, self.maximum)


@lru_cache(maxsize=16)
def stamp_of(limit: int) -> NDArray[np.uint16]:
    """Return the closeness around one occupied cell, up to k cells away: (2 k + 1, 2 k + 1 and more) uint16.

    Rows begin with a block of zeros, and end with zeros up to whole blocks and one more: 64 lanes from any index on
    exist, and raise nothing beyond the stamp.
    """
    reach = 0
    while (2 * reach + 1) ** 2 < limit:
        reach += 1
    steps = np.maximum(2 * np.abs(np.arange(-reach, reach + 1)) - 1, 0) ** 2
    stamp: NDArray[np.uint16] = np.zeros((len(steps), (-(-len(steps) // BLOCK) + 2) * BLOCK), np.uint16)
    stamp[:, BLOCK : BLOCK + len(steps)] = np.maximum(limit - (steps[:, None] + steps[None, :]), 0)
    stamp.flags.writeable = False
    return stamp
