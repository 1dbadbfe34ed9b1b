"""Graphs of nodes on a map: a lattice over known free space, its edges, ways along them, and frontiers in view.

The rules are those of ARiADNE (Cao et al., ICRA 2023) and DARE (Cao et al., ICRA 2025): nodes are the points of a
lattice that are known to be free, edges are lines through known free space, and the utility of a node is the number
of frontiers in sight of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from lidarium.mapping.grids.grid_lines import line_is_free
from lidarium.mapping.kernels.compilation import Array, kernel


@dataclass(frozen=True, slots=True, eq=False)
class NodeGraph:
    """The nodes on a map and the ways to them from one of them.

    Attributes
    ----------
    positions : (N, 2) float64
        x, y of the nodes [m].
    utilities : (N,) int64
        Frontiers in sight.
    here : int
        The node where the ways begin.
    lengths : (N,) float64
        Lengths of the shortest ways along edges [m], inf if there is none.
    previous : (N,) int64
        The node before each on its way, negative if there is none.
    """

    positions: NDArray[np.float64]
    utilities: NDArray[np.int64]
    here: int
    lengths: NDArray[np.float64]
    previous: NDArray[np.int64]

    def way_to(self, node: int) -> list[int]:
        """Return the nodes on the way to a node that has one, without the first; empty if that is the node."""
        way: list[int] = []
        while node != self.here:
            way.append(node)
            node = int(self.previous[node])
        return way[::-1]


def ways_along(
    positions: NDArray[np.float64], edges: NDArray[np.int64], here: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return lengths (N,) [m] of the shortest ways from a node, and the node before each on its way.

    ``edges`` (E, 2) are pairs of nodes.
    """
    count = len(positions)
    gaps = positions[edges[:, 0]] - positions[edges[:, 1]]
    weights = csr_array((np.hypot(gaps[:, 0], gaps[:, 1]), (edges[:, 0], edges[:, 1])), shape=(count, count))
    lengths, previous = dijkstra(weights, directed=False, indices=[here], return_predecessors=True)
    return np.asarray(lengths[0], np.float64), np.asarray(previous[0], np.int64)


@kernel
def add_edges(passable: Array, cells: Array, columns: int, is_node: Array, searching: Array, edges: Array) -> None:
    """Add the edges of the nodes ``searching`` (S,) to others whose line is negative in ``passable`` (kernel).

    Nodes are points of a lattice of ``columns`` columns with cells (L, 2), as ``is_node`` (L,) tells. ``edges``
    (L, side, side) bool holds an edge to a neighbour by its place in a square around the node.
    """
    reach, rows = edges.shape[1] // 2, len(cells) // columns
    for node in searching:
        row, column = node // columns, node % columns
        for i in range(max(row - reach, 0), min(row + reach + 1, rows)):
            for j in range(max(column - reach, 0), min(column + reach + 1, columns)):
                other, up, across = i * columns + j, reach + i - row, reach + j - column
                if other == node or not is_node[other] or edges[node, up, across]:
                    continue
                if line_is_free(passable, cells[node, 0], cells[node, 1], cells[other, 0], cells[other, 1]):
                    edges[node, up, across] = edges[other, 2 * reach - up, 2 * reach - across] = True


def pairs_of(edges: NDArray[np.bool_], columns: int) -> NDArray[np.int64]:
    """Return the edges that `add_edges` has found as pairs of points of the lattice, each once, (E, 2)."""
    reach = edges.shape[1] // 2
    nodes, up, across = np.nonzero(edges)
    others = nodes + (up - reach) * columns + across - reach
    return np.asarray(np.stack([nodes, others], axis=1)[nodes < others], np.int64)


@kernel
def frontiers_of(log_odds: Array) -> NDArray[np.bool_]:
    """Return which cells are frontiers: free, with 2 to 7 unknown cells among the eight around (kernel)."""
    rows, columns = log_odds.shape
    found = np.zeros((rows, columns), np.bool_)
    for i in range(rows):
        for j in range(columns):
            if log_odds[i, j] >= 0:
                continue
            unknown = 0
            for k in range(max(i - 1, 0), min(i + 2, rows)):
                for m in range(max(j - 1, 0), min(j + 2, columns)):
                    unknown += log_odds[k, m] == 0
            found[i, j] = 1 < unknown < 8
    return found


def thinned(cells: NDArray[np.int64], corner: NDArray[np.float64], side: float) -> NDArray[np.int64]:
    """Return one cell of each square that contains some, the one nearest to the corner of the square, (M, 2).

    Squares have sides of ``side`` cells, measured from ``corner`` (row, column) and rounded towards it, so squares at
    the row and column of ``corner`` are twice as wide. The corner of a square is the one nearest to ``corner``.
    """
    gaps = cells - corner
    squares = np.trunc(gaps / side)
    excess = ((gaps - squares * side) ** 2).sum(axis=1)
    order = np.lexsort((cells[:, 0], cells[:, 1], excess))
    _, firsts = np.unique(squares[order], axis=0, return_index=True)
    return cells[np.sort(order[firsts])]


@kernel
def in_sight(log_odds: Array, cells: Array, frontiers: Array, reach: float) -> NDArray[np.bool_]:
    """Return which frontier cells (M, 2) are in sight of each cell (N, 2) and nearer than ``reach`` [cells], (N, M).

    In sight means that all cells between are known to be free.
    """
    seen = np.zeros((len(cells), len(frontiers)), np.bool_)
    for n in range(len(cells)):
        for m in range(len(frontiers)):
            rise, run = frontiers[m, 0] - cells[n, 0], frontiers[m, 1] - cells[n, 1]
            if rise * rise + run * run < reach * reach:
                seen[n, m] = line_is_free(log_odds, cells[n, 0], cells[n, 1], frontiers[m, 0], frontiers[m, 1])
    return seen
