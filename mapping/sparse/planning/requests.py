"""Requests for paths: from a start to a goal on the map, or why there is none.

References
----------
Sparse mapper, section 7.3. The straight connections of start and goal to the graph are tested, which the
thesis leaves out; the nearest nodes are tried in order of their distance.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.graph.node_grid import NodeGrid, nearest_nodes
from lidarium.mapping.sparse.graph.topological_graph import TopologicalGraph
from lidarium.mapping.sparse.planning.a_star import shortest_path
from lidarium.mapping.sparse.planning.shortcuts import path_length, shortened
from lidarium.mapping.sparse.swept_body import BoxIndex, is_free

CONNECTORS = 10
"""Nearest nodes to which a start and a goal are connected."""

FOUND, START_IN_COLLISION, GOAL_IN_COLLISION, NO_PATH = range(4)

REASONS = ("", "start in collision", "goal in collision", "no path")
"""Why there is no path, by number; empty where there is one."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The answer to a request.

    Attributes
    ----------
    path : (P, 3) float64
        Points from the start to the goal [m]; empty where there is no path.
    reason : str
        Why there is none: ``start in collision``, ``goal in collision`` or ``no path``; else empty.
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
        """Length of the path [m]; inf where there is none."""
        return float(path_length(self.path)) if self.is_found else float("inf")


def plan(
    graph: TopologicalGraph,
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    shortens: bool = True,
) -> Plan:
    """Plan a path for the body of a graph.

    Parameters
    ----------
    graph : TopologicalGraph
        Where it can be driven.
    start, goal : (2,) or (3,) float64
        Where from and where to [m]; without a height, that of the nearest node.
    shortens : bool
        Whether the path leaves the graph where it can be driven straight.

    Raises
    ------
    ValueError
        Where the start or the goal is no finite point.
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
    return Plan(path, REASONS[reason], nodes)


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
def connect(index: BoxIndex, grid: NodeGrid, point: Array, body: Array, costs: Array) -> bool:
    """Write what it costs to go straight from a point to its nearest nodes, where the body can; inf else."""
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
    if not connect(index, grid, start, body, first) or not connect(index, grid, goal, body, last):
        return nothing, 0, NO_PATH
    nodes, _ = shortest_path(grid.nodes, starts, ends, weights, first, last, goal)
    if nodes.shape[0] == 0:
        return nothing, 0, NO_PATH
    path = np.empty((nodes.shape[0] + 2, 3))
    path[0], path[nodes.shape[0] + 1] = start, goal
    for k in range(nodes.shape[0]):
        path[k + 1] = grid.nodes[nodes[k]]
    return (shortened(index, path, body) if shortens else path), path.shape[0], FOUND
