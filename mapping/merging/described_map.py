"""A map with all that is computed of it once, whatever it is compared with."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.merging.corners import Corners, CornerSettings, detect_corners
from lidarium.mapping.merging.descriptors import Descriptors, DescriptorSettings, describe_corners
from lidarium.mapping.merging.regions.graph import RegionGraph
from lidarium.mapping.merging.rims import without_rims

MAX_SIDE, MAX_CELLS = 20_000, 50_000_000
"""Most rows or columns of a map, and most cells: each takes some 20 bytes while maps are compared."""

_FACING_REACH = 3
_FAR = 1e6

OPEN_DISTANCE_M = 0.1
"""Least distance of a cell in the open from all that is not free [m].

A wall that an error of 4 cm of two maps puts at the rim of free space is not open.
"""

FACING_DISTANCE_M = 0.075
"""How far before and behind a wall cells are read to find its side [m].

Half of what thin walls measure.
"""


@dataclass(frozen=True, slots=True, eq=False)
class DescribedMap:
    """A map and its features.

    Attributes
    ----------
    levels : (rows, columns) uint8
        0 occupied, 127 unknown, 255 free.
    resolution : float
        Side of a cell [m].
    corners : Corners
        Its corners.
    descriptors : Descriptors
        Theirs.
    walls : (n, 2) float64
        Centres of the occupied cells that border on a free one: walls as seen by a laser [m].
    normals : (n, 2) float64
        Normal of each of them: unit vectors towards the free space around it, zero if that has no
        side.
    distance : (rows, columns) float32
        Distance to the nearest of these walls [m]; large if there is none.
    is_open : (rows, columns) uint8
        1 if all around a cell is free, so that no wall that is seen elsewhere can belong there.
    regions : RegionGraph or None
        Its regions of free space; None if they were not asked for.
    """

    levels: NDArray[np.uint8]
    resolution: float
    corners: Corners
    descriptors: Descriptors
    walls: NDArray[np.float64]
    normals: NDArray[np.float64]
    distance: NDArray[np.float32]
    is_open: NDArray[np.uint8]
    regions: RegionGraph | None = None


def describe_map(
    levels: ArrayLike,
    resolution: float,
    corner_settings: CornerSettings | None = None,
    descriptor_settings: DescriptorSettings | None = None,
) -> DescribedMap:
    """Compute all that is needed of a map to merge it with others.

    Parameters
    ----------
    levels : (rows, columns) uint8
        Occupancy, dark is occupied; row 0 at the lowest y. Greys are cut into three levels.
    resolution : float
        Side of a cell [m].
    corner_settings, descriptor_settings : CornerSettings, DescriptorSettings or None
        The computed features.

    Returns
    -------
    DescribedMap
        The map and its features.

    Raises
    ------
    ValueError
        If the array is no map of one channel, is empty or huge, or the resolution is not positive.
    """
    corner_settings = corner_settings or CornerSettings()
    three = three_levels_of(levels, corner_settings)
    check_resolution(resolution)
    three = without_rims(three, resolution)
    corners = detect_corners(three, resolution, corner_settings)
    descriptors = describe_corners(three, resolution, corners, descriptor_settings)
    cells, normals = _walls(three)
    distance = _distance(three.shape, cells, resolution)
    walls = np.asarray((cells + 0.5) * resolution, np.float64)
    return DescribedMap(
        three, float(resolution), corners, descriptors, walls, normals, distance, _open(three, resolution)
    )


def three_levels_of(levels: ArrayLike, settings: CornerSettings) -> NDArray[np.uint8]:
    """Return a map of three levels, having checked that it is a map.

    Raises as `describe_map`.
    """
    grid = np.asarray(levels)
    if grid.ndim != 2 or grid.size == 0:
        raise ValueError(f"a map has shape {grid.shape}; want rows and columns of one grey each")
    if max(grid.shape) > MAX_SIDE:
        raise ValueError(f"a map has shape {grid.shape}; want at most {MAX_SIDE} rows and columns")
    if grid.size > MAX_CELLS:
        raise ValueError(
            f"a map has shape {grid.shape}; want at most {MAX_CELLS:,} cells: crop it, or use coarser ones"
        )
    if grid.dtype != np.uint8:
        raise ValueError(f"a map has type {grid.dtype}; want uint8 greys: 0 occupied, 127 unknown, 255 free")
    three = np.full(grid.shape, UNKNOWN, np.uint8)
    three[grid < settings.occupied_below] = OCCUPIED
    three[grid > settings.free_above] = FREE
    return three


def check_resolution(resolution: float) -> None:
    """Raise ValueError if a resolution is not a positive number."""
    if not (math.isfinite(resolution) and resolution > 0.0):
        raise ValueError(f"the resolution of a map is {resolution} m; want a positive number")


def _walls(levels: NDArray[np.uint8]) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Return column and row of the walls' cells, and their normals."""
    cells = np.empty((int(np.count_nonzero(levels == OCCUPIED)), 2), np.int32)
    count = _find_walls(levels, cells)
    normals = np.zeros((count, 2))
    _face(levels, cells, _FACING_REACH, normals)
    return cells[:count], normals


