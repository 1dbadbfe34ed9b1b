"""Updates of closeness.

Stamps are placed around cells that became occupied, and blocks recomputed where cells became free.

The distance transform is separable (Felzenszwalb and Huttenlocher, Distance transforms of sampled functions,
Theory of Computing 8, 2012); with a small largest distance the plain minimum along rows, of many cells at
once, beats the lower envelope.
"""

import numpy as np

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.llvm import BLOCK
from lidarium.mapping.kernels.simd.clearance import (
    cells_that_differ,
    raise_block,
    same_cells,
)
from lidarium.mapping.planning.row_sweeps import is_within, recompute

Window = tuple[int, int, int, int]


STAMPS_PER_CELL = 1.0 / 200.0
"""Stamping one disc costs about as much as computing 200 cells again."""


@kernel
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
def update_closeness(log_odds: Array, closeness: Array, limit: int, stamp: Array, window: Window) -> bool:
    """Update closeness where cells of a window became or ceased to be occupied.

    Returns whether any did (kernel).

    Parameters are those of :class:`ClearanceField` and its ``update``.
    """
    return update_around(log_odds, closeness, limit, stamp, changed_cells(log_odds, closeness, limit, window))  # type: ignore[no-any-return]


@kernel
def update_around(log_odds: Array, closeness: Array, limit: int, stamp: Array, changed: Array) -> bool:
    """Update closeness around all cells (N, 2) that changed occupancy (kernel).

    They became occupied or ceased to be. Returns whether any did.
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
            recompute(
                log_odds, closeness, limit, reach, target[0] + first, stale[first : last + 1], block * BLOCK
            )
    if not is_all:
        for k in range(len(changed)):
            if log_odds[changed[k, 0], changed[k, 1]] > 0:
                _stamp_at(closeness, stamp, changed[k, 0], changed[k, 1])
    return True


@kernel(forceinline=True)
def _next_stale(stale: Array, row: int) -> int:
    """Return the first stale row from ``row`` on.

    The number of rows where there is none.
    """
    while row < stale.size and not stale[row]:
        row += 1
    return row


@kernel
def _mark_stale(
    closeness: Array, stamp: Array, row: int, column: int, first_row: int, first_block: int, is_stale: Array
) -> None:
    """Mark the rows of blocks whose closeness may come from a freed cell.

    A freed cell is one that ceased to be occupied.

    Where it did not come from there it was greater, and the occupied cell from which it came is still there,
    or marks it itself.
    """
    (rows, columns), reach = closeness.shape, stamp.shape[0] // 2
    low, high = max(row - reach, 0), min(row + reach + 1, rows)
    if columns < BLOCK:
        is_stale[:, low - first_row : high - first_row] = True
        return
    for lane in range(BLOCK, stamp.shape[1] - BLOCK, BLOCK):
        first = column - reach + lane - BLOCK
        within = is_within(first, columns)
        if within < 0:
            continue
        # The lanes lie in one block of columns, or in two.
        place, border = within // BLOCK - first_block, BLOCK - within % BLOCK
        for other in range(low, high):
            source = stamp.ctypes.data + 2 * ((other - row + reach) * stamp.shape[1] + lane + within - first)
            same = same_cells(closeness.ctypes.data + 2 * (other * columns + within), source)
            if same == np.uint64(0):
                continue
            near = same if border == BLOCK else same & ((np.uint64(1) << np.uint64(border)) - np.uint64(1))
            if near != np.uint64(0):
                is_stale[place, other - first_row] = True
            if near != same:
                is_stale[place + 1, other - first_row] = True


@kernel
def changed_cells(log_odds: Array, closeness: Array, limit: int, window: Window) -> Array:
    """List the changed cells (row, column) of a window (kernel).

    They became occupied or ceased to be since closeness was last updated.
    """
    row_low, row_high, column_low, column_high = grown_window(window, 0, log_odds.shape)
    columns = log_odds.shape[1]
    changed, count = room_for_cells(), 0
    for row in range(row_low, row_high):
        place = row * columns + column_low
        for column in range(column_low, column_high, BLOCK):
            differing = _that_differ(log_odds, closeness, limit, place, min(BLOCK, column_high - column))
            place += BLOCK
            if differing != np.uint64(0):
                changed, count = list_cells(changed, count, differing, row, column)
    cells: Array = changed[:count]
    return cells


@kernel(forceinline=True)
def room_for_cells() -> Array:
    """Return what ``list_cells`` can list cells in (kernel)."""
    return np.empty((256, 2), np.int64)


@kernel
def list_cells(listed: Array, count: int, word: np.uint64, row: int, column: int) -> tuple[Array, int]:
    """Add the cells (row, column) of a block whose bits are set to a list (kernel).

    The block is part of a row, from ``column`` on; the list has so many entries.

    Returns
    -------
    listed : (N, 2) int64
        The list, another one where there was no room left.
    count : int
        How many there are now.
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


@kernel
def _that_differ(log_odds: Array, closeness: Array, limit: int, place: int, cells: int) -> np.uint64:
    """Return which of up to 64 cells from a place on became occupied or free.

    The place is an index into the grid.
    """
    if place + BLOCK <= log_odds.size:
        found: np.uint64 = cells_that_differ(
            log_odds.ctypes.data + place, closeness.ctypes.data + 2 * place, limit
        )
        return found & (np.uint64(0xFFFFFFFFFFFFFFFF) >> np.uint64(BLOCK - cells))
    differing, beliefs, known = np.uint64(0), log_odds.reshape(-1), closeness.reshape(-1)
    for k in range(cells):
        differing |= np.uint64((beliefs[place + k] > 0) != (known[place + k] == limit)) << np.uint64(k)
    return differing


@kernel
def _box_of(log_odds: Array, cells: Array) -> Window:
    """Bound cells by a window."""
    row_low, row_high, column_low, column_high = log_odds.shape[0], 0, log_odds.shape[1], 0
    for k in range(len(cells)):
        row_low, row_high = min(row_low, cells[k, 0]), max(row_high, cells[k, 0] + 1)
        column_low, column_high = min(column_low, cells[k, 1]), max(column_high, cells[k, 1] + 1)
    return row_low, row_high, column_low, column_high


@kernel
def _stamp_at(closeness: Array, stamp: Array, row: int, column: int) -> None:
    """Raise the closeness around an occupied cell."""
    (rows, columns), reach = closeness.shape, stamp.shape[0] // 2
    low, high = max(row - reach, 0), min(row + reach + 1, rows)
    if columns < BLOCK:
        for other in range(low, high):
            for place in range(max(column - reach, 0), min(column + reach + 1, columns)):
                closeness[other, place] = max(
                    closeness[other, place], stamp[other - row + reach, BLOCK + place - column + reach]
                )
        return
    for lane in range(BLOCK, stamp.shape[1] - BLOCK, BLOCK):
        first = column - reach + lane - BLOCK
        within = is_within(first, columns)
        if within < 0:
            continue
        for other in range(low, high):
            source = stamp.ctypes.data + 2 * ((other - row + reach) * stamp.shape[1] + lane + within - first)
            raise_block(closeness.ctypes.data + 2 * (other * columns + within), source)
