"""The coarse cells that are joined to bodies on a map, by runs of fine cells.

The rules are those of ``coarse_grid``: a coarse cell is open if a body may stand anywhere in it, and only where the
body gets on the map. Runs of fine cells are joined row by row (A. Rosenfeld and J. Pfaltz, "Sequential operations in
digital picture processing", 1966), which takes one pass over the map instead of a search.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.words import first_bit, free_cells, last_bit, near_cells

WORD = 64
"""Cells of a word."""


class Standing(NamedTuple):
    """Where a body may stand.

    Attributes
    ----------
    factor : int
        Side of a coarse cell [cells of the map].
    max_closeness : int
        Maximum closeness of a cell of the map in which the body may stand.
    near_start : int
        Bodies start from the nearest cells in which they fit, up to this distance [cells].
    """

    factor: int
    max_closeness: int
    near_start: int


@kernel
def open_cells(
    log_odds: Array, closeness: Array, window: Array, starts: Array, standing: Standing, is_open: Array
) -> tuple[int, int, int, int]:
    """Mark the open coarse cells, and return the rows and columns of coarse cells around all that is free (kernel).

    Parameters
    ----------
    log_odds, closeness : (rows, columns) int8, uint16
        The map and its clearance.
    window : (4,) int64
        Rows and columns of the map beyond which nothing is known, the last exclusive.
    starts : (n, 2) int64
        Cells of the map from which bodies start.
    is_open : (coarse rows + 2, coarse columns + 2) uint8
        Written: 1 for open cells; zeros before. It has a border of one cell.

    Returns
    -------
    int, int, int, int
        First and last rows and columns of coarse cells, the last exclusive; zeros and a cell if nothing is free.
    """
    runs, starts_of_rows, free = _runs_of(log_odds, closeness, window, standing)
    if free[1] == 0:
        return 0, 1, 0, 1
    parents = np.arange(len(runs))
    for row in range(window[0] + 1, window[1]):
        _join(log_odds, closeness, row, window[0], runs, starts_of_rows, standing, parents)
    is_joined, has_start = np.zeros(len(runs), np.bool_), False
    reach = standing.near_start
    for k in range(len(starts)):
        for row in range(max(starts[k, 0] - reach, window[0]), min(starts[k, 0] + reach + 1, window[1])):
            for run in range(starts_of_rows[row - window[0]], starts_of_rows[row - window[0] + 1]):
                if runs[run, 0] <= starts[k, 1] + reach and runs[run, 1] >= starts[k, 1] - reach:
                    is_joined[_root(parents, run)] = has_start = True
    factor = standing.factor
    for row in range(window[0], window[1]):
        opened = is_open[row // factor + 1]
        for run in range(starts_of_rows[row - window[0]], starts_of_rows[row - window[0] + 1]):
            if not has_start or is_joined[_root(parents, run)]:
                for column in range(runs[run, 0] // factor + 1, runs[run, 1] // factor + 2):
                    opened[column] = 1
    low_row, low_column = free[0] // factor, free[2] // factor
    return low_row, -(-free[1] // factor), low_column, -(-free[3] // factor)


@kernel
def _runs_of(
    log_odds: Array, closeness: Array, window: Array, standing: Standing
) -> tuple[NDArray[np.int64], NDArray[np.int64], tuple[int, int, int, int]]:
    """Return the first and last columns of the runs of cells that fit, where each row begins, and the free window."""
    rows = max(window[1] - window[0], 0)
    rows, width, columns = max(window[1] - window[0], 0), max(window[3] - window[2], 0), log_odds.shape[1]
    runs, count = np.empty((1024, 2), np.int64), 0
    starts_of_rows, words = np.zeros(rows + 1, np.int64), (width + WORD - 1) // WORD
    row_low, row_high, free_columns = log_odds.shape[0], 0, np.zeros(words, np.uint64)
    for row in range(window[0], window[1]):
        first, carry, has_free = np.int64(-1), np.uint64(0), False
        for word in range(words):
            at, number = row * columns + window[2] + WORD * word, min(width - WORD * word, WORD)
            levels, near = log_odds.ctypes.data + at, closeness.ctypes.data + 2 * at
            if number == WORD:
                free, fits = free_cells(levels), near_cells(near, standing.max_closeness)
            else:
                free, fits = np.uint64(0), np.uint64(0)
                for k in range(number):
                    column, bit = window[2] + WORD * word + k, np.uint64(1) << np.uint64(k)
                    if log_odds[row, column] < 0:
                        free |= bit
                    if closeness[row, column] <= standing.max_closeness:
                        fits |= bit
            fits &= free
            free_columns[word] |= free
            has_free |= free != 0
            edges = fits ^ (fits << np.uint64(1) | carry)
            carry = fits >> np.uint64(WORD - 1)
            while edges != 0:
                column = window[2] + WORD * word + first_bit(edges)
                edges &= edges - np.uint64(1)
                if first < 0:
                    first = column
                    continue
                runs = _with_room(runs, count)
                runs[count, 0], runs[count, 1] = first, column - 1
                count, first = count + 1, np.int64(-1)
        if first >= 0:
            runs = _with_room(runs, count)
            runs[count, 0], runs[count, 1] = first, window[3] - 1
            count += 1
        if has_free:
            row_low, row_high = min(row_low, row), row + 1
        starts_of_rows[row - window[0] + 1] = count
    column_low, column_high = columns, 0
    for word in range(words):
        if free_columns[word] != 0:
            begin = window[2] + WORD * word
            column_low = min(column_low, begin + first_bit(free_columns[word]))
            column_high = begin + last_bit(free_columns[word]) + 1
    return runs[:count], starts_of_rows, (row_low, row_high, column_low, column_high)


@kernel
def _with_room(runs: Array, count: int) -> NDArray[np.int64]:
    """Return the runs with room for one more."""
    if count < len(runs):
        return runs
    longer = np.empty((2 * count, 2), np.int64)
    longer[:count] = runs
    return longer


@kernel(nrt=False)
def _root(parents: Array, run: int) -> int:
    while parents[run] != run:
        parents[run] = parents[parents[run]]
        run = parents[run]
    return run


@kernel(nrt=False)
def _join(
    log_odds: Array,
    closeness: Array,
    row: int,
    first_row: int,
    runs: Array,
    starts_of_rows: Array,
    standing: Standing,
    parents: Array,
) -> None:
    """Join the runs of a row to those of the row before.

    Diagonal steps keep the body's clearance, as those of the path planner in ``grid_search`` do. Where a straight
    step leads beside, they change nothing.
    """
    above, end = starts_of_rows[row - first_row - 1], starts_of_rows[row - first_row]
    for run in range(end, starts_of_rows[row - first_row + 1]):
        first, last = runs[run, 0], runs[run, 1]
        while above < end and runs[above, 1] < first - 1:
            above += 1
        other = above
        while other < end and runs[other, 0] <= last + 1:
            is_joined = True
            if runs[other, 1] < first:
                is_joined = _is_step(log_odds, closeness, row - 1, runs[other, 1], row, first, standing)
            elif runs[other, 0] > last:
                is_joined = _is_step(log_odds, closeness, row - 1, runs[other, 0], row, last, standing)
            if is_joined:
                parents[_root(parents, other)] = _root(parents, run)
            other += 1


@kernel(nrt=False)
def _is_step(
    log_odds: Array, closeness: Array, row: int, column: int, other: int, another: int, standing: Standing
) -> bool:
    """Whether a body gets diagonally from a cell to another one, while it fits into neither cell beside."""
    nearest = max(closeness[row, column], closeness[other, another])
    is_walled = log_odds[row, another] >= 0 and log_odds[other, column] >= 0
    return bool(np.int64(nearest) <= standing.max_closeness - 2 and not is_walled)
