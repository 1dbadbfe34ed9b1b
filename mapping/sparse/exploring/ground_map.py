"""A map of the ground: seen, unknown, or taken up by something; its frontiers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.frontiers.frontier_map import Clusters, FrontierMap
from lidarium.mapping.sparse.swept_body import SweptBody

SEEN, UNKNOWN, BLOCKED = -1, 0, 1
"""What is known of a cell; signs are those of log-odds, so that frontiers are found as in any grid."""


@dataclass(frozen=True, eq=False, slots=True)
class GroundMap:
    """What is known of the ground.

    Attributes
    ----------
    levels : (rows, columns) int8
        ``SEEN``, ``UNKNOWN`` or ``BLOCKED``; row 0 has the lowest y.
    origin : (x, y)
        Lower left corner [m].
    cell_m : float
        Side of a cell [m].
    """

    levels: NDArray[np.int8]
    origin: tuple[float, float]
    cell_m: float

    @property
    def frame(self) -> NDArray[np.float64]:
        """The lower left corner and the side of a cell [m], shape (3,), for kernels."""
        return np.array([*self.origin, self.cell_m])

    @property
    def seen_m2(self) -> float:
        """Area of the ground that was seen [m2]."""
        return float(np.count_nonzero(self.levels == SEEN) * self.cell_m**2)

    def frontiers(self, least_m: float) -> Clusters:
        """Return where seen ground borders on unknown cells, in connected groups of at least a length [m]."""
        shape = (self.levels.shape[0], self.levels.shape[1])
        frontiers = FrontierMap(shape, self.cell_m)
        frontiers.update(self.levels)
        return frontiers.clusters(self.origin, max(round(least_m / self.cell_m), 1))

    def centres(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the centres x, y of cells (N, 2) by row and column [m], (N, 2)."""
        return np.asarray((cells[:, ::-1] + 0.5) * self.cell_m + self.origin)

    def cells_of(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the cells (row, column) of points x, y (N, 2) [m], which may lie outside of the map."""
        return np.floor((points - self.origin) / self.cell_m).astype(np.int64)[:, ::-1]

    def are_unknown(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points x, y (N, 2) [m] lie on unknown ground, (N,) bool; those outside do."""
        cells = self.cells_of(points)
        is_inside = ((cells >= 0) & (cells < self.levels.shape)).all(axis=1)
        rows, columns = cells[is_inside].T
        found = np.ones(len(cells), np.bool_)
        found[is_inside] = self.levels[rows, columns] == UNKNOWN
        return found


def ground_map(
    cells: NDArray[np.bool_],
    origin: tuple[float, float],
    cell_m: float,
    boxes: NDArray[np.float64],
    body: SweptBody,
) -> GroundMap:
    """Return the map of seen ground and of what stands on it.

    Parameters
    ----------
    cells : (rows, columns) bool
        Which cells were seen.
    origin : (x, y)
        Lower left corner of the first cell [m].
    cell_m : float
        Side of a cell [m].
    boxes : (M, 2, 3) float64
        Low and high corners of what stands there [m]; what a body passes below takes up no cell.
    body : SweptBody
        The body.
    """
    levels = np.where(cells, SEEN, UNKNOWN).astype(np.int8)
    flat = np.ascontiguousarray(boxes.reshape(-1, 6))
    _block(levels, np.array([*origin, cell_m]), flat, body.numbers)
    return GroundMap(levels, origin, cell_m)


@kernel
def _block(levels: Array, frame: Array, boxes: Array, body: Array) -> None:
    """Mark the cells over which boxes (M, 6) stand in the way of a body (3,)."""
    rows, columns, cell = levels.shape[0], levels.shape[1], frame[2]
    for box in boxes:
        if box[2] >= body[2] or box[5] <= body[1]:
            continue
        first_row, last_row = (box[1] - frame[1]) // cell, (box[4] - frame[1]) // cell
        first_column, last_column = (box[0] - frame[0]) // cell, (box[3] - frame[0]) // cell
        for row in range(int(max(first_row, 0.0)), int(min(last_row, rows - 1.0)) + 1):
            for column in range(int(max(first_column, 0.0)), int(min(last_column, columns - 1.0)) + 1):
                levels[row, column] = BLOCKED
