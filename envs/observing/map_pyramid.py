"""The whole known map around a robot, in pictures of one size of which each shows more."""

import math
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.observing.rows import Rows
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.observables import Observable
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.kernels.compilation import Array, kernel

_FREE, _OCCUPIED, _UNKNOWN = np.uint8(FREE), np.uint8(OCCUPIED), np.uint8(UNKNOWN)


@kernel
def _known_reach(log_odds: Array, row: int, column: int) -> int:
    """Return how far from a cell the farthest known one is, along rows or columns [cells]."""
    reach = 0
    for i in range(log_odds.shape[0]):
        for j in range(log_odds.shape[1]):
            if log_odds[i, j] != 0:
                reach = max(reach, abs(i - row), abs(j - column))
    return reach


@kernel
def _least_level(log_odds: Array, first_row: int, first_column: int, scale: int) -> int:
    """Return the lowest level of a block of cells: occupied, otherwise unknown, otherwise free."""
    rows, columns = log_odds.shape
    found = _FREE
    for i in range(first_row, first_row + scale):
        for j in range(first_column, first_column + scale):
            if i < 0 or i >= rows or j < 0 or j >= columns or log_odds[i, j] == 0:
                found = _UNKNOWN
            elif log_odds[i, j] > 0:
                return int(_OCCUPIED)
    return int(found)


@kernel
def write_pyramid(log_odds: Array, row: int, column: int, pictures: Array) -> None:
    """Write pictures (levels, side, side) uint8 of a map around a cell.

    The first one has the map's own cells; in the last one the whole known map has room. Between them the sides of
    cells grow by the same factor, in whole cells.
    """
    levels, side = pictures.shape[0], pictures.shape[1]
    widest = max(int(math.ceil((_known_reach(log_odds, row, column) + 1) / (side // 2))), 1)
    for level in range(levels):
        share = 1.0 if levels == 1 else level / (levels - 1)
        scale = max(int(round(float(widest) ** share)), 1)
        top, left = row - scale * (side // 2), column - scale * (side // 2)
        for i in range(side):
            for j in range(side):
                pictures[level, i, j] = _least_level(log_odds, top + i * scale, left + j * scale, scale)


def pyramid(rows: Rows) -> NDArray[np.uint8]:
    """Return the pictures of each robot's map, (rows, levels, side, side)."""
    settings = rows.settings
    shape = (settings.pyramid_levels, settings.pyramid_cells, settings.pyramid_cells)
    pictures = np.empty((rows.robots * rows.episodes, *shape), np.uint8)
    for number, (log_odds, cell) in enumerate(zip(rows.log_odds, rows.map_cell, strict=True)):
        write_pyramid(log_odds, int(cell[0]), int(cell[1]), pictures[number])
    return pictures


def _box(settings: Any) -> spaces.Box:  # noqa: ANN401
    assert isinstance(settings, ExplorationSettings)
    side = settings.pyramid_cells
    return spaces.Box(0, 255, (settings.pyramid_levels, side, side), np.uint8)


PYRAMID = Observable(_box, compute=pyramid)
