"""Updates of closeness.

Stamps are placed around cells that became occupied, and blocks recomputed where cells became free.

The distance transform is separable (Felzenszwalb and Huttenlocher, Distance transforms of sampled functions,
Theory of Computing 8, 2012); with a small largest distance the plain minimum along rows, of many cells at
once, beats the lower envelope.
"""

from typing import NamedTuple

import numpy as np

from lidarium.mapping.kernels.clearance_blocks import (
    cells_that_differ,
    count_rows,
    raise_block,
    same_cells,
    write_least_sums,
    write_squares,
)
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.vectors import BLOCK

Window = tuple[int, int, int, int]

STAMPS_PER_CELL = 1.0 / 200.0
"""Stamping one disc costs about as much as computing 200 cells anew."""


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
            _recompute(
                log_odds, closeness, limit, reach, target[0] + first, stale[first : last + 1], block * BLOCK
            )
    if not is_all:
        for k in range(len(changed)):
            if log_odds[changed[k, 0], changed[k, 1]] > 0:
                _stamp_at(closeness, stamp, changed[k, 0], changed[k, 1])
    return True


@kernel(inline=True)
def _next_stale(stale: Array, row: int) -> int:
    """Return the first stale row from ``row`` on.

    The number of rows where there is none.
    """
    while row < stale.size and not stale[row]:
        row += 1
    return row


@kernel(inline=True)
def _within(column: int, columns: int) -> int:
    """Return the first of 64 columns within the grid that cover those wanted.

    They hold all columns from ``column`` on that lie in the grid; -1 for none.
    """
    return min(max(column, 0), columns - BLOCK) if columns >= BLOCK and -BLOCK < column < columns else -1


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
        within = _within(first, columns)
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


@kernel(inline=True)
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
        within = _within(first, columns)
        if within < 0:
            continue
        for other in range(low, high):
            source = stamp.ctypes.data + 2 * ((other - row + reach) * stamp.shape[1] + lane + within - first)
            raise_block(closeness.ctypes.data + 2 * (other * columns + within), source)


class _Sweep(NamedTuple):
    """Rows that are gone through one after the other.

    Attributes
    ----------
    row, step, rows : int
        The first row, 1 or -1, and how many there are.
    largest : int
        Up to which number steps are counted.
    """

    row: int
    step: int
    rows: int
    largest: int


@kernel
def _count_rows(log_odds: Array, sweep: _Sweep, column: int, steps: Array, fewest: Array, lane: int) -> None:
    """Apply ``count_rows`` to the columns from ``column`` on.

    ``steps`` is (64,); ``fewest`` (rows, width), in which the columns begin at ``lane``, may have one row for
    all. Beyond the grid nothing is occupied.
    """
    row, step, rows, largest = sweep
    columns, width = log_odds.shape[1], fewest.shape[1]
    place = lane if step > 0 else (fewest.shape[0] - 1) * width + lane
    stride = step * width if fewest.shape[0] > 1 else 0
    if column >= 0 and column + BLOCK <= columns:
        beliefs, target = log_odds.ctypes.data + row * columns + column, fewest.ctypes.data + 2 * place
        count_rows(beliefs, step * columns, rows, steps.ctypes.data, largest, target, 2 * stride)
        return
    lanes = fewest.reshape(-1)
    for k in range(max(-column, 0), min(BLOCK, columns - column)):
        for i in range(rows):
            steps[k] = 0 if log_odds[row + i * step, column + k] > 0 else min(steps[k] + 1, largest)
            lanes[place + i * stride + k] = min(lanes[place + i * stride + k], steps[k])


@kernel
def _nearest_rows(log_odds: Array, reach: int, row_low: int, row_high: int, column: int, width: int) -> Array:
    """Return the number of rows to the nearest occupied cell of the same column.

    ``reach`` + 1 for farther: (rows, width) uint16.
    """
    far, low, high = reach + 1, max(row_low - reach, 0), min(row_high + reach, log_odds.shape[0])
    steps, beyond = np.empty(BLOCK, np.uint16), np.empty((1, width), np.uint16)
    fewest = np.full((row_high - row_low, width), far, np.uint16)
    for chunk in range(0, width, BLOCK):
        # At the border 64 columns within the grid, of which some are counted twice, serve as well.
        within = _within(column + chunk, log_odds.shape[1])
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
    """Compute the closeness of a block of columns in its stale rows.

    Columns from ``column``, rows from ``row_low`` on; from all occupied cells.
    """
    columns, far = log_odds.shape[1], reach + 1
    width = (BLOCK + 2 * reach + BLOCK - 1) // BLOCK * BLOCK
    costs, sides = np.empty(2 * reach + 1, np.uint16), np.empty(far, np.int64)
    for k in range(2 * reach + 1):
        costs[k] = max(2 * abs(k - reach) - 1, 0) ** 2
    side = reach
    for nearest in range(far):
        # Steps to the side that cost more than what is left cannot bring anything.
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
            place = squares.ctypes.data + 2 * chunk
            nearest = min(nearest, write_squares(place, far, limit, place))
        if nearest == far:
            closeness[row, column : column + used] = 0
            continue
        side = sides[nearest]
        target = closeness.ctypes.data + 2 * (row * columns + column) if used == BLOCK else result.ctypes.data
        write_least_sums(
            squares.ctypes.data, costs.ctypes.data, reach - side, reach + side + 1, limit, target
        )
        if used < BLOCK:
            closeness[row, column : column + used] = result[:used]
