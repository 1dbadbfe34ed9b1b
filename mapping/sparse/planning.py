"""Paths on the graph of a sparse map: requests, A*, shortcuts, reachable nodes, and measures of paths.

References
----------
P. E. Hart, N. J. Nilsson and B. Raphael, "A formal basis for the heuristic determination of minimum cost
paths", 1968. Sparse mapper, section 7.2, corrected: costs and estimates are kept apart.

Sparse mapper, section 7.3. The straight connections of start and goal to the graph are tested, which the
thesis leaves out; the nearest nodes are tried in order of their distance.

E. W. Dijkstra, "A note on two problems in connexion with graphs", 1959. Sparse mapper, section 7.1,
corrected: costs are those of the node that is left, not of the one that is entered.

Sparse mapper, section 10, with the corrections of its formulas. Turning and dispersion depend on how the
points of a path are spaced: paths are compared at equal arc lengths.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.graph import NodeGrid, TopologicalGraph, nearest_nodes
from lidarium.mapping.sparse.swept_body import BoxIndex, index_boxes, is_free

NO_NODE = -1


@kernel(nrt=False)
def _push(heap: Array, keys: Array, size: int, node: int, key: float) -> int:
    """Put a node into a binary heap of nodes by their keys; return its size."""
    place = size
    while place > 0:
        parent = (place - 1) // 2
        if keys[parent] <= key:
            break
        heap[place], keys[place] = heap[parent], keys[parent]
        place = parent
    heap[place], keys[place] = node, key
    return size + 1


@kernel(nrt=False)
def _pop(heap: Array, keys: Array, size: int) -> int:
    """Take the least node out of a binary heap, which is that of place 0; return its size."""
    size -= 1
    node, key = heap[size], keys[size]
    place = 0
    while True:
        child = 2 * place + 1
        if child >= size:
            break
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        heap[place], keys[place] = heap[child], keys[child]
        place = child
    heap[place], keys[place] = node, key
    return size


@kernel
def _shortest_path(
    nodes: Array, starts: Array, ends: Array, weights: Array, first: Array, last: Array, goal: Array
) -> tuple[Array, float]:
    """Find the cheapest path through a graph.

    Parameters
    ----------
    nodes : (N, 3) float64
        Places of the nodes [m].
    starts, ends, weights : (N + 1,) int64, (E,) int64, (E,) float64
        Edges, as ``TopologicalGraph`` has them; no edge is cheaper than it is long.
    first, last : (N,) float64
        Cost from the start to each node, and from it to the goal; inf if there is no way
        [m].
    goal : (3,) float64
        Position of the goal [m].

    Returns
    -------
    path : (P,) int64
        Nodes in order; empty if there is no path.
    """
    count = nodes.shape[0]
    costs, before = np.full(count, np.inf), np.full(count, NO_NODE)
    is_closed = np.zeros(count, np.bool_)
    heap, keys = np.empty(ends.shape[0] + count + 1, np.int64), np.empty(ends.shape[0] + count + 1)
    size = 0
    for node in range(count):
        if first[node] < np.inf:
            costs[node] = first[node]
            size = _push(heap, keys, size, node, first[node] + _estimate(nodes[node], goal))
    best, best_cost = NO_NODE, np.inf
    while size > 0 and keys[0] < best_cost:
        node = heap[0]
        size = _pop(heap, keys, size)
        if is_closed[node]:
            continue
        is_closed[node] = True
        if costs[node] + last[node] < best_cost:
            best, best_cost = node, costs[node] + last[node]
        for k in range(starts[node], starts[node + 1]):
            other, cost = ends[k], costs[node] + weights[k]
            if cost < costs[other]:
                costs[other], before[other] = cost, node
                size = _push(heap, keys, size, other, cost + _estimate(nodes[other], goal))
    length, node = 0, best
    while node != NO_NODE:
        length, node = length + 1, before[node]
    path, node = np.empty(length, np.int64), best
    for k in range(length - 1, -1, -1):
        path[k], node = node, before[node]
    return path, best_cost


@kernel(forceinline=True)
def _estimate(node: Array, goal: Array) -> float:
    """Return a lower bound of the cost from a node to the goal."""
    return math.sqrt((node[0] - goal[0]) ** 2 + (node[1] - goal[1]) ** 2 + (node[2] - goal[2]) ** 2)


PULLS = 3
"""How often the corners of a path are pulled tight."""

PULL_STEPS = 5
"""Halvings in search of how far a corner can be pulled."""


@kernel
def _shortened(index: BoxIndex, path: Array, body: Array) -> Any:  # noqa: ANN401
    """Shorten a path of straight segments that a body can be driven along.

    From each point on the path goes straight to the farthest point that it can reach. Then corners are pulled
    towards the straight line between their neighbours, as far as the body goes.

    Parameters
    ----------
    path : (P, 3) float64
        Points of the path [m].
    body : (3,) float64
        ``SweptBody.numbers``.

    Returns
    -------
    (Q, 3) float64
        Points of the shorter path; it has the same ends as the other one.
    """
    points = _skipped(index, path, body)
    for _ in range(PULLS):
        if points.shape[0] < 3:
            break
        _pull(index, points, body)
        points = _skipped(index, points, body)
    return points


@kernel
def _skipped(index: BoxIndex, path: Array, body: Array) -> Array:
    """Leave out points between two others that see each other."""
    count = path.shape[0]
    kept, found = np.empty((count, 3)), 0
    place = 0
    while place < count:
        kept[found] = path[place]
        found += 1
        if place == count - 1:
            break
        # Twice as far each time, then between: most tests are of what is near.
        reach, step = 1, 1
        while place + reach + step < count and is_free(index, path[place], path[place + reach + step], body):
            reach += step
            step *= 2
        while step > 0:
            farther = place + reach + step
            if farther < count and is_free(index, path[place], path[farther], body):
                reach += step
            step //= 2
        place += reach
    return kept[:found]


@kernel
def _pull(index: BoxIndex, points: Array, body: Array) -> None:
    """Move inner points towards the line between their neighbours, as far as the body can be driven."""
    middle = np.empty(3)
    for k in range(1, points.shape[0] - 1):
        before, here, after = points[k - 1], points[k], points[k + 1]
        run, gap, squared = 0.0, 0.0, 0.0
        for axis in range(3):
            run = after[axis] - before[axis]
            squared += run * run
            gap += (here[axis] - before[axis]) * run
        share = min(max(gap / squared, 0.0), 1.0) if squared > 0.0 else 0.0
        low, high = 0.0, 1.0
        for _ in range(PULL_STEPS):
            part = 0.5 * (low + high)
            for axis in range(3):
                foot = before[axis] + share * (after[axis] - before[axis])
                middle[axis] = here[axis] + part * (foot - here[axis])
            if is_free(index, before, middle, body) and is_free(index, middle, after, body):
                low = part
            else:
                high = part
        for axis in range(3):
            foot = before[axis] + share * (after[axis] - before[axis])
            points[k, axis] = here[axis] + low * (foot - here[axis])


@kernel
def _path_length(path: Array) -> float:
    """Return the length of a path (P, 3) [m]."""
    total = 0.0
    for k in range(1, path.shape[0]):
        gap = path[k] - path[k - 1]
        total += math.sqrt(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2])
    return total


CONNECTORS = 10
"""Nearest nodes to which a start and a goal are connected."""

FOUND, START_IN_COLLISION, GOAL_IN_COLLISION, NO_PATH, START_WITHOUT_FLOOR, GOAL_WITHOUT_FLOOR = range(6)

REASONS = (
    "",
    "start in collision",
    "goal in collision",
    "no path",
    "start without floor",
    "goal without floor",
)
"""Why there is no path, by number; empty if there is one."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The answer to a request.

    Attributes
    ----------
    path : (P, 3) float64
        Points from the start to the goal [m]; empty if there is no path.
    reason : str
        Why there is none: ``start in collision``, ``start without floor`` (the same of the goal) or ``no path``;
        else empty.
    nodes : int
        Points of the path on the graph, before it was shortened.
    """

    path: NDArray[np.float64]
    reason: str
    nodes: int

    @property
    def is_found(self) -> bool:
        """Whether there is a path."""
        return not self.reason

    @property
    def length(self) -> float:
        """Length of the path [m]; inf if there is none."""
        return float(_path_length(self.path)) if self.is_found else float("inf")

    @property
    def result(self) -> dict[str, Any]:
        """The answer for JSON, in tenths of millimetres."""
        return {
            "found": self.is_found,
            "reason": self.reason,
            "length_m": round(self.length, 4) if self.is_found else None,
            "points": np.round(self.path, 4).tolist(),
            "nodes": self.nodes,
        }


def map_bounds(graph: TopologicalGraph) -> NDArray[np.float64]:
    """Return the low and the high corner of the ground and boxes of a graph, z of the floor alone, (2, 3) [m]."""
    nodes, boxes = graph.nodes, graph.index.boxes.reshape(-1, 2, 3)
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    if len(boxes):
        low[:2] = np.minimum(low[:2], boxes[:, 0, :2].min(axis=0))
        high[:2] = np.maximum(high[:2], boxes[:, 1, :2].max(axis=0))
    low[2], high[2] = low[2] - graph.body.height, high[2] + graph.body.height
    return np.stack([low, high])


def check_on_map(bounds: NDArray[np.float64], name: str, point: NDArray[np.float64]) -> None:
    """Check that a point (2,) or (3,) is within bounds (2, 3): outside nothing is known, and nothing in the way."""
    low, high = bounds[:, : len(point)]
    if not ((low <= point) & (point <= high)).all():
        area = ", ".join(f"{axis} from {a:.2f} to {b:.2f}" for axis, a, b in zip("xyz", low, high, strict=False))
        raise ValueError(f"{name} is {', '.join(f'{x:g}' for x in point)}; want a point on the map: {area} m")


def plan(
    graph: TopologicalGraph,
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    shortens: bool = True,
) -> Plan:
    """Plan a path for the body of a graph, by A* and shortcuts.

    Parameters
    ----------
    graph : TopologicalGraph
        The graph, from `build_graph`.
    start, goal : (2,) or (3,) float64
        Start and goal [m]; without a height, that of the nearest node.
    shortens : bool, optional
        Whether the path leaves the graph if it can be driven straight; True by default.

    Returns
    -------
    Plan
        ``path`` (P, 3) [m] and ``length`` [m]; if no path exists, ``reason`` says why.

    Raises
    ------
    ValueError
        If start or goal are not two or three finite numbers.

    Examples
    --------
    >>> import lidarium, numpy as np
    >>> x, y = np.meshgrid(np.arange(0.0, 4.0, 0.2), np.arange(0.0, 3.0, 0.2))
    >>> free = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    >>> shelf = np.array([[[1.9, 0.0, 0.0], [2.1, 2.0, 1.5]]])  # low and high corner [m]
    >>> graph = lidarium.build_graph(free, shelf, lidarium.SweptBody(radius=0.2))
    >>> lidarium.plan(graph, [1.0, 0.5], [3.0, 0.5]).length > 2.0
    True
    """
    ends = [_terminal(graph, name, point) for name, point in (("start", start), ("goal", goal))]
    path, nodes, reason = _plan(
        graph.index,
        graph.grid,
        graph.starts,
        graph.ends,
        graph.weights,
        np.array(ends),
        graph.body.numbers,
        shortens,
    )
    if graph.support is not None and reason in (START_IN_COLLISION, GOAL_IN_COLLISION):
        point = ends[reason - START_IN_COLLISION]
        if is_free(index_boxes(graph.boxes), point, point, graph.body.numbers):  # it touches a rim alone
            reason += START_WITHOUT_FLOOR - START_IN_COLLISION
    elif graph.support is not None:
        for point, without_floor in zip(ends, (START_WITHOUT_FLOOR, GOAL_WITHOUT_FLOOR), strict=True):
            if not _stands_on_floor(graph, point):
                return Plan(np.empty((0, 3)), REASONS[without_floor], 0)
    return Plan(path, REASONS[reason], nodes)


OFF_FLOOR_M = 0.25
"""A start or goal farther above or below the nearest node is not on the floor [m]."""


def _stands_on_floor(graph: TopologicalGraph, point: NDArray[np.float64]) -> bool:
    """Whether a point (3,) is on the floor, above a cell that bears the body."""
    if graph.support is None or not graph.support.bears(point):
        return graph.support is None
    found, gaps = np.full(1, -1), np.full(1, np.inf)
    nearest_nodes(graph.grid, point, found, gaps, -1)
    return bool(abs(graph.nodes[found[0], 2] - point[2]) <= OFF_FLOOR_M)


def _terminal(graph: TopologicalGraph, name: str, point: NDArray[np.float64]) -> NDArray[np.float64]:
    given = np.asarray(point, np.float64)
    if given.shape not in ((2,), (3,)) or not np.isfinite(given).all():
        raise ValueError(f"{name} is {point}; want x, y or x, y, z in metres")
    if given.shape == (3,):
        return given
    found, gaps = np.full(1, -1), np.full(1, np.inf)
    nearest_nodes(graph.grid, np.array([*given, graph.nodes[:, 2].mean()]), found, gaps, -1)
    return np.array([*given, graph.nodes[found[0], 2]])


@kernel
def _connect(index: BoxIndex, grid: NodeGrid, point: Array, body: Array, costs: Array) -> bool:
    """Write the cost of going straight from a point to its nearest nodes; inf if the body cannot."""
    found, gaps = np.empty(CONNECTORS, np.int64), np.empty(CONNECTORS)
    count, is_connected = nearest_nodes(grid, point, found, gaps, -1), False
    for k in range(count):
        if is_free(index, point, grid.nodes[found[k]], body):
            costs[found[k]] = np.sqrt(gaps[k])
            is_connected = True
    return is_connected


@kernel
def _plan(
    index: BoxIndex,
    grid: NodeGrid,
    starts: Array,
    ends: Array,
    weights: Array,
    terminals: Array,
    body: Array,
    shortens: bool,
) -> tuple[Array, int, int]:
    """Return the path between two terminals (2, 3), its nodes on the graph, and a number of ``REASONS``."""
    nothing, start, goal = np.empty((0, 3)), terminals[0], terminals[1]
    if not is_free(index, start, start, body):
        return nothing, 0, START_IN_COLLISION
    if not is_free(index, goal, goal, body):
        return nothing, 0, GOAL_IN_COLLISION
    straight = np.empty((2, 3))
    straight[0], straight[1] = start, goal
    if shortens and is_free(index, start, goal, body):
        return straight, 2, FOUND
    first, last = np.full(grid.nodes.shape[0], np.inf), np.full(grid.nodes.shape[0], np.inf)
    if not _connect(index, grid, start, body, first) or not _connect(index, grid, goal, body, last):
        return nothing, 0, NO_PATH
    nodes, _ = _shortest_path(grid.nodes, starts, ends, weights, first, last, goal)
    if nodes.shape[0] == 0:
        return nothing, 0, NO_PATH
    path = np.empty((nodes.shape[0] + 2, 3))
    path[0], path[nodes.shape[0] + 1] = start, goal
    for k in range(nodes.shape[0]):
        path[k + 1] = grid.nodes[nodes[k]]
    return (_shortened(index, path, body) if shortens else path), path.shape[0], FOUND


def costs_from(graph: TopologicalGraph, start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cost of reaching each node from a place.

    Parameters
    ----------
    start : (3,) float64
        Start [m]; it is connected to its nearest nodes as in a request.

    Returns
    -------
    (N,) float64
        Costs; inf for nodes that cannot be reached [m].
    """
    first = np.full(len(graph.nodes), np.inf)
    _connect(graph.index, graph.grid, np.asarray(start, np.float64), graph.body.numbers, first)
    return np.asarray(_costs(graph.starts, graph.ends, graph.weights, first))


