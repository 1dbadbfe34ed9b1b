"""Topological graph of a sparse map: nodes in free space, moved away from obstacles, and safe edges.

References
----------
Sparse mapper, sections 5.1 and 5.2, corrected: the count begins at one, and the seed's distance decides.

Sparse mapper, section 5.3; an edge is there if either end lists the other among its nearest nodes.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import above, check_settings, within
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.seen_floor import SeenFloor, Support
from lidarium.mapping.sparse.swept_body import (
    HIGH,
    LOW,
    RADIUS,
    BoxIndex,
    SweptBody,
    are_free,
    index_boxes,
    is_free,
)


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
        Index of the first node of each cell in ``members``.
    members : (N,) int64
        Numbers of nodes, cell by cell.
    """

    nodes: Annotated[Array, np.float64, 2]
    origin: Annotated[Array, np.float64, 1]
    cell: Annotated[Array, np.float64, 1]
    shape: Annotated[Array, np.int64, 1]
    starts: Annotated[Array, np.int64, 1]
    members: Annotated[Array, np.int64, 1]


MAX_CELLS = 1_000_000
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
    point : (3,) float64
        The point [m].
    found : (count,) int64
        Result: numbers of the nearest nodes, nearest first; of equal ones the lower number comes first.
    gaps : (count,) float64
        Result: their squared distances [m2].
    """
    maximum, number = found.shape[0], 0
    rows, columns, cell = grid.shape[0], grid.shape[1], grid.cell[0]
    own_column = int(min(max(math.floor((point[0] - grid.origin[0]) / cell), -1.0), float(columns)))
    own_row = int(min(max(math.floor((point[1] - grid.origin[1]) / cell), -1.0), float(rows)))
    for ring in range(max(rows, columns) + 2):
        # What lies in farther rings is at least this far away.
        bound = max((ring - 1) * cell, 0.0)
        if number == maximum and gaps[maximum - 1] < bound * bound:
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
def _take_cell(grid: NodeGrid, place: int, point: Array, found: Array, gaps: Array, number: int, without: int) -> int:
    """Sort the nodes of a cell into the nearest ones; return how many these are now."""
    maximum = found.shape[0]
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
        if number == maximum and (gap, node) >= (gaps[maximum - 1], found[maximum - 1]):
            continue
        place_of = number if number < maximum else maximum - 1
        number = min(number + 1, maximum)
        while place_of > 0 and (gap, node) < (gaps[place_of - 1], found[place_of - 1]):
            gaps[place_of], found[place_of] = gaps[place_of - 1], found[place_of - 1]
            place_of -= 1
        gaps[place_of], found[place_of] = gap, node
    return number


def reduced_nodes(nodes: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """Merge free nodes that lie close together.

    In their order, each node that is left takes all that are nearer to it than the radius; their mean stands for
    them.

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
    """Return at which nodes (N, 3) a body can fit, (N,) bool."""
    return np.asarray(_can_stand(index, np.ascontiguousarray(nodes, np.float64).reshape(-1, 3), body.numbers))


@kernel
def _can_stand(index: BoxIndex, nodes: Array, body: Array) -> Array:
    found = np.empty(nodes.shape[0], np.bool_)
    for k in range(nodes.shape[0]):
        found[k] = is_free(index, nodes[k], nodes[k], body)
    return found


STEPS = 12
"""How often a node is moved."""

MARGIN_M = 0.002
"""By how much a node is moved farther than it needs [m]."""


def _retracted_nodes(nodes: NDArray[np.float64], index: BoxIndex, body: SweptBody) -> NDArray[np.float64]:
    """Move nodes from the boxes in which a body at them stands.

    Parameters
    ----------
    nodes : (N, 3) float64
        Free nodes [m].

    Returns
    -------
    (N, 3) float64
        The nodes, unchanged or moved by at most the body's radius. Those under boxes, and those without a free
        position, are left unchanged.
    """
    return np.asarray(_retract(index, np.ascontiguousarray(nodes, np.float64).reshape(-1, 3), body.numbers))


