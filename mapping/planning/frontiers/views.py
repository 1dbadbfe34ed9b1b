"""Cells from which robots observe frontiers with much of the unknown area in view.

A frontier begins at the corner that hides it. From next to that corner nothing new is visible; from a few
steps farther on all of it is.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.grid_lines import line_is_open
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.touring.coarse_distances import UNREACHED, CoarseGrid

RAYS = 32
"""Number of rays by which a view is measured."""


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


class _Views(NamedTuple):
    """A view of each of K frontiers.

    Attributes
    ----------
    cells : (K, 2) int64
        Coarse cells (row, column) to observe from; -1 if there is none.
    gains : (K,) float64
        Unknown area in view [m2].
    lengths : (K,) int64
        Lengths of the paths there, as in ``distances_from``.
    """

    cells: NDArray[np.int64]
    gains: NDArray[np.float64]
    lengths: NDArray[np.int64]


class _Frame(NamedTuple):
    """Position of coarse cells on the map, and view rules in cells."""

    row: int
    column: int
    factor: int
    around: int
    spacing: int
    reach: int
    depth: int
    stride: int
    area: float
    kept_share: float


def views_of(
    log_odds: NDArray[np.int8],
    resolution: float,
    grid: CoarseGrid,
    lengths: NDArray[np.int32],
    clusters: tuple[NDArray[np.int64], NDArray[np.int64]],
    rules: ViewRules,
) -> _Views:
    """Return a view of each cluster of frontier cells.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map: < 0 free, 0 unknown, > 0 occupied.
    resolution : float
        Side of its cells [m].
    lengths : (rows, columns) int32
        Lengths of the paths to all coarse cells.
    clusters : (N, 2) int64, (K + 1,) int64
        Cells (row, column) of the map, and the start of each cluster.
    """
    frame = _frame_of(grid, resolution, rules)
    cells, gains, found = _view_all(log_odds, lengths, clusters[0], clusters[1], _rays(), frame)
    return _Views(cells, gains, found)


def gain_at(
    log_odds: NDArray[np.int8], resolution: float, cell: tuple[int, int], rules: ViewRules
) -> tuple[float, float]:
    """Return the unknown area in view of a cell (row, column), and the direction to it [m2, rad]."""
    stride = _stride_of(resolution)
    reach, depth = round(rules.reach / resolution), round(rules.depth / resolution)
    gain, along, across = _gain(log_odds, cell[0], cell[1], _rays(), (reach, depth, stride))
    return float(gain * resolution * resolution), math.atan2(across, along)


def _rays() -> NDArray[np.float64]:
    angles = (np.arange(RAYS) + 0.5) * (2.0 * math.pi / RAYS)
    return np.stack([np.sin(angles), np.cos(angles)], axis=1)


def _stride_of(resolution: float) -> int:
    return max(round(0.05 / resolution), 1)


def _frame_of(grid: CoarseGrid, resolution: float, rules: ViewRules) -> _Frame:
    return _Frame(
        grid.row,
        grid.column,
        grid.factor,
        math.ceil(rules.around / grid.side),
        max(round(rules.spacing / grid.side), 1),
        round(rules.reach / resolution),
        round(rules.depth / resolution),
        _stride_of(resolution),
        resolution * resolution,
        rules.kept_share,
    )


@kernel
def _gain(
    log_odds: Array, row: int, column: int, rays: Array, limits: tuple[int, int, int]
) -> tuple[float, float, float]:
    """Return the unknown area in view [cells], and the sum of the directions to it."""
    reach, depth, stride = limits
    rows, columns = log_odds.shape
    area, along, across = 0.0, 0.0, 0.0
    for ray in range(rays.shape[0]):
        seen, unknown = 0.0, 0
        for step in range(stride, reach + 1, stride):
            at_row = int(math.floor(row + 0.5 + step * rays[ray, 0]))
            at_column = int(math.floor(column + 0.5 + step * rays[ray, 1]))
            if not (0 <= at_row < rows and 0 <= at_column < columns):
                break
            level = log_odds[at_row, at_column]
            if level > 0:
                break
            if level == 0:
                seen += step * stride
                unknown += stride
                if unknown >= depth:
                    break
        area += seen
        across += seen * rays[ray, 0]
        along += seen * rays[ray, 1]
    return area * (2.0 * math.pi / rays.shape[0]), along, across


@kernel
def _view_all(
    log_odds: Array, lengths: Array, cells: Array, starts: Array, rays: Array, frame: _Frame
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Return each cluster's view, its gain [m2] and its path's length."""
    count = len(starts) - 1
    views = np.full((count, 2), -1, np.int64)
    gains, found = np.zeros(count), np.full(count, UNREACHED, np.int64)
    tried = np.full(lengths.shape, -1, np.int32)
    for k in range(count):
        places, shown = _tried(log_odds, lengths, cells[starts[k] : starts[k + 1]], rays, frame, tried, k)
        if len(shown) == 0:
            continue
        wanted = frame.kept_share * shown.max()
        for i in range(len(shown)):
            length = lengths[places[i, 0], places[i, 1]]
            if shown[i] >= wanted and length < found[k]:
                views[k, 0], views[k, 1] = places[i, 0], places[i, 1]
                gains[k], found[k] = shown[i], length
    return views, gains, found


@kernel
def _tried(
    log_odds: Array, lengths: Array, cells: Array, rays: Array, frame: _Frame, tried: Array, number: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the coarse cells that see a cluster, and the gain of each [m2]."""
    rows, columns = lengths.shape
    places, shown = np.empty((512, 2), np.int64), np.empty(512)
    count = 0
    step = max(frame.spacing * frame.factor, 1)
    for i in range((len(cells) % step) // 2, len(cells), step):
        row, column = cells[i, 0], cells[i, 1]
        middle_row, middle_column = (row - frame.row) // frame.factor, (column - frame.column) // frame.factor
        for at in range(middle_row - frame.around, middle_row + frame.around + 1):
            if at % frame.spacing != 0 or not 0 <= at < rows:
                continue
            for across in range(middle_column - frame.around, middle_column + frame.around + 1):
                if across % frame.spacing != 0 or not 0 <= across < columns:
                    continue
                if tried[at, across] == number or lengths[at, across] == UNREACHED or count == len(places):
                    continue
                place_row = frame.row + at * frame.factor + frame.factor // 2
                place_column = frame.column + across * frame.factor + frame.factor // 2
                if not line_is_open(log_odds, place_row, place_column, row, column):
                    continue
                tried[at, across] = number
                limits = (frame.reach, frame.depth, frame.stride)
                shown[count] = _gain(log_odds, place_row, place_column, rays, limits)[0] * frame.area
                places[count, 0], places[count, 1] = at, across
                count += 1
    return places[:count], shown[:count]
