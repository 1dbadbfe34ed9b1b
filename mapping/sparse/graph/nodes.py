"""Nodes of the graph: free codes, reduced and pruned.

References
----------
Sparse mapper, sections 5.1 and 5.2, corrected: the count begins at one, and the seed's distance decides.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.swept_body import BoxIndex, SweptBody, is_free


def reduced_nodes(nodes: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """Merge free nodes that lie close together.

    In their order, each node that is left takes all that are nearer to it than the radius; their mean stands
    for them.

    Parameters
    ----------
    nodes : (N, 3) float64
        Free codes [m].
    radius : float
        Within which nodes are merged [m]; 0 merges none.

    Returns
    -------
    (M, 3) float64
        The nodes [m].
    """
    points = np.ascontiguousarray(nodes, np.float64).reshape(-1, 3)
    if radius <= 0.0 or len(points) < 2:
        return points.copy()
    order = np.lexsort(np.floor(points[:, :2] / radius).astype(np.int64).T)
    return np.asarray(_reduce(points, radius, order))


@kernel
def _reduce(points: Array, radius: float, order: Array) -> Array:
    """Return the means of nodes; ``order`` sorts the nodes by row and column of a grid of cells."""
    count = points.shape[0]
    columns, rows = np.empty(count, np.int64), np.empty(count, np.int64)
    for k in range(count):
        columns[k] = int(np.floor(points[order[k], 0] / radius))
        rows[k] = int(np.floor(points[order[k], 1] / radius))
    taken = np.zeros(count, np.bool_)
    means, found = np.empty((count, 3)), 0
    for seed in range(count):
        if taken[seed]:
            continue
        column, row = int(np.floor(points[seed, 0] / radius)), int(np.floor(points[seed, 1] / radius))
        total, number = np.zeros(3), 0
        for beside in range(-1, 2):
            place = _first_at(rows, columns, row + beside, column - 1)
            while place < count and rows[place] == row + beside and columns[place] <= column + 1:
                node = order[place]
                place += 1
                gap = points[node] - points[seed]
                squared = gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2]
                if not taken[node] and (node == seed or squared < radius * radius):
                    taken[node] = True
                    total += points[node]
                    number += 1
        means[found] = total / number
        found += 1
    return means[:found]


@kernel(nrt=False)
def _first_at(rows: Array, columns: Array, row: int, column: int) -> int:
    """Return the first place at or behind a cell, in lists sorted by row and column."""
    low, high = 0, rows.shape[0]
    while low < high:
        middle = (low + high) // 2
        if rows[middle] < row or (rows[middle] == row and columns[middle] < column):
            low = middle + 1
        else:
            high = middle
    return low


def standing_nodes(nodes: NDArray[np.float64], index: BoxIndex, body: SweptBody) -> NDArray[np.bool_]:
    """Return at which nodes (N, 3) a body can stand, (N,) bool."""
    return np.asarray(_can_stand(index, np.ascontiguousarray(nodes, np.float64).reshape(-1, 3), body.numbers))


@kernel
def _can_stand(index: BoxIndex, nodes: Array, body: Array) -> Array:
    found = np.empty(nodes.shape[0], np.bool_)
    for k in range(nodes.shape[0]):
        found[k] = is_free(index, nodes[k], nodes[k], body)
    return found
