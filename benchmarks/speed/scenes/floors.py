"""Floors of the speed benchmarks, and poses to scan from.

They are rooms with doors and boxes, and the same turned by 17 degrees.

The floors are made of cells, so that every contender works on the same walls; the boxes that the cells were
drawn from go to the contenders that want shapes.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lidarium.envs.floors.floor import Floor, Raster
from lidarium.envs.simulation.kernels.contact import distance_bound
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kernels.ray_tables import RayTables

RESOLUTION = 0.025
TURN = math.radians(17.0)

_MARGIN, _WALL, _DOOR, _SMALLEST_ROOM, _LARGEST_ROOM = 8, 4, 36, 120, 240
_SMALLEST_BOX, _LARGEST_BOX, _BOX_GAP, _MOST_BOXES = 10, 44, 30, 3

Rectangle = tuple[int, int, int, int]


@dataclass(frozen=True, eq=False)
class BenchFloor:
    """A floor of cells.

    `name`: what the tables call it; `solid` (rows, columns) uint8: 1 if solid; row 0 at the lowest y; `boxes` (B, 4)
    float64: the walls and boxes as x_low, y_low, x_high, y_high [m]; empty if they are not along the axes;
    `resolution`: side of a cell [m].
    """

    name: str
    solid: NDArray[np.uint8]
    boxes: NDArray[np.float64]
    resolution: float = RESOLUTION

    @property
    def raster(self) -> Raster:
        """The cells as the package knows them."""
        return Raster(self.solid, (0.0, 0.0), self.resolution)

    def tables(self) -> FloorTables:
        """Prepare the kernels' tables."""
        raster = self.raster
        return FloorTables(raster, raster, RayTables(self.solid), distance_bound(self.solid))

    def floor(self) -> Floor:
        """Return the floor for an environment."""
        rows, columns = self.solid.shape
        return Floor(self.name, (0.0, 0.0, columns * self.resolution, rows * self.resolution), cells=self.raster)


def straight_floor(rows: int = 512, columns: int = 512, seed: int = 1, resolution: float = RESOLUTION) -> BenchFloor:
    """Draw rooms of 3 to 6 m (at 2.5 cm a cell) with boxes in them. There is a door in every wall between two rooms."""
    generator = np.random.default_rng(seed)
    low, top, right = _MARGIN, rows - _MARGIN, columns - _MARGIN
    boxes: list[Rectangle] = [
        (low, low, right, low + _WALL),
        (low, top - _WALL, right, top),
        (low, low, low + _WALL, top),
        (right - _WALL, low, right, top),
    ]
    pending: list[Rectangle] = [(low + _WALL, low + _WALL, right - _WALL, top - _WALL)]
    while pending:
        room = pending.pop()
        parts = _divided(room, generator)
        if parts is None:
            boxes += _furniture(room, generator)
        else:
            halves, walls = parts
            pending += halves
            boxes += walls
    solid = np.zeros((rows, columns), np.uint8)
    for x_low, y_low, x_high, y_high in boxes:
        solid[y_low:y_high, x_low:x_high] = 1
    return BenchFloor(f"{rows} x {columns}", _closed(solid), np.array(boxes) * resolution, resolution)


def turned_floor(floor: BenchFloor, angle: float = TURN) -> BenchFloor:
    """Turn a floor about its middle at the same scale. A cell is solid if its centre was in a solid cell."""
    rows, columns = floor.solid.shape
    cosine, sine = math.cos(angle), math.sin(angle)
    new_columns = math.ceil(columns * cosine + rows * sine)
    new_rows = math.ceil(columns * sine + rows * cosine)
    # From a cell's centre in the new raster back to where it was.
    back = np.array([[cosine, sine], [-sine, cosine]])
    shift = np.array([columns - 1, rows - 1]) / 2 - back @ np.array([new_columns - 1, new_rows - 1]) / 2
    solid = cv2.warpAffine(
        floor.solid,
        np.column_stack([back, shift]),
        (new_columns, new_rows),
        flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
        borderValue=1,
    )
    return BenchFloor(
        f"{floor.name} turned by 17 deg", _closed(np.asarray(solid, np.uint8)), np.zeros((0, 4)), floor.resolution
    )


