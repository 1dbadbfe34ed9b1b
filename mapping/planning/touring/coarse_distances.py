"""Lengths of paths over a grid of coarse cells.

An order of visits needs many lengths of paths, none of them to the centimetre. A coarse cell is open if a
body may stand anywhere in it; lengths are those over open cells, straight and diagonal.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.clearance import ClearanceField, limit_of

STRAIGHT, DIAGONAL = 5, 7
"""Lengths of the steps to the neighbours of a cell, in fifths of its side."""

NEAR_START = 0.2
"""Bodies start from the nearest cells in which they fit, up to this distance [m]."""

_BUCKETS = DIAGONAL + 1

UNREACHED = np.iinfo(np.int32).max


class CoarseGrid(NamedTuple):
    """Coarse cells in which a body may stand.

    Attributes
    ----------
    is_open : (rows, columns) bool
        Whether it may stand anywhere in the cell.
    factor : int
        Side of a coarse cell [cells of the map].
    row, column : int
        The map's cell at which coarse cell (0, 0) begins.
    side : float
        Side of a coarse cell [m].
    max_closeness : int
        Maximum closeness of a cell of the map in which the body may stand.
    """

    is_open: NDArray[np.bool_]
    factor: int
    row: int
    column: int
    side: float
    max_closeness: int

    def cell_of(self, cell: tuple[int, int]) -> tuple[int, int]:
        """Return the coarse cell of a cell of the map, or the nearest one beyond the grid."""
        rows, columns = self.is_open.shape
        row, column = (int(cell[0]) - self.row) // self.factor, (int(cell[1]) - self.column) // self.factor
        return min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)


def coarse_grid(
    log_odds: NDArray[np.int8],
    clearance: ClearanceField,
    radius: float,
    side: float = 0.1,
    starts: NDArray[np.int64] | None = None,
) -> CoarseGrid:
    """Return the coarse cells in which a body of a radius may stand on a map.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map: < 0 free.
    radius : float
        Radius of the body [m].
    side : float
        Side of a coarse cell [m], rounded to whole cells. As bodies keep their radius from both sides of a
        wall, coarse cells of less than half a body's width never join the two sides of a wall.
    starts : (n, 2) int64, optional
        The map's cells (row, column) from which bodies start: cells that are not connected to any of them on
        the map are excluded. Coarse cells may connect them if a gap is too narrow by less than their side.
    """
    factor = max(round(side / clearance.resolution), 1)
    max_closeness = clearance.limit - limit_of(radius, clearance.resolution)
    fits = (log_odds < 0) & (clearance.closeness <= max_closeness)
    if starts is not None:
        reach = math.ceil(NEAR_START / clearance.resolution)
        fits = _joined(log_odds, clearance.closeness, max_closeness, np.asarray(starts, np.int64), reach, fits)
    is_open, row, column = _opened(log_odds, fits, factor)
    return CoarseGrid(is_open, factor, int(row), int(column), factor * clearance.resolution, max_closeness)


def place_in(
    grid: CoarseGrid, log_odds: NDArray[np.int8], clearance: ClearanceField, cell: tuple[int, int]
) -> tuple[int, int]:
    """Return the map's cell (row, column) with maximum clearance in an open coarse cell.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map: < 0 free.
    cell : (row, column)
        The coarse cell.
    """
    row, column = grid.row + cell[0] * grid.factor, grid.column + cell[1] * grid.factor
    part = np.s_[row : row + grid.factor, column : column + grid.factor]
    closeness = np.where(log_odds[part] < 0, clearance.closeness[part].astype(np.int64), 1 << 20)
    best = np.unravel_index(int(np.argmin(closeness)), closeness.shape)
    return row + int(best[0]), column + int(best[1])


def distances_from(grid: CoarseGrid, starts: NDArray[np.int64], maximum: float = math.inf) -> NDArray[np.int32]:
    """Return the lengths of the shortest paths from each of some coarse cells to all.

    Parameters
    ----------
    starts : (n, 2) int64
        Coarse cells (row, column); they count as open.
    maximum : float
        Maximum length of a path [m].

    Returns
    -------
    (n, rows, columns) int32
        Lengths in fifths of the side of a coarse cell; ``UNREACHED`` if there is no path.
    """
    max_length = UNREACHED - _BUCKETS if math.isinf(maximum) else int(maximum / grid.side * STRAIGHT)
    lengths = np.empty((len(starts), *grid.is_open.shape), np.int32)
    nowhere = np.zeros((0, 2), np.int64)
    _spread(grid.is_open, np.ascontiguousarray(starts, np.int64), nowhere, False, max_length, lengths)
    return lengths


def distances_among(
    grid: CoarseGrid, places: NDArray[np.int64], others: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the lengths of the shortest paths among places, and from each around other cells.

    Parameters
    ----------
    places : (n, 2) int64
        Open coarse cells (row, column).
    others : (m, 2) int64
        Coarse cells.

    Returns
    -------
    (n, n) int32
        Lengths between places, as in ``distances_from``.
    (n, rows, columns) int32
        Lengths from each place, if they are no longer than those to ``others``; else they may be
        ``UNREACHED``.
    """
    lengths = np.empty((len(places), *grid.is_open.shape), np.int32)
    places, others = np.ascontiguousarray(places, np.int64), np.ascontiguousarray(others, np.int64)
    _spread(grid.is_open, places, others, True, UNREACHED - _BUCKETS, lengths)
    between = lengths[:, places[:, 0], places[:, 1]]
    upper = np.triu(between)
    return upper + np.triu(between, 1).T, lengths


