"""Graphs of places and views with links of given lengths."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from lidarium.envs.floors.floor import Raster
from lidarium.evaluation.bounds.view_graph import ViewGraph, bits_of


def graph_of(links, seen_by, robots=1):
    """Return a graph of links (first, second, length); point k is seen from the places ``seen_by[k]``."""
    count = 1 + max(max(a, b) for a, b, _ in links)
    table = np.zeros((count, count))
    for a, b, length in links:
        table[a, b] = table[b, a] = length
    lengths, before = dijkstra(csr_array(table), return_predecessors=True)
    views = np.zeros((count, 1), np.uint64)
    for point, places in enumerate(seen_by):
        for place in places:
            views[place] |= bits_of(np.array([point]), 1)
    raster = Raster(np.zeros((4, 4), np.uint8), (0.0, 0.0), 1.0)
    points = np.zeros((len(seen_by), 2), np.int64)
    places = np.zeros((count, 2))
    return ViewGraph(places, np.ones(count), robots, csr_array(table), lengths, before, views, points, raster)


STAR = [(0, 1, 1.0), (1, 2, 1.0), (0, 3, 1.0), (3, 4, 2.0), (0, 5, 1.0), (5, 6, 3.0)]
"""Three arms of 2, 3 and 4 m."""
