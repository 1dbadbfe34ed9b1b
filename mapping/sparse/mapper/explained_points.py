"""Points that a map has already: they need no codes."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.swept_body import BoxIndex, index_boxes


def are_covered(points: NDArray[np.float64], boxes: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points (N, 3) [m] lie in one of the boxes (M, 2, 3) [m], (N,) bool."""
    if len(boxes) == 0:
        return np.zeros(len(points), np.bool_)
    return np.asarray(_are_covered(index_boxes(boxes), np.ascontiguousarray(points)))


@kernel
def _are_covered(index: BoxIndex, points: Array) -> Array:
    found = np.zeros(points.shape[0], np.bool_)
    rows, columns, cell = index.shape[0], index.shape[1], index.cell[0]
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        column = math.floor((x - index.origin[0]) / cell)
        row = math.floor((y - index.origin[1]) / cell)
        if column < 0 or row < 0 or column > columns or row > rows:
            continue
        # A point on the upper border of the grid belongs to its last column.
        place = int(min(row, rows - 1) * columns + min(column, columns - 1))
        for member in range(index.starts[place], index.starts[place + 1]):
            box = index.boxes[index.members[member]]
            if box[0] <= x <= box[3] and box[1] <= y <= box[4] and box[2] <= z <= box[5]:
                found[k] = True
                break
    return found


def are_near(points: NDArray[np.float64], nodes: NDArray[np.float64], distance: float) -> NDArray[np.bool_]:
    """Return which points (N, 3) are near [m] to one of nodes (M, 3), (N,) bool."""
    if len(nodes) == 0 or len(points) == 0:
        return np.zeros(len(points), np.bool_)
    gaps = cKDTree(nodes).query(points, distance_upper_bound=distance)[0]
    return np.asarray(gaps <= distance)
