"""Shortest paths of a disc on a floor that is known: by a graph of corners that see each other.

Solids at the body's heights are grown by its radius. The shortest path between two points bends at corners
of what has grown alone (Lozano-Perez and Wesley, CACM 22, 1979).
"""

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from lidarium.benchmarks.studies.sparse.places import BODY, Place

ARC_SEGMENTS = 8
"""Straight pieces of a quarter circle around a grown corner."""

TOUCH_M = 1e-5
"""By how much what has grown shrinks again, so that paths may run along it [m]."""

LINES_AT_ONCE = 200_000


class ShortestPaths:
    """The shortest paths of the body in a place.

    Parameters
    ----------
    place : Place
        The place.
    """

    def __init__(self, place: Place) -> None:
        solids = [
            shapely.Polygon(solid.polygon, list(solid.holes))
            for solid in place.floor.solids
            if solid.z_low < BODY.height and solid.z_high > BODY.clearance
        ]
        grown = shapely.union_all([solid.buffer(BODY.radius, quad_segs=ARC_SEGMENTS) for solid in solids])
        self._barrier = grown.buffer(-TOUCH_M)
        shapely.prepare(self._barrier)
        self._corners = self._reached_corners(place, grown)
        count = len(self._corners)
        first, second = np.triu_indices(count, 1)
        seen = self._see(self._corners[first], self._corners[second])
        self._first, self._second = first[seen], second[seen]
        self._gaps = np.linalg.norm(self._corners[self._first] - self._corners[self._second], axis=1)

    @staticmethod
    def _reached_corners(place: Place, grown: shapely.Geometry) -> NDArray[np.float64]:
        """Return the corners of what has grown beside which the body can be, (C, 2) [m]."""
        corners = np.unique(shapely.get_coordinates(grown.simplify(1e-3)), axis=0)
        low_x, low_y, high_x, high_y = place.floor.bounds
        inside = (corners > (low_x, low_y)).all(axis=1) & (corners < (high_x, high_y)).all(axis=1)
        return np.asarray(corners[inside])

    def _see(self, starts: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which pairs of points (N, 2) are joined by a free straight line, (N,) bool."""
        parts = []
        for first in range(0, len(starts), LINES_AT_ONCE):
            part = slice(first, first + LINES_AT_ONCE)
            lines = shapely.linestrings(np.stack([starts[part], ends[part]], axis=1))
            parts.append(~shapely.intersects(self._barrier, lines))
        return np.concatenate(parts) if parts else np.zeros(0, np.bool_)

    def lengths(self, requests: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the length of the shortest path of each request (N, 2, 2) [m]; inf where there is none."""
        count, corners = len(self._corners), self._corners
        found = np.empty(len(requests))
        for k, (start, goal) in enumerate(requests):
            ends = np.stack([start, goal])
            tips, nodes = np.repeat([count, count + 1], count), np.tile(np.arange(count), 2)
            seen = self._see(np.repeat(ends, count, axis=0), np.tile(corners, (2, 1)))
            direct = np.linalg.norm(goal - start) if self._see(start[None], goal[None])[0] else np.inf
            rows = np.concatenate([self._first, tips[seen]])
            columns = np.concatenate([self._second, nodes[seen]])
            gaps = np.linalg.norm(np.repeat(ends, count, axis=0) - np.tile(corners, (2, 1)), axis=1)[seen]
            weights = np.concatenate([self._gaps, np.maximum(gaps, 1e-12)])
            shortest: Any = dijkstra
            graph = csr_array((weights, (rows, columns)), shape=(count + 2, count + 2))
            gone = shortest(graph, directed=False, indices=count)
            found[k] = min(direct, gone[count + 1])
        return found