def _open(levels: NDArray[np.uint8], resolution: float) -> NDArray[np.uint8]:
    """Return 1 if a cell and all within `OPEN_DISTANCE_M` are free.

    The distance is along the axes, and at least a cell.
    """
    reach = max(round(OPEN_DISTANCE_M / resolution), 1)
    is_free = np.asarray(levels == FREE, np.uint8)
    return np.asarray(cv2.erode(is_free, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8), borderValue=0.0), np.uint8)


def _distance(shape: tuple[int, ...], cells: NDArray[np.int32], resolution: float) -> NDArray[np.float32]:
    """Return the distance to the nearest of some cells [m]."""
    if len(cells) == 0:
        return np.full(shape, _FAR, np.float32)
    mask = np.ones(shape, np.uint8)
    # To the faces, not to any occupied cell: within a wall that noise has made thick, the distance still
    # shows where its face is.
    mask[cells[:, 1], cells[:, 0]] = 0
    return np.asarray(cv2.distanceTransform(mask, cv2.DIST_L2, 5) * np.float32(resolution), np.float32)


@kernel
def _find_walls(levels: Array, cells: Array) -> int:
    """Write column and row of each occupied cell next to a free one.

    Returns their number.
    """
    rows, columns = levels.shape
    count = 0
    for row in range(rows):
        for column in range(columns):
            if levels[row, column] == OCCUPIED and (
                (column > 0 and levels[row, column - 1] == FREE)
                or (column + 1 < columns and levels[row, column + 1] == FREE)
                or (row > 0 and levels[row - 1, column] == FREE)
                or (row + 1 < rows and levels[row + 1, column] == FREE)
            ):
                cells[count, 0], cells[count, 1] = column, row
                count += 1
    return count


@kernel
def _face(levels: Array, cells: Array, reach: int, normals: Array) -> None:
    """Fill in the unit vector from each cell to the free ones of the square around it."""
    rows, columns = levels.shape
    for i in range(normals.shape[0]):
        x, y = 0, 0
        for row in range(max(cells[i, 1] - reach, 0), min(cells[i, 1] + reach + 1, rows)):
            for column in range(max(cells[i, 0] - reach, 0), min(cells[i, 0] + reach + 1, columns)):
                if levels[row, column] == FREE:
                    x += column - cells[i, 0]
                    y += row - cells[i, 1]
        length = math.hypot(x, y)
        if length > 0.0:
            normals[i, 0], normals[i, 1] = x / length, y / length


@kernel(forceinline=True)
def faces_away(levels: Array, column: float, row: float, ahead_x: float, ahead_y: float) -> bool:
    """Return whether this map's wall at a place [cells] faces the opposite side.

    A given direction ahead leads into a wall of this map, and its free space lies behind.

    Then it is the other side of a wall that is being compared, a wall's thickness away from its position.
    """
    rows, columns = levels.shape
    x, y = int(math.floor(column - ahead_x)), int(math.floor(row - ahead_y))
    if not (0 <= x < columns and 0 <= y < rows) or levels[y, x] != FREE:
        return False
    x, y = int(math.floor(column + ahead_x)), int(math.floor(row + ahead_y))
    return not (0 <= x < columns and 0 <= y < rows) or levels[y, x] != FREE


def resampled(levels: NDArray[np.uint8], resolution: float, wanted: float) -> NDArray[np.uint8]:
    """Return a map in coarser cells.

    A cell with an occupied one in it is occupied, else free if most known ones are.

    Parameters
    ----------
    levels : (rows, columns) uint8
        The three-level map.
    resolution, wanted : float
        Its side of a cell and the new one, not smaller [m].

    Returns
    -------
    (rows, columns) uint8
        The map from the same corner; the last cells may reach beyond it.
    """
    if math.isclose(resolution, wanted, rel_tol=1e-6):
        return levels
    ratio = resolution / wanted
    rows, columns = (math.ceil(side * ratio - 1e-9) for side in levels.shape)
    row, column = (
        np.minimum(((np.arange(side) + 0.5) * ratio).astype(np.int64), count - 1)
        for side, count in zip(levels.shape, (rows, columns), strict=True)
    )
    position = (row[:, None] * columns + column[None, :]).ravel()
    counts = {
        level: np.bincount(position[(levels == level).ravel()], minlength=rows * columns)
        for level in (OCCUPIED, UNKNOWN, FREE)
    }
    coarse = np.where(counts[FREE] > counts[UNKNOWN], FREE, UNKNOWN)
    return np.where(counts[OCCUPIED] > 0, OCCUPIED, coarse).astype(np.uint8).reshape(rows, columns)
