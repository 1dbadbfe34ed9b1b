"""All scans that were matched, and the map of them."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.grids.growing_array import GrowingArray
from lidarium.mapping.grids.occupancy import OccupancyGrid, OccupancySettings
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.dead_reckoning.localizer import KeyScans


class ScanHistory:
    """Matched scans, each with the node before it and its pose in that node's frame.

    Parameters
    ----------
    geometry : ScanGeometry
        Directions of the beams.
    resolution : float
        Side of the map's cells [m].
    """

    def __init__(self, geometry: ScanGeometry, resolution: float) -> None:
        self._geometry, self._resolution = geometry, resolution
        self._nodes, self._poses = GrowingArray((), np.int64), GrowingArray((3,), np.float64)
        self._ranges = GrowingArray((geometry.beams,), np.float32)
        self._times = GrowingArray((), np.float64)
        self._map, self._mapped = OccupancyGrid(), 0

    def append(
        self, node: int, pose: NDArray[np.float64], ranges: NDArray[np.float32], time_s: float
    ) -> None:
        """Take in a scan that was taken at a time [s]."""
        self._nodes.append(node)
        self._poses.append(pose)
        self._ranges.append(ranges)
        self._times.append(time_s)

    def scans(self, nodes: NDArray[np.float64]) -> KeyScans:
        """Return all scans at their poses, by the poses of the nodes (n, 3) [m, rad]."""
        poses = composed(nodes[self._nodes.rows], self._poses.rows)
        return KeyScans(poses, self._ranges.rows, self._times.rows)

    def since(self, node: int) -> NDArray[np.int64]:
        """Return the numbers of the scans that were taken at a node or after it."""
        return np.flatnonzero(self._nodes.rows >= node)

    def map(self, nodes: NDArray[np.float64]) -> OccupancyGrid:
        """Return the map of all scans, by the poses of the nodes (n, 3) [m, rad]."""
        if self._mapped == 0:
            self._map = OccupancyGrid(OccupancySettings(resolution=self._resolution))
        scans = self.scans(nodes)
        for pose, ranges in zip(scans.poses[self._mapped :], scans.ranges[self._mapped :], strict=True):
            self._map.integrate(pose, ranges, self._geometry)
        self._mapped = len(self._ranges)
        return self._map

    def discard_map(self) -> None:
        """Render the map again when it is next asked for: nodes have moved."""
        self._mapped = 0
