"""Nodes in the cells of a grid over the plane, for their neighbours."""

import math
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel


class NodeGrid(NamedTuple):
    """Nodes sorted into square cells.

    Attributes
    ----------
    nodes : (N, 3) float64
        Nodes [m].
    origin : (2,) float64
        Lower left corner of the grid [m].
    cell : (1,) float64
        Side of a cell [m].
    shape : (2,) int64
        Rows and columns.
    starts : (rows * columns + 1,) int64
        Where the nodes of each cell begin in ``members``.
    members : (N,) int64
        Numbers of nodes, cell by cell.
    """

    nodes: Annotated[Array, np.float64, 2]
    origin: Annotated[Array, np.float64, 1]
    cell: Annotated[Array, np.float64, 1]
    shape: Annotated[Array, np.int64, 1]
    starts: Annotated[Array, np.int64, 1]
    members: Annotated[Array, np.int64, 1]


MOST_CELLS = 1_000_000
"""Most cells of a grid; a wider map has larger ones."""

NODES_A_CELL = 2.0
"""Nodes that a cell holds on average."""


def grid_of_nodes(nodes: NDArray[np.float64]) -> NodeGrid:
    """Return nodes (N, 3) [m] in cells."""
    points = np.ascontiguousarray(nodes, np.float64).reshape(-1, 3)
    low = points[:, :2].min(axis=0) if len(points) else np.zeros(2)
    extent = (points[:, :2].max(axis=0) if len(points) else low) - low
    cell = math.sqrt(NODES_A_CELL * max(float(extent.prod()), 1e-6) / max(len(points), 1))
    cell = max(cell, float(extent.max()) / 1000.0, 1e-3)
    shape = (np.floor(extent / cell).astype(np.int64) + 1)[::-1].copy()
    columns, rows = np.minimum(np.floor((points[:, :2] - low) / cell).astype(np.int64), shape[::-1] - 1).T
    places = rows * shape[1] + columns
    members = np.argsort(places, kind="stable")
    starts = np.zeros(int(shape.prod()) + 1, np.int64)
    np.cumsum(np.bincount(places, minlength=int(shape.prod())), out=starts[1:])
    return NodeGrid(points, low, np.array([cell]), shape, starts, members)


@kernel(nrt=False)
def nearest_nodes(grid: NodeGrid, point: Array, found: Array, gaps: Array, without: int) -> int:
    """Find the nodes that are nearest to a point.

    Parameters
    ----------
    grid : NodeGrid
        The nodes.
    point : (3,) float64
        The point [m].
    found : (count,) int64
        Result: numbers of the nearest nodes, nearest first; of equal ones the lower number comes first.
    gaps : (count,) float64
        Result: their squared distances [m2].
    without : int
        A node that is not looked at; -1 for none.

    Returns
    -------
    int
        How many there are.
    """
    most, number = found.shape[0], 0
    rows, columns, cell = grid.shape[0], grid.shape[1], grid.cell[0]
    own_column = int(min(max(math.floor((point[0] - grid.origin[0]) / cell), -1.0), float(columns)))
    own_row = int(min(max(math.floor((point[1] - grid.origin[1]) / cell), -1.0), float(rows)))
    for ring in range(max(rows, columns) + 2):
        # What lies in farther rings is at least this far away.
        bound = max((ring - 1) * cell, 0.0)
        if number == most and gaps[most - 1] < bound * bound:
            break
        for row in range(max(own_row - ring, 0), min(own_row + ring, rows - 1) + 1):
            is_end = row == own_row - ring or row == own_row + ring
            step = 1 if is_end or ring == 0 else 2 * ring
            column = own_column - ring
            while column <= own_column + ring:
                if 0 <= column < columns:
                    number = _take_cell(grid, row * columns + column, point, found, gaps, number, without)
                column += step
    return number


@kernel(nrt=False)
def _take_cell(
    grid: NodeGrid, place: int, point: Array, found: Array, gaps: Array, number: int, without: int
) -> int:
    """Sort the nodes of a cell into the nearest ones; return how many these are now."""
    most = found.shape[0]
    for k in range(grid.starts[place], grid.starts[place + 1]):
        node = grid.members[k]
        if node == without:
            continue
        x, y, z = (
            grid.nodes[node, 0] - point[0],
            grid.nodes[node, 1] - point[1],
            grid.nodes[node, 2] - point[2],
        )
        gap = x * x + y * y + z * z
        if number == most and (gap, node) >= (gaps[most - 1], found[most - 1]):
            continue
        place_of = number if number < most else most - 1
        number = min(number + 1, most)
        while place_of > 0 and (gap, node) < (gaps[place_of - 1], found[place_of - 1]):
            gaps[place_of], found[place_of] = gaps[place_of - 1], found[place_of - 1]
            place_of -= 1
        gaps[place_of], found[place_of] = gap, node
    return number
