"""Maps of ROS map_server as floors: unknown cells are solid."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.importers.common import floor_of_cells, refuse_resolution
from lidarium.mapping.files.images import MAX_PIXELS
from lidarium.mapping.files.map_files import FREE, MapImage, read_ros_map

SUFFIXES = (".yaml", ".yml")
"""Suffixes of descriptions; a picture of the same name belongs to each."""

# Indices of a whole map would take sixteen times its memory.
_BLOCK_ROWS = 256


def load(path: Path, resolution: float | None) -> Floor:
    """Read a ROS map as a floor.

    A map turned by the yaw of its origin is redrawn along the axes.
    """
    refuse_resolution(path, resolution)
    return floor_of_map(path, read_ros_map(path))


def floor_of_map(path: Path, image: MapImage, starts: NDArray[np.float64] | None = None) -> Floor:
    """Return the floor of a map; the first of the starts (K, 3), if there are some, is in its area."""
    free = image.levels == FREE
    if math.remainder(image.origin[2], 2.0 * math.pi) == 0.0:
        cells, origin, side = free, image.origin[:2], image.resolution
    else:
        cells, origin, side = _turned(image, free)
    seed = None
    if starts is not None and len(starts):
        column, row = (math.floor((value - low) / side) for value, low in zip(starts[0, :2], origin, strict=True))
        is_free = 0 <= row < cells.shape[0] and 0 <= column < cells.shape[1] and cells[row, column]
        seed, starts = ((row, column), starts) if is_free else (None, None)
    return floor_of_cells(path, cells, origin, side, seed, starts)


def _turned(image: MapImage, free: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], tuple[float, float], float]:
    """Return the free cells along the axes, with origin and resolution.

    The cells have half the size: walls of one pixel stay 4-connected when turned only if sampled more densely than
    a cell's diagonal.
    """
    x, y, yaw = image.origin
    cosine, sine = math.cos(yaw), math.sin(yaw)
    rows, columns = free.shape
    corners = (
        np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]])
        * image.resolution
        @ np.array([[cosine, sine], [-sine, cosine]])
    )
    low, high = corners.min(axis=0), corners.max(axis=0)
    resolution = image.resolution / 2.0
    width, height = (math.ceil(side / resolution) for side in high - low)
    if width * height > MAX_PIXELS:
        raise ValueError(f"a map turned by {yaw} rad has {width:,} x {height:,} cells; want {MAX_PIXELS:,}")
    along_x = low[0] + (np.arange(width) + 0.5) * resolution
    turned = np.zeros((height, width), dtype=np.bool_)
    for first in range(0, height, _BLOCK_ROWS):
        block = np.arange(first, min(first + _BLOCK_ROWS, height))
        along_y = low[1] + (block + 0.5)[:, None] * resolution
        j = np.floor((cosine * along_x + sine * along_y) / image.resolution).astype(np.int64)
        i = np.floor((cosine * along_y - sine * along_x) / image.resolution).astype(np.int64)
        on_image = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
        turned[block[0] : block[-1] + 1][on_image] = free[i[on_image], j[on_image]]
    return turned, (float(x + low[0]), float(y + low[1])), resolution
