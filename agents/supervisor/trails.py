"""Where robots have been: no walls are there, but others may have mapped the robots themselves as such.

Robots that do not know where the others are draw their bodies into their maps. To a merger these are walls that contradict the free
floor on which the other one drove, and on a merged map they bar the way.
"""

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.merging.incremental import GrowingMap
from lidarium.mapping.occupancy import OCCUPIED, UNKNOWN

MARGIN_M = 0.15
"""How much further than the body what others draw of it may lie [m]."""

_SUBCELL = 4
_CELL = 1 << _SUBCELL


def without_own_trail(one: GrowingMap, trail: NDArray[np.float64], radius: float, resolution: float) -> GrowingMap:
    """Return a map that claims nothing of where its robot has been, so that its image on other maps is no contradiction.

    Parameters
    ----------
    one : GrowingMap
        The robot's map.
    trail : (N, 2) float64
        Where the robot was, in its map frame [m].
    radius, resolution : float
        Of its body, and side of a cell [m].
    """
    levels = one.levels.copy()
    levels[_swept(one, trail, radius, resolution)] = UNKNOWN
    return GrowingMap(levels, one.origin)


def without_bodies(one: GrowingMap, trails: Iterable[NDArray[np.float64]], radius: float, resolution: float) -> GrowingMap:
    """Return a map without walls where other robots have been.

    Parameters
    ----------
    one : GrowingMap
        The map.
    trails : iterable of (N, 2) float64
        Where the others were, in the frame of the map [m].
    radius, resolution : float
        Of their bodies, and side of a cell [m].
    """
    levels = one.levels.copy()
    for trail in trails:
        levels[_swept(one, trail, radius, resolution) & (levels == OCCUPIED)] = UNKNOWN
    return GrowingMap(levels, one.origin)


def _swept(one: GrowingMap, trail: NDArray[np.float64], radius: float, resolution: float) -> NDArray[np.bool_]:
    """Return the cells (rows, columns) of a map in which others may have drawn a body of a radius [m] that was on a trail."""
    swept = np.zeros(one.levels.shape, np.uint8)
    if len(trail):
        # Pixels are addressed by their centres, in parts of a cell.
        points = np.rint(((trail - one.origin) / resolution - 0.5) * _CELL).astype(np.int32)
        thickness = max(round(2.0 * (radius + MARGIN_M) / resolution), 1)
        cv2.polylines(swept, [points.reshape(-1, 1, 2)], False, 1, thickness, cv2.LINE_8, _SUBCELL)
    return np.asarray(swept != 0)
