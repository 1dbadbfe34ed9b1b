"""What it costs to come to each node of a graph.

References
----------
E. W. Dijkstra, "A note on two problems in connexion with graphs", 1959. Sparse mapper, section 7.1,
corrected: costs are those of the node that is left, not of the one that is entered.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.graph.topological_graph import TopologicalGraph
from lidarium.mapping.sparse.planning.a_star import pop, push
from lidarium.mapping.sparse.planning.requests import connect


def costs_from(graph: TopologicalGraph, start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what it costs to come to each node from a place.

    Parameters
    ----------
    graph : TopologicalGraph
        The graph.
    start : (3,) float64
        Where from; it is connected to its nearest nodes as a request is [m].

    Returns
    -------
    (N,) float64
        Costs; inf for nodes that cannot be reached [m].
    """
    first = np.full(len(graph.nodes), np.inf)
    connect(graph.index, graph.grid, np.asarray(start, np.float64), graph.body.numbers, first)
    return np.asarray(_costs(graph.starts, graph.ends, graph.weights, first))


@kernel
def _costs(starts: Array, ends: Array, weights: Array, first: Array) -> Array:
    """Return the cost of each node; ``first`` (N,) is that of coming to it straight, inf where one cannot."""
    count = first.shape[0]
    costs, is_closed = first.copy(), np.zeros(count, np.bool_)
    heap, keys = np.empty(ends.shape[0] + count + 1, np.int64), np.empty(ends.shape[0] + count + 1)
    size = 0
    for node in range(count):
        if costs[node] < np.inf:
            size = push(heap, keys, size, node, costs[node])
    while size > 0:
        node = heap[0]
        size = pop(heap, keys, size)
        if is_closed[node]:
            continue
        is_closed[node] = True
        for k in range(starts[node], starts[node + 1]):
            cost = costs[node] + weights[k]
            if cost < costs[ends[k]]:
                costs[ends[k]] = cost
                size = push(heap, keys, size, ends[k], cost)
    return costs
