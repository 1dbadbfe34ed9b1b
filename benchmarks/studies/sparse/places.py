"""Furnished places, the requests that are made there, and what decides whether a path collides."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Floor
from lidarium.mapping.sparse.planning import points_along
from lidarium.mapping.sparse.swept_body import SweptBody

PLACES = ("robotics_laboratory", "signal_laboratory", "home_arena", "apartment")
"""Two laboratories, an arena and a flat, as in the thesis, section 5.2."""

BODY = SweptBody(radius=0.30, height=1.2)
REQUESTS = 1000
CLEAR_M = 0.05
"""By how much a start and a goal are farther from what stands there than the robot's radius [m]."""

CELL_M = 0.01
"""Side of a cell of the raster that decides whether a path collides [m]."""

STEP_M = 0.005
"""Distance of the points of a path that are looked up [m]."""


@dataclass(frozen=True, eq=False)
class Place:
    """A furnished floor as it is, for a body.

    Attributes
    ----------
    name : str
        Name of the floor.
    floor : Floor
        The floor.
    origin : (2,) float64
        Lower left corner of the raster [m].
    gaps : (rows, columns) float32
        Distance of each cell's centre from the nearest solid one at the body's heights [m].
    reached : (rows, columns) bool
        Cells to which the body can be driven from the first start.
    """

    name: str
    floor: Floor
    origin: NDArray[np.float64]
    gaps: NDArray[np.float32]
    reached: NDArray[np.bool_]

    def gaps_at(self, points: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the gaps at points (N, 2 or 3) [m]."""
        columns, rows = np.floor((points[:, :2] - self.origin) / CELL_M).astype(np.int64).T
        return np.asarray(self.gaps[rows, columns])

    def collides(self, path: NDArray[np.float64]) -> bool:
        """Whether the body is less than its radius, less a cell, from a solid anywhere on a path (P, 3)."""
        return bool(self.gaps_at(points_along(path, STEP_M)).min() < BODY.radius - CELL_M)

    def drawn_points(self, clearance_m: float, count: int, seed: int) -> NDArray[np.float64]:
        """Draw points (count, 2) that the body can reach, so far from solids [m]."""
        rows, columns = np.nonzero(self.reached & (self.gaps > clearance_m))
        drawn = np.random.default_rng(seed).integers(0, len(rows), count)
        return self.origin + (np.stack([columns[drawn], rows[drawn]], axis=1) + 0.5) * CELL_M


def load_place(name: str) -> Place:
    """Load a place."""
    floor = load_floor(name)
    raster = floor.raster(CELL_M, BODY.clearance, BODY.height)
    gaps = ndimage.distance_transform_edt(raster.solid == 0) * CELL_M
    labels, _ = ndimage.label(gaps > BODY.radius)
    origin = np.array(raster.origin)
    column, row = np.floor((floor.starts[0, :2] - origin) / CELL_M).astype(np.int64)
    return Place(name, floor, origin, gaps.astype(np.float32), np.asarray(labels == labels[row, column]))


def requests_of(place: Place) -> NDArray[np.float64]:
    """Return starts and goals, (REQUESTS, 2, 2) [m]."""
    return place.drawn_points(BODY.radius + CLEAR_M, 2 * REQUESTS, seed=0).reshape(-1, 2, 2)
