"""The figures of a run, as pure functions on arrays.

Cells of one grid throughout. F are the free cells that count: those that the disc of the smallest robot sweeps over its
configuration space, connected to the starts. S are the truth's occupied cells around them.

References
----------
C_free: Chen et al., Self-learning exploration and mapping (2019), and ARiADNE (Cao et al., ICRA 2023). C_known, balance:
Xu et al., Explore-Bench (ICRA 2022). C_valid and the IoU of occupied cells: Ho et al., MapEx (ICRA 2025). C_own: IR2 (Tan et
al., IROS 2024). Overlap: Zhu et al., MAexp (ICRA 2024).
"""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]


def free_coverage(sensed: Mask, counted: Mask) -> float:
    """Return ``C_free`` = |sensed and F| / |F|, the share of F that was sensed (1 where F is empty).

    Parameters
    ----------
    sensed : (rows, columns) bool
        Cells that were sensed.
    counted : (rows, columns) bool
        F.
    """
    return _share(sensed & counted, counted)


def own_coverage(sensed: NDArray[np.bool_], counted: Mask) -> tuple[float, float]:
    """Return the least and the mean ``C_own,i`` = |known free by robot i and F| / |F| over the robots.

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
    """Return ``C_known`` = |known and knowable| / |knowable|; walls count as well (Explore-Bench).

    Parameters
    ----------
    known : (rows, columns) bool
        Cells of the map that are not unknown.
    knowable : (rows, columns) bool
        Cells of the true map that are not unknown.
    """
    return _share(known & knowable, knowable)


def valid_coverage(known: Mask, counted: Mask, occupied: Mask) -> float:
    """Return ``C_valid`` = |known and (F or S)| / |F or S| with S around all of F (MapEx).

    Parameters
    ----------
    known, counted, occupied : (rows, columns) bool
        Cells that are not unknown, F, and the truth's occupied cells.
    """
    valid = counted | surface(occupied, counted)
    return _share(known & valid, valid)


def surface(occupied: Mask, free: Mask) -> Mask:
    """Return the occupied cells that are 8-adjacent to given free cells."""
    return occupied & widened(free)


def widened(cells: Mask, by: int = 1) -> Mask:
    """Return the cells within ``by`` cells of given ones, diagonals included."""
    side = 2 * by + 1
    grown = cv2.dilate(cells.astype(np.uint8), np.ones((side, side), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=(0.0,))
    return np.asarray(grown != 0)


def occupied_f1(believed: Mask, occupied: Mask, tolerance: int = 1) -> float:
    """Return F1 = 2 P R / (P + R) of the occupied cells.

    P is the share of believed cells within the tolerance of a true one, R that of true cells within the tolerance of a
    believed one. 1 where there is neither, 0 where there is one only.

    Parameters
    ----------
    believed, occupied : (rows, columns) bool
        Occupied cells of the map and of the truth.
    tolerance : int
        In cells, diagonals included.
    """
    if not believed.any() and not occupied.any():
        return 1.0
    precision = _share(believed & widened(occupied, tolerance), believed, empty=0.0)
    recall = _share(occupied & widened(believed, tolerance), occupied, empty=0.0)
    return 2.0 * precision * recall / (precision + recall) if precision + recall > 0.0 else 0.0


def occupied_iou(believed: Mask, occupied: Mask, sensed: Mask) -> float:
    """Return ``iou_occupied`` = (hits of B + hits of S) / (|B| + |S|); 1 where both are empty.

    B are the believed occupied cells, S the truth's occupied cells that are 8-adjacent to sensed cells of F, so that the inside
    of solids does not count. A cell of either is a hit where one of the other is within one cell.

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


def overlap(masks: Sequence[NDArray[np.uint64]] | NDArray[np.uint64]) -> float:
    """Return ``Overlap_MX`` = |cells seen by two or more| / |cells seen by one or more| (MAexp); 0 where none was seen.

    Parameters
    ----------
    masks : sequence of (rows, words) uint64
        What each robot saw, a bit per cell.
    """
    once = np.zeros_like(masks[0])
    twice = np.zeros_like(masks[0])
    for mask in masks:
        twice |= once & mask
        once |= mask
    seen = int(np.bitwise_count(once).sum())
    return int(np.bitwise_count(twice).sum()) / seen if seen else 0.0


def path_lengths(track: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the length of each robot's way through its positions [m], shape (robots,).

    Parameters
    ----------
    track : (times, robots, 2 or more) float64
        Positions x, y first [m].
    """
    steps = np.diff(np.asarray(track, np.float64)[..., :2], axis=0)
    return np.asarray(np.hypot(steps[..., 0], steps[..., 1]).sum(axis=0))


def balance(shares: NDArray[np.float64]) -> float:
    """Return the population standard deviation of the robots' shares ``C_known,i`` (Explore-Bench's "std")."""
    return float(np.std(np.asarray(shares, np.float64)))


def path_balance(lengths: NDArray[np.float64]) -> float:
    """Return the population standard deviation of the path lengths over their mean; 0 where nobody moved."""
    mean = float(np.mean(lengths))
    return float(np.std(lengths)) / mean if mean > 0.0 else 0.0


def decision_percentiles(seconds: Sequence[float]) -> dict[str, float | None]:
    """Return the median and the 95th percentile of decision times in milliseconds, None where there was no decision."""
    if not len(seconds):
        return {"p50": None, "p95": None}
    half, most = np.percentile(np.asarray(seconds, np.float64) * 1e3, [50.0, 95.0])
    return {"p50": round(float(half), 4), "p95": round(float(most), 4)}


def _share(part: NDArray[Any], whole: NDArray[Any], empty: float = 1.0) -> float:
    size = int(np.count_nonzero(whole))
    return int(np.count_nonzero(part)) / size if size else empty
