"""Trails of the robots, if no walls can be.

Other robots may have mapped the robots themselves as walls.

Robots that do not know the poses of the others draw their bodies into their maps. To a merger these are walls
that contradict the free floor on which the other one drove, and on a merged map they block the path.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.occupancy import OCCUPIED, UNKNOWN
from lidarium.mapping.merging.incremental import GrowingMap
from lidarium.mapping.planning.footprint import footprint_mask


def without_own_trail(one: GrowingMap, trail: NDArray[np.float64], radius: float, resolution: float) -> GrowingMap:
    """Return a map without any claim about its robot's own trail.

    The robot's image on other maps is then no contradiction.

    Parameters
    ----------
    trail : (N, 2) float64
        Positions of the robot, in its map frame [m].
    radius, resolution : float
        Radius of its body, and side of a cell [m].
    """
    levels = one.levels.copy()
    levels[footprint_mask(one.levels.shape, one.origin, trail, radius, resolution)] = UNKNOWN
    return GrowingMap(levels, one.origin)


def without_bodies(
    one: GrowingMap, trails: Iterable[NDArray[np.float64]], radius: float, resolution: float
) -> GrowingMap:
    """Return a map without walls along the trails of other robots.

    Parameters
    ----------
    trails : iterable of (N, 2) float64
        Positions of the others, in the frame of the map [m].
    radius, resolution : float
        Radius of their bodies, and side of a cell [m].
    """
    levels = one.levels.copy()
    for trail in trails:
        levels[footprint_mask(one.levels.shape, one.origin, trail, radius, resolution) & (levels == OCCUPIED)] = UNKNOWN
    return GrowingMap(levels, one.origin)
