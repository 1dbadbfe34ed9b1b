"""Frontiers: where what is known to be free meets what is unknown.

A frontier cell is a known free cell with an unknown 4-neighbour inside the grid (Yamauchi, A frontier-based
approach for autonomous exploration, CIRA 1997). The flags are kept up to date window by window, with counts
per tile, so that listing them, clustering them and searching the nearest never pass over the whole map.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.planning.clearance import full_window
from lidarium.mapping.planning.clearance_updates import Window
from lidarium.mapping.planning.frontier_kernels import (
    FRONTIER,
    IGNORED,
    TILE,
    centres,
    frontier_clusters,
    ignore_frontiers_near,
    listed,
    update_frontiers,
)
from lidarium.mapping.planning.grid_planning import centres_of
from lidarium.mapping.planning.search.search_targets import Targets, disc_spans, near_tiles


@dataclass(frozen=True, slots=True)
class Clusters:
    """8-connected groups of frontier cells.

    Ordered by their first cell in the order of rows and columns.

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
        """Cells (M, 2) of cluster k."""
        return self.cells[self.starts[k] : self.starts[k + 1]]

    def without(self, left_out: NDArray[np.bool_], minimum_cells: int = 1) -> "Clusters":
        """Return the clusters without some cells of the map, (rows, columns) bool.

        Clusters of which fewer cells are left are dropped.
        """
        is_kept = ~left_out[self.cells[:, 0], self.cells[:, 1]]
        counts = np.diff(np.concatenate([[0], np.cumsum(is_kept)])[self.starts])
        is_large = counts >= max(minimum_cells, 1)
        cells = self.cells[is_kept & np.repeat(is_large, self.counts)]
        resolution = self.sizes[is_large] / np.maximum(self.counts[is_large], 1)
        return Clusters(
            cells,
            np.concatenate([[0], np.cumsum(counts[is_large])]).astype(np.int64),
            self.centroids[is_large],
            self.representatives[is_large],
            counts[is_large] * resolution,
        )


class FrontierMap:
    """Frontier cells kept beside a belief.

    Attributes
    ----------
    flags : (rows, columns) uint8
        1 in frontier cells, 2 in those to be ignored, else 0.
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
        """Recompute the flags around a window of the belief that changed.

        (row_low, row_high, column_low, column_high), all by default.

        Raises
        ------
        ValueError
            If the belief's shape is not that of the map.
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
        """Frontier cells (N, 2), by row and column, without those ignored."""
        return np.asarray(listed(self.flags, self.tiles, len(self)))

    def ignore(self, cells: NDArray[np.integer]) -> None:
        """Ignore cells (N, 2) for as long as they stay frontier cells.

        Such as those of a cluster that cannot be reached.
        """
        chosen = np.asarray(cells, dtype=np.int64).reshape(-1, 2)
        chosen = np.unique(chosen[self.flags[chosen[:, 0], chosen[:, 1]] == FRONTIER], axis=0)
        self.flags[chosen[:, 0], chosen[:, 1]] = IGNORED
        np.subtract.at(self.tiles, (chosen[:, 0] // TILE, chosen[:, 1] // TILE), 1)

    def ignore_near(self, cell: tuple[int, int], reach: float) -> int:
        """Ignore the frontier cells within ``reach`` [m] of a cell, itself included.

        Return how many.
        """
        return int(
            ignore_frontiers_near(self.flags, self.tiles, int(cell[0]), int(cell[1]), reach / self.resolution)
        )

    def add(self, cells: NDArray[np.integer]) -> None:
        """Flag distinct cells (N, 2) that are not flagged yet.

        For a map that holds a choice of another's frontier cells.
        """
        self.flags[cells[:, 0], cells[:, 1]] = FRONTIER
        np.add.at(self.tiles, (cells[:, 0] // TILE, cells[:, 1] // TILE), 1)

    def remove(self, cells: NDArray[np.integer]) -> None:
        """Take back what ``add`` flagged."""
        self.flags[cells[:, 0], cells[:, 1]] = 0
        np.subtract.at(self.tiles, (cells[:, 0] // TILE, cells[:, 1] // TILE), 1)

    def clusters(self, origin: tuple[float, float] = (0.0, 0.0), minimum_cells: int = 1) -> Clusters:
        """8-connected clusters of at least ``minimum_cells`` cells.

        ``origin`` is the lower left corner of the grid [m].
        """
        cells, starts = frontier_clusters(self.flags, self.tiles, minimum_cells)
        means, representatives = centres(cells, starts)
        return Clusters(
            cells,
            starts,
            centres_of(means, origin, self.resolution),
            representatives,
            np.diff(starts) * self.resolution,
        )

    def targets(self, reach: float) -> Targets:
        """Frontier cells as the targets of a search, from up to ``reach`` [m] away."""
        cells = reach / self.resolution
        return Targets(self.flags, near_tiles(self.tiles, cells), disc_spans(cells))
