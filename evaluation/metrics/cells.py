"""Shares of cells: coverage, overlap, and how well a map agrees with the true floor.

F are the free cells that count: those that the disc of the smallest robot sweeps over its configuration
space, connected to the starts. S are the truth's occupied cells around them.

References
----------
C_free: Chen et al., Self-learning exploration and mapping (2019), and ARiADNE (Cao et al., ICRA 2023).
C_known and Overlap_EB: Xu et al., Explore-Bench (ICRA 2022). C_valid and IoU of occupied cells (here with a
tolerance of a cell): Ho et al., MapEx (ICRA 2025). C_own: IR2 (Tan et al., IROS 2024). Overlap_MX: Zhu et
al., MAexp (ICRA 2024). Overlap_MV: MARVEL (Chiun et al., ICRA 2025). F1 within a tolerance: precision and
recall as boundaries are compared in image segmentation (Martin et al., PAMI 2004).
"""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

Mask = NDArray[np.bool_]
"""Which cells of a grid are meant, (rows, columns) bool."""


def share(part: NDArray[Any], whole: NDArray[Any], empty: float = 1.0) -> float:
    """Return ``|part| / |whole|``, the cells of which are those that are not 0.

    ``empty`` if the whole has none.
    """
    size = int(np.count_nonzero(whole))
    return int(np.count_nonzero(part)) / size if size else empty


def free_coverage(sensed: Mask, counted: Mask) -> float:
    """Return ``C_free`` = |sensed and F| / |F|, the share of F that was sensed.

    It is 1 if F is empty.

    Parameters
    ----------
    sensed : (rows, columns) bool
        Cells that were sensed.
    counted : (rows, columns) bool
        F.
    """
    return share(sensed & counted, counted)


def own_coverage(sensed: NDArray[np.bool_], counted: Mask) -> tuple[float, float]:
    """Return the least and the mean ``C_own,i`` over the robots (IR2).

    ``C_own,i`` = |known free by robot i and F| / |F|.

    Parameters
    ----------
    sensed : (robots, rows, columns) bool
        Cells that each robot knows to be free.
    counted : (rows, columns) bool
        F.
    """
    shares = [free_coverage(own, counted) for own in sensed]
    return min(shares), float(np.mean(shares))


def known_coverage(known: Mask, knowable: Mask) -> float:
    """Return ``C_known`` = |known and knowable| / |knowable|.

    Walls count as well (Explore-Bench).

    Explore-Bench's script divides all known cells by the area of the true map that is not unknown, so that cells
    known beyond that area count and the share can pass 1; here they do not count.

    Parameters
    ----------
    known : (rows, columns) bool
        Cells of the map that are not unknown.
    knowable : (rows, columns) bool
        Cells of the true map that are not unknown.
    """
    return share(known & knowable, knowable)


def valid_coverage(known: Mask, counted: Mask, occupied: Mask) -> float:
    """Return ``C_valid`` = |known and (F or S)| / |F or S| (MapEx).

    S lies around all of F.

    Parameters
    ----------
    known, counted, occupied : (rows, columns) bool
        Cells that are not unknown, F, and the truth's occupied cells.
    """
    valid = counted | surface(occupied, counted)
    return share(known & valid, valid)


def overlap(masks: Sequence[NDArray[np.uint64]] | NDArray[np.uint64]) -> float:
    """Return ``Overlap_MX``, the share of seen cells seen by several (MAexp).

    It is |cells seen by two or more| / |cells seen by one or more|; 0 if none was seen.

    MAexp prints it at T_0.85 and T_0.95.

    Parameters
    ----------
    masks : sequence of (rows, words) uint64
        Cells that each robot saw, a bit per cell.
    """
    once = np.zeros_like(masks[0])
    twice = np.zeros_like(masks[0])
    for mask in masks:
        twice |= once & mask
        once |= mask
    seen = int(np.bitwise_count(once).sum())
    return int(np.bitwise_count(twice).sum()) / seen if seen else 0.0


def overlap_of_maps(known_shares: ArrayLike) -> float:
    """Return ``Overlap_EB`` = sum_i C_known,i - 1 (Explore-Bench, at T_0.99).

    A share below 0 says that the maps together hold less than the floor once: it is a measure of overlap if the
    team's map is nearly whole, and of nothing before.

    Parameters
    ----------
    known_shares : (robots,) float64
        C_known of each robot's own map.
    """
    return float(np.sum(np.asarray(known_shares, np.float64)) - 1.0)


def instant_overlap(seen_once: ArrayLike, seen_twice: ArrayLike) -> float:
    """Return ``Overlap_MV``, the mean footprint overlap over decisions (MARVEL).

    It is the mean of |footprint of two or more| / |footprint of one or more|.

    Decisions at which no robot sees anything count as 0; 0 without decisions.

    Parameters
    ----------
    seen_once, seen_twice : (decisions,) int
        Cells that one robot or more, and two or more, see at each decision from their current poses.
    """
    once, twice = np.asarray(seen_once, np.float64), np.asarray(seen_twice, np.float64)
    ratios = np.divide(twice, once, out=np.zeros_like(once), where=once > 0.0)
    return float(ratios.mean()) if ratios.size else 0.0


def surface(occupied: Mask, free: Mask) -> Mask:
    """Return the occupied cells that are 8-adjacent to given free cells."""
    return occupied & _widened(free)


def _widened(cells: Mask, by: int = 1) -> Mask:
    """Return the cells within ``by`` cells of given ones, diagonals included."""
    side = 2 * by + 1
    bytes_of = np.ascontiguousarray(cells).view(np.uint8)
    grown = cv2.dilate(bytes_of, np.ones((side, side), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=(0.0,))
    return np.asarray(grown, np.uint8).view(np.bool_)


def occupied_f1(believed: Mask, occupied: Mask, tolerance: int = 1, wanted: Mask | None = None) -> float:
    """Return F1 = 2 P R / (P + R) of the occupied cells.

    P is the share of believed cells within the tolerance of a true one, R that of wanted true cells within the
    tolerance of a believed one. 1 if there is neither, 0 if there is one only.

    Parameters
    ----------
    believed, occupied : (rows, columns) bool
        Occupied cells of the map and of the truth.
    wanted : (rows, columns) bool or None
        The true cells that a map should hold, of which R is the share found: such as those on the surface of the
        sensed area, as the inside of solids is true but cannot be seen. All by default.
    """
    wanted = occupied if wanted is None else wanted
    if not believed.any() and not wanted.any():
        return 1.0
    precision = share(believed & _widened(occupied, tolerance), believed, empty=0.0)
    recall = share(wanted & _widened(believed, tolerance), wanted, empty=0.0)
    return 2.0 * precision * recall / (precision + recall) if precision + recall > 0.0 else 0.0


def occupied_iou(believed: Mask, occupied: Mask, sensed: Mask) -> float:
    """Return ``iou_occupied`` = (hits of B + hits of S) / (|B| + |S|).

    1 if both are empty.

    B are the believed occupied cells, S the truth's occupied cells that are 8-adjacent to sensed cells of F, so
    that the inside of solids does not count. A cell of either is a hit if one of the other is within one cell.

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
    hits = int((believed & _widened(true_surface)).sum()) + int((true_surface & _widened(believed)).sum())
    return hits / size


def free_error_rate(believed_free: Mask, occupied: Mask) -> float:
    """Return |believed free and occupied in truth| / |believed free|.

    0 if nothing is believed free.

    Parameters
    ----------
    believed_free, occupied : (rows, columns) bool
        Free cells of the map, and occupied cells of the truth.
    """
    return share(believed_free & occupied, believed_free, empty=0.0)