@kernel
def _joined(
    log_odds: Array, closeness: Array, max_closeness: int, starts: Array, reach: int, fits: Array
) -> NDArray[np.bool_]:
    """Return the cells joined to those that fit within ``reach`` cells of a start, all if none fits there.

    Diagonal steps keep the body's clearance, as those of the path planner in ``grid_search`` do.
    """
    rows, columns = fits.shape
    is_joined = np.zeros(fits.shape, np.bool_)
    queue = np.empty((fits.sum(), 2), np.int32)
    count = 0
    for k in range(len(starts)):
        for row in range(max(starts[k, 0] - reach, 0), min(starts[k, 0] + reach + 1, rows)):
            for column in range(max(starts[k, 1] - reach, 0), min(starts[k, 1] + reach + 1, columns)):
                if fits[row, column] and not is_joined[row, column]:
                    is_joined[row, column] = True
                    queue[count, 0], queue[count, 1] = row, column
                    count += 1
    if count == 0:
        return np.asarray(fits)
    head = 0
    while head < count:
        row, column = queue[head]
        head += 1
        for other in range(max(row - 1, 0), min(row + 2, rows)):
            for another in range(max(column - 1, 0), min(column + 2, columns)):
                if not fits[other, another] or is_joined[other, another]:
                    continue
                if other != row and another != column:
                    if max(closeness[row, column], closeness[other, another]) <= max_closeness - 2:
                        if log_odds[row, another] >= 0 and log_odds[other, column] >= 0:
                            continue
                    elif not (fits[row, another] and fits[other, column]):
                        continue
                is_joined[other, another] = True
                queue[count, 0], queue[count, 1] = other, another
                count += 1
    return is_joined


@kernel
def _opened(log_odds: Array, fits: Array, factor: int) -> tuple[NDArray[np.bool_], int, int]:
    """Return the open coarse cells, cropped to the known area, and its first row and column."""
    rows, columns = log_odds.shape
    row_low, row_high, column_low, column_high = rows, 0, columns, 0
    for row in range(rows):
        first = -1
        last = -1
        for column in range(columns):
            if log_odds[row, column] < 0:
                if first < 0:
                    first = column
                last = column
        if first >= 0:
            row_low, row_high = min(row_low, row), row + 1
            column_low, column_high = min(column_low, first), max(column_high, last + 1)
    if row_high == 0:
        return np.zeros((1, 1), np.bool_), 0, 0
    row_low, column_low = row_low // factor * factor, column_low // factor * factor
    shape = (-(-(row_high - row_low) // factor), -(-(column_high - column_low) // factor))
    is_open = np.zeros(shape, np.bool_)
    for row in range(row_low, row_high):
        opened = is_open[(row - row_low) // factor]
        for column in range(column_low, column_high):
            if fits[row, column]:
                opened[(column - column_low) // factor] = True
    return is_open, row_low, column_low


@kernel
def _spread(is_open: Array, starts: Array, others: Array, is_among: bool, max_length: int, lengths: Array) -> None:
    """Spread lengths from each start over open cells.

    If ``is_among``, it ends when all cells up to the length of the farthest target are reached. Targets are the
    others and the starts that follow: paths have the same length in both directions.
    """
    rows, columns = is_open.shape
    # The border and closed cells have length -1, so that no path is shorter.
    width = columns + 2
    fresh = np.full((rows + 2, width), -1, np.int32)
    for row in range(rows):
        for column in range(columns):
            if is_open[row, column]:
                fresh[row + 1, column + 1] = UNREACHED
    queues = np.empty((_BUCKETS, rows * columns), np.int32)
    is_target = np.zeros(fresh.size, np.bool_)
    for k in range(len(starts)):
        spread = fresh.copy().reshape(-1)
        wanted = 0
        if is_among:
            is_target[:] = False
            for row, column in others:
                is_target[(row + 1) * width + column + 1] = True
            for row, column in starts[k + 1 :]:
                is_target[(row + 1) * width + column + 1] = True
            wanted = is_target.sum()
        _spread_from(
            (starts[k, 0] + 1) * width + starts[k, 1] + 1,
            width,
            is_target,
            wanted,
            max_length,
            queues,
            spread,
        )
        for row in range(rows):
            for column in range(columns):
                length = spread[(row + 1) * width + column + 1]
                lengths[k, row, column] = length if length >= 0 else UNREACHED


@kernel
def _spread_from(
    start: int, width: int, is_target: Array, wanted: int, max_length: int, queues: Array, spread: Array
) -> None:
    """Spread lengths from a cell, one length after the other.

    If targets are wanted, it ends when all cells up to the length of the farthest one are reached.
    """
    steps = np.array([1, width, -1, -width, width + 1, width - 1, 1 - width, -1 - width])
    # A bucket holds cells of one length, and none of them twice.
    counts = np.zeros(_BUCKETS, np.int64)
    spread[start] = 0
    queues[0, 0] = start
    counts[0] = 1
    length, empty, found = 0, 0, 0
    while empty < _BUCKETS and length <= max_length and (wanted == 0 or found < wanted):
        bucket = length % _BUCKETS
        count = counts[bucket]
        counts[bucket] = 0
        empty = empty + 1 if count == 0 else 0
        straight, diagonal = (length + STRAIGHT) % _BUCKETS, (length + DIAGONAL) % _BUCKETS
        for i in range(count):
            cell = queues[bucket, i]
            if spread[cell] != length:
                continue
            if wanted > 0 and is_target[cell]:
                found += 1
            for k in range(8):
                other = cell + steps[k]
                further = length + (STRAIGHT if k < 4 else DIAGONAL)
                if further < spread[other]:
                    spread[other] = further
                    target = straight if k < 4 else diagonal
                    queues[target, counts[target]] = other
                    counts[target] += 1
        length += 1
