"""Sweeps over rows that find the nearest occupied cells."""

from typing import NamedTuple

import numpy as np

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.llvm import BLOCK
from lidarium.mapping.kernels.simd.clearance import (
    count_rows,
    write_min_sums,
    write_squares,
)


@kernel(forceinline=True)
def is_within(column: int, columns: int) -> int:
    """Return the first of 64 columns within the grid that cover those wanted.

    They hold all columns from ``column`` on that lie in the grid; -1 for none.
    """
    return min(max(column, 0), columns - BLOCK) if columns >= BLOCK and -BLOCK < column < columns else -1


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
        within = is_within(column + chunk, log_odds.shape[1])
        first = within if within >= 0 and 0 <= within - column <= width - BLOCK else column + chunk
        for step, outside, inside in ((1, low, row_low), (-1, high - 1, row_high - 1)):
            steps[:] = far
            before = _Sweep(outside, step, abs(inside - outside), far)
            _count_rows(log_odds, before, first, steps, beyond, first - column)
            within_rows = _Sweep(inside, step, row_high - row_low, far)
            _count_rows(log_odds, within_rows, first, steps, fewest, first - column)
    return fewest


@kernel
def recompute(
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
        write_min_sums(squares.ctypes.data, costs.ctypes.data, reach - side, reach + side + 1, limit, target)
        if used < BLOCK:
            closeness[row, column : column + used] = result[:used]
