"""Lengths of paths over a grid of open cells from many places at once.

Open cells are numbered row by row, and each has a length from every place, side by side. Runs of open cells are
swept down and up in turn until no length changes, all places at once. Lengths from views do not begin with nothing:
paths past a robot, from which all lengths are known, are a bound, and only what is shorter spreads. Lengths are whole
numbers and the shortest is unique, so neither the bound nor the order of sweeps shows in them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.lengths import (
    DIAGONAL,
    FAR,
    FEW_LANES,
    LANES,
    STRAIGHT,
    begin_with_bounds,
    lower_run,
    lower_run_of_few,
)

_FIRST, _COUNT, _ROW, _COLUMN, _ABOVE, _ABOVE_END, _BELOW, _BELOW_END = range(8)
"""Columns of runs: number of the first cell and how many there are; row and column of the first; runs above and below
that have a neighbour of one of the cells, the last exclusive."""


class Cells(NamedTuple):
    """The open cells of a grid.

    Attributes
    ----------
    numbers : (rows + 2, columns + 2) int32
        Number of each open cell, 1 the first; 0 for others. The grid has a border of one cell.
    runs : (n, 8) int64
        Cells of a row next to each other.
    total : int
        How many cells are open.
    """

    numbers: NDArray[np.int32]
    runs: NDArray[np.int64]
    total: int


@kernel
def number_cells(is_open: Array, window: Array, numbers: Array) -> Cells:
    """Return the open cells of a grid with its border, numbered, and their runs (kernel).

    Parameters
    ----------
    is_open : (rows + 2, columns + 2) uint8
        The grid with its border; read within the window, and cleared.
    window : (4,) int64
        First and last rows and columns of all that is open, the last exclusive, without the border.
    numbers : (rows + 2, columns + 2) int32
        Written in the window; zeros elsewhere.
    """
    runs, count, number = np.empty((1024, 8), np.int64), 0, 0
    above, last = 0, 0
    for row in range(window[0] + 1, window[1] + 1):
        begin, column = count, window[2] + 1
        while column <= window[3]:
            if not is_open[row, column]:
                numbers[row, column] = 0
                column += 1
                continue
            if count == len(runs):
                longer = np.empty((2 * count, 8), np.int64)
                longer[:count] = runs
                runs = longer
            run, first = runs[count], column
            run[_FIRST], run[_ROW], run[_COLUMN] = number + 1, row, column
            run[_BELOW], run[_BELOW_END] = 0, 0
            while is_open[row, column]:
                number += 1
                numbers[row, column], is_open[row, column] = number, 0
                column += 1
            run[_COUNT] = column - first
            while above < last and runs[above, _COLUMN] + runs[above, _COUNT] < first:
                above += 1
            end = above
            while end < last and runs[end, _COLUMN] <= column:
                if runs[end, _BELOW_END] == 0:
                    runs[end, _BELOW] = count
                runs[end, _BELOW_END] = count + 1
                end += 1
            run[_ABOVE], run[_ABOVE_END] = above, end
            count += 1
        above, last = begin, count
    return Cells(numbers, runs[:count], number)


@kernel
def lengths_from_few(cells: Cells, starts: Array) -> NDArray[np.uint16]:
    """Return the lengths from cells of the grid with its border, (groups, total + 1, FEW_LANES) (kernel).

    Starts count as open, but lengths from other places do not reach one that is not.
    """
    groups = max(-(-len(starts) // FEW_LANES), 1)
    lanes = np.full((groups, cells.total + 1, FEW_LANES), FAR, np.uint16)
    waiting = np.zeros((2, len(cells.runs)), np.uint8)
    for group in range(groups):
        for k in range(group * FEW_LANES, min((group + 1) * FEW_LANES, len(starts))):
            _begin(cells, lanes[group], starts[k], k % FEW_LANES, waiting)
        _sweep_all(cells, lanes[group], waiting, False)
    return lanes


@kernel
def lengths_from_many(cells: Cells, starts: Array, known: Array, hubs: Array) -> NDArray[np.uint16]:
    """Return the lengths from up to LANES cells of the grid with its border, (total + 1, LANES) (kernel).

    Parameters
    ----------
    known : (total + 1, FEW_LANES) uint16
        Lengths from up to FEW_LANES other places, a group of those of ``lengths_from_few``.
    hubs : (n,) int64
        Cells of these places.
    """
    lanes = np.empty((cells.total + 1, LANES), np.uint16)
    waiting = np.zeros((2, len(cells.runs)), np.uint8)
    to_hubs = np.full((len(hubs), LANES), FAR, np.uint16)
    flat = cells.numbers.reshape(-1)
    for h in range(len(hubs)):
        if flat[hubs[h]]:
            for k in range(len(starts)):
                if flat[starts[k]]:
                    to_hubs[h, k] = known[flat[starts[k]], h]
    begin_with_bounds(lanes.ctypes.data, known.ctypes.data, to_hubs.ctypes.data, len(hubs), len(lanes))
    for k in range(len(starts)):
        _begin(cells, lanes, starts[k], k, waiting)
    _sweep_all(cells, lanes, waiting, True)
    return lanes


@kernel
def lengths_between(is_open: Array, starts: Array, ends: Array) -> NDArray[np.uint16]:
    """Return the lengths of paths from each of some cells to each of others, (starts, ends), ``FAR`` for none (kernel).

    Parameters
    ----------
    is_open : (rows + 2, columns + 2) uint8
        The grid with its border; cleared.
    starts, ends : (n,), (m,) int64
        Cells of the grid with its border. All is found faster if the first ends are near many starts.
    """
    window = np.array([0, is_open.shape[0] - 2, 0, is_open.shape[1] - 2])
    cells = number_cells(is_open, window, np.zeros(is_open.shape, np.int32))
    hubs, flat = ends[:FEW_LANES], cells.numbers.reshape(-1)
    known = lengths_from_few(cells, hubs)[0]
    lengths = np.empty((len(starts), len(ends)), np.uint16)
    for begin in range(0, len(starts), LANES):
        group = starts[begin : begin + LANES]
        lanes = lengths_from_many(cells, group, known, hubs)
        for k in range(len(group)):
            for end in range(len(ends)):
                lengths[begin + k, end] = 0 if ends[end] == group[k] else lanes[flat[ends[end]], k]
    return lengths


@kernel(nrt=False)
def _begin(cells: Cells, lanes: Array, start: int, lane: int, waiting: Array) -> None:
    """Let lengths spread from a cell: write those of its neighbours."""
    row, column = start // cells.numbers.shape[1], start % cells.numbers.shape[1]
    is_open = cells.numbers[row, column] > 0
    if is_open:
        lanes[cells.numbers[row, column], lane] = 0
    for i in range(-1, 2):
        for j in range(-1, 2):
            number = cells.numbers[row + i, column + j]
            length = DIAGONAL if i != 0 and j != 0 else STRAIGHT
            if number == 0 or (i == 0 and j == 0):
                continue
            lanes[number, lane] = min(lanes[number, lane], np.uint16(length))
            run = _run_of(cells.runs, number)
            waiting[0, run] = waiting[1, run] = 1
            _let_wait_around(cells.runs, run, waiting)


@kernel(nrt=False)
def _run_of(runs: Array, number: int) -> int:
    """Return the run of a cell."""
    low, high = 0, len(runs)
    while high - low > 1:
        middle = (low + high) // 2
        if runs[middle, _FIRST] <= number:
            low = middle
        else:
            high = middle
    return low


@kernel(nrt=False)
def _let_wait_around(runs: Array, run: int, waiting: Array) -> None:
    """Let the runs below wait for the next sweep down, and those above for the next one up."""
    for other in range(runs[run, _BELOW], runs[run, _BELOW_END]):
        waiting[0, other] = 1
    for other in range(runs[run, _ABOVE], runs[run, _ABOVE_END]):
        waiting[1, other] = 1


@kernel(nrt=False)
def _sweep_all(cells: Cells, lanes: Array, waiting: Array, is_wide: bool) -> None:
    """Sweep down and up until no length changes."""
    runs, columns = cells.runs, cells.numbers.shape[1]
    table, numbers = lanes.ctypes.data, cells.numbers.ctypes.data
    is_done = False
    while not is_done:
        is_done = True
        for way in range(2):
            for r in range(len(runs)):
                k = r if way == 0 else len(runs) - 1 - r
                if not waiting[way, k]:
                    continue
                waiting[way, k], is_done, run = 0, False, runs[k]
                at = numbers + 4 * ((run[_ROW] + 2 * way - 1) * columns + run[_COLUMN] - 1)
                if is_wide:
                    changed = lower_run(table, at, run[_FIRST], run[_COUNT])
                else:
                    changed = lower_run_of_few(table, at, run[_FIRST], run[_COUNT])
                if changed:
                    _let_wait_around(runs, k, waiting)
