"""Kernels that mark frontier cells, then join them into clusters."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.clearance_updates import Window, grown_window
from lidarium.mapping.planning.search.search_state import TILE_SHIFT

FRONTIER = 1


IGNORED = 2


VISITED = 4


FRONTIER_MARK = np.uint8(FRONTIER)  # typed, so that whole rows are marked at once


IGNORED_MARK = np.uint8(IGNORED)


TILE = 1 << TILE_SHIFT


@kernel
def update_frontiers(log_odds: Array, flags: Array, tiles: Array, window: Window) -> None:
    """Recompute the flags in and beside a changed window (kernel).

    The counts of its tiles are recomputed too; see ``FrontierMap``.
    """
    rows, columns = log_odds.shape
    row_low, row_high, column_low, column_high = grown_window(window, 1, log_odds.shape)
    for row in range(row_low, row_high):
        here = log_odds[row, column_low:column_high]
        below = log_odds[max(row - 1, 0), column_low:column_high]
        above = log_odds[min(row + 1, rows - 1), column_low:column_high]
        marks = flags[row, column_low:column_high]
        width = here.size
        for i in range(width):
            beside = False
            if i > 0:
                beside |= here[i - 1] == 0
            elif column_low > 0:
                beside |= log_odds[row, column_low - 1] == 0
            if i < width - 1:
                beside |= here[i + 1] == 0
            elif column_high < columns:
                beside |= log_odds[row, column_high] == 0
            is_frontier = (here[i] < 0) & (beside | (below[i] == 0) | (above[i] == 0))
            marks[i] = (
                np.uint8(0)
                if not is_frontier
                else IGNORED_MARK
                if marks[i] == IGNORED_MARK
                else FRONTIER_MARK
            )
    for tile_row in range(row_low >> TILE_SHIFT, ((row_high - 1) >> TILE_SHIFT) + 1):
        for tile_column in range(column_low >> TILE_SHIFT, ((column_high - 1) >> TILE_SHIFT) + 1):
            count = 0
            for row in range(tile_row * TILE, min((tile_row + 1) * TILE, rows)):
                marks = flags[row, tile_column * TILE : min((tile_column + 1) * TILE, columns)]
                for i in range(marks.size):
                    count += marks[i] == FRONTIER
            tiles[tile_row, tile_column] = count


@kernel
def ignore_frontiers_near(flags: Array, tiles: Array, row: int, column: int, reach: float) -> int:
    """Ignore the frontier cells within ``reach`` cells of a cell, itself included.

    Return how many (kernel).
    """
    rows, columns = flags.shape
    margin = math.ceil(reach)
    count = 0
    for other in range(max(row - margin, 0), min(row + margin + 1, rows)):
        for another in range(max(column - margin, 0), min(column + margin + 1, columns)):
            if flags[other, another] == FRONTIER and math.hypot(other - row, another - column) <= reach:
                flags[other, another] = IGNORED_MARK
                tiles[other >> TILE_SHIFT, another >> TILE_SHIFT] -= 1
                count += 1
    return count


@kernel
def frontier_clusters(flags: Array, tiles: Array, minimum: int) -> tuple[Array, Array]:
    """Return 8-connected clusters of frontier cells and their starts (kernel).

    Each has at least ``minimum`` cells. The starts index the first cell of each cluster.
    """
    cells, starts = _clustered(flags, listed(flags, tiles, tiles.sum()), minimum)
    return cells, starts


@kernel
def listed(flags: NDArray[np.uint8], tiles: NDArray[np.int32], total: int) -> NDArray[np.int64]:
    """Frontier cells by row and column, from the tiles that have some."""
    cells = np.empty((total, 2), np.int64)
    columns = flags.shape[1]
    filled = np.empty(tiles.shape[1], np.int64)
    count = 0
    for tile_row in range(tiles.shape[0]):
        filled_count = 0
        for tile_column in range(tiles.shape[1]):
            if tiles[tile_row, tile_column] > 0:
                filled[filled_count] = tile_column
                filled_count += 1
        if filled_count == 0:
            continue
        for row in range(tile_row * TILE, min((tile_row + 1) * TILE, flags.shape[0])):
            for k in range(filled_count):
                for column in range(filled[k] * TILE, min((filled[k] + 1) * TILE, columns)):
                    if flags[row, column] == FRONTIER:
                        cells[count, 0] = row
                        cells[count, 1] = column
                        count += 1
    return cells


@kernel
def _clustered(
    flags: NDArray[np.uint8], cells: NDArray[np.int64], minimum: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Flood each cluster from its first cell.

    Flags serve as marks of what was visited.
    """
    rows, columns = flags.shape
    ordered = np.empty_like(cells)
    starts = np.zeros(len(cells) + 1, np.int64)
    clusters = 0
    count = 0
    for i in range(len(cells)):
        if flags[cells[i, 0], cells[i, 1]] != FRONTIER:
            continue
        first = count
        ordered[count] = cells[i]
        flags[cells[i, 0], cells[i, 1]] = VISITED
        count += 1
        head = first
        while head < count:
            row = ordered[head, 0]
            column = ordered[head, 1]
            head += 1
            for other in range(max(row - 1, 0), min(row + 2, rows)):
                for another in range(max(column - 1, 0), min(column + 2, columns)):
                    if flags[other, another] == FRONTIER:
                        flags[other, another] = VISITED
                        ordered[count, 0] = other
                        ordered[count, 1] = another
                        count += 1
        if count - first < minimum:
            count = first
        else:
            clusters += 1
            starts[clusters] = count
    for i in range(len(cells)):
        flags[cells[i, 0], cells[i, 1]] = FRONTIER
    return ordered[:count].copy(), starts[: clusters + 1].copy()


@kernel
def centres(
    cells: NDArray[np.int64], starts: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Mean cell of each cluster, and its cell nearest to that.

    Of equals the lowest row and column.
    """
    count = len(starts) - 1
    means = np.zeros((count, 2))
    nearest = np.zeros((count, 2), np.int64)
    for k in range(count):
        number = starts[k + 1] - starts[k]
        row_sum = 0
        column_sum = 0
        for i in range(starts[k], starts[k + 1]):
            row_sum += cells[i, 0]
            column_sum += cells[i, 1]
        means[k, 0] = row_sum / number
        means[k, 1] = column_sum / number
        best = np.inf
        for i in range(starts[k], starts[k + 1]):
            row, column = cells[i]
            distance = float(
                (row * number - row_sum) ** 2 + (column * number - column_sum) ** 2
            )  # whole numbers: ties are exact
            if distance < best or (distance == best and (row, column) < (nearest[k, 0], nearest[k, 1])):
                best = distance
                nearest[k, 0] = row
                nearest[k, 1] = column
    return means, nearest
