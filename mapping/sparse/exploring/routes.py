"""Routes on a sparse map for a robot that sees only some of the ground.

Paths of the graph are shortened over ground that was seen. A robot that stands too near to something, by its
map, first goes to where it can stand: straight, where a thinner body can, or back along its trail.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.exploring.ground_map import UNKNOWN, GroundMap
from lidarium.mapping.sparse.graph.node_grid import nearest_nodes
from lidarium.mapping.sparse.graph.topological_graph import TopologicalGraph, clearances
from lidarium.mapping.sparse.planning.requests import NO_PATH, REASONS, START_IN_COLLISION, plan
from lidarium.mapping.sparse.swept_body import BoxIndex, are_free, is_free

ROOM_M = 0.3
"""Room beside a body is known up to this [m]."""

PREFERRED_ROOM_M = 0.12
"""Routes keep this room beside the body where they can [m]."""

TIGHT_M = 1.0
"""Longest straight piece of a route where they cannot [m]."""

PATH_OUT_M = 1.5
"""Farthest node to which a robot goes straight out of a place where it cannot stand [m]."""

NODES_OUT = 32
"""Nearest nodes that are tried for that."""

THINNER = (0.75, 0.5, 0.25)
"""Shares of the radius with which it is tried to go there."""


@dataclass(frozen=True, eq=False, slots=True)
class PlannedRoute:
    """The answer to a request for a route.

    Attributes
    ----------
    points : (P, 3) float64
        From the start to the goal [m]; empty where there is no route.
    room : (P,) float64
        Room beside the body on the piece that leads to each point [m].
    reason : str
        Why there is none, as of ``Plan``; else empty.
    """

    points: NDArray[np.float64]
    room: NDArray[np.float64]
    reason: str = ""

    @property
    def length(self) -> float:
        """Length of the route [m]."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def plan_route(
    graph: TopologicalGraph,
    ground: GroundMap,
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    trail: NDArray[np.float64],
    margin_m: float = 0.0,
) -> PlannedRoute:
    """Plan a route for the body of a graph.

    Parameters
    ----------
    graph : TopologicalGraph
        Where it can be driven.
    ground : GroundMap
        What is known of the ground.
    start, goal : (3,) float64
        Where from and where to [m].
    trail : (T, 3) float64
        Where the robot has been, the last place last [m].
    margin_m : float
        By how much the graph's body is wider than the robot [m].

    Returns
    -------
    PlannedRoute
        The route, or why there is none.
    """
    path_out = path_to_stand(graph, start, trail)
    if path_out is None:
        return _none(REASONS[START_IN_COLLISION])
    found = plan(graph, path_out[-1], goal, shortens=False)
    if not found.is_found:
        return _none(found.reason)
    path = shortened_on_ground(graph.index, found.path, graph.body.numbers, ground.levels, ground.frame)
    points = np.concatenate([path_out[:-1], path])
    return PlannedRoute(points, margin_m + _room_along(graph, points))


def plan_straight(
    index: BoxIndex, body: NDArray[np.float64], start: NDArray[np.float64], goal: NDArray[np.float64]
) -> PlannedRoute:
    """Return the straight route, for a map without nodes."""
    if not is_free(index, start, goal, body):
        return _none(REASONS[NO_PATH])
    return PlannedRoute(np.stack([start, goal]), np.zeros(2))


