"""Frontiers: the border between known free and unknown cells.

A frontier cell is a known free cell with an unknown 4-neighbour inside the grid (Yamauchi, A frontier-based
approach for autonomous exploration, CIRA 1997). The flags are updated window by window, with counts per
tile, so that listing them, clustering them and searching the nearest never pass over the whole map.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.clearance import Window, full_window, grown_window
from lidarium.mapping.planning.grid_planning import centres_of
from lidarium.mapping.planning.search.search_state import TILE_SHIFT, Targets, disc_spans, near_tiles

FRONTIER = 1


IGNORED = 2


VISITED = 4


FRONTIER_MARK = np.uint8(FRONTIER)  # typed, so that whole rows are marked at once


IGNORED_MARK = np.uint8(IGNORED)


TILE = 1 << TILE_SHIFT


@kernel(nrt=False)
def update_frontiers(log_odds: Array, flags: Array, tiles: Array, window: Window) -> None:
    """Recompute the flags in and next to a changed window, and the counts of its tiles (kernel).

    See ``FrontierMap``.
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
            marks[i] = np.uint8(0) if not is_frontier else IGNORED_MARK if marks[i] == IGNORED_MARK else FRONTIER_MARK
    for tile_row in range(row_low >> TILE_SHIFT, ((row_high - 1) >> TILE_SHIFT) + 1):
        for tile_column in range(column_low >> TILE_SHIFT, ((column_high - 1) >> TILE_SHIFT) + 1):
            count = 0
            for row in range(tile_row * TILE, min((tile_row + 1) * TILE, rows)):
                marks = flags[row, tile_column * TILE : min((tile_column + 1) * TILE, columns)]
                for i in range(marks.size):
                    count += marks[i] == FRONTIER
            tiles[tile_row, tile_column] = count


