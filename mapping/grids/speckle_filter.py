"""Removal of small groups of free cells within walls, for pictures.

In fine maps, noise leaves them between the ends of beams.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED

LARGEST_COMPONENT = 3
"""Maximum number of cells of a group that is removed."""

_CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)


def without_small_components(levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a three-level map (rows, columns) with small free components within walls closed, for pictures.

    If cells are finer than the noise of the laser, ends of beams scatter over the front of a wall, and single free
    cells remain between them. A component is removed if it has at most `LARGEST_COMPONENT` cells, joined over
    sides, and half or more of its sides are walls. ``levels`` (0 occupied, 127 unknown, 255 free) is not changed.
    """
    count, labels, statistics, _ = cv2.connectedComponentsWithStats((levels == FREE).astype(np.uint8), connectivity=4)
    is_small = statistics[:, cv2.CC_STAT_AREA] <= LARGEST_COMPONENT
    is_small[0] = False
    if not is_small.any():
        return levels.copy()
    # Sides of each cell that are walls, and those that are not of its own group.
    walls = cv2.filter2D((levels == OCCUPIED).astype(np.uint8), -1, _CROSS, borderType=cv2.BORDER_CONSTANT)
    others = cv2.filter2D((levels != FREE).astype(np.uint8), -1, _CROSS, borderType=cv2.BORDER_CONSTANT)
    component = is_small[labels]
    sides = [np.bincount(labels[component], weights=kind[component], minlength=count) for kind in (walls, others)]
    is_in_wall = is_small & (2 * sides[0] >= sides[1]) & (sides[0] > 0)
    closed = levels.copy()
    closed[is_in_wall[labels]] = OCCUPIED
    return closed
