"""Search for a scan's pose on a local map, in steps of a cell.

It covers all places around the pose by odometry.

References
----------
Olson, Real-time correlative scan matching (ICRA 2009), here weighed against odometry.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.small_matrices import squared
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.localization.matching.submaps import FULL_LEVEL, UNSEEN, AgreementGrid

LEVEL_BITS = 8
"""Bits of a level of agreement.

Squares of disagreement are counted in parts of 255.
"""

LEVELS = 1 << LEVEL_BITS
"""Levels of agreement that there can be."""

FAR_SHARE = 0.9
"""Share of the points that lie nearer than those that set the step of an angle."""

MIN_STEP, DEFAULT_STEP, MAX_STEP = math.radians(0.25), math.radians(1.0), math.radians(2.0)
"""Step of an angle at least, where there are no points, and at most [rad]."""


class _Window(NamedTuple):
    """Poses among which a search chooses.

    Attributes
    ----------
    around : (3,) float64
        The pose in the middle [m, rad].
    steps, turns : int
        How many steps of a cell and of an angle to each side.
    angle_step : float
        Step of an angle [rad].
    """

    around: NDArray[np.float64]
    steps: int
    turns: int
    angle_step: float


def search(
    grid: AgreementGrid,
    points: NDArray[np.float64],
    around: NDArray[np.float64],
    reach_m: float,
    reach_angle: float,
    information: NDArray[np.float64],
    weight: float,
    unseen: float,
) -> NDArray[np.float64]:
    """Return the pose (3,) of least cost of all within reach, in steps of a cell.

    The cost is that of ``refine``, without smoothing.

    Parameters
    ----------
    grid : AgreementGrid
        The map.
    points : (n, 2) float64
        Points in the robot's frame [m].
    around : (3,) float64
        Middle of the search, the pose by odometry: x, y, theta in the map's frame [m, rad].
    reach_m, reach_angle : float
        How far the search goes to each side [m, rad].
    information, weight, unseen
        As for ``refine``.
    """
    step = angle_step(points, grid.resolution)
    steps, turns = math.ceil(reach_m / grid.resolution - 1e-9), math.ceil(reach_angle / step - 1e-9)
    if len(points) == 0 or steps + turns == 0:
        return around
    found = np.empty(3)
    window = _Window(around, steps, turns, step)
    _search(grid, points, window, information, weight / len(points), unseen, found)
    return found


def angle_step(points: NDArray[np.float64], resolution: float) -> float:
    """Return the turn by which far points move by a cell [rad].

    Of the farthest tenth no notice is taken.
    """
    if len(points) == 0:
        return DEFAULT_STEP
    far = float(np.quantile(np.hypot(points[:, 0], points[:, 1]), FAR_SHARE))
    return min(max(resolution / max(far, resolution), MIN_STEP), MAX_STEP)


@kernel
def _search(
    grid: AgreementGrid,
    points: Array,
    window: _Window,
    information: Array,
    weight: float,
    unseen: float,
    found: Array,
) -> None:
    """Write the pose of least cost within a window into ``found`` (3,)."""
    levels, first_column, first_row, side = grid
    around, steps, turns, step = window
    width = 2 * steps + 1
    sums = np.empty((width, width), np.int64)
    unseen_cost, scale = int(FULL_LEVEL * unseen), weight / FULL_LEVEL
    least = np.inf
    found[:] = around
    away = np.empty(3)
    for turn in range(-turns, turns + 1):
        heading = around[2] + turn * step
        cosine, sine = math.cos(heading) / side, math.sin(heading) / side
        x0, y0 = around[0] / side - first_column - steps, around[1] / side - first_row - steps
        _sum_disagreement(levels, points, (cosine, sine, x0, y0), unseen_cost, sums)
        for i in range(width):
            for j in range(width):
                away[0], away[1], away[2] = (j - steps) * side, (i - steps) * side, turn * step
                cost = scale * sums[i, j] + squared(information, away)
                if cost < least:
                    least = cost
                    found[:] = around + away


@kernel(nrt=False)
def _sum_disagreement(
    levels: Array, points: Array, place: tuple[float, float, float, float], unseen_cost: int, sums: Array
) -> None:
    """Fill ``sums`` (width, width) with the disagreement at the places of a window.

    ``place`` is cosine and sine of the heading, by the side of a cell, and the window's corner [cells].
    """
    cosine, sine, x0, y0 = place
    rows, columns = levels.shape
    width = sums.shape[0]
    sums[:] = 0
    for k in range(points.shape[0]):
        column = int(math.floor(cosine * points[k, 0] - sine * points[k, 1] + x0))
        row = int(math.floor(sine * points[k, 0] + cosine * points[k, 1] + y0))
        if column < 0 or row < 0 or column + width > columns or row + width > rows:
            _add_everywhere(sums, unseen_cost)
            continue
        for i in range(width):
            for j in range(width):
                level = int(levels[np.uintp(row + i), np.uintp(column + j)])
                squared = ((LEVELS - level) * (LEVELS - level)) >> LEVEL_BITS
                sums[i, j] += unseen_cost if level == UNSEEN else squared


@kernel(nrt=False)
def _add_everywhere(sums: Array, cost: int) -> None:
    for i in range(sums.shape[0]):
        for j in range(sums.shape[1]):
            sums[i, j] += cost