def path_to_stand(
    graph: TopologicalGraph, start: NDArray[np.float64], trail: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the points from a place to the nearest one at which the body can stand.

    Parameters
    ----------
    graph : TopologicalGraph
        Where it can.
    start : (3,) float64
        Where it is [m].
    trail : (T, 3) float64
        Where the robot has been, the last place last [m].

    Returns
    -------
    (P, 3) float64 or None
        The start alone where it can stand there; None where no path out is known.
    """
    start = np.asarray(start, np.float64)
    body = graph.body.numbers
    if is_free(graph.index, start, start, body):
        return start[None]
    nearest, gaps = np.full(NODES_OUT, -1), np.full(NODES_OUT, np.inf)
    nearest_nodes(graph.grid, start, nearest, gaps, -1)
    nodes = graph.nodes[nearest[(nearest >= 0) & (gaps <= PATH_OUT_M**2)]]
    starts = np.broadcast_to(start, nodes.shape).copy()
    for share in THINNER:
        thin = body * np.array([share, 1.0, 1.0])
        free = are_free(graph.index, starts, nodes, thin)
        if free.any():
            return np.stack([start, nodes[np.argmax(free)]])
    # Where it came from it could drive, whatever the map says.
    trail = np.ascontiguousarray(trail, np.float64).reshape(-1, 3)
    stands = are_free(graph.index, trail, trail, body)
    if not stands.any():
        return None
    last = int(np.flatnonzero(stands)[-1])
    return np.concatenate([start[None], trail[last:][::-1]])


def is_route_free(index: BoxIndex, body: NDArray[np.float64], points: NDArray[np.float64]) -> bool:
    """Whether a route (P, 3) [m] can be driven."""
    path = np.ascontiguousarray(points, np.float64)
    starts = path[:-1] if len(path) > 1 else path
    return bool(np.all(are_free(index, starts, path[-len(starts) :], body)))


def _none(reason: str) -> PlannedRoute:
    return PlannedRoute(np.empty((0, 3)), np.empty(0), reason)


def _room_along(graph: TopologicalGraph, points: NDArray[np.float64]) -> NDArray[np.float64]:
    starts = np.concatenate([points[:1], points[:-1]])
    return clearances(graph.index, starts, points, graph.body.numbers, ROOM_M)


@kernel
def shortened_on_ground(index: BoxIndex, path: Array, body: Array, levels: Array, frame: Array) -> Array:
    """Shorten a path where a body can be driven straight over ground that was seen.

    Where there is room beside the body the path goes straight as far as that lasts; else no farther than
    ``TIGHT_M`` at once, so that it keeps off what it passes where it can.

    Parameters
    ----------
    index : BoxIndex
        What stands there.
    path : (P, 3) float64
        Points of the path [m]; its pieces can be driven.
    body : (3,) float64
        ``SweptBody.numbers``.
    levels : (rows, columns) int8
        What is known of the ground.
    frame : (3,) float64
        Lower left corner of the ground and side of its cells [m].

    Returns
    -------
    (Q, 3) float64
        Some of the points, the first and the last among them.
    """
    count = path.shape[0]
    kept, found, place = np.empty((count, 3)), 0, 0
    wide = body.copy()
    wide[0] += PREFERRED_ROOM_M
    while True:
        kept[found] = path[place]
        found += 1
        if place == count - 1:
            return kept[:found]
        last = count - 1
        farther = _farthest_straight(index, path, place, last, wide, levels, frame)
        if farther == place:
            last = place + 1
            while last < count - 1 and _apart(path[place], path[last + 1]) <= TIGHT_M:
                last += 1
            farther = _farthest_straight(index, path, place, last, body, levels, frame)
        place = max(farther, place + 1)


@kernel(forceinline=True)
def _apart(a: Array, b: Array) -> float:
    return math.hypot(b[0] - a[0], b[1] - a[1])


@kernel(nrt=False)
def _farthest_straight(
    index: BoxIndex, path: Array, place: int, last: int, body: Array, levels: Array, frame: Array
) -> int:
    """Return the farthest point up to ``last`` to which one can go straight; ``place`` for none."""
    for farther in range(last, place, -1):
        a, b = path[place], path[farther]
        if _is_known(levels, frame, a, b) and is_free(index, a, b, body):
            return farther
    return place


@kernel(nrt=False)
def _is_known(levels: Array, frame: Array, a: Array, b: Array) -> bool:
    """Whether no cell on a line, sampled twice a cell, is unknown."""
    cell = frame[2]
    steps = int(math.ceil(2.0 * math.hypot(b[0] - a[0], b[1] - a[1]) / cell)) + 1
    for step in range(steps + 1):
        share = step / steps
        column = math.floor((a[0] + share * (b[0] - a[0]) - frame[0]) / cell)
        row = math.floor((a[1] + share * (b[1] - a[1]) - frame[1]) / cell)
        if not (0 <= row < levels.shape[0] and 0 <= column < levels.shape[1]):
            return False
        if levels[int(row), int(column)] == UNKNOWN:
            return False
    return True
