"""Measures of a building, to compare a generated floor with its request.

What the generator was asked for is measured on the floor that it produced.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.free_space import configuration_space

MEASURED_RADIUS = 0.30
"""Radius of the robot whose loops are counted [m]."""

HALF_DOOR = 0.55
"""Half the widest opening that separates two rooms [m]."""

_RESOLUTION = 0.05
_BODY_HEIGHT = 2.0


@dataclass(frozen=True, slots=True)
class BuildingMeasures:
    """Figures of a building.

    Attributes
    ----------
    area_m2 : float
        Free floor area, neither under walls nor under furniture [m²].
    loops : int
        Independent cycles on which a robot of radius 0.30 m can drive around walls; furniture is not counted.
    clutter : float
        Share of the area between the walls that is under furniture, all that ends below the ceiling.
    rooms : int
        Spaces that openings up to 1.1 m wide separate, halls and corridors included.
    """

    area_m2: float
    loops: int
    clutter: float
    rooms: int


def measure_building(floor: Floor) -> BuildingMeasures:
    """Measure a floor at a resolution of 0.05 m.

    Parameters
    ----------
    floor : Floor
        Any floor; one made of cells has walls only.

    Returns
    -------
    BuildingMeasures

    Raises
    ------
    ValueError
        If a robot of radius 0.30 m fits nowhere.
    """
    walls = floor
    if floor.solids:
        walls = Floor(
            floor.name, floor.bounds, tuple(solid for solid in floor.solids if solid.z_high == np.inf)
        )
    empty = walls.raster(_RESOLUTION, 0.0, _BODY_HEIGHT)
    full = floor.raster(_RESOLUTION, 0.0, _BODY_HEIGHT)
    space = configuration_space(empty, MEASURED_RADIUS)
    if not space.any():
        raise ValueError(f"floor {floor.name!r} has no room for a robot of radius {MEASURED_RADIUS} m")
    largest = _largest_part(space)
    inside = _containing(empty.solid == 0, largest)
    wide = (
        cv2.distanceTransform(1 - empty.solid, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * _RESOLUTION > HALF_DOOR
    )
    between_walls = int(inside.sum())
    free = int((inside & (full.solid == 0)).sum())
    return BuildingMeasures(
        area_m2=round(free * _RESOLUTION**2, 3),
        loops=_holes(largest),
        clutter=round(1.0 - free / between_walls, 4),
        rooms=cv2.connectedComponents((wide & inside).astype(np.uint8), connectivity=4)[0] - 1,
    )


def _largest_part(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    _, parts, stats, _ = cv2.connectedComponentsWithStats(cells.astype(np.uint8), connectivity=4)
    return np.asarray(parts == 1 + np.argmax(stats[1:, cv2.CC_STAT_AREA]))


def _containing(cells: NDArray[np.bool_], part: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the connected part of `cells` that holds `part`."""
    _, parts = cv2.connectedComponents(cells.astype(np.uint8), connectivity=4)
    return np.asarray(parts == parts[part][0])


def _holes(part: NDArray[np.bool_]) -> int:
    """Holes of a connected part of the plane: its independent cycles."""
    framed = np.pad(~part, 1, constant_values=True)
    return int(cv2.connectedComponents(framed.astype(np.uint8), connectivity=8)[0]) - 2
