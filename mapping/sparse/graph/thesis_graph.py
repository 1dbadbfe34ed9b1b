"""The graph as the thesis has it: codes are points, edges are cylinders on the floor.

References
----------
Sparse mapper, sections 5.1 to 5.4, with the corrections of the cylinder test. What hangs over the middle
of an edge is missed, as in the thesis.
"""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import above, check_settings, within
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.graph.node_grid import grid_of_nodes
from lidarium.mapping.sparse.graph.nodes import reduced_nodes, standing_nodes
from lidarium.mapping.sparse.graph.topological_graph import (
    GraphSettings,
    TopologicalGraph,
    adjacency,
    candidate_pairs,
    edge_weights,
)
from lidarium.mapping.sparse.graph.voxel_index import KdTreeIndex, VoxelIndex
from lidarium.mapping.sparse.swept_body import SweptBody, cylinder_holds, index_boxes

SUPPORTS: dict[str, type[VoxelIndex] | type[KdTreeIndex] | None] = {
    "voxels": VoxelIndex,
    "kd_tree": KdTreeIndex,
    "none": None,
}
"""What finds the points beside an edge, by name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ThesisGraphSettings:
    """Parameters of the thesis's graph, tables 5.5 and 5.6.

    Attributes
    ----------
    merge_radius : float
        Free nodes nearer to each other than this are merged [m].
    collision_radius, height : float
        Cylinder that must be free above a node [m].
    connection_radius : float
        Cylinder that must be free around an edge [m].
    neighbours : int
        Nearest nodes to which edges are tried.
    longest_edge : float or None
        Longest edge [m]; None for three times the median distance of nearest nodes, at least 1 m.
    support : str
        What finds the points beside an edge: ``voxels``, a ``kd_tree``, or ``none`` to test all. The graph is
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
            raise ValueError(
                f"support of the thesis's graph is {self.support!r}; want one of {', '.join(SUPPORTS)}"
            )


def build_thesis_graph(
    free: NDArray[np.float64], occupied: NDArray[np.float64], settings: ThesisGraphSettings | None = None
) -> TopologicalGraph:
    """Build the graph of free nodes among occupied points.

    Parameters
    ----------
    free, occupied : (N, 3), (M, 3) float64
        Codes [m].
    settings : ThesisGraphSettings or None
        How; the defaults where None.

    Raises
    ------
    ValueError
        Where no node is left.
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
