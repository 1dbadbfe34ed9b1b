"""Grids beside sparse maps: an OctoMap and its projection, the map of a planar laser, their planner.

The thesis's baseline, section 8: an OctoMap without floor and ceiling, projected to the plane and inflated by
the robot's radius, on which A* finds paths that keep off obstacles.
"""

import importlib
import zlib
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.sparse.places import BODY, Frame, Place
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import cells_of, centres_of, plan
from lidarium.mapping.planning.search.path_search import SearchSpace

RESOLUTION_M = 0.05
RANGE_M = 4.0
FLOOR_M = 0.10
"""Height up to which a voxel belongs to the floor [m]."""

LASER_M = 0.30
"""Height of a laser's plane [m]."""

MARGIN_M = 0.20
"""Farther than the radius from obstacles by this, grid paths cost no more than their length [m]."""


class GridMap:
    """A grid of what is free, and its planner.

    `log_odds` (rows, columns) int8: < 0 free, 0 unknown, > 0 occupied; `origin` (2,) float64: lower left corner [m].
    """

    def __init__(self, log_odds: NDArray[np.int8], origin: NDArray[np.float64]) -> None:
        self.log_odds = np.ascontiguousarray(log_odds)
        self.origin = (float(origin[0]), float(origin[1]))
        rows, columns = log_odds.shape
        self._footprint = Footprint(BODY.radius, BODY.radius + MARGIN_M)
        self._clearance = ClearanceField((rows, columns), RESOLUTION_M)
        self._clearance.update(self.log_odds, (0, rows, 0, columns))
        self._space = SearchSpace((rows, columns), RESOLUTION_M)

    def plan(self, start: NDArray[np.float64], goal: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the path (P, 2) from a start to a goal [m], or None."""
        ends = [tuple(map(int, cells_of(point, self.origin, RESOLUTION_M))) for point in (start, goal)]
        found = plan(
            self._space,
            self.log_odds,
            self._clearance,
            (ends[0][0], ends[0][1]),
            (ends[1][0], ends[1][1]),
            self._footprint,
        )
        if found is None:
            return None
        inner = centres_of(found[1][1:-1], self.origin, RESOLUTION_M)
        return np.concatenate([start[None], inner, goal[None]])

    def are_blocked(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return at which points (N, 2) [m] the inflated grid lets no robot stand, (N,) bool."""
        rows, columns = cells_of(points, self.origin, RESOLUTION_M).T
        closeness = self._clearance.closeness[rows, columns].astype(np.float64)
        gaps = np.sqrt(self._clearance.limit - closeness) * 0.5 * RESOLUTION_M
        return np.asarray((gaps < BODY.radius) | (self.log_odds[rows, columns] >= 0))


def laser_grid(place: Place) -> GridMap:
    """Return the grid of a planar laser that has seen everything, without error."""
    raster = place.floor.raster(RESOLUTION_M, LASER_M, LASER_M)
    return GridMap(np.where(raster.solid, 1, -1).astype(np.int8), np.array(raster.origin))


@dataclass(frozen=True, slots=True)
class TreeSizes:
    """Bytes of an OctoMap: as bits, with probabilities, and the bits deflated."""

    bits: int
    full: int
    bits_deflated: int


class OctoMap:
    """An OctoMap of frames, made by the octomap library."""

    def __init__(self) -> None:
        library: Any = importlib.import_module("octomap")
        self._tree: Any = library.OcTree(RESOLUTION_M)

    def add(self, frame: Frame) -> None:
        """Insert the rays of a frame, one for each voxel that it meets."""
        points = np.ascontiguousarray(frame.in_map, np.float64)
        self._tree.insertPointCloud(points, frame.pose[:3, 3].copy(), RANGE_M, True, True)

    def sizes(self) -> TreeSizes:
        """Return the bytes of its files."""
        self._tree.updateInnerOccupancy()
        with TemporaryDirectory() as folder:
            full, bits = Path(folder) / "tree.ot", Path(folder) / "tree.bt"
            if not self._tree.write(str(full).encode()) or not self._tree.writeBinary(str(bits).encode()):
                raise OSError(f"octomap has not written to {folder}")
            content = bits.read_bytes()
            return TreeSizes(len(content), full.stat().st_size, len(zlib.compress(content, 9)))

    def projected(self, place: Place) -> GridMap:
        """Return the grid of what stands between floor and ceiling; what no ray has met is unknown."""
        raster = place.floor.raster(RESOLUTION_M, BODY.clearance, BODY.height)
        log_odds = np.zeros(raster.solid.shape, np.int8)
        for node in self._tree.begin_leafs():
            x, y, z = node.getCoordinate()
            half = 0.5 * node.getSize()
            is_occupied = self._tree.isNodeOccupied(node)
            if z - half >= BODY.height or (is_occupied and z + half <= FLOOR_M + 1e-6):
                if not (is_occupied and z + half <= FLOOR_M + 1e-6):
                    continue
                value = np.int8(-1)
            else:
                value = np.int8(1 if is_occupied else -1)
            low = cells_of(np.array([x - half + 1e-6, y - half + 1e-6]), raster.origin, RESOLUTION_M)
            high = cells_of(np.array([x + half - 1e-6, y + half - 1e-6]), raster.origin, RESOLUTION_M)
            part = log_odds[max(low[0], 0) : high[0] + 1, max(low[1], 0) : high[1] + 1]
            if value > 0:
                part[:] = 1
            else:
                part[part == 0] = -1
        return GridMap(log_odds, np.array(raster.origin))
