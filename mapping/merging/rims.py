"""Rims of unknown cells between walls and free space, as mappers with fine cells leave them."""

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN

WIDEST_M = 0.15
"""Widest rim [m]."""

FEW = 0.5
"""A map has rims if, without them, less than this share of its walls' cells border on free space."""

_CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)


def without_rims(levels: NDArray[np.uint8], resolution: float) -> NDArray[np.uint8]:
    """Return a map in which free space reaches up to the walls, if in most places a rim of unknown cells is between.

    Parameters
    ----------
    levels : (rows, columns) uint8
        The three-level map; returned as it is if most of its walls border on free space.
    resolution : float
        Side of a cell [m].
    """
    steps = round(WIDEST_M / resolution)
    occupied, unknown = ((levels == level).view(np.uint8) for level in (OCCUPIED, UNKNOWN))
    grown = [(levels == FREE).view(np.uint8)]
    if not steps or _bordering(occupied, grown[0]) >= FEW * np.count_nonzero(occupied):
        return levels
    for _ in range(steps):
        # Free space grows along the axes, so that it does not pass through walls that are drawn aslant.
        grown.append(grown[-1] | (_grown(grown[-1]) & unknown))
    counts = [_bordering(occupied, free) for free in grown]
    if counts[0] >= FEW * counts[-1]:
        return levels
    width = next(k for k, count in enumerate(counts) if count >= 0.9 * counts[-1])
    near = unknown & np.asarray(cv2.dilate(occupied, np.ones((2 * width + 1,) * 2, np.uint8)), np.uint8)
    free = grown[0]
    for _ in range(2 * width):  # corners are twice as far along the axes
        free = free | (_grown(free) & near)
    filled = levels.copy()
    filled[free != 0] = FREE
    return filled


def _grown(cells: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.dilate(cells, _CROSS), np.uint8)


def _bordering(occupied: NDArray[np.uint8], free: NDArray[np.uint8]) -> int:
    """Return the number of occupied cells beside free ones."""
    return int(np.count_nonzero(occupied & _grown(free)))
