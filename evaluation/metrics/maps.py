"""How well a map agrees with the truth, cell by cell.

References
----------
IoU of occupied cells: Ho et al., MapEx (ICRA 2025), here with a tolerance of a cell. F1 within a tolerance:
precision and recall of occupied cells as boundaries are compared in image segmentation (Martin et al., PAMI
2004).
"""

import cv2
import numpy as np

from lidarium.evaluation.metrics.shares import Mask, share


def surface(occupied: Mask, free: Mask) -> Mask:
    """Return the occupied cells that are 8-adjacent to given free cells."""
    return occupied & widened(free)


def widened(cells: Mask, by: int = 1) -> Mask:
    """Return the cells within ``by`` cells of given ones, diagonals included."""
    side = 2 * by + 1
    bytes_of = np.ascontiguousarray(cells).view(np.uint8)
    grown = cv2.dilate(
        bytes_of, np.ones((side, side), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=(0.0,)
    )
    return np.asarray(grown, np.uint8).view(np.bool_)


def occupied_f1(believed: Mask, occupied: Mask, tolerance: int = 1, wanted: Mask | None = None) -> float:
    """Return F1 = 2 P R / (P + R) of the occupied cells.

    P is the share of believed cells within the tolerance of a true one, R that of wanted true cells within
    the tolerance of a believed one. 1 where there is neither, 0 where there is one only.

    Parameters
    ----------
    believed, occupied : (rows, columns) bool
        Occupied cells of the map and of the truth.
    tolerance : int
        In cells, diagonals included.
    wanted : (rows, columns) bool or None
        The true cells that a map should hold, of which R is the share found: such as those on the surface of
        what was sensed, where the inside of solids is true but cannot be seen. All where None.
    """
    wanted = occupied if wanted is None else wanted
    if not believed.any() and not wanted.any():
        return 1.0
    precision = share(believed & widened(occupied, tolerance), believed, empty=0.0)
    recall = share(wanted & widened(believed, tolerance), wanted, empty=0.0)
    return 2.0 * precision * recall / (precision + recall) if precision + recall > 0.0 else 0.0


def occupied_iou(believed: Mask, occupied: Mask, sensed: Mask) -> float:
    """Return ``iou_occupied`` = (hits of B + hits of S) / (|B| + |S|).

    1 where both are empty.

    B are the believed occupied cells, S the truth's occupied cells that are 8-adjacent to sensed cells of F,
    so that the inside of solids does not count. A cell of either is a hit where one of the other is within
    one cell.

    Parameters
    ----------
    believed, occupied : (rows, columns) bool
        Occupied cells of the map and of the truth.
    sensed : (rows, columns) bool
        Sensed cells of F.
    """
    true_surface = surface(occupied, sensed)
    size = int(believed.sum()) + int(true_surface.sum())
    if size == 0:
        return 1.0
    hits = int((believed & widened(true_surface)).sum()) + int((true_surface & widened(believed)).sum())
    return hits / size


def free_error_rate(believed_free: Mask, occupied: Mask) -> float:
    """Return |believed free and occupied in truth| / |believed free|.

    0 where nothing is believed free.

    Parameters
    ----------
    believed_free, occupied : (rows, columns) bool
        Cells that the map says are free, and the truth's occupied cells.
    """
    return share(believed_free & occupied, believed_free, empty=0.0)