def free_poses(floor: BenchFloor, count: int, clearance: float = 0.3, seed: int = 1) -> NDArray[np.float64]:
    """Draw poses x, y, theta [m, rad] inside the building.

    They are this far off everything and twice that off each other.
    """
    generator = np.random.default_rng(seed)
    roomy = _roomy_places(floor, clearance)
    places: list[NDArray[np.float64]] = []
    for k in generator.permutation(len(roomy)):
        place = roomy[k]
        if all(np.hypot(*(place - other)) > 2.0 * clearance for other in places):
            places.append(place)
        if len(places) == count:
            return np.column_stack([np.array(places), generator.uniform(-math.pi, math.pi, count)])
    raise ValueError(f"floor {floor.name!r} has no room for {count} poses that are {clearance} m off everything")


def team_poses(
    floor: BenchFloor, teams: int, robots: int, clearance: float = 0.3, seed: int = 1
) -> NDArray[np.float64]:
    """Draw poses for many teams, (teams * robots, 3) [m, rad].

    They are drawn as by ``free_poses``; the teams do not see each other.
    """
    generator = np.random.default_rng(seed)
    roomy = _roomy_places(floor, clearance)
    places = np.empty((teams, robots, 2))
    for team in places:
        is_apart = False
        while not is_apart:
            team[:] = roomy[generator.integers(len(roomy), size=robots)]
            gaps = np.hypot(*(team[:, None] - team[None]).transpose(2, 0, 1))
            is_apart = bool((gaps[~np.eye(robots, dtype=np.bool_)] > 2.0 * clearance).all())
    return np.column_stack([places.reshape(-1, 2), generator.uniform(-math.pi, math.pi, teams * robots)])


def _roomy_places(floor: BenchFloor, clearance: float) -> NDArray[np.float64]:
    """Return the middles of cells inside the building, (N, 2) [m]. They are this far off everything."""
    distance = ndimage.distance_transform_edt(floor.solid == 0) * floor.resolution
    parts, _ = ndimage.label(floor.solid == 0)
    inside = parts == 1 + int(np.argmax(np.bincount(parts[parts > 0])[1:]))
    rows, columns = np.nonzero(inside & (distance > clearance))
    places: NDArray[np.float64] = (np.column_stack([columns, rows]).astype(np.float64) + 0.5) * floor.resolution
    return places


def _divided(room: Rectangle, generator: np.random.Generator) -> tuple[list[Rectangle], list[Rectangle]] | None:
    """Halve a room by a wall with a door; None if it is small enough."""
    x_low, y_low, x_high, y_high = room
    is_wide = x_high - x_low >= y_high - y_low
    if max(x_high - x_low, y_high - y_low) <= _LARGEST_ROOM + _WALL:
        return None
    along, across = ((x_low, x_high), (y_low, y_high)) if is_wide else ((y_low, y_high), (x_low, x_high))
    wall = int(generator.integers(along[0] + _SMALLEST_ROOM, along[1] - _SMALLEST_ROOM - _WALL + 1))
    door = int(generator.integers(across[0] + 6, across[1] - _DOOR - 5))
    pieces = ((wall, across[0], wall + _WALL, door), (wall, door + _DOOR, wall + _WALL, across[1]))
    if is_wide:
        return [(x_low, y_low, wall, y_high), (wall + _WALL, y_low, x_high, y_high)], list(pieces)
    return [(x_low, y_low, x_high, wall), (x_low, wall + _WALL, x_high, y_high)], [
        (b, a, d, c) for a, b, c, d in pieces
    ]


def _furniture(room: Rectangle, generator: np.random.Generator) -> list[Rectangle]:
    x_low, y_low, x_high, y_high = room
    boxes: list[Rectangle] = []
    for _ in range(int(generator.integers(1, _MOST_BOXES + 1))):
        width, depth = (int(side) for side in generator.integers(_SMALLEST_BOX, _LARGEST_BOX, 2))
        if x_high - x_low > width + 2 * _BOX_GAP and y_high - y_low > depth + 2 * _BOX_GAP:
            x, y = (int(generator.integers(x_low, x_high - width)), int(generator.integers(y_low, y_high - depth)))
            boxes.append((x, y, x + width, y + depth))
    return boxes


def _closed(solid: NDArray[np.uint8]) -> NDArray[np.uint8]:
    solid[[0, -1]] = 1
    solid[:, [0, -1]] = 1
    return np.ascontiguousarray(solid)