def _nodes_with_room(
    nodes: NDArray[np.float64], index: BoxIndex, body: SweptBody, merge_radius: float
) -> NDArray[np.float64]:
    """Return the nodes at which a body can fit, those that had to be moved behind the others.

    Parameters
    ----------
    nodes : (N, 3) float64
        Free nodes [m].
    merge_radius : float
        A node that was moved is left out if another one is nearer than this [m].

    Returns
    -------
    (M, 3) float64
        The nodes [m].
    """
    stands = standing_nodes(nodes, index, body)
    moved = _retracted_nodes(nodes[~stands], index, body)
    moved = moved[standing_nodes(moved, index, body)]
    found, own = np.concatenate([nodes[stands], moved]), int(stands.sum())
    if merge_radius <= 0.0 or len(moved) == 0:
        return found
    pairs = scipy.spatial.cKDTree(found).query_pairs(merge_radius, output_type="ndarray")
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
    """Write from the nearest blocking box to a node, x and y and their length; False if none blocks."""
    radius, cell = body[RADIUS], index.cell[0]
    rows, columns = index.shape[0], index.shape[1]
    minimum = radius * radius
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
                if squared < minimum:
                    minimum, is_blocked = squared, True
                    gap[0], gap[1], gap[2] = x, y, math.sqrt(squared)
    return is_blocked


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphSettings:
    """How a graph is made.

    Attributes
    ----------
    merge_radius : float, default 0.15
        Free nodes nearer to each other than this are merged [m].
    neighbours : int, default 8
        Nearest nodes to which edges are tried.
    longest_edge : float or None
        Longest edge [m]; None for three times the median distance of nearest nodes, at least 1 m.
    clearance_weight, clearance_m : float, default 0.0, 0.5
        By how much an edge near an obstacle is longer, as a share, and from which distance it is not [m].
    slope_weight : float, default 0.0
        By how much an edge is longer for each metre it climbs a metre.
    """

    merge_radius: Annotated[float, within(0.0, 10.0)] = 0.15
    neighbours: Annotated[int, within(1, 64)] = 8
    longest_edge: Annotated[float, above(0.0, 1000.0)] | None = None
    clearance_weight: Annotated[float, within(0.0, 100.0)] = 0.0
    clearance_m: Annotated[float, above(0.0, 10.0)] = 0.5
    slope_weight: Annotated[float, within(0.0, 100.0)] = 0.0

    def __post_init__(self) -> None:
        check_settings(self, "the graph")


@dataclass(frozen=True, eq=False)
class TopologicalGraph:
    """Nodes and edges that a body can be driven along.

    Attributes
    ----------
    grid : NodeGrid
        The nodes, (N, 3) float64 [m], in cells.
    starts : (N + 1,) int64
        Index of the first edge of each node in ``ends``.
    ends : (E,) int64
        The other end of each edge; each edge is listed at both of its ends.
    weights : (E,) float64
        Cost of each edge, at least its length [m].
    index : BoxIndex
        Obstacles, and rims of the floor that bears the body.
    body : SweptBody
        The body that drives.
    support : Support or None
        Cells of floor that bear the body; None if that is not known.
    """

    grid: NodeGrid
    starts: NDArray[np.int64]
    ends: NDArray[np.int64]
    weights: NDArray[np.float64]
    index: BoxIndex
    body: SweptBody
    support: Support | None = None

    @property
    def nodes(self) -> NDArray[np.float64]:
        """The nodes, (N, 3) [m]."""
        return self.grid.nodes

    @property
    def boxes(self) -> NDArray[np.float64]:
        """Boxes of the obstacles, without rims of the floor, (M, 2, 3) [m]."""
        boxes = self.index.boxes
        return boxes[np.isfinite(boxes[:, 2])].reshape(-1, 2, 3)

    @property
    def edges(self) -> NDArray[np.int64]:
        """Both ends of each edge, the lower number first, (E / 2, 2)."""
        first = np.repeat(np.arange(len(self.nodes)), np.diff(self.starts))
        return np.stack([first, self.ends], axis=1)[first < self.ends]


