"""The graph as the thesis has it: codes are points, edges are cylinders on the floor.

References
----------
Sparse mapper, section 6, corrected: a query divides by the size of voxels, and the index counts columns times
rows for each layer.

Sparse mapper, sections 5.1 to 5.4, with the corrections of the cylinder test. What hangs over the middle
of an edge is missed, as in the thesis.
"""

from dataclasses import dataclass
from itertools import product
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidarium.mapping.geometry.bounds import above, check_settings, shown, within
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.graph import (
    GraphSettings,
    TopologicalGraph,
    adjacency,
    candidate_pairs,
    edge_weights,
    grid_of_nodes,
    reduced_nodes,
    standing_nodes,
)
from lidarium.mapping.sparse.swept_body import SweptBody, cylinder_holds, index_boxes

NEIGHBOURHOODS: dict[int, NDArray[np.int64]] = {
    4: np.array([(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0)]),
    6: np.array([(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)]),
    8: np.array([(i, j, 0) for i, j in product((-1, 0, 1), repeat=2) if (i, j) != (0, 0)]),
    27: np.array(list(product((-1, 0, 1), repeat=3))),
}
"""Neighbouring voxels of a query: along x and y, along all axes, all of a layer, all around."""


class VoxelIndex:
    """Points sorted into voxels.

    Parameters
    ----------
    points : (N, 3) float64
        The points [m].
    size : float or (3,) float
        Sides of a voxel [m].
    """

    def __init__(self, points: NDArray[np.float64], size: float | NDArray[np.float64] = 0.5) -> None:
        self.points = np.ascontiguousarray(points, np.float64).reshape(-1, 3)
        self.size = np.broadcast_to(np.asarray(size, np.float64), 3)
        if not (np.isfinite(self.size).all() and (self.size > 0.0).all()):
            raise ValueError(f"size of voxels is {shown(size)} m; want positive numbers")
        if len(self.points) == 0:
            raise ValueError("there are no points to index; want at least one")
        self._low = self.points.min(axis=0)
        cells = np.floor((self.points - self._low) / self.size).astype(np.int64)
        self.shape = cells.max(axis=0) + 1
        places = self._places(cells)
        self._order = np.argsort(places, kind="stable")
        self._sorted = places[self._order]

    def _places(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.asarray(cells @ np.array([1, self.shape[0], self.shape[0] * self.shape[1]]))

    def _members(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the points in cells (C, 3), in their order."""
        places = self._places(cells)
        firsts, lasts = (np.searchsorted(self._sorted, places, side) for side in ("left", "right"))
        found = [self._order[first:last] for first, last in zip(firsts, lasts, strict=True)]
        return np.sort(np.concatenate(found)) if found else np.zeros(0, np.int64)

    def voxel(self, point: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the voxel (3,) in which a point lies; it may lie beyond all of them."""
        place = (np.asarray(point, np.float64) - self._low) / self.size
        return np.asarray(np.floor(place).astype(np.int64))

    def beside(self, point: NDArray[np.float64], neighbours: int = 27) -> NDArray[np.int64]:
        """Return the points in the voxel of a point and in its neighbours.

        Parameters
        ----------
        point : (3,) float64
            The place [m].

        Returns
        -------
        (M,) int64
            Numbers of points, in their order.
        """
        if neighbours not in NEIGHBOURHOODS:
            raise ValueError(f"neighbours is {neighbours}; want one of {', '.join(map(str, NEIGHBOURHOODS))}")
        cells = np.unique(np.vstack([NEIGHBOURHOODS[neighbours], (0, 0, 0)]), axis=0) + self.voxel(point)
        return self._members(cells[((cells >= 0) & (cells < self.shape)).all(axis=1)])

    def within(self, point: NDArray[np.float64], radius: float) -> NDArray[np.int64]:
        """Return the points at most so far [m] from a place (3,), in their order, (M,) int64."""
        low = np.maximum(self.voxel(point - radius), 0)
        high = np.minimum(self.voxel(point + radius), self.shape - 1)
        if (low > high).any():
            return np.zeros(0, np.int64)
        spans = [np.arange(first, last + 1) for first, last in zip(low, high, strict=True)]
        found = self._members(np.stack(np.meshgrid(*spans, indexing="ij"), axis=-1).reshape(-1, 3))
        gaps = self.points[found] - point
        return np.asarray(found[np.einsum("ij,ij->i", gaps, gaps) <= radius * radius])


class KdTreeIndex:
    """Points in a k-d tree, which the thesis names as an alternative to voxels.

    Parameters
    ----------
    points : (N, 3) float64
        The points [m].
    """

    def __init__(self, points: NDArray[np.float64]) -> None:
        self.points = np.ascontiguousarray(points, np.float64).reshape(-1, 3)
        self._tree = cKDTree(self.points)

    def within(self, point: NDArray[np.float64], radius: float) -> NDArray[np.int64]:
        """Return the points at most so far [m] from a place (3,), in their order, (M,) int64."""
        return np.asarray(self._tree.query_ball_point(point, radius, return_sorted=True), np.int64)


SUPPORTS: dict[str, type[VoxelIndex] | type[KdTreeIndex] | None] = {
    "voxels": VoxelIndex,
    "kd_tree": KdTreeIndex,
    "none": None,
}
"""Index of the points near an edge, by name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ThesisGraphSettings:
    """Parameters of the thesis's graph, tables 5.5 and 5.6.

    Attributes
    ----------
    merge_radius : float, default 0.15
        Free nodes nearer to each other than this are merged [m].
    collision_radius, height : float, default 0.3, 1.2
        Cylinder that must be free above a node [m].
    connection_radius : float, default 0.3
        Cylinder that must be free around an edge [m].
    neighbours : int, default 6
        Nearest nodes to which edges are tried.
    longest_edge : float or None
        Longest edge [m]; None for three times the median distance of nearest nodes, at least 1 m.
    support : str, default "voxels"
        Index of the points near an edge: ``voxels``, a ``kd_tree``, or ``none`` to test all. The graph is
        the same.
    """

    merge_radius: Annotated[float, within(0.0, 10.0)] = 0.15
    collision_radius: Annotated[float, above(0.0, 10.0)] = 0.3
    height: Annotated[float, above(0.0, 100.0)] = 1.2
    connection_radius: Annotated[float, above(0.0, 10.0)] = 0.3
    neighbours: Annotated[int, within(1, 64)] = 6
    longest_edge: Annotated[float, above(0.0, 1000.0)] | None = None
    support: str = "voxels"

    def __post_init__(self) -> None:
        check_settings(self, "the thesis's graph")
        if self.support not in SUPPORTS:
            raise ValueError(f"support of the thesis's graph is {self.support!r}; want one of {', '.join(SUPPORTS)}")


def build_thesis_graph(
    free: NDArray[np.float64], occupied: NDArray[np.float64], settings: ThesisGraphSettings | None = None
) -> TopologicalGraph:
    """Build the graph of free nodes among occupied points.

    Parameters
    ----------
    free, occupied : (N, 3), (M, 3) float64
        Codes [m].
    """
    settings = settings or ThesisGraphSettings()
    points = np.ascontiguousarray(occupied, np.float64).reshape(-1, 3)
    index = index_boxes(np.stack([points, points], axis=1))
    body = SweptBody(radius=settings.collision_radius, height=settings.height, clearance=0.0)
    nodes = reduced_nodes(free, settings.merge_radius)
    nodes = nodes[standing_nodes(nodes, index, body)]
    if len(nodes) == 0:
        raise ValueError(
            f"none of {len(free)} free codes has a free cylinder of {settings.collision_radius} m above it; "
            "want a smaller collision_radius"
        )
    grid = grid_of_nodes(nodes)
    pairs = candidate_pairs(grid, settings.neighbours, settings.longest_edge)
    starts, ends = nodes[pairs[:, 0]], nodes[pairs[:, 1]]
    open_pairs = pairs[_are_open(starts, ends, points, settings)]
    weights = edge_weights(nodes, open_pairs, index, body, GraphSettings())
    starts, ends, listed = adjacency(len(nodes), open_pairs, weights)
    return TopologicalGraph(grid, starts, ends, listed, index, body)


def _are_open(
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    points: NDArray[np.float64],
    settings: ThesisGraphSettings,
) -> NDArray[np.bool_]:
    """Return which edges (P, 3) to (P, 3) have a cylinder without points (M, 3), (P,) bool."""
    make, radius = SUPPORTS[settings.support], settings.connection_radius
    if make is None or len(points) == 0:
        return np.asarray(_free_cylinders(starts, ends, points, radius))
    index, found = make(points), np.ones(len(starts), np.bool_)
    for k, (start, end) in enumerate(zip(starts, ends, strict=True)):
        # A ball around the cylinder holds all that can be in it.
        reach = float(np.hypot(0.5 * np.linalg.norm(end - start), radius)) + 1e-9
        near = index.within(0.5 * (start + end), reach)
        found[k] = len(near) == 0 or not cylinder_holds(start, end, points[near], radius).any()
    return found


@kernel
def _free_cylinders(starts: Array, ends: Array, points: Array, radius: float) -> Any:  # noqa: ANN401
    """Return which cylinders from (N, 3) to (N, 3) hold none of the points (M, 3), (N,) bool."""
    found = np.empty(starts.shape[0], np.bool_)
    for k in range(starts.shape[0]):
        found[k] = not cylinder_holds(starts[k], ends[k], points, radius).any()
    return found
