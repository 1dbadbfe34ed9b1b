"""Search for a scan's pose on a local map, in steps of a cell.

It covers all places around the pose by odometry.

References
----------
Olson, Real-time correlative scan matching (ICRA 2009), here weighed against odometry.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.localization.matching.submaps import UNSEEN, AgreementGrid


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
        Middle of the search, where odometry says the robot is: x, y, theta in the map's frame [m, rad].
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
    _search(
        grid.levels,
        grid.column,
        grid.row,
        grid.resolution,
        points,
        around,
        steps,
        turns,
        step,
        information,
        weight / len(points),
        unseen,
        found,
    )
    return found


def angle_step(points: NDArray[np.float64], resolution: float) -> float:
    """Return the turn by which far points move by a cell [rad].

    Of the farthest tenth no notice is taken.
    """
    if len(points) == 0:
        return math.radians(1.0)
    far = float(np.quantile(np.hypot(points[:, 0], points[:, 1]), 0.9))
    return min(max(resolution / max(far, resolution), math.radians(0.25)), math.radians(2.0))


@kernel
def _search(
    levels: Array,
    first_column: int,
    first_row: int,
    side: float,
    points: Array,
    around: Array,
    steps: int,
    turns: int,
    step: float,
    information: Array,
    weight: float,
    unseen: float,
    found: Array,
) -> None:
    rows, columns = levels.shape
    width = 2 * steps + 1
    sums = np.empty((width, width), np.int64)
    # Squares of disagreement in parts of 255.
    unseen_cost, scale = int(255 * unseen), weight / 255.0
    least = np.inf
    found[:] = around
    away = np.empty(3)
    for turn in range(-turns, turns + 1):
        heading = around[2] + turn * step
        cosine, sine = math.cos(heading) / side, math.sin(heading) / side
        x0, y0 = around[0] / side - first_column - steps, around[1] / side - first_row - steps
        sums[:] = 0
        for k in range(points.shape[0]):
            column = int(math.floor(cosine * points[k, 0] - sine * points[k, 1] + x0))
            row = int(math.floor(sine * points[k, 0] + cosine * points[k, 1] + y0))
            if column < 0 or row < 0 or column + width > columns or row + width > rows:
                sums += unseen_cost
                continue
            for i in range(width):
                for j in range(width):
                    level = int(levels[row + i, column + j])
                    sums[i, j] += unseen_cost if level == UNSEEN else ((256 - level) * (256 - level)) >> 8
        for i in range(width):
            for j in range(width):
                away[0], away[1], away[2] = (j - steps) * side, (i - steps) * side, turn * step
                cost = scale * sums[i, j] + away @ information @ away
                if cost < least:
                    least = cost
                    found[:] = around + away
