"""The topological graph: nodes on the floor, edges that a body can be driven along.

References
----------
Sparse mapper, section 5.3; an edge is there if either end lists the other among its nearest nodes.
"""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import above, check_settings, within
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.graph.node_grid import NodeGrid, grid_of_nodes, nearest_nodes
from lidarium.mapping.sparse.graph.nodes import reduced_nodes
from lidarium.mapping.sparse.graph.retraction import nodes_with_room
from lidarium.mapping.sparse.swept_body import BoxIndex, SweptBody, are_free, index_boxes


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphSettings:
    """How a graph is made.

    Attributes
    ----------
    merge_radius : float
        Free nodes nearer to each other than this are merged [m].
    neighbours : int
        Nearest nodes to which edges are tried.
    longest_edge : float or None
        Longest edge [m]; None for three times the median distance of nearest nodes, at least 1 m.
    clearance_weight, clearance_m : float
        By how much an edge beside an obstacle is longer, as a share, and from which distance it is not [m].
    slope_weight : float
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
        Where the edges of each node begin in ``ends``.
    ends : (E,) int64
        The other end of each edge; each edge is listed at both of its ends.
    weights : (E,) float64
        What it costs to drive along each edge, at least its length [m].
    index : BoxIndex
        What stands there.
    body : SweptBody
        What is driven.
    """

    grid: NodeGrid
    starts: NDArray[np.int64]
    ends: NDArray[np.int64]
    weights: NDArray[np.float64]
    index: BoxIndex
    body: SweptBody

    @property
    def nodes(self) -> NDArray[np.float64]:
        """The nodes, (N, 3) [m]."""
        return self.grid.nodes

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
) -> TopologicalGraph:
    """Build the graph of free nodes among boxes.

    Parameters
    ----------
    free : (N, 3) float64
        Free codes, on the floor [m].
    occupied : (M, 2, 3) float64
        Low and high corners of the boxes of occupied codes [m].
    body : SweptBody
        What is driven.
    settings : GraphSettings or None
        How; the defaults where None.

    Raises
    ------
    ValueError
        Where there is no free node, or none at which the body can stand.
    """
    settings = settings or GraphSettings()
    free = np.ascontiguousarray(free, np.float64).reshape(-1, 3)
    if len(free) == 0:
        raise ValueError("the map has no free nodes; want a cloud with floor in it, or another floor height")
    index = index_boxes(occupied)
    nodes = reduced_nodes(free, settings.merge_radius)
    nodes = nodes_with_room(nodes, index, body, settings.merge_radius)
    if len(nodes) == 0:
        raise ValueError(
            f"a body of radius {body.radius} m and height {body.height} m can stand at none of {len(free)} "
            "free nodes; want a smaller one"
        )
    return graph_of_nodes(nodes, index, body, settings)


def graph_of_nodes(
    nodes: NDArray[np.float64], index: BoxIndex, body: SweptBody, settings: GraphSettings
) -> TopologicalGraph:
    """Return the graph of nodes (N, 3) at which the body can stand."""
    grid = grid_of_nodes(nodes)
    pairs = candidate_pairs(grid, settings.neighbours, settings.longest_edge)
    open_pairs = pairs[are_free(index, grid.nodes[pairs[:, 0]], grid.nodes[pairs[:, 1]], body.numbers)]
    weights = edge_weights(grid.nodes, open_pairs, index, body, settings)
    starts, ends, listed = adjacency(len(grid.nodes), open_pairs, weights)
    return TopologicalGraph(grid, starts, ends, listed, index, body)


def candidate_pairs(grid: NodeGrid, neighbours: int, longest: float | None) -> NDArray[np.int64]:
    """Return the pairs of nodes that may have an edge, each once, the lower number first, (P, 2).

    ``longest`` is the longest edge [m]; None for three times the median distance of nearest nodes, at least
    1 m.
    """
    near, gaps = nearest_of_all(grid, neighbours)
    if longest is None:
        nearest = np.sqrt(gaps[:, 0][np.isfinite(gaps[:, 0])])
        longest = max(3.0 * float(np.median(nearest)), 1.0) if len(nearest) else 1.0
    return np.asarray(_pairs(near, gaps, longest))


@kernel
def nearest_of_all(grid: NodeGrid, count: int) -> tuple[Array, Array]:
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
    """Return what it costs to drive along edges (P, 2), (P,) [m]."""
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
    most: float,
) -> NDArray[np.float64]:
    """Return how far what blocks a body is from it along segments, at most ``most``, (N,) [m]."""
    low, high = np.zeros(len(starts)), np.full(len(starts), most)
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
    """Return where the edges of each node begin, their other ends in order, and their weights."""
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


def components_of(graph: TopologicalGraph) -> NDArray[np.int64]:
    """Return the number of each node's connected component, (N,)."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    count = len(graph.nodes)
    matrix: Any = csr_array((np.ones(len(graph.ends)), graph.ends, graph.starts), shape=(count, count))
    return np.asarray(connected_components(matrix, directed=False)[1], np.int64)
