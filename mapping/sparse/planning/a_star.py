"""A* on a topological graph, from several first nodes to several last ones.

References
----------
P. E. Hart, N. J. Nilsson and B. Raphael, "A formal basis for the heuristic determination of minimum cost
paths", 1968. Sparse mapper, section 7.2, corrected: costs and estimates are kept apart.
"""

import math

import numpy as np

from lidarium.mapping.kernels.compilation import Array, kernel

NO_NODE = -1


@kernel(nrt=False)
def push(heap: Array, keys: Array, size: int, node: int, key: float) -> int:
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
def pop(heap: Array, keys: Array, size: int) -> int:
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
def shortest_path(
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
        What it costs to come to each node from the start, and to go from it to the goal; inf where one cannot
        [m].
    goal : (3,) float64
        Where the goal is [m].

    Returns
    -------
    path : (P,) int64
        Nodes in order; empty where there is no path.
    cost : float
        What it costs from the start to the goal; inf where there is no path.
    """
    count = nodes.shape[0]
    costs, before = np.full(count, np.inf), np.full(count, NO_NODE)
    is_closed = np.zeros(count, np.bool_)
    heap, keys = np.empty(ends.shape[0] + count + 1, np.int64), np.empty(ends.shape[0] + count + 1)
    size = 0
    for node in range(count):
        if first[node] < np.inf:
            costs[node] = first[node]
            size = push(heap, keys, size, node, first[node] + _estimate(nodes[node], goal))
    best, best_cost = NO_NODE, np.inf
    while size > 0 and keys[0] < best_cost:
        node = heap[0]
        size = pop(heap, keys, size)
        if is_closed[node]:
            continue
        is_closed[node] = True
        if costs[node] + last[node] < best_cost:
            best, best_cost = node, costs[node] + last[node]
        for k in range(starts[node], starts[node + 1]):
            other, cost = ends[k], costs[node] + weights[k]
            if cost < costs[other]:
                costs[other], before[other] = cost, node
                size = push(heap, keys, size, other, cost + _estimate(nodes[other], goal))
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
