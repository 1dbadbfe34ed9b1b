"""Free nodes at which a body cannot stand are moved to where it can, a short distance away.

In a passage that is hardly wider than the body few codes of the floor lie on its middle line. A code beside
it is moved from the nearest box, then from the next one, until nothing is in the way.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.graph.nodes import standing_nodes
from lidarium.mapping.sparse.swept_body import HIGH, LOW, RADIUS, BoxIndex, SweptBody

STEPS = 12
"""How often a node is moved."""

MARGIN_M = 0.002
"""By how much a node is moved farther than it needs [m]."""


def retracted_nodes(nodes: NDArray[np.float64], index: BoxIndex, body: SweptBody) -> NDArray[np.float64]:
    """Move nodes from the boxes in which a body at them stands.

    Parameters
    ----------
    nodes : (N, 3) float64
        Free nodes [m].
    index : BoxIndex
        What stands there.
    body : SweptBody
        The body.

    Returns
    -------
    (N, 3) float64
        The nodes; each is where it was, or at most the body's radius away. Those under boxes, and those that
        find no place, are left where they were.
    """
    return np.asarray(_retract(index, np.ascontiguousarray(nodes, np.float64).reshape(-1, 3), body.numbers))


def nodes_with_room(
    nodes: NDArray[np.float64], index: BoxIndex, body: SweptBody, merge_radius: float
) -> NDArray[np.float64]:
    """Return the nodes at which a body can stand, those that had to be moved behind the others.

    Parameters
    ----------
    nodes : (N, 3) float64
        Free nodes [m].
    index : BoxIndex
        What stands there.
    body : SweptBody
        The body.
    merge_radius : float
        A node that was moved is left out where another one is nearer than this [m].

    Returns
    -------
    (M, 3) float64
        The nodes [m].
    """
    stands = standing_nodes(nodes, index, body)
    moved = retracted_nodes(nodes[~stands], index, body)
    moved = moved[standing_nodes(moved, index, body)]
    found, own = np.concatenate([nodes[stands], moved]), int(stands.sum())
    if merge_radius <= 0.0 or len(moved) == 0:
        return found
    pairs = cKDTree(found).query_pairs(merge_radius, output_type="ndarray")
    pairs = pairs[np.argsort(pairs[:, 1], kind="stable")]
    return np.asarray(found[_are_kept(len(found), own, pairs)])


@kernel
def _are_kept(count: int, own: int, pairs: Array) -> Array:
    """Return which nodes are kept: of pairs (P, 2) in the order of their later nodes, that one is not."""
    kept = np.ones(count, np.bool_)
    for pair in pairs:
        if pair[1] >= own and kept[pair[0]]:
            kept[pair[1]] = False
    return kept


@kernel
def _retract(index: BoxIndex, nodes: Array, body: Array) -> Array:
    moved, radius = nodes.copy(), body[RADIUS]
    gap = np.empty(3)
    for k in range(nodes.shape[0]):
        node, is_free = moved[k], False
        for _ in range(STEPS):
            if not _nearest_blocking(index, node, body, gap):
                is_free = True
                break
            if gap[2] <= 1e-9:
                break
            share = (radius + MARGIN_M) / gap[2] - 1.0
            node[0] += share * gap[0]
            node[1] += share * gap[1]
        run_x, run_y = node[0] - nodes[k, 0], node[1] - nodes[k, 1]
        if not is_free or run_x * run_x + run_y * run_y > radius * radius:
            node[:] = nodes[k]
    return moved


@kernel(nrt=False)
def _nearest_blocking(index: BoxIndex, node: Array, body: Array, gap: Array) -> bool:
    """Write from the nearest blocking box to a node, x and y and their length; False where none blocks."""
    radius, cell = body[RADIUS], index.cell[0]
    rows, columns = index.shape[0], index.shape[1]
    least = radius * radius
    is_blocked = False
    first_row = max(int(math.floor((node[1] - radius - index.origin[1]) / cell)), 0)
    last_row = min(int(math.floor((node[1] + radius - index.origin[1]) / cell)), rows - 1)
    first_column = max(int(math.floor((node[0] - radius - index.origin[0]) / cell)), 0)
    last_column = min(int(math.floor((node[0] + radius - index.origin[0]) / cell)), columns - 1)
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            place = row * columns + column
            for k in range(index.starts[place], index.starts[place + 1]):
                box = index.boxes[index.members[k]]
                if box[2] >= node[2] + body[HIGH] or box[5] <= node[2] + body[LOW]:
                    continue
                x = node[0] - min(max(node[0], box[0]), box[3])
                y = node[1] - min(max(node[1], box[1]), box[4])
                squared = x * x + y * y
                if squared < least:
                    least, is_blocked = squared, True
                    gap[0], gap[1], gap[2] = x, y, math.sqrt(squared)
    return is_blocked