@kernel
def _costs(starts: Array, ends: Array, weights: Array, first: Array) -> Array:
    """Return the cost of each node; ``first`` (N,) is that of coming to it straight, inf if one cannot."""
    count = first.shape[0]
    costs, is_closed = first.copy(), np.zeros(count, np.bool_)
    heap, keys = np.empty(ends.shape[0] + count + 1, np.int64), np.empty(ends.shape[0] + count + 1)
    size = 0
    for node in range(count):
        if costs[node] < np.inf:
            size = _push(heap, keys, size, node, costs[node])
    while size > 0:
        node = heap[0]
        size = _pop(heap, keys, size)
        if is_closed[node]:
            continue
        is_closed[node] = True
        for k in range(starts[node], starts[node + 1]):
            cost = costs[node] + weights[k]
            if cost < costs[ends[k]]:
                costs[ends[k]] = cost
                size = _push(heap, keys, size, ends[k], cost)
    return costs


SPACING_M = 0.05
"""Distance of the points of paths that are compared [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _PathMeasures:
    """Measures of a path.

    Attributes
    ----------
    length : float
        Length [m].
    points : int
        Points of the path as it was given.
    turning : float
        Sum of the angles by which the path turns at its points, the thesis's tortuosity [rad].
    dispersion : float
        Root of the mean squared distance of its points from their mean [m].
    """

    length: float
    points: int
    turning: float
    dispersion: float


def measure_path(path: NDArray[np.float64], spacing: float | None = SPACING_M) -> _PathMeasures:
    """Measure a path.

    Parameters
    ----------
    path : (P, D) float64
        Its points, at least one [m].
    spacing : float or None
        Equal arc length to which points are set before turning and dispersion are measured [m]; None for the
        points as they are.
    """
    points = np.asarray(path, np.float64)
    if points.ndim != 2 or len(points) == 0 or not np.isfinite(points).all():
        raise ValueError(f"the path has shape {points.shape}; want (P, D) with at least one finite point")
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    even = points if spacing is None else points_along(points, spacing)
    return _PathMeasures(length=length, points=len(points), turning=_turning_of(even), dispersion=_dispersion_of(even))


def points_along(path: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Return points of a path (P, D) at equal arc lengths of at most ``spacing``, its ends among them [m]."""
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    lengths = np.concatenate([[0.0], np.cumsum(steps)])
    places = np.linspace(0.0, lengths[-1], max(math.ceil(lengths[-1] / spacing), 1) + 1)
    return np.stack([np.interp(places, lengths, column) for column in path.T], axis=1)


def _turning_of(points: NDArray[np.float64]) -> float:
    """Return the sum of the angles at inner points (P, D), steps of no length left out [rad]."""
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    units = steps[lengths > 1e-12] / lengths[lengths > 1e-12, None]
    # The arc cosine is blind to small angles; half the angle is the arc sine of half the chord.
    chords = np.linalg.norm(np.diff(units, axis=0), axis=1)
    return float(2.0 * np.arcsin(np.clip(0.5 * chords, 0.0, 1.0)).sum())


def _dispersion_of(points: NDArray[np.float64]) -> float:
    """Return how far points (P, D) spread about their mean, with one degree of freedom less [m]."""
    if len(points) < 2:
        return 0.0
    gaps = points - points.mean(axis=0)
    return math.sqrt(float((gaps**2).sum()) / (len(points) - 1))