def build_graph(
    free: NDArray[np.float64],
    occupied: NDArray[np.float64],
    body: SweptBody,
    settings: GraphSettings | None = None,
    floor: SeenFloor | None = None,
) -> TopologicalGraph:
    """Build the graph that a body can be driven along, from a sparse map or any nodes and boxes.

    Parameters
    ----------
    free : (N, 3) float64
        Free codes, on the floor [m].
    occupied : (M, 2, 3) float64
        Low and high corners of the boxes of occupied codes [m].
    body : SweptBody
        The body that drives.
    settings : GraphSettings, optional
        Settings; defaults if None.
    floor : SeenFloor, optional
        The floor that was seen, `seen_floor` of a sparse map: the body keeps its whole footprint on it, and off
        steps higher than its clearance. By default all floor counts as seen.

    Returns
    -------
    TopologicalGraph
        Nodes and edges, for `plan`.

    Raises
    ------
    ValueError
        If there are no free nodes, or the body can stand at none of them.

    Examples
    --------
    >>> import lidarium, numpy as np
    >>> x, y = np.meshgrid(np.arange(0.0, 4.0, 0.2), np.arange(0.0, 3.0, 0.2))
    >>> free = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    >>> shelf = np.array([[[1.9, 0.0, 0.0], [2.1, 2.0, 1.5]]])  # low and high corner [m]
    >>> graph = lidarium.build_graph(free, shelf, lidarium.SweptBody(radius=0.2))
    >>> graph.nodes.shape[1]
    3
    """
    settings = settings or GraphSettings()
    free = np.ascontiguousarray(free, np.float64).reshape(-1, 3)
    if len(free) == 0:
        raise ValueError("the map has no free nodes; want a cloud with floor in it, or another floor height")
    boxes, rims, support = np.reshape(occupied, (-1, 2, 3)), np.empty((0, 2, 3)), None
    if floor is not None:
        support = floor.supports(body.clearance)
        rims = support.rims()
        boxes = np.concatenate([boxes, rims])
    index = index_boxes(boxes)
    nodes = reduced_nodes(free, settings.merge_radius)
    nodes = _nodes_with_room(nodes, index, body, settings.merge_radius)
    if support is not None:
        nodes = np.concatenate([nodes, _nodes_beside(rims, free, index, body)])
        nodes = nodes[[support.bears(node) for node in nodes]]
    if len(nodes) == 0:
        raise ValueError(
            f"a body of radius {body.radius} m and height {body.height} m can stand at none of {len(free)} "
            f"free nodes; want a smaller one{', or a map with more seen floor' if support is not None else ''}"
        )
    return replace(graph_of_nodes(nodes, index, body, settings), support=support)


RIM_MARGIN_M = 0.02
"""By how much a node beside a rim is farther from it than the body's radius [m]."""

RIM_MERGE_M = 0.1
"""Nodes beside rims that are nearer to each other than this are merged [m]."""


def _nodes_beside(
    rims: NDArray[np.float64], free: NDArray[np.float64], index: BoxIndex, body: SweptBody
) -> NDArray[np.float64]:
    """Return nodes (N, 3) at the corners of rims (M, 2, 3), where paths turn around holes in the floor."""
    if len(rims) == 0:
        return np.empty((0, 3))
    found, away = [], body.radius + RIM_MARGIN_M
    for x, y in ((0, 0), (0, 1), (1, 0), (1, 1)):
        corners = np.stack([rims[:, x, 0], rims[:, y, 1]], axis=1)
        outward = np.array([2.0 * x - 1.0, 2.0 * y - 1.0])
        found += [corners + outward * away * share for share in ((1.0, 0.0), (0.0, 1.0), (math.sqrt(0.5),) * 2)]
    places = np.concatenate(found)
    nodes = np.column_stack([places, free[scipy.spatial.cKDTree(free[:, :2]).query(places)[1], 2]])
    nodes = reduced_nodes(nodes[standing_nodes(nodes, index, body)], RIM_MERGE_M)
    return nodes[standing_nodes(nodes, index, body)]


def graph_of_nodes(
    nodes: NDArray[np.float64], index: BoxIndex, body: SweptBody, settings: GraphSettings
) -> TopologicalGraph:
    """Return the graph of nodes (N, 3) at which the body fits."""
    grid = grid_of_nodes(nodes)
    pairs = candidate_pairs(grid, settings.neighbours, settings.longest_edge)
    open_pairs = pairs[are_free(index, grid.nodes[pairs[:, 0]], grid.nodes[pairs[:, 1]], body.numbers)]
    weights = edge_weights(grid.nodes, open_pairs, index, body, settings)
    starts, ends, listed = adjacency(len(grid.nodes), open_pairs, weights)
    return TopologicalGraph(grid, starts, ends, listed, index, body)


def candidate_pairs(grid: NodeGrid, neighbours: int, longest: float | None) -> NDArray[np.int64]:
    """Return the pairs of nodes that may have an edge, each once, the lower number first, (P, 2).

    ``longest`` is the longest edge [m]; None for three times the median distance of nearest nodes, at least 1 m.
    """
    near, gaps = _nearest_of_all(grid, neighbours)
    if longest is None:
        nearest = np.sqrt(gaps[:, 0][np.isfinite(gaps[:, 0])])
        longest = max(3.0 * float(np.median(nearest)), 1.0) if len(nearest) else 1.0
    return np.asarray(_pairs(near, gaps, longest))


