"""Cells from which robots observe frontiers with much of the unknown area in view.

A frontier begins at the corner that hides it. From next to that corner nothing new is visible; from a few
steps farther on all of it is.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.sight import RAYS, unknown_in_view


class ViewRules(NamedTuple):
    """Settings of the measurement and choice of views.

    Attributes
    ----------
    around : float
        Maximum distance of views from a cell of the frontier [m].
    spacing : float
        Distance between candidates [m].
    reach : float
        Unknown area counts up to this distance from the view [m].
    depth : float
        Maximum depth of unknown area that counts along a ray [m]: deeper cells may be no floor.
    kept_share : float
        The view with the shortest path is taken among those that show this share of the best one's area.
    """

    around: float = 1.0
    spacing: float = 0.3
    reach: float = 3.0
    depth: float = 1.5
    kept_share: float = 0.7


class ViewFrame(NamedTuple):
    """View rules in coarse cells (around, spacing) and cells of the map.

    Attributes
    ----------
    around, spacing : int
        Maximum distance of views from a cell of the frontier, and distance between candidates [coarse cells].
    reach, depth, stride : int
        Unknown area counts up to the first from the view and up to the second along a ray; the step along it [cells].
    area : float
        Of a cell of the map [m2].
    kept_share : float
        See ``ViewRules``.
    rays : (RAYS, 2) float64
        Directions: rows and columns along a cell.
    steps : (RAYS, K, 2) int64
        Rows and columns from a cell to those along each ray.
    ahead : (K, 2, RAYS) int32
        The same, step after step.
    """

    around: int
    spacing: int
    reach: int
    depth: int
    stride: int
    area: float
    kept_share: float
    rays: NDArray[np.float64]
    steps: NDArray[np.int64]
    ahead: NDArray[np.int32]


@lru_cache(maxsize=64)
def frame_of(rules: ViewRules, resolution: float, side: float) -> ViewFrame:
    """Return view rules in cells of the map and coarse cells, by their sides [m]."""
    reach, stride, rays = round(rules.reach / resolution), max(round(0.05 / resolution), 1), _rays()
    along = np.arange(stride, reach + 1, stride)
    steps = np.floor(0.5 + along[None, :, None] * rays[:, None, :]).astype(np.int64)
    return ViewFrame(
        math.ceil(rules.around / side),
        max(round(rules.spacing / side), 1),
        reach,
        round(rules.depth / resolution),
        stride,
        resolution * resolution,
        rules.kept_share,
        rays,
        steps,
        np.ascontiguousarray(steps.transpose(1, 2, 0), np.int32),
    )


def gain_at(
    log_odds: NDArray[np.int8], resolution: float, cell: tuple[int, int], rules: ViewRules
) -> tuple[float, float]:
    """Return the unknown area in view of a cell (row, column), and the direction to it [m2, rad]."""
    gains, directions = gains_at(log_odds, resolution, np.array([cell], np.int64), rules)
    return float(gains[0]), float(directions[0])


def gains_at(
    log_odds: NDArray[np.int8], resolution: float, cells: NDArray[np.int64], rules: ViewRules
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the unknown area in view of cells (n, 2), and the directions to it [m2, rad], (n,) each."""
    frame = frame_of(rules, resolution, resolution)
    return _gains(log_odds, cells, frame, resolution)  # type: ignore[no-any-return]


def _rays() -> NDArray[np.float64]:
    angles = (np.arange(RAYS) + 0.5) * (2.0 * math.pi / RAYS)
    return np.stack([np.sin(angles), np.cos(angles)], axis=1)


@kernel
def offsets_of(frame: ViewFrame, columns: int) -> NDArray[np.int32]:
    """Return the offsets from a cell to those along each ray, (K, RAYS), on a map of this many columns (kernel)."""
    offsets = np.empty((len(frame.ahead), RAYS), np.int32)
    for step in range(len(offsets)):
        for ray in range(RAYS):
            offsets[step, ray] = frame.ahead[step, 0, ray] * columns + frame.ahead[step, 1, ray]
    return offsets


@kernel(nrt=False)
def view_gain(log_odds: Array, row: int, column: int, frame: ViewFrame, offsets: Array) -> float:
    """Return the unknown area in view of a cell [m2]; ``offsets`` are those of ``offsets_of`` (kernel)."""
    (rows, columns), margin, area = log_odds.shape, frame.reach + 1, 0
    if margin <= row < rows - margin and margin <= column < columns - margin:
        most, cell = max(-(-frame.depth // frame.stride), 1), log_odds.ctypes.data + row * columns + column
        seen = unknown_in_view(cell, offsets.ctypes.data, len(offsets), most)
        area = seen * frame.stride * frame.stride
    else:
        for ray in range(len(frame.rays)):
            area += _seen_along(log_odds, row, column, frame, ray)
    return area * (2.0 * math.pi / len(frame.rays)) * frame.area


@kernel(nrt=False)
def _seen_along(log_odds: Array, row: int, column: int, frame: ViewFrame, ray: int) -> int:
    """Return the sum of the distances of unknown cells along a ray [cells], up to the depth behind what is known."""
    (rows, columns), margin = log_odds.shape, frame.reach + 1
    is_inside = margin <= row < rows - margin and margin <= column < columns - margin
    cells = log_odds.reshape(-1)
    seen, unknown = 0, 0
    for step in range(frame.steps.shape[1]):
        at_row, at_column = row + frame.steps[ray, step, 0], column + frame.steps[ray, step, 1]
        if not (is_inside or (0 <= at_row < rows and 0 <= at_column < columns)):
            break
        level = cells[np.uint64(at_row * columns + at_column)]
        if level > 0:
            break
        if level == 0:
            seen += (step + 1) * frame.stride * frame.stride
            unknown += frame.stride
            if unknown >= frame.depth:
                break
    return seen


@kernel
def _gains(
    log_odds: Array, cells: Array, frame: ViewFrame, resolution: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    gains, directions = np.empty(len(cells)), np.empty(len(cells))
    for k in range(len(cells)):
        area, along, across = 0, 0.0, 0.0
        for ray in range(len(frame.rays)):
            seen = _seen_along(log_odds, cells[k, 0], cells[k, 1], frame, ray)
            area += seen
            across += seen * frame.rays[ray, 0]
            along += seen * frame.rays[ray, 1]
        gains[k] = area * (2.0 * math.pi / len(frame.rays)) * resolution * resolution
        directions[k] = math.atan2(across, along)
    return gains, directions