@kernel(nrt=False)
def ignore_frontiers_near(flags: Array, tiles: Array, row: int, column: int, reach: float) -> int:
    """Ignore the frontier cells within ``reach`` cells of a cell, itself included (kernel).

    Returns their number.
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
    """Return 8-connected clusters of at least ``minimum`` frontier cells, and their starts (kernel).

    The starts index the first cell of each cluster.
    """
    cells, starts = _clustered(flags, _listed(flags, tiles, tiles.sum()), minimum)
    return cells, starts


@kernel
def _listed(flags: NDArray[np.uint8], tiles: NDArray[np.int32], total: int) -> NDArray[np.int64]:
    """Return the frontier cells by row and column, from the tiles that have some."""
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
    """Flood each cluster from its first cell, with flags as marks of visited cells."""
    rows, columns = flags.shape
    ordered = np.empty_like(cells)
    starts = np.zeros(len(cells) + 1, np.int64)
    clusters = 0
    count = 0
    for i in range(len(cells)):
        if flags[cells[i, 0], cells[i, 1]] != FRONTIER:
            continue
        first = count
        ordered[count, 0], ordered[count, 1] = cells[i, 0], cells[i, 1]
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
def _centres(cells: NDArray[np.int64], starts: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the mean cell of each cluster, and its cell nearest to that.

    Ties go to the lowest row and column.
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


@dataclass(frozen=True, slots=True)
class Clusters:
    """8-connected groups of frontier cells, ordered by their first cell in the order of rows and columns.

    Attributes
    ----------
    cells : (N, 2) int64
        Cells (row, column), cluster after cluster.
    starts : (K + 1,) int64
        Cluster k has ``cells[starts[k]:starts[k + 1]]``.
    centroids : (K, 2) float64
        Mean x, y of the cells [m].
    representatives : (K, 2) int64
        The cell (row, column) of each cluster that is nearest to its centroid.
    sizes : (K,) float64
        Number of cells times the side of a cell [m].
    """

    cells: NDArray[np.int64]
    starts: NDArray[np.int64]
    centroids: NDArray[np.float64]
    representatives: NDArray[np.int64]
    sizes: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.starts) - 1

    @property
    def counts(self) -> NDArray[np.int64]:
        """Number of cells of each cluster, (K,)."""
        return np.diff(self.starts)

    def of(self, k: int) -> NDArray[np.int64]:
        """Return the cells (M, 2) of cluster k."""
        return self.cells[self.starts[k] : self.starts[k + 1]]

    def without(self, left_out: NDArray[np.bool_], minimum_cells: int = 1) -> "Clusters":
        """Return the clusters without some cells of the map, (rows, columns) bool.

        Clusters with fewer remaining cells than ``minimum_cells`` are dropped.
        """
        is_kept = ~left_out[self.cells[:, 0], self.cells[:, 1]]
        counts = np.diff(np.concatenate([[0], np.cumsum(is_kept)])[self.starts])
        is_large = counts >= max(minimum_cells, 1)
        cells = self.cells[is_kept & np.repeat(is_large, self.counts)]
        starts = np.concatenate([[0], np.cumsum(counts[is_large])]).astype(np.int64)
        resolution = self.sizes[is_large] / np.maximum(self.counts[is_large], 1)
        (before, _), (means, representatives) = _centres(self.cells, self.starts), _centres(cells, starts)
        moved = (means - before[is_large])[:, ::-1] * resolution[:, None]
        return Clusters(cells, starts, self.centroids[is_large] + moved, representatives, counts[is_large] * resolution)


class FrontierMap:
    """Frontier cells kept next to a belief.

    Attributes
    ----------
    flags : (rows, columns) uint8
        1 in frontier cells, 2 in ignored ones, else 0.
    tiles : (ceil(rows / 16), ceil(columns / 16)) int32
        Number of frontier cells, ignored ones excluded, in each tile of 16 x 16 cells.
    """

    def __init__(self, shape: tuple[int, int], resolution: float) -> None:
        if not resolution > 0.0:
            raise ValueError(f"resolution is {resolution} m; want a positive side of a cell")
        self.resolution = float(resolution)
        self.flags: NDArray[np.uint8] = np.zeros(shape, dtype=np.uint8)
        self.tiles: NDArray[np.int32] = np.zeros(tuple(-(-side // TILE) for side in shape), dtype=np.int32)

    def update(self, log_odds: NDArray[np.int8], window: Window | None = None) -> None:
        """Recompute the flags around a window of the belief that changed, by default everywhere.

        The window is (row_low, row_high, column_low, column_high). Raises ValueError if the belief's shape is not
        that of the map.
        """
        if log_odds.shape != self.flags.shape:
            raise ValueError(f"log_odds has shape {log_odds.shape}; this map was made for {self.flags.shape}")
        row_low, row_high, column_low, column_high = full_window(log_odds.shape) if window is None else window
        update_frontiers(
            log_odds, self.flags, self.tiles, (int(row_low), int(row_high), int(column_low), int(column_high))
        )

    def __len__(self) -> int:
        return int(self.tiles.sum())

    def cells(self) -> NDArray[np.int64]:
        """Return the frontier cells (N, 2), by row and column, without ignored ones."""
        return np.asarray(_listed(self.flags, self.tiles, len(self)))

    def ignore(self, cells: NDArray[np.integer]) -> None:
        """Ignore cells (N, 2) for as long as they stay frontier cells, such as an unreachable cluster."""
        chosen = np.asarray(cells, dtype=np.int64).reshape(-1, 2)
        chosen = np.unique(chosen[self.flags[chosen[:, 0], chosen[:, 1]] == FRONTIER], axis=0)
        self.flags[chosen[:, 0], chosen[:, 1]] = IGNORED
        np.subtract.at(self.tiles, (chosen[:, 0] // TILE, chosen[:, 1] // TILE), 1)

    def ignore_near(self, cell: tuple[int, int], reach: float) -> int:
        """Ignore the frontier cells within ``reach`` [m] of a cell, itself included; return their number."""
        return int(ignore_frontiers_near(self.flags, self.tiles, int(cell[0]), int(cell[1]), reach / self.resolution))

    def add(self, cells: NDArray[np.integer]) -> None:
        """Flag distinct cells (N, 2) that are not flagged yet, in a map with a selection of cells."""
        self.flags[cells[:, 0], cells[:, 1]] = FRONTIER
        np.add.at(self.tiles, (cells[:, 0] // TILE, cells[:, 1] // TILE), 1)

    def remove(self, cells: NDArray[np.integer]) -> None:
        """Remove the flags that ``add`` set."""
        self.flags[cells[:, 0], cells[:, 1]] = 0
        np.subtract.at(self.tiles, (cells[:, 0] // TILE, cells[:, 1] // TILE), 1)

    def clusters(self, origin: tuple[float, float] = (0.0, 0.0), minimum_cells: int = 1) -> Clusters:
        """Return the 8-connected clusters of at least ``minimum_cells`` cells.

        ``origin`` is the lower left corner of the grid [m].
        """
        cells, starts = frontier_clusters(self.flags, self.tiles, minimum_cells)
        means, representatives = _centres(cells, starts)
        return Clusters(
            cells,
            starts,
            centres_of(means, origin, self.resolution),
            representatives,
            np.diff(starts) * self.resolution,
        )

    def targets(self, reach: float) -> Targets:
        """Return the frontier cells as the targets of a search, from up to ``reach`` [m] away."""
        cells = reach / self.resolution
        return Targets(self.flags, near_tiles(self.tiles, cells), disc_spans(cells))