@kernel
def _nearest_of_all(grid: NodeGrid, count: int) -> tuple[Array, Array]:
    """Return the nearest nodes of each node and their squared distances, (N, count); -1 and inf for none."""
    near = np.full((grid.nodes.shape[0], count), -1)
    gaps = np.full((grid.nodes.shape[0], count), np.inf)
    for node in range(grid.nodes.shape[0]):
        nearest_nodes(grid, grid.nodes[node], near[node], gaps[node], node)
    return near, gaps


@kernel
def _pairs(near: Array, gaps: Array, longest: float) -> Any:  # noqa: ANN401
    """Return the pairs of nodes that may have an edge, each once, the lower number first, (P, 2)."""
    pairs, found = np.empty((near.size, 2), np.int64), 0
    for node in range(near.shape[0]):
        for k in range(near.shape[1]):
            other = near[node, k]
            if other < 0 or gaps[node, k] > longest * longest:
                continue
            # Where both list each other, the lower number names the pair.
            is_named = False
            if other < node:
                for back in range(near.shape[1]):
                    is_named = is_named or near[other, back] == node
            if not is_named:
                pairs[found, 0], pairs[found, 1] = min(node, other), max(node, other)
                found += 1
    return pairs[:found]


def edge_weights(
    nodes: NDArray[np.float64],
    pairs: NDArray[np.int64],
    index: BoxIndex,
    body: SweptBody,
    settings: GraphSettings,
) -> NDArray[np.float64]:
    """Return the costs of edges (P, 2), (P,) [m]."""
    starts, ends = nodes[pairs[:, 0]], nodes[pairs[:, 1]]
    lengths = np.linalg.norm(ends - starts, axis=1)
    factors = np.ones(len(pairs))
    if settings.clearance_weight > 0.0:
        gaps = clearances(index, starts, ends, body.numbers, settings.clearance_m)
        factors += settings.clearance_weight * (1.0 - gaps / settings.clearance_m)
    if settings.slope_weight > 0.0:
        level = np.maximum(np.linalg.norm(ends[:, :2] - starts[:, :2], axis=1), 1e-9)
        factors += settings.slope_weight * np.abs(ends[:, 2] - starts[:, 2]) / level
    return np.asarray(lengths * factors)


def clearances(
    index: BoxIndex,
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    body: NDArray[np.float64],
    maximum: float,
) -> NDArray[np.float64]:
    """Return the distance of obstacles from a body along segments, at most ``maximum``, (N,) [m]."""
    low, high = np.zeros(len(starts)), np.full(len(starts), maximum)
    for _ in range(10):
        middle = 0.5 * (low + high)
        free = _free_with_margins(index, starts, ends, body, middle)
        low, high = np.where(free, middle, low), np.where(free, high, middle)
    return np.asarray(low)


@kernel
def _free_with_margins(index: BoxIndex, starts: Array, ends: Array, body: Array, margins: Array) -> Array:
    found, wide = np.empty(starts.shape[0], np.bool_), body.copy()
    for k in range(starts.shape[0]):
        wide[0] = body[0] + margins[k]
        found[k] = are_free(index, starts[k : k + 1], ends[k : k + 1], wide)[0]
    return found


@kernel
def adjacency(count: int, pairs: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Return the index of the first edge of each node, their other ends in order, and their weights."""
    starts, filled = np.zeros(count + 1, np.int64), np.zeros(count, np.int64)
    for pair in pairs:
        starts[pair[0] + 1] += 1
        starts[pair[1] + 1] += 1
    for node in range(count):
        starts[node + 1] += starts[node]
    ends, listed = np.empty(2 * pairs.shape[0], np.int64), np.empty(2 * pairs.shape[0])
    for k in range(pairs.shape[0]):
        for side in range(2):
            node, other = pairs[k, side], pairs[k, 1 - side]
            place = starts[node] + filled[node]
            filled[node] += 1
            while place > starts[node] and ends[place - 1] > other:
                ends[place], listed[place] = ends[place - 1], listed[place - 1]
                place -= 1
            ends[place], listed[place] = other, weights[k]
    return starts, ends, listed


def _components_of(graph: TopologicalGraph) -> NDArray[np.int64]:
    """Return the number of each node's connected component, (N,)."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    count = len(graph.nodes)
    matrix: Any = csr_array((np.ones(len(graph.ends)), graph.ends, graph.starts), shape=(count, count))
    return np.asarray(connected_components(matrix, directed=False)[1], np.int64)
